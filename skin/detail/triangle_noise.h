#pragma once

#include <cstdint>

#include "geometry/base/types.h"

namespace effuse::skin {

/// A value and its gradient in the plane.
struct TriangleSample {
  Real value = 0;
  Vec2 gradient = Vec2::Zero();
};

/// Noise on a lattice of equilateral triangles of side 1: at each node a random plane (height in [-1, 1], slope of length
/// kSlope in any direction, by hashing (seed, node)); inside a triangle the three planes, weighted by its barycentric coordinates l:
///
///   f = sum_k w_k (height_k + slope_k . (p - node_k)),   w_k = l_k^2 (3 - 2 l_k) + 3 l_0 l_1 l_2 (1 - l_m l_n / (l_0 l_1 + l_1 l_2 + l_2 l_0))
///
/// with m, n the two others. The w_k sum to one, are 1 at their node with slope 0, 0 with slope 0 on the edge opposite, and have no
/// slope across any edge (the second term takes off what the first leaves there): hence f is C1 everywhere, and follows each
/// plane to first order at its node.
///
///   p   any finite point within 2^50 of the origin, beyond it 0; features about 1 wide
///
/// Mean 0, within +-1.6, deviation kDeviation over the plane. Variance of the value and of its slope is the same in every direction (the lattice
/// has six-fold symmetry and slopes any direction). A pure function, no tables.
/// Source: planes on triangles: Stora, Agliati, Cani, Neyret & Gascuel 1999, Animating lava flows, section 4.4.
Real triangle_noise(const Vec2& p, std::uint64_t seed);

/// The same with its exact gradient.
TriangleSample triangle_noise_sample(const Vec2& p, std::uint64_t seed);

/// Octaves by recursive subdivision: each triangle in four, the new lattice half as wide on the same origin, planes of its own:
/// sum_k gain^k f(2^k p) / (deviation of that sum), so that the deviation is 1 whatever the octaves.
///   octaves >= 1, gain > 0 (checked)
TriangleSample triangle_octaves(const Vec2& p, std::uint64_t seed, int octaves, Real gain);

namespace triangle_noise_constants {
inline constexpr Real kSlope = 1.2;       ///< of the planes at the nodes
inline constexpr Real kDeviation = 0.504;///< of triangle_noise, measured (see its test)
}  // namespace triangle_noise_constants

}  // namespace effuse::skin
