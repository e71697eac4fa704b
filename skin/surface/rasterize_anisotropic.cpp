#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/surface/anisotropy.h"
#include "skin/surface/clones.h"

namespace effuse::skin {

namespace {

/// The bound between separate particles, as in rasterize.cpp.
constexpr float kBound = 1.15f, kBoundSlope = 3;
/// A point this near to a particle [spacings] is in lava or beside it: holes of dense packings are 0.87 wide.
constexpr float kCovered = 1;
/// Where the kernels' weights are not much larger the nearest particle gives the field.
constexpr float kLittleWeight = 1e-4f;

using Row = float __attribute__((vector_size(kSide * sizeof(float))));
constexpr std::size_t kRows = kSide * kSide;

/// What the sums need of a particle, lengths in voxels.
struct Felt {
  float xx, xy, xz, yy, yz, zz;  // metric over the kernel's reach squared
  float ex, ey, ez;              // half the kernel's extents
  float lean, side, width2;      // at x from the centre the kernel covers y = -lean x +- sqrt(width2 - side x^2)
  float root;                    // amplitude^(1/5)
  float radius, crowd;
};

/// A particle near a block, coordinates from its voxel (0, 0, 0).
struct Candidate {
  float x, y, z;     // the particle
  float cx, cy, cz;  // its kernel's centre
  Index felt;
};

/// Sums along a row of voxels: of the weights w, of w times the offsets of the kernels' centres, of w times radii and crowds.
struct Sums {
  Row W, x, y, z, r, crowd;
};
/// At a block's voxels, one row along z after another.
using SumRows = std::array<Sums, kRows>;
using Rows = std::array<Row, kRows>;

/// Whole numbers of 0 .. 7 within at +- half. Always inline: a call from a clone for wider registers costs more than all the rest.
[[gnu::always_inline]] inline void rows_between(float at, float half, int& from, int& to) {
  // Shifted to be positive, where cutting off rounds down.
  constexpr int kShift = 1024;
  constexpr float kLow = 1 - kShift;
  from = std::max(0, static_cast<int>(std::max(at - half, kLow) + kShift) - kShift + 1);
  to = std::min(kSide - 1, static_cast<int>(std::max(at + half, kLow) + kShift) - kShift);
}

/// Squared distance of the nearest particle, where less than cut^2.
EFFUSE_CLONES void gather_nearest(const std::vector<Candidate>& near, float cut, Rows& nearest) {
  const Row lane = {0, 1, 2, 3, 4, 5, 6, 7};
  const float cut2 = cut * cut;
  nearest.fill(Row{} + cut2);
  for (const Candidate& c : near) {
    int i0, i1, j0, j1;
    rows_between(c.x, cut, i0, i1);
    const Row dz = c.z - lane, dz2 = dz * dz;
    rows_between(c.y, cut, j0, j1);
    for (int i = i0; i <= i1; ++i) {
      const float dx = c.x - static_cast<float>(i), dx2 = dx * dx;
      for (int j = j0; j <= j1; ++j) {
        const float dy = c.y - static_cast<float>(j);
        Row& to = nearest[static_cast<std::size_t>(i * kSide + j)];
        const Row d2 = dz2 + (dx2 + dy * dy);
        to = d2 < to ? d2 : to;
      }
    }
  }
}

/// The sums at the block's voxels, candidate after candidate.
EFFUSE_CLONES void gather_sums(const std::vector<Candidate>& near, const std::vector<Felt>& felt, SumRows& out) {
  const Row zero{}, lane = {0, 1, 2, 3, 4, 5, 6, 7};
  out.fill({zero, zero, zero, zero, zero, zero});
  for (const Candidate& c : near) {
    const Felt& f = felt[c.felt];
    int i0, i1;
    rows_between(c.cx, f.ex, i0, i1);
    const Row z = c.cz - lane;
    for (int i = i0; i <= i1; ++i) {
      const float x = c.cx - static_cast<float>(i);
      int j0, j1;
      rows_between(c.cy + f.lean * x, std::sqrt(std::max(0.0f, f.width2 - f.side * x * x)), j0, j1);
      const float xx = f.xx * x * x, xy = 2 * f.xy * x, xz = 2 * f.xz * x, yz = 2 * f.yz;
      for (int j = j0; j <= j1; ++j) {
        const float y = c.cy - static_cast<float>(j);
        const Row q = z * (f.zz * z + (xz + yz * y)) + (xx + y * (xy + f.yy * y));
        Row t = (1 - q) * f.root;
        t = t > zero ? t : zero;
        const Row t2 = t * t, w = t2 * t2 * t;
        Sums& to = out[static_cast<std::size_t>(i * kSide + j)];
        to.W += w;
        to.x += w * x;
        to.y += w * y;
        to.z += w * z;
        to.r += w * f.radius;
        to.crowd += w * f.crowd;
      }
    }
  }
}

/// The field from the sums and the squared distance of the nearest particle; rows of either.
EFFUSE_CLONES void field_from_sums(const SumRows& sums, const Rows& nearest, const RasterOptions& o, float* phi, float* weight) {
  const float ratio = o.radius_factor * o.spacing / (2 * o.reach), inside = 1 - ratio * ratio, lone = inside * inside * inside;
  const float radius = o.radius_factor * o.spacing / 2, gap = kBound * o.spacing;
  for (std::size_t row = 0; row < kRows; ++row)
    for (int k = 0; k < kSide; ++k) {
      const float W = sums[row].W[k], x = sums[row].x[k], y = sums[row].y[k], z = sums[row].z[k];
      const float distance = std::sqrt(nearest[row][k]), inverse = 1 / (W + kLittleWeight);
      const float value =
          (std::sqrt(x * x + y * y + z * z) - o.radius_factor * sums[row].r[k] + kLittleWeight * (distance - radius)) * inverse;
      phi[row * kSide + static_cast<std::size_t>(k)] = std::min(o.outside, std::max(value, kBoundSlope * (distance - gap)));
      weight[row * kSide + static_cast<std::size_t>(k)] = lone * sums[row].crowd[k] * inverse;
    }
}

/// reach: of the kernels.
std::vector<Felt> felt_of(const ParticleGrid& particles, const Kernels& kernels, float reach) {
  std::vector<Felt> felt(particles.size());
  parallel_for(particles.size(), [&](std::size_t i) {
    const float per_reach2 = 1 / (reach * reach);
    std::array<float, 6> m = kernels.metric[i];
    // The inverse's diagonal, as det M = 1.
    const auto half = [&](float a, float b, float c) { return reach * std::sqrt(a * b - c * c); };
    const float ex = half(m[3], m[5], m[4]), ey = half(m[0], m[5], m[2]), ez = half(m[0], m[3], m[1]);
    for (float& v : m) v *= per_reach2;
    // q < 1 for some z: u x^2 + 2 v x y + w y^2 < 1.
    const float u = m[0] - m[2] * m[2] / m[5], v = m[1] - m[2] * m[4] / m[5], w = m[3] - m[4] * m[4] / m[5];
    felt[i] = {m[0],
               m[1],
               m[2],
               m[3],
               m[4],
               m[5],
               ex,
               ey,
               ez,
               v / w,
               u / w - v * v / (w * w),
               1 / w,
               std::pow(kernels.amplitude[i], 0.2f),
               particles.radius()[i],
               kernels.crowd[i]};
  });
  return felt;
}

/// Particles nearer than cut to a voxel of the block, and those whose kernels may reach one.
void candidates(const ParticleGrid& particles, const Kernels& kernels, const std::vector<Felt>& felt, const BlockCoord& coord, Real margin,
                float cut, std::vector<Candidate>& near) {
  const Vec3 low(coord[0] * kSide, coord[1] * kSide, coord[2] * kSide), high = low + Vec3::Constant(kSide - 1);
  const float last = kSide - 1, cut2 = cut * cut;
  near.clear();
  particles.runs(low - Vec3::Constant(margin), high + Vec3::Constant(margin), [&](Index from, Index to) {
    for (Index i = from; i < to; ++i) {
      const Eigen::Vector3f p = (particles.x()[i] - low).cast<float>(), c = (kernels.centre[i] - low).cast<float>();
      const auto beside = [last](float v) { return std::abs(v - std::clamp(v, 0.0f, last)); };
      const Felt& f = felt[i];
      const bool reaches = beside(c.x()) < f.ex && beside(c.y()) < f.ey && beside(c.z()) < f.ez;
      const float x = beside(p.x()), y = beside(p.y()), z = beside(p.z());
      if (reaches || x * x + y * y + z * z < cut2) near.push_back({p.x(), p.y(), p.z(), c.x(), c.y(), c.z(), i});
    }
  });
}

/// Blocks that lie a block and more from any voxel without a particle within kCovered spacings.
std::vector<std::uint8_t> deep_blocks(const ParticleGrid& particles, const Blocks& blocks, float spacing) {
  std::vector<Index> count(blocks.size(), 0);
  for (const Vec3& p : particles.x()) {
    const Index b = blocks.block_at(p);
    if (b != kNone) ++count[b];
  }
  // Covered ones hold two thirds of a lattice's particles: others need no second look.
  const float half = 0.5f * static_cast<float>(kVoxels) / (spacing * spacing * spacing), cut = kCovered * spacing;
  std::vector<std::uint8_t> covered(blocks.size(), 0), deep(blocks.size(), 0);
  parallel_ranges(blocks.size(), 8, [&](std::size_t begin, std::size_t end) {
    std::vector<Candidate> near;
    Rows nearest;
    for (std::size_t b = begin; b < end; ++b) {
      if (static_cast<float>(count[b]) < half) continue;
      const BlockCoord& coord = blocks.coords()[b];
      const Vec3 low(coord[0] * kSide, coord[1] * kSide, coord[2] * kSide), margin = Vec3::Constant(static_cast<Real>(cut));
      near.clear();
      particles.runs(low - margin, low + Vec3::Constant(kSide - 1) + margin, [&](Index from, Index to) {
        for (Index i = from; i < to; ++i) {
          const Eigen::Vector3f p = (particles.x()[i] - low).cast<float>();
          near.push_back({p.x(), p.y(), p.z(), p.x(), p.y(), p.z(), i});
        }
      });
      gather_nearest(near, cut, nearest);
      const float* first = &nearest[0][0];
      covered[b] = *std::max_element(first, first + kVoxels) < cut * cut;
    }
  });
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const auto& around = blocks.around(b);
    deep[b] = std::all_of(around.begin(), around.end(), [&](Index k) { return k != kNone && covered[k]; });
  }
  return deep;
}

}  // namespace

