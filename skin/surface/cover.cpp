#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/surface/clones.h"
#include "skin/surface/level_set_impl.h"

namespace effuse::skin {

namespace {

using Row = float __attribute__((vector_size(kSide * sizeof(float))));
using Rows = std::array<Row, kSide * kSide>;

/// A ball near a block, coordinates from its voxel (0, 0, 0).
struct Ball {
  float x, y, z, radius;
};

/// Least |p - x|^2 - radius^2 at the block's voxels, and the radius of that ball, which is 0 where none is within kCoverBand.
EFFUSE_CLONES void nearest_of(const std::vector<Ball>& balls, Rows& least, Rows& radius) {
  const Row lane = {0, 1, 2, 3, 4, 5, 6, 7}, zero{};
  least.fill(zero + 1e9f);
  radius.fill(zero);
  for (const Ball& ball : balls) {
    const float cut = ball.radius + kCoverBand, cut2 = cut * cut, own2 = ball.radius * ball.radius;
    const Row own = zero + ball.radius, dz = ball.z - lane, dz2 = dz * dz;
    const int i0 = std::max(0, static_cast<int>(std::ceil(ball.x - cut))), i1 = std::min(kSide - 1, static_cast<int>(std::floor(ball.x + cut)));
    for (int i = i0; i <= i1; ++i) {
      const float dx = ball.x - static_cast<float>(i), half = std::sqrt(std::max(0.0f, cut2 - dx * dx));
      const int j0 = std::max(0, static_cast<int>(std::ceil(ball.y - half))), j1 = std::min(kSide - 1, static_cast<int>(std::floor(ball.y + half)));
      for (int j = j0; j <= j1; ++j) {
        const float dy = ball.y - static_cast<float>(j);
        const std::size_t row = static_cast<std::size_t>(i * kSide + j);
        const Row d2 = dz2 + (dx * dx + dy * dy), power = d2 < cut2 ? d2 - own2 : zero + 1e9f;
        radius[row] = power < least[row] ? own : radius[row];
        least[row] = power < least[row] ? power : least[row];
      }
    }
  }
}

/// Sum of (1 - |x_i - x_j|^2 / reach^2)^3 over the particles, i among them; or `enough`, once it has come to that.
float crowd(const ParticleGrid& particles, const Vec3& x, Real reach, float enough) {
  float sum = 0;
  const Vec3 margin = Vec3::Constant(reach);
  particles.runs(x - margin, x + margin, [&](Index from, Index to) {
    for (Index j = from; j < to && sum < enough; ++j) {
      const float t = static_cast<float>(1 - (particles.x()[j] - x).squaredNorm() / (reach * reach));
      if (t > 0) sum += t * t * t;
    }
  });
  return std::min(sum, enough);
}

}  // namespace

void cover_particles(const ParticleGrid& particles, const Blocks& blocks, float outside, const Cover& cover, Field& phi) {
  ZONE("skin.cover");
  const float factor = cover.factor, blend = cover.blend;
  if (factor <= 0) return;
  CHECK_GT(blend, 0.0f);
  CHECK_GT(cover.none, cover.all);
  const float largest = factor * static_cast<float>(parallel_max(particles.size(), 0, [&](std::size_t i) { return static_cast<Real>(particles.radius()[i]); }));
  const Real reach = static_cast<Real>(largest + kCoverBand);
  // f(particle, its place from the block's voxel (0, 0, 0)) for those near block b.
  const auto each_near = [&](std::size_t b, auto&& f) {
    const BlockCoord& c = blocks.coords()[b];
    const Vec3 low(c[0] * kSide, c[1] * kSide, c[2] * kSide), high = low + Vec3::Constant(kSide - 1);
    particles.runs(low - Vec3::Constant(reach), high + Vec3::Constant(reach), [&](Index from, Index to) {
      for (Index i = from; i < to; ++i)
        if (const Vec3& p = particles.x()[i]; (p - p.cwiseMax(low).cwiseMin(high)).squaredNorm() < reach * reach) f(i, Eigen::Vector3f((p - low).cast<float>()));
    });
  };

  // Particles near a block's shallow voxels that are shallow themselves: others' balls ask for nothing. The field's slope is about one, two at
  // most between the particle and its nearest voxel.
  std::vector<std::uint8_t> shallow(blocks.size(), 0);
  std::vector<float> radius(particles.size(), -1);  // of the balls; -1: not wanted, 1: wanted
  parallel_for(
      blocks.size(),
      [&](std::size_t b) {
        const float* value = &phi[b * kVoxels];
        // A ball asks for no less than -radius.
        shallow[b] = *std::max_element(value, value + kVoxels) > -largest - blend;
        if (!shallow[b]) return;
        const BlockCoord& c = blocks.coords()[b];
        each_near(b, [&](Index i, const Eigen::Vector3f& p) {
          const auto at = [&](int axis) { return kSide * c[static_cast<std::size_t>(axis)] + static_cast<int>(std::lround(p[axis])); };
          if (blocks.at(phi, outside, static_cast<Index>(b), at(0), at(1), at(2)) > -2 * largest - blend - 2) std::atomic_ref<float>(radius[i]).store(1, std::memory_order_relaxed);
        });
      },
      8);
  parallel_for(radius.size(), [&](std::size_t i) {
    if (radius[i] < 0) return;
    const float W = crowd(particles, particles.x()[i], static_cast<Real>(cover.reach), cover.none);
    const float t = std::clamp((cover.none - W) / (cover.none - cover.all), 0.0f, 1.0f);
    radius[i] = factor * particles.radius()[i] * t * t * (3 - 2 * t);
  });
  parallel_ranges(blocks.size(), 8, [&](std::size_t begin, std::size_t end) {
    std::vector<Ball> near;
    Rows least, nearest;
    for (std::size_t b = begin; b < end; ++b) {
      if (!shallow[b]) continue;
      near.clear();
      each_near(b, [&](Index i, const Eigen::Vector3f& p) {
        if (radius[i] > 0) near.push_back({p.x(), p.y(), p.z(), radius[i]});
      });
      if (near.empty()) continue;
      nearest_of(near, least, nearest);
      float* value = &phi[b * kVoxels];
      for (std::size_t v = 0; v < kVoxels; ++v) {
        const float r = nearest[v / kSide][v % kSide];
        if (r == 0) continue;
        const float ball = std::sqrt(std::max(0.0f, least[v / kSide][v % kSide] + r * r)) - r, apart = std::max(0.0f, blend - std::abs(value[v] - ball));
        value[v] = std::min(value[v], ball) - apart * apart / (4 * blend);
      }
    }
  });
}

}  // namespace effuse::skin
