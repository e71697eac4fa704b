#pragma once

#include <cstddef>
#include <cstdint>

#include "geometry/base/random.h"
#include "geometry/base/types.h"

namespace effuse::geometry {

/// A value and its gradient.
struct NoiseSample {
  Real value = 0;
  Vec3 gradient = Vec3::Zero();
};

/// Gradient noise on the unit lattice (Perlin 1985, 2002): at each lattice point a gradient, one of the twelve
/// directions to the middles of a cube's edges, chosen by hashing (seed, point); between them the ramps blended by
/// 6 t^5 - 15 t^4 + 10 t^3, hence twice continuously differentiable.
///
///   p   any finite point, also far from the origin: within [-1.04, 1.04], 0 at lattice points, features about 1 wide
///
/// Mean 0, deviation about 0.28. A pure function: no tables, no state. Coordinates beyond 2^52 have no fraction: 0.
Real gradient_noise(const Vec3& p, std::uint64_t seed);

/// The same with its exact gradient.
NoiseSample gradient_noise_sample(const Vec3& p, std::uint64_t seed);

/// Gradient noise's directions at lattice points, and which of them stands at (i, j, k).
inline constexpr int kLatticeDirections[12][3] = {{-1, -1, 0}, {1, -1, 0}, {-1, 1, 0}, {1, 1, 0}, {-1, 0, -1}, {1, 0, -1},
                                                  {-1, 0, 1},  {1, 0, 1},  {0, -1, -1}, {0, 1, -1}, {0, -1, 1}, {0, 1, 1}};
inline std::size_t lattice_direction(std::int64_t i, std::int64_t j, std::int64_t k, std::uint64_t seed) {
  // j and k share a counter; the odd factor keeps (j, k) apart from all others nearby.
  const std::uint64_t row = static_cast<std::uint64_t>(j) * 0x9e3779b97f4a7c15ULL + static_cast<std::uint64_t>(k);
  const std::uint64_t bits = random_bits(seed, row, static_cast<std::uint64_t>(i));
  return (bits >> 32) % 3 * 4 + (bits & 3);  // 2^32 / 3: the bias is 1e-10
}

struct FractalOptions {
  int octaves = 5;         ///< >= 1
  Real lacunarity = 2;     ///< frequency from octave to octave, > 0
  Real gain = 0.5;         ///< amplitude from octave to octave, > 0
  Real wavelength = 1;     ///< of the first octave [m], > 0
};

/// Fractal sum  sum_k gain^k noise(p lacunarity^k / wavelength + shift_k) / sum_k gain^k,  a seed of its own for each
/// octave, lattices shifted against one another so that their zeros do not meet. Within [-1.04, 1.04]. The gradient is that of p.
NoiseSample fractal_noise(const Vec3& p, std::uint64_t seed, const FractalOptions& options = {});

}  // namespace effuse::geometry
