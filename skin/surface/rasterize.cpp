#include "skin/surface/rasterize.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "geometry/base/check.h"
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

/// The field on these rows of one block. The sums run over the candidates in their order.
EFFUSE_CLONES void gather_block(const Candidates& near, RowSet rows, Narrowed& slab, Narrowed& row, const RasterOptions& o, float* phi, float* weight) {
  const float R2 = o.reach * o.reach, inverse_R2 = 1 / R2;
  const Row zero{}, lane = {0, 1, 2, 3, 4, 5, 6, 7};
  const std::size_t n = near.size();

  for (int i = 0; i < kSide; ++i) {
    if ((rows >> (8 * i) & 255u) == 0) continue;
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
      if ((rows >> (8 * i + j) & 1u) == 0) continue;
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

// Finer voxels: sums on every second one, cubic between.

/// A point this near to a particle [spacings] is in lava or beside it: holes of dense packings are 0.87 wide.
constexpr float kCovered = 1;

/// Rows of nodes (i, j, .) of a block: bit 4 i + j.
using NodeRows = std::uint16_t;
NodeRows node_rows(RowSet rows) {
  unsigned set = 0;
  for (unsigned r = 0; r < 16; ++r) set |= static_cast<unsigned>(rows >> (16 * (r / 4) + 2 * (r % 4)) & 1u) << r;
  return static_cast<NodeRows>(set);
}
/// Of the block at slot (0..26, as Blocks::around), those that the one in the middle interpolates between: all of its own, the last before it,
/// the first two beyond.
NodeRows rows_used(std::size_t slot) {
  const auto used = [](std::size_t step, unsigned node) { return step == 0 ? node == 3 : step == 1 || node < 2; };
  unsigned set = 0;
  for (unsigned r = 0; r < 16; ++r) set |= used(slot / 9, r / 4) && used(slot / 3 % 3, r % 4) ? 1u << r : 0u;
  return static_cast<NodeRows>(set);
}

/// Two rows of four nodes at a time.
EFFUSE_CLONES void gather_nodes(const Candidates& near, NodeRows rows, Narrowed& slab, const RasterOptions& o, NodeSums& out) {
  const float R2 = o.reach * o.reach, inverse_R2 = 1 / R2;
  const Row zero{}, lane_y = {0, 0, 0, 0, 2, 2, 2, 2}, lane_z = {0, 2, 4, 6, 0, 2, 4, 6};
  const std::size_t n = near.size();
  for (int i = 0; i < kNodesAlong; ++i) {
    if ((rows >> (4 * i) & 15u) == 0) continue;
    std::size_t in_slab = 0;
    for (std::size_t c = 0; c < n; ++c) {
      const float dx = near.x[c] - static_cast<float>(2 * i), d2 = dx * dx;
      slab.d2[in_slab] = d2;
      slab.dx[in_slab] = near.x[c];
      slab.dy[in_slab] = near.y[c];
      slab.z[in_slab] = near.z[c];
      slab.r[in_slab] = near.r[c];
      in_slab += d2 < R2;
    }
    for (int j = 0; j < kNodesAlong; j += 2) {
      if ((rows >> (4 * i + j) & 3u) == 0) continue;
      Row W = zero, wx = zero, wy = zero, wz = zero, wr = zero, nearest = zero + R2;
      const float low = static_cast<float>(2 * j), high = low + 2;
      const Row at_y = lane_y + low;
      for (std::size_t c = 0; c < in_slab; ++c) {
        const float y = slab.dy[c], beside = y < low ? low - y : y > high ? y - high : 0;
        if (slab.d2[c] + beside * beside >= R2) continue;
        const Row dy = y - at_y, dz = slab.z[c] - lane_z, d2 = dy * dy + dz * dz + slab.d2[c];
        Row t = 1 - d2 * inverse_R2;
        t = t > zero ? t : zero;
        const Row w = t * t * t;
        W += w;
        wx += w * slab.dx[c];
        wy += w * y;
        wz += w * slab.z[c];
        wr += w * slab.r[c];
        nearest = d2 < nearest ? d2 : nearest;
      }
      for (int k = 0; k < 8; ++k) {
        const std::size_t node = static_cast<std::size_t>((i * kNodesAlong + j) * kNodesAlong + k);
        out.W[node] = W[k];
        out.x[node] = wx[k];
        out.y[node] = wy[k];
        out.z[node] = wz[k];
        out.r[node] = wr[k];
        out.nearest[node] = nearest[k];
      }
    }
  }
}

/// Nodes -1 .. 5 of a block along each axis, z fastest and padded to 8.
struct NodesAround {
  static constexpr int kWide = 7;
  std::array<std::array<Row, kWide * kWide>, 5> sums;   // W, x, y, z, r
  std::array<std::array<float, 8>, kWide * kWide> nearest;  // [voxels], not squared
};

void collect(const Blocks& blocks, const std::vector<NodeSums, Unwritten<NodeSums>>& nodes, float reach, std::size_t b, NodesAround& out) {
  for (int i = -1; i < NodesAround::kWide - 1; ++i)
    for (int j = -1; j < NodesAround::kWide - 1; ++j) {
      const std::size_t row = static_cast<std::size_t>((i + 1) * NodesAround::kWide + j + 1);
      for (int k = -1; k < NodesAround::kWide; ++k) {
        const std::size_t lane = static_cast<std::size_t>(k + 1);
        const int da = i < 0 ? -1 : i / kNodesAlong, db = j < 0 ? -1 : j / kNodesAlong, dc = k < 0 ? -1 : k / kNodesAlong;
        const Index block = k == NodesAround::kWide - 1 ? kNone : blocks.around(b)[static_cast<std::size_t>((da + 1) * 9 + (db + 1) * 3 + dc + 1)];
        if (block == kNone) {
          for (auto& sum : out.sums) sum[row][lane] = 0;
          out.nearest[row][lane] = reach;
          continue;
        }
        const std::size_t node = static_cast<std::size_t>(((i & 3) * kNodesAlong + (j & 3)) * kNodesAlong + (k & 3));
        const NodeSums& from = nodes[block];
        const float W = from.W[node], side = kSide;
        out.sums[0][row][lane] = W;
        out.sums[1][row][lane] = from.x[node] + W * side * static_cast<float>(da);
        out.sums[2][row][lane] = from.y[node] + W * side * static_cast<float>(db);
        out.sums[3][row][lane] = from.z[node] + W * side * static_cast<float>(dc);
        out.sums[4][row][lane] = from.r[node];
        out.nearest[row][lane] = std::sqrt(from.nearest[node]);
      }
    }
}

/// Cubic through four nodes, in the middle.
template <class T>
void middle(const T& a, const T& b, const T& c, const T& d, T& to) {
  to = (9 * (b + c) - (a + d)) * (1.0f / 16);
}

/// The five sums at the block's voxels.
EFFUSE_CLONES void interpolate(const NodesAround& nodes, std::array<std::array<Row, kSide * kSide>, 5>& out) {
  constexpr std::size_t kWide = NodesAround::kWide;
  std::array<Row, kSide * kWide> along_x;
  std::array<float, 8> z;
  for (std::size_t f = 0; f < 5; ++f) {
    const auto& in = nodes.sums[f];
    for (std::size_t q = 0; q < kNodesAlong; ++q)
      for (std::size_t j = 0; j < kWide; ++j) {
        along_x[2 * q * kWide + j] = in[(q + 1) * kWide + j];
        middle(in[q * kWide + j], in[(q + 1) * kWide + j], in[(q + 2) * kWide + j], in[(q + 3) * kWide + j], along_x[(2 * q + 1) * kWide + j]);
      }
    for (std::size_t i = 0; i < kSide; ++i)
      for (std::size_t q = 0; q < kNodesAlong; ++q) {
        const Row* in_y = &along_x[i * kWide + q];
        Row rows[2] = {in_y[1], in_y[1]};
        middle(in_y[0], in_y[1], in_y[2], in_y[3], rows[1]);
        for (std::size_t h = 0; h < 2; ++h) {
          Row& to = out[f][i * kSide + 2 * q + h];
          std::memcpy(z.data(), &rows[h], sizeof(Row));
          for (std::size_t k = 0; k < kNodesAlong; ++k) {
            to[2 * k] = z[k + 1];
            float between = 0;
            middle(z[k], z[k + 1], z[k + 2], z[k + 3], between);
            to[2 * k + 1] = between;
          }
        }
      }
  }
}

/// Squared distance of the nearest particle at the eight voxels of row (i, j).
EFFUSE_CLONES void nearest_in_row(const Candidates& near, float i, float j, float R2, float* out) {
  const Row lane = {0, 1, 2, 3, 4, 5, 6, 7};
  Row nearest = Row{} + R2;
  for (std::size_t c = 0; c < near.size(); ++c) {
    const float dx = near.x[c] - i, dy = near.y[c] - j;
    const Row dz = near.z[c] - lane, d2 = dz * dz + (dx * dx + dy * dy);
    nearest = d2 < nearest ? d2 : nearest;
  }
  std::memcpy(out, &nearest, sizeof nearest);
}

/// The field on the block's voxels from the sums at its nodes; near(): the block's particles, asked for where the bound between
/// separate particles may count.
template <class Near>
void field_from_nodes(const NodesAround& nodes, const RasterOptions& o, Near&& near, float* phi, float* weight) {
  std::array<std::array<Row, kSide * kSide>, 5> sums;
  interpolate(nodes, sums);
  const float counts = o.spacing / 2 + 2;  // farther out the bound only makes the field steeper
  for (int i = 0; i < kSide; ++i)
    for (int j = 0; j < kSide; ++j) {
      const std::size_t row = static_cast<std::size_t>(i * kSide + j);
      float* out = phi + row * kSide;
      bool bound_counts = false;
      for (int k = 0; k < kSide; ++k) {
        const float W = sums[0][row][k];
        weight[row * kSide + static_cast<std::size_t>(k)] = std::max(W, 0.0f);
        out[k] = o.outside;
        if (W < 1e-3f) continue;  // farther than the bound lets lava be
        const float inverse = 1 / W;
        const float x = sums[1][row][k] * inverse - static_cast<float>(i), y = sums[2][row][k] * inverse - static_cast<float>(j),
                    z = sums[3][row][k] * inverse - static_cast<float>(k);
        out[k] = std::min(o.outside, std::sqrt(x * x + y * y + z * z) - o.radius_factor * sums[4][row][k] * inverse);
        // The nearest particle is no farther than that of a node plus the way there.
        constexpr float kWay[4] = {0, 1, 1.4142136f, 1.7320508f};
        const std::size_t node = static_cast<std::size_t>((i / 2 + 1) * NodesAround::kWide + j / 2 + 1);
        const float farthest = nodes.nearest[node][static_cast<std::size_t>(k / 2 + 1)] + kWay[(i & 1) + (j & 1) + (k & 1)];
        bound_counts = bound_counts || (out[k] < counts && kBoundSlope * (farthest - kBound * o.spacing) > out[k]);
      }
      if (!bound_counts) continue;
      float nearest[kSide];
      nearest_in_row(near(), static_cast<float>(i), static_cast<float>(j), o.reach * o.reach, nearest);
      for (int k = 0; k < kSide; ++k)
        if (out[k] < counts) out[k] = std::max(out[k], kBoundSlope * (std::sqrt(nearest[k]) - kBound * o.spacing));
    }
  for (std::size_t v = 0; v < kVoxels; ++v) phi[v] = std::min(phi[v], o.outside);
}

/// Particles within reach of a voxel of the block.
void candidates(const ParticleGrid& particles, const BlockCoord& coord, Real reach, Candidates& near) {
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
}

void rasterize_fine(const ParticleGrid& particles, const Blocks& blocks, const RasterOptions& o, std::span<const RowSet> rows, RasterField& raster) {
  const std::size_t n = blocks.size();
  raster.nodes.resize(n);
  raster.covered.resize(n);
  std::vector<NodeRows> anew(n, 0xffff);
  std::vector<std::uint8_t> uncertain(n, 0);  // whether it is covered has changed
  const float covered2 = kCovered * o.spacing * kCovered * o.spacing;
  parallel_ranges(n, 8, [&](std::size_t begin, std::size_t end) {
    Candidates near;
    Narrowed slab;
    for (std::size_t b = begin; b < end; ++b) {
      if (!rows.empty() && (anew[b] = node_rows(rows[b])) == 0) continue;
      candidates(particles, blocks.coords()[b], o.reach, near);
      slab.resize(near.size() + 1);
      NodeSums& sums = raster.nodes[b];
      gather_nodes(near, anew[b], slab, o, sums);
      const std::uint8_t covered = *std::max_element(sums.nearest.begin(), sums.nearest.end()) < covered2;
      uncertain[b] = covered != raster.covered[b];
      raster.covered[b] = covered;
    }
  });
  std::array<NodeRows, 27> used;
  for (std::size_t slot = 0; slot < 27; ++slot) used[slot] = rows_used(slot);
  parallel_ranges(n, 8, [&](std::size_t begin, std::size_t end) {
    Candidates near;
    NodesAround around;
    for (std::size_t b = begin; b < end; ++b) {
      const auto& beside = blocks.around(b);
      if (!rows.empty()) {
        bool changed = rows[b] == ~RowSet{0};
        for (std::size_t slot = 0; slot < 27 && !changed; ++slot) changed = beside[slot] != kNone && ((anew[beside[slot]] & used[slot]) != 0 || uncertain[beside[slot]]);
        if (!changed) continue;
      }
      float *out = &raster.phi[b * kVoxels], *weight = &raster.weight[b * kVoxels];
      const NodeSums& own = raster.nodes[b];
      if (*std::max_element(own.W.begin(), own.W.end()) == 0) {
        std::fill_n(out, kVoxels, o.outside);
        std::fill_n(weight, kVoxels, 0.0f);
      } else if (std::all_of(beside.begin(), beside.end(), [&](Index k) { return k != kNone && raster.covered[k]; })) {
        // Two spacings from the next gap: deep inside.
        std::fill_n(out, kVoxels, -o.radius_factor * own.r[0] / own.W[0]);
        std::fill_n(weight, kVoxels, own.W[0]);
      } else {
        collect(blocks, raster.nodes, o.reach, b, around);
        near.clear();
        const auto found = [&]() -> const Candidates& {
          if (near.size() == 0) candidates(particles, blocks.coords()[b], o.reach, near);
          return near;
        };
        field_from_nodes(around, o, found, out, weight);
      }
    }
  });
}

}  // namespace

void rasterize(const ParticleGrid& particles, const Blocks& blocks, const RasterOptions& options, std::span<const RowSet> rows, RasterField& raster) {
  ZONE("skin.rasterize");
  CHECK(rows.empty() || rows.size() == blocks.size());
  raster.phi.resize(blocks.size() * kVoxels);
  raster.weight.resize(blocks.size() * kVoxels);
  if (options.reach >= kFineReach) return rasterize_fine(particles, blocks, options, rows, raster);
  parallel_ranges(blocks.size(), 8, [&](std::size_t begin, std::size_t end) {
    Candidates near;
    Narrowed slab, row;
    for (std::size_t b = begin; b < end; ++b) {
      const RowSet anew = rows.empty() ? ~RowSet{0} : rows[b];
      if (anew == 0) continue;
      candidates(particles, blocks.coords()[b], options.reach, near);
      if (near.size() == 0) {
        std::fill_n(&raster.phi[b * kVoxels], kVoxels, options.outside);
        std::fill_n(&raster.weight[b * kVoxels], kVoxels, 0.0f);
        continue;
      }
      // One more than can be kept: the narrowing writes before it decides.
      slab.resize(near.size() + 1);
      row.resize(near.size() + 1);
      gather_block(near, anew, slab, row, options, &raster.phi[b * kVoxels], &raster.weight[b * kVoxels]);
    }
  });
}

void rasterize(const ParticleGrid& particles, const Blocks& blocks, const RasterOptions& options, Field& phi, Field& weight) {
  RasterField raster;
  raster.phi.swap(phi);
  raster.weight.swap(weight);
  rasterize(particles, blocks, options, {}, raster);
  phi.swap(raster.phi);
  weight.swap(raster.weight);
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
