#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
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
  /// w[i] = (*this)(p[i]), of equal size (checked). Where the table is larger than the caches its lines are waited for together, not one
  /// point after the other.
  void sample(std::span<const Vec3> p, std::span<Vec3> w) const;

  /// From now on what lies in box is looked up, if a table of at most most lattice points holds it; without one all is hashed, five times as
  /// slow. A table that holds the box already is kept. The box may be empty. Not while another thread asks.
  void cover(const Box3& box, std::size_t most);

  std::size_t memory() const { return table_.capacity() * sizeof(std::uint16_t); }

 private:
  /// Where a point is in its cell, and the directions at the cell's corners, x fastest.
  struct Place {
    Real x = 0, y = 0, z = 0;
    std::array<std::uint16_t, 8> corner = {};
    bool any = false;  // false: it is no place, or too far out
  };
  Place find(const Vec3& p) const;
  static Vec3 curl(const Place& at);
  std::uint16_t directions(std::int64_t i, std::int64_t j, std::int64_t k) const;

  std::array<std::uint64_t, 3> seeds_;
  std::array<std::int64_t, 3> low_ = {0, 0, 0}, n_ = {0, 0, 0};  // of the table, z fastest: clouds are wide rather than high
  std::vector<std::uint16_t> table_;                             // directions of noise k in bits 4k to 4k + 3
};

}  // namespace effuse::geometry
