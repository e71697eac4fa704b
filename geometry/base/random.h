#pragma once

#include <cmath>
#include <cstdint>

#include "geometry/base/types.h"

/// Counter-based random numbers: each is a pure function of (seed, stream, index), so that the order
/// of work and the number of threads cannot change it, and a run resumed draws what it would have.
namespace effuse {

/// 64 well-mixed bits of (seed, stream, index). The mixer is MurmurHash3's finaliser (Appleby, public
/// domain constants), applied after each word: every input bit flips each output bit with p = 1/2 +- 1 %.
inline std::uint64_t random_bits(std::uint64_t seed, std::uint64_t stream, std::uint64_t index) {
  const auto mix = [](std::uint64_t h) {
    h ^= h >> 33;
    h *= 0xff51afd7ed558ccdULL;
    h ^= h >> 33;
    h *= 0xc4ceb9fe1a85ec53ULL;
    return h ^ (h >> 33);
  };
  std::uint64_t h = mix(seed + 0x9e3779b97f4a7c15ULL);
  h = mix(h ^ (stream * 0xd1b54a32d192ed03ULL + 0x632be59bd9b4e019ULL));
  return mix(h ^ (index * 0x8cb92ba72f3d8dd7ULL + 0xa0761d6478bd642fULL));
}

/// Uniform in [0, 1), 53 bits.
inline Real random_uniform(std::uint64_t seed, std::uint64_t stream, std::uint64_t index) {
  return static_cast<Real>(random_bits(seed, stream, index) >> 11) * 0x1.0p-53;
}

/// Normal with mean 0 and deviation 1 (Box-Muller on two draws of the same index).
inline Real random_normal(std::uint64_t seed, std::uint64_t stream, std::uint64_t index) {
  const Real u = 1 - random_uniform(seed, 2 * stream, index), v = random_uniform(seed, 2 * stream + 1, index);
  return std::sqrt(-2 * std::log(u)) * std::cos(2 * kPi * v);
}

}  // namespace effuse
