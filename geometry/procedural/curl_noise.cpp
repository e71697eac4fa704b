#include "geometry/procedural/curl_noise.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/procedural/noise.h"

namespace effuse::geometry {

namespace {

constexpr Real kNoFraction = 0x1.0p52;

/// kLatticeDirections as numbers, side by side in a line of memory.
struct Direction {
  Real x, y, z, spare;
};
struct Directions {
  alignas(64) Direction of[16] = {};
  constexpr Directions() {
    for (std::size_t k = 0; k < 12; ++k)
      of[k] = {static_cast<Real>(kLatticeDirections[k][0]), static_cast<Real>(kLatticeDirections[k][1]), static_cast<Real>(kLatticeDirections[k][2]), 0};
  }
};
constexpr Directions kDirections;

/// Largest integer not above p, |p| < 2^52.
std::int64_t floor_of(Real p) {
  const auto cut = static_cast<std::int64_t>(p);
  return cut - (p < static_cast<Real>(cut));
}

/// Between two lattice points: weight of each, and how fast the second's grows.
struct Blend {
  Real weight[2], slope;
  explicit Blend(Real t) {
    weight[1] = t * t * t * (t * (t * 6 - 15) + 10);
    weight[0] = 1 - weight[1];
    slope = 30 * t * t * (t * (t - 2) + 1);
  }
};

}  // namespace

std::uint16_t CurlNoise::directions(std::int64_t i, std::int64_t j, std::int64_t k) const {
  return static_cast<std::uint16_t>(lattice_direction(i, j, k, seeds_[0]) | lattice_direction(i, j, k, seeds_[1]) << 4 | lattice_direction(i, j, k, seeds_[2]) << 8);
}

CurlNoise::Place CurlNoise::find(const Vec3& p) const {
  Place at;
  at.any = std::abs(p.x()) < kNoFraction && std::abs(p.y()) < kNoFraction && std::abs(p.z()) < kNoFraction;
  if (!at.any) return at;
  const std::int64_t i = floor_of(p.x()), j = floor_of(p.y()), k = floor_of(p.z());
  at.x = p.x() - static_cast<Real>(i), at.y = p.y() - static_cast<Real>(j), at.z = p.z() - static_cast<Real>(k);
  const std::int64_t a = i - low_[0], b = j - low_[1], c = k - low_[2];
  if (a >= 0 && b >= 0 && c >= 0 && a + 1 < n_[0] && b + 1 < n_[1] && c + 1 < n_[2]) {
    const std::uint16_t* first = table_.data() + (a * n_[1] + b) * n_[2] + c;
    for (std::size_t q = 0; q < 4; ++q) {
      const std::uint16_t* column = first + (static_cast<std::int64_t>(q & 1) * n_[1] + static_cast<std::int64_t>(q >> 1)) * n_[2];
      at.corner[q] = column[0];
      at.corner[q + 4] = column[1];
    }
  } else {
    for (std::size_t q = 0; q < 8; ++q) at.corner[q] = directions(i + static_cast<std::int64_t>(q & 1), j + static_cast<std::int64_t>(q >> 1 & 1), k + static_cast<std::int64_t>(q >> 2));
  }
  return at;
}

/// N = sum over corners of W R: weight W, and ramps R_k = g_k . r from the corner. So curl N = sum of grad W x R + W curl R, where
/// curl R = (g_2y - g_1z, g_0z - g_2x, g_1x - g_0y).
Vec3 CurlNoise::curl(const Place& at) {
  if (!at.any) return Vec3::Zero();
  const Blend x(at.x), y(at.y), z(at.z);
  Real wx = 0, wy = 0, wz = 0;
  for (std::size_t q = 0; q < 8; ++q) {
    const std::size_t u = q & 1, v = q >> 1 & 1, w = q >> 2;
    const std::uint16_t corner = at.corner[q];
    const Direction &g0 = kDirections.of[corner & 15], &g1 = kDirections.of[corner >> 4 & 15], &g2 = kDirections.of[corner >> 8];
    const Real rx = at.x - static_cast<Real>(u), ry = at.y - static_cast<Real>(v), rz = at.z - static_cast<Real>(w);
    const Real r0 = g0.x * rx + g0.y * ry + g0.z * rz, r1 = g1.x * rx + g1.y * ry + g1.z * rz, r2 = g2.x * rx + g2.y * ry + g2.z * rz;
    const Real yz = y.weight[v] * z.weight[w], xz = x.weight[u] * z.weight[w], xy = x.weight[u] * y.weight[v], all = x.weight[u] * yz;
    const Real sx = (u ? x.slope : -x.slope) * yz, sy = (v ? y.slope : -y.slope) * xz, sz = (w ? z.slope : -z.slope) * xy;
    wx += sy * r2 - sz * r1 + all * (g2.y - g1.z);
    wy += sz * r0 - sx * r2 + all * (g0.z - g2.x);
    wz += sx * r1 - sy * r0 + all * (g1.x - g0.y);
  }
  return {wx, wy, wz};
}

Vec3 CurlNoise::operator()(const Vec3& p) const { return curl(find(p)); }

void CurlNoise::sample(std::span<const Vec3> p, std::span<Vec3> w) const {
  CHECK_EQ(w.size(), p.size());
  constexpr std::size_t kTogether = 32;
  std::array<Place, kTogether> at;
  for (std::size_t begin = 0; begin < p.size(); begin += kTogether) {
    const std::size_t n = std::min(kTogether, p.size() - begin);
    for (std::size_t q = 0; q < n; ++q) at[q] = find(p[begin + q]);
    for (std::size_t q = 0; q < n; ++q) w[begin + q] = curl(at[q]);
  }
}

void CurlNoise::cover(const Box3& box, std::size_t most) {
  constexpr std::int64_t kMargin = 1;  // what drifts stays in for a while
  if (!(box.min().cwiseAbs().maxCoeff() < kNoFraction / 2 && box.max().cwiseAbs().maxCoeff() < kNoFraction / 2)) return;
  std::array<std::int64_t, 3> low, n;
  bool holds = true;
  Real points = 1;
  for (std::size_t d = 0; d < 3; ++d) {
    const auto axis = static_cast<Eigen::Index>(d);
    const std::int64_t from = floor_of(box.min()[axis]), to = floor_of(box.max()[axis]) + 1;
    holds = holds && from >= low_[d] && to < low_[d] + n_[d];
    low[d] = from - kMargin;
    n[d] = to + kMargin - low[d] + 1;
    points *= static_cast<Real>(n[d]);
  }
  if (holds || !(points <= static_cast<Real>(most)) || box.isEmpty()) return;
  low_ = low;
  n_ = n;
  table_.resize(static_cast<std::size_t>(n[0] * n[1] * n[2]));
  parallel_for(
      static_cast<std::size_t>(n[0] * n[1]),
      [&](std::size_t column) {
        const auto at = static_cast<std::int64_t>(column);
        for (std::int64_t k = 0; k < n[2]; ++k) table_[static_cast<std::size_t>(at * n[2] + k)] = directions(low[0] + at / n[1], low[1] + at % n[1], low[2] + k);
      },
      64);
}

}  // namespace effuse::geometry
