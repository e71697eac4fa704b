#include "skin/detail/triangle_noise.h"

#include <array>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/random.h"

namespace effuse::skin {

namespace {

/// The random plane at node (i, j) of the lattice.
struct Plane {
  Real height;
  Vec2 slope;
};

Plane plane_at(std::int64_t i, std::int64_t j, std::uint64_t seed) {
  // One draw: its upper half the height, its lower the direction.
  const std::uint64_t bits = random_bits(seed, static_cast<std::uint64_t>(i), static_cast<std::uint64_t>(j));
  const Real height = static_cast<Real>(bits >> 32) * 0x1.0p-31 - 1;
  const Real angle = static_cast<Real>(bits & 0xffffffffULL) * (2 * kPi * 0x1.0p-32);
  return {height, triangle_noise_constants::kSlope * Vec2(std::cos(angle), std::sin(angle))};
}

constexpr Real kHeight = 0.86602540378443864676;  // of the triangle: sqrt(3) / 2

}  // namespace

TriangleSample triangle_noise_sample(const Vec2& p, std::uint64_t seed) {
  if (!(p.cwiseAbs().maxCoeff() < 0x1.0p50)) return {};
  // Lattice coordinates: p = s (1, 0) + t (1/2, kHeight).
  const Real t = p.y() / kHeight, s = p.x() - t / 2;
  const Real s0 = std::floor(s), t0 = std::floor(t);
  const Real a = s - s0, b = t - t0;
  const auto i = static_cast<std::int64_t>(s0), j = static_cast<std::int64_t>(t0);
  // Each cell is two triangles: the lower with its corner at (i, j), the upper with its own at (i + 1, j + 1).
  const bool upper = a + b > 1;
  const std::int64_t corner = upper ? 1 : 0;
  const std::array<std::array<std::int64_t, 2>, 3> node = {{{i + corner, j + corner}, {i + 1, j}, {i, j + 1}}};
  const Real sign = upper ? -1 : 1;
  std::array<Real, 3> l;
  if (upper) l = {a + b - 1, 1 - b, 1 - a};
  else l = {1 - a - b, a, b};
  // Slopes of the coordinates: of a (1, -1 / (2 kHeight)), of b (0, 1 / kHeight).
  const Vec2 of_a(1, -0.5 / kHeight), of_b(0, 1 / kHeight);
  std::array<Vec2, 3> dl;
  dl[0] = -sign * (of_a + of_b);
  dl[1] = upper ? Vec2(-of_b) : of_a;
  dl[2] = upper ? Vec2(-of_a) : of_b;

  const Real pairs = l[0] * l[1] + l[1] * l[2] + l[2] * l[0];
  TriangleSample sample;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t m = (k + 1) % 3, n = (k + 2) % 3;
    const Plane plane = plane_at(node[k][0], node[k][1], seed);
    const Vec2 at(static_cast<Real>(node[k][0]) + 0.5 * static_cast<Real>(node[k][1]), kHeight * static_cast<Real>(node[k][1]));
    const Real value = plane.height + plane.slope.dot(p - at);

    // w = l_k^2 (3 - 2 l_k) + 3 l_0 l_1 l_2 - 3 l_k q^2 / S, q = l_m l_n, S = pairs; at a node S is 0 and so is the fraction.
    const Real q = l[m] * l[n], ratio = pairs > 0 ? q / pairs : 0;
    const Real w = l[k] * l[k] * (3 - 2 * l[k]) + 3 * l[k] * q * (1 - ratio);
    const Real dk = 6 * l[k] * (1 - l[k]) + 3 * q * (1 - ratio) + 3 * l[k] * ratio * ratio * (l[m] + l[n]);
    const Real dm = 3 * l[k] * l[n] - 6 * l[k] * l[n] * ratio + 3 * l[k] * ratio * ratio * (l[k] + l[n]);
    const Real dn = 3 * l[k] * l[m] - 6 * l[k] * l[m] * ratio + 3 * l[k] * ratio * ratio * (l[k] + l[m]);
    sample.value += w * value;
    sample.gradient += w * plane.slope + value * (dk * dl[k] + dm * dl[m] + dn * dl[n]);
  }
  return sample;
}

Real triangle_noise(const Vec2& p, std::uint64_t seed) { return triangle_noise_sample(p, seed).value; }

TriangleSample triangle_octaves(const Vec2& p, std::uint64_t seed, int octaves, Real gain) {
  CHECK_GE(octaves, 1);
  CHECK_GT(gain, 0.0);
  TriangleSample sum;
  Real amplitude = 1, squares = 0, frequency = 1;
  for (int k = 0; k < octaves; ++k, amplitude *= gain, frequency *= 2) {
    const TriangleSample part = triangle_noise_sample(frequency * p, seed + 0x9e3779b97f4a7c15ULL * static_cast<std::uint64_t>(k));
    sum.value += amplitude * part.value;
    sum.gradient += amplitude * frequency * part.gradient;
    squares += amplitude * amplitude;
  }
  const Real scale = 1 / (triangle_noise_constants::kDeviation * std::sqrt(squares));
  sum.value *= scale;
  sum.gradient *= scale;
  return sum;
}

}  // namespace effuse::skin
