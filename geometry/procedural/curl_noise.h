#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "geometry/base/types.h"

namespace effuse::geometry {

/// Curl of three gradient noises, a field that flows and has no sources:
///
///   w(p) = curl (N_0, N_1, N_2)(p),   N_k(p) = gradient_noise(p, seed k)
///
/// Once continuously differentiable, div w = 0 to rounding; swirls about 1 wide, each component's deviation about 1. A pure function of p:
/// what is looked up in a table of the lattice's directions, two bytes a point, has the same bits as what is hashed anew.
/// Accuracy: 1e-14 of the exact derivative near the origin. Points beyond 2^52 and NaN: 0.
/// Source: Bridson, Hourihan, Nordenstam 2007, Curl-noise for procedural fluid flow, ACM Trans. Graph. 26 (3), 46.
class CurlNoise {
 public:
  explicit CurlNoise(const std::array<std::uint64_t, 3>& seeds) : seeds_(seeds) {}

  Vec3 operator()(const Vec3& p) const;

  /// From now on what lies in box is looked up, if a table of at most most lattice points holds it; without one all is hashed, five times as
  /// slow. A table that holds the box already is kept. The box may be empty. Not while another thread asks.
  void cover(const Box3& box, std::size_t most);

  std::size_t memory() const { return table_.capacity() * sizeof(std::uint16_t); }

 private:
  std::uint16_t directions(std::int64_t i, std::int64_t j, std::int64_t k) const;

  std::array<std::uint64_t, 3> seeds_;
  std::array<std::int64_t, 3> low_ = {0, 0, 0}, n_ = {0, 0, 0};  // of the table, x fastest
  std::vector<std::uint16_t> table_;                             // directions of noise k in bits 4k to 4k + 3
};

}  // namespace effuse::geometry