void rasterize_anisotropic(const ParticleGrid& particles, const Kernels& kernels, const Blocks& blocks, const RasterOptions& o, Field& phi,
                           Field& weight, std::span<const std::uint8_t> wanted) {
  ZONE("skin.rasterize");
  CHECK_EQ(kernels.centre.size(), particles.size());
  CHECK(wanted.empty() || wanted.size() == blocks.size());
  phi.resize(blocks.size() * kVoxels);
  weight.resize(blocks.size() * kVoxels);
  const float cut = kBound * o.spacing + o.outside / kBoundSlope;  // farther from any particle the field is `outside`
  const float across = o.reach / o.spacing,
              full = static_cast<float>(64 * kPi / 315) * across * across * across;  // W of a full neighbourhood
  const std::vector<Felt> felt = felt_of(particles, kernels, kKernelReach * o.reach);
  const Real margin = parallel_max(felt.size(), static_cast<Real>(cut), [&](std::size_t i) {
    const Felt& f = felt[i];
    return ((kernels.centre[i] - particles.x()[i]).cwiseAbs() + Eigen::Vector3f(f.ex, f.ey, f.ez).cast<Real>()).maxCoeff();
  });
  const std::vector<std::uint8_t> deep = deep_blocks(particles, blocks, o.spacing);
  parallel_ranges(blocks.size(), 8, [&](std::size_t begin, std::size_t end) {
    std::vector<Candidate> near;
    SumRows sums;
    Rows nearest;
    for (std::size_t b = begin; b < end; ++b) {
      if (!wanted.empty() && !wanted[b]) {
        // Nothing is known there: whoever asks must take it for shallow.
        std::fill_n(&phi[b * kVoxels], kVoxels, 0.0f);
        std::fill_n(&weight[b * kVoxels], kVoxels, 0.0f);
        continue;
      }
      if (deep[b]) {
        std::fill_n(&phi[b * kVoxels], kVoxels, -o.radius_factor * o.spacing / 2);
        std::fill_n(&weight[b * kVoxels], kVoxels, full);
        continue;
      }
      candidates(particles, kernels, felt, blocks.coords()[b], margin, cut, near);
      if (near.empty()) {
        std::fill_n(&phi[b * kVoxels], kVoxels, o.outside);
        std::fill_n(&weight[b * kVoxels], kVoxels, 0.0f);
        continue;
      }
      gather_nearest(near, cut, nearest);
      gather_sums(near, felt, sums);
      field_from_sums(sums, nearest, o, &phi[b * kVoxels], &weight[b * kVoxels]);
    }
  });
}

