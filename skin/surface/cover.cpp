#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
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

/// Particles round a stretch of a column, coordinates from its corner.
struct Around {
  std::vector<float> x, y, z;
};

/// Sums of max(0, 1 - |p - x|^2 / reach^2)^3 over x, at eight points.
EFFUSE_CLONES void crowds(const Around& around, const float* at_x, const float* at_y, const float* at_z, float reach, float* out) {
  const Row zero{};
  Row px, py, pz;
  std::memcpy(&px, at_x, sizeof px);
  std::memcpy(&py, at_y, sizeof py);
  std::memcpy(&pz, at_z, sizeof pz);
  const float inverse = 1 / (reach * reach);
  Row sum = zero;
  for (std::size_t j = 0; j < around.x.size(); ++j) {
    const Row dx = px - around.x[j], dy = py - around.y[j], dz = pz - around.z[j];
    Row t = 1 - (dx * dx + dy * dy + dz * dz) * inverse;
    t = t > zero ? t : zero;
    sum += t * t * t;
  }
  std::memcpy(out, &sum, sizeof sum);
}

}  // namespace

std::vector<float> ball_radii(const ParticleGrid& particles, const Cover& cover, std::span<const std::uint8_t> wanted) {
  CHECK(wanted.empty() || wanted.size() == particles.size());
  std::vector<float> radius(particles.size(), 0);
  if (!(cover.factor > 0)) return radius;
  // Upright stretches of columns: so high that about eight particles lie in one, wherever others are wanted or not.
  const float reach = cover.reach;
  const Real stretch = 4 * static_cast<Real>(reach);
  parallel_ranges(particles.columns().size(), 8, [&](std::size_t begin, std::size_t end) {
    Around around;
    std::array<Index, kSide> group;
    for (std::size_t c = begin; c < end; ++c) {
      const ParticleGrid::Column& column = particles.columns()[c];
      Index i = column.begin;
      while (i < column.end) {
        const Vec3& first = particles.x()[i];
        const Real bottom = stretch * std::floor(first.z() / stretch);
        // The columns' own corner: the same for all of it, whichever is asked for.
        const Vec3 corner(std::floor(first.x() / particles.side()) * particles.side(), std::floor(first.y() / particles.side()) * particles.side(), bottom);
        Index last = i;
        bool any = false;
        while (last < column.end && particles.x()[last].z() < bottom + stretch) {
          any = any || wanted.empty() || wanted[last];
          ++last;
        }
        if (any) {
          for (auto* v : {&around.x, &around.y, &around.z}) v->clear();
          const Vec3 margin = Vec3::Constant(static_cast<Real>(reach));
          particles.runs(corner - margin, corner + Vec3(particles.side(), particles.side(), stretch) + margin, [&](Index from, Index to) {
            for (Index j = from; j < to; ++j) {
              const Eigen::Vector3f p = (particles.x()[j] - corner).cast<float>();
              around.x.push_back(p.x());
              around.y.push_back(p.y());
              around.z.push_back(p.z());
            }
          });
          for (Index next = i; next < last;) {
            float x[kSide] = {}, y[kSide] = {}, z[kSide] = {}, W[kSide];
            int n = 0;
            for (; next < last && n < kSide; ++next) {
              if (!wanted.empty() && !wanted[next]) continue;
              const Eigen::Vector3f p = (particles.x()[next] - corner).cast<float>();
              x[n] = p.x();
              y[n] = p.y();
              z[n] = p.z();
              group[static_cast<std::size_t>(n++)] = next;
            }
            if (n == 0) break;
            crowds(around, x, y, z, reach, W);
            for (int k = 0; k < n; ++k) {
              const float t = std::clamp((cover.none - W[k]) / (cover.none - cover.all), 0.0f, 1.0f);
              const Index of = group[static_cast<std::size_t>(k)];
              radius[of] = cover.factor * particles.radius()[of] * t * t * (3 - 2 * t);
            }
          }
        }
        i = last;
      }
    }
  });
  return radius;
}

void cover_particles(const ParticleGrid& particles, const Blocks& blocks, const Cover& cover, const Field& weight, Field& phi,
                     std::span<const std::uint8_t> only) {
  ZONE("skin.cover");
  const float factor = cover.factor, blend = cover.blend;
  if (factor <= 0) return;
  CHECK(only.empty() || only.size() == blocks.size());
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

  // Particles near a block's shallow voxels that may be shallow themselves: others' balls ask for nothing. W at a particle is what the voxels
  // round it say but for its curvature, of some W / reach^2.
  const float surely = cover.none * (1 + 1.6f / (cover.reach * cover.reach));
  enum : std::uint8_t { kUnasked, kWanted, kNotWanted };
  std::vector<std::uint8_t> shallow(blocks.size(), 0), asked(particles.size(), kUnasked);
  parallel_for(
      blocks.size(),
      [&](std::size_t b) {
        if (!only.empty() && !only[b]) return;
        const float* value = &phi[b * kVoxels];
        // A ball asks for no less than -radius.
        shallow[b] = *std::max_element(value, value + kVoxels) > -largest - blend;
        if (!shallow[b]) return;
        each_near(b, [&](Index i, const Eigen::Vector3f&) {
          std::atomic_ref<std::uint8_t> want(asked[i]);
          if (want.load(std::memory_order_relaxed) == kUnasked)
            want.store(blocks.sample(weight, 0, static_cast<Index>(b), particles.x()[i]) < surely ? kWanted : kNotWanted, std::memory_order_relaxed);
        });
      },
      8);
  std::transform(asked.begin(), asked.end(), asked.begin(), [](std::uint8_t a) { return std::uint8_t{a == kWanted}; });
  const std::vector<float> radius = ball_radii(particles, cover, asked);
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
