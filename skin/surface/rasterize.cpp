#include "skin/surface/rasterize.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/surface/clones.h"

namespace effuse::skin {

namespace {

/// Particles farther from a point than this do not make it lava [spacings]: a sheet on a square lattice stays whole up to
/// 1.6 spacings between its particles, and lobes closer than 2.5 from particle to particle join.
constexpr float kBound = 1.15f;
/// Steeper than a distance, so that shifting the surface by half a spacing moves the bound by a sixth only.
constexpr float kBoundSlope = 3;

/// Particles near a block, coordinates from its voxel (0, 0, 0).
struct Candidates {
  std::vector<float> x, y, z, r;
  void clear() {
    for (auto* v : {&x, &y, &z, &r}) v->clear();
  }
  std::size_t size() const { return x.size(); }
};

/// Lists narrowed to a slab and to a row of voxels: what is left of the squared distance, and the coordinates.
struct Narrowed {
  std::vector<float> d2, dx, dy, z, r;
  void resize(std::size_t n) {
    for (auto* v : {&d2, &dx, &dy, &z, &r}) v->resize(n);
  }
};

using Row = float __attribute__((vector_size(kSide * sizeof(float))));

/// The field on the 512 voxels of one block. The sums run over the candidates in their order.
EFFUSE_CLONES void gather_block(const Candidates& near, Narrowed& slab, Narrowed& row, const RasterOptions& o, float* phi, float* weight) {
  const float R2 = o.reach * o.reach, inverse_R2 = 1 / R2;
  const Row zero{}, lane = {0, 1, 2, 3, 4, 5, 6, 7};
  const std::size_t n = near.size();

  for (int i = 0; i < kSide; ++i) {
    std::size_t in_slab = 0;
    for (std::size_t c = 0; c < n; ++c) {
      const float dx = near.x[c] - static_cast<float>(i), d2 = dx * dx;
      slab.d2[in_slab] = d2;
      slab.dx[in_slab] = dx;
      slab.dy[in_slab] = near.y[c];
      slab.z[in_slab] = near.z[c];
      slab.r[in_slab] = near.r[c];
      in_slab += d2 < R2;
    }
    for (int j = 0; j < kSide; ++j) {
      std::size_t in_row = 0;
      for (std::size_t c = 0; c < in_slab; ++c) {
        const float dy = slab.dy[c] - static_cast<float>(j), d2 = slab.d2[c] + dy * dy;
        row.d2[in_row] = d2;
        row.dx[in_row] = slab.dx[c];
        row.dy[in_row] = dy;
        row.z[in_row] = slab.z[c];
        row.r[in_row] = slab.r[c];
        in_row += d2 < R2;
      }

      Row W = zero, wx = zero, wy = zero, wz = zero, wr = zero, nearest = zero + R2;
      for (std::size_t c = 0; c < in_row; ++c) {
        const Row dz = row.z[c] - lane;
        const Row d2 = dz * dz + row.d2[c];
        Row t = 1 - d2 * inverse_R2;
        t = t > zero ? t : zero;
        const Row w = t * t * t;
        W += w;
        wx += w * row.dx[c];
        wy += w * row.dy[c];
        wz += w * dz;
        wr += w * row.r[c];
        nearest = d2 < nearest ? d2 : nearest;
      }

      for (int k = 0; k < kSide; ++k) {
        const std::size_t v = voxel_index(i, j, k);
        weight[v] = W[k];
        phi[v] = o.outside;
        if (W[k] < 1e-9f) continue;
        const float to_mean = std::sqrt(wx[k] * wx[k] + wy[k] * wy[k] + wz[k] * wz[k]) / W[k];
        const float bound = kBoundSlope * (std::sqrt(nearest[k]) - kBound * o.spacing);
        phi[v] = std::min(o.outside, std::max(to_mean - o.radius_factor * wr[k] / W[k], bound));
      }
    }
  }
}

}  // namespace

Blocks blocks_around(const ParticleGrid& particles, Real reach) {
  ZONE("skin.blocks");
  const auto block = [](Real v) { return static_cast<int>(std::floor(v / kSide)); };
  KeyTable seen;
  std::vector<BlockCoord> coords;
  for (const ParticleGrid::Column& column : particles.columns()) {
    Box3 box;
    for (Index p = column.begin; p < column.end; ++p) box.extend(particles.x()[p]);
    const int x0 = block(box.min().x() - reach), x1 = block(box.max().x() + reach);
    const int y0 = block(box.min().y() - reach), y1 = block(box.max().y() + reach);
    // Heights rise along the column: every block up to `done` has been seen to.
    int done = block(box.min().z() - reach) - 1;
    for (Index p = column.begin; p < column.end; ++p) {
      const Real z = particles.x()[p].z();
      const int z1 = block(z + reach);
      for (int c = std::max(done + 1, block(z - reach)); c <= z1; ++c)
        for (int a = x0; a <= x1; ++a)
          for (int b = y0; b <= y1; ++b)
            if (seen.number(pack(a, b, c)) == coords.size()) coords.push_back({a, b, c});
      done = std::max(done, z1);
    }
  }
  return Blocks(std::move(coords));
}

void rasterize(const ParticleGrid& particles, const Blocks& blocks, const RasterOptions& options, Field& phi, Field& weight) {
  ZONE("skin.rasterize");
  phi.resize(blocks.size() * kVoxels);
  weight.resize(blocks.size() * kVoxels);
  const Real reach = options.reach;
  parallel_ranges(blocks.size(), 8, [&](std::size_t begin, std::size_t end) {
    Candidates near;
    Narrowed slab, row;
    for (std::size_t b = begin; b < end; ++b) {
      const BlockCoord& coord = blocks.coords()[b];
      const Vec3 low(coord[0] * kSide, coord[1] * kSide, coord[2] * kSide), high = low + Vec3::Constant(kSide - 1);
      near.clear();
      particles.runs(low - Vec3::Constant(reach), high + Vec3::Constant(reach), [&](Index from, Index to) {
        for (Index i = from; i < to; ++i) {
          const Vec3& p = particles.x()[i];
          if ((p - p.cwiseMax(low).cwiseMin(high)).squaredNorm() >= reach * reach) continue;
          near.x.push_back(static_cast<float>(p.x() - low.x()));
          near.y.push_back(static_cast<float>(p.y() - low.y()));
          near.z.push_back(static_cast<float>(p.z() - low.z()));
          near.r.push_back(particles.radius()[i]);
        }
      });
      if (near.size() == 0) {
        std::fill_n(&phi[b * kVoxels], kVoxels, options.outside);
        std::fill_n(&weight[b * kVoxels], kVoxels, 0.0f);
        continue;
      }
      // One more than can be kept: the narrowing writes before it decides.
      slab.resize(near.size() + 1);
      row.resize(near.size() + 1);
      gather_block(near, slab, row, options, &phi[b * kVoxels], &weight[b * kVoxels]);
    }
  });
}

Real zhu_bridson(const ParticleGrid& particles, const RasterOptions& options, const Vec3& p) {
  const Real R = options.reach;
  Real W = 0, wr = 0, nearest = R;
  Vec3 wx = Vec3::Zero();
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const Vec3 d = particles.x()[i] - p;
    const Real w = std::pow(std::max(0.0, 1 - d.squaredNorm() / (R * R)), 3);
    W += w;
    wx += w * d;
    wr += w * static_cast<Real>(particles.radius()[i]);
    nearest = std::min(nearest, d.norm());
  }
  if (W < 1e-9) return options.outside;
  const Real bound = static_cast<Real>(kBoundSlope) * (nearest - static_cast<Real>(kBound * options.spacing));
  return std::min<Real>(options.outside, std::max((wx / W).norm() - static_cast<Real>(options.radius_factor) * wr / W, bound));
}

}  // namespace effuse::skin