Real anisotropic_distance(const ParticleGrid& particles, const Kernels& kernels, const RasterOptions& o, const Vec3& p) {
  const Real R = static_cast<Real>(kKernelReach * o.reach), cut = static_cast<Real>(kBound * o.spacing + o.outside / kBoundSlope);
  Real W = 0, wr = 0, nearest = cut;
  Vec3 wx = Vec3::Zero();
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const auto& m = kernels.metric[i];
    Mat3 M;
    M << m[0], m[1], m[2], m[1], m[3], m[4], m[2], m[4], m[5];
    const Vec3 d = kernels.centre[i] - p;
    const Real w = static_cast<Real>(kernels.amplitude[i]) * std::pow(std::max(0.0, 1 - d.dot(M * d) / (R * R)), 5);
    W += w;
    wx += w * d;
    wr += w * static_cast<Real>(particles.radius()[i]);
    nearest = std::min(nearest, (particles.x()[i] - p).norm());
  }
  const Real factor = static_cast<Real>(o.radius_factor), little = static_cast<Real>(kLittleWeight);
  const Real value = (wx.norm() - factor * wr + little * (nearest - factor * static_cast<Real>(o.spacing) / 2)) / (W + little);
  return std::min<Real>(o.outside, std::max(value, static_cast<Real>(kBoundSlope) * (nearest - static_cast<Real>(kBound * o.spacing))));
}

}  // namespace effuse::skin
