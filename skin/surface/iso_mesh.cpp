#include "skin/surface/iso_mesh.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/surface/dual_cells.h"
#include "skin/surface/surface_cache.h"

namespace effuse::skin {

namespace {

/// Values nearer to zero than this [voxels] are moved here: a surface through a lattice point would collapse
/// all the cells around it into triangles of no area.
constexpr float kLeast = 1.0f / 64;

/// Least cosine between the field's slope and the crossings where the slope is believed; how far along it a vertex may go [voxels].
constexpr float kAgree = 0.3f, kFarthest = 0.2f;

float off_zero(float v) { return std::abs(v) >= kLeast ? v : v < 0 ? -kLeast : kLeast; }

/// Values from voxel -1 to 9 of a block, z fastest.
struct Padded {
  static constexpr int kWide = 11, kX = kWide * kWide, kY = kWide;
  std::array<float, kWide * kWide * kWide> value;

  static std::size_t at(int i, int j, int k) { return static_cast<std::size_t>((i + 1) * kX + (j + 1) * kY + k + 1); }
  const float& operator()(int i, int j, int k) const { return value[at(i, j, k)]; }

  Padded(const Blocks& blocks, float outside, const Field& phi, std::size_t b) {
    const std::array<Index, 27>& around = blocks.around(b);
    for (int i = -1; i < kWide - 1; ++i)
      for (int j = -1; j < kWide - 1; ++j) {
        const auto part = [&](int dz) -> const float* {
          const Index block = around[static_cast<std::size_t>(((i >> 3) + 1) * 9 + ((j >> 3) + 1) * 3 + dz)];
          if (block == kNone) return nullptr;
          return phi.data() + block * kVoxels + voxel_index(i & 7, j & 7, 0);
        };
        float* row = &value[at(i, j, -1)];
        std::fill_n(row, kWide, outside);
        if (const float* p = part(0)) row[0] = off_zero(p[7]);
        if (const float* p = part(1))
          for (int k = 0; k < kSide; ++k) row[k + 1] = off_zero(p[k]);
        if (const float* p = part(2)) {
          row[9] = off_zero(p[0]);
          row[10] = off_zero(p[1]);
        }
      }
  }

  /// Of the cell at (i, j, k), -1 .. 8.
  unsigned configuration(int i, int j, int k) const {
    const float* c = &value[at(i, j, k)];
    // In a loop over the corners g++ 12 with -fsanitize=undefined gets them wrong.
    const auto inside = [](float v) { return v < 0 ? 1u : 0u; };
    const unsigned bits = inside(c[0]) | inside(c[1]) << 1 | inside(c[kY]) << 2 | inside(c[kY + 1]) << 3 | inside(c[kX]) << 4 | inside(c[kX + 1]) << 5 |
                          inside(c[kX + kY]) << 6 | inside(c[kX + kY + 1]) << 7;
    return bits;
  }
};

/// The faces of a cell that have to be joined: pinched on both sides.
unsigned joined_faces(const Padded& p, int i, int j, int k, unsigned configuration) {
  unsigned joined = 0;
  const unsigned pinched = kDualCells[configuration].pinched;
  for (unsigned face = 0; face < 6; ++face) {
    if (((pinched >> face) & 1u) == 0) continue;
    const int step = face % 2 == 1 ? 1 : -1, axis = static_cast<int>(face / 2);
    const unsigned other = p.configuration(i + (axis == 0 ? step : 0), j + (axis == 1 ? step : 0), k + (axis == 2 ? step : 0));
    if ((kDualCells[other].pinched >> (face ^ 1u)) & 1u) joined |= 1u << face;
  }
  return joined;
}

/// The field near a point of a cell: central differences at the cell's voxels, trilinear between.
struct Local {
  Eigen::Vector3f gradient;
  float value;  ///< trilinear, less what that is too large by where the field is curved: sum t (1 - t) / 2 times the second differences
};
Local local_field(const Padded& p, int i, int j, int k, const Eigen::Vector3f& x) {
  Eigen::Vector3f slope = Eigen::Vector3f::Zero(), bend = Eigen::Vector3f::Zero();
  float value = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const int di = corner >> 2, dj = (corner >> 1) & 1, dk = corner & 1;
    const float weight = (di ? x[0] : 1 - x[0]) * (dj ? x[1] : 1 - x[1]) * (dk ? x[2] : 1 - x[2]);
    const float* c = &p.value[Padded::at(i + di, j + dj, k + dk)];
    const Eigen::Vector3f after(c[Padded::kX], c[Padded::kY], c[1]), before(c[-Padded::kX], c[-Padded::kY], c[-1]);
    slope += weight * (after - before);
    bend += weight * (after + before);
    value += weight * c[0];
  }
  const Eigen::Vector3f curved = bend.array() - 2 * value;
  return {slope / 2, value - (x.array() * (1 - x.array()) * curved.array()).sum() / 2};
}

/// Vertices of a block's cells, quads left out; nullptr: it has none.
std::unique_ptr<MeshedBlock> mesh_cells(const Padded& p) {
  std::unique_ptr<MeshedBlock> meshed;
  for (int i = 0; i < kSide; ++i)
    for (int j = 0; j < kSide; ++j)
      for (int k = 0; k < kSide; ++k) {
        const unsigned configuration = p.configuration(i, j, k);
        if (configuration == 0 || configuration == 255) continue;
        if (!meshed) {
          meshed = std::make_unique<MeshedBlock>();
          meshed->configuration.assign(kVoxels, 0);
          meshed->joined.assign(kVoxels, 0);
          meshed->first.assign(kVoxels, 0);
        }
        MeshedBlock& out = *meshed;
        const std::size_t cell = voxel_index(i, j, k);
        const unsigned joined = joined_faces(p, i, j, k, configuration);
        out.configuration[cell] = static_cast<std::uint8_t>(configuration);
        out.joined[cell] = static_cast<std::uint8_t>(joined);
        out.first[cell] = static_cast<std::uint16_t>(out.position.size());
        const DualCell dual = joined == 0 ? kDualCells[configuration] : dual_cell(configuration, joined);

        constexpr int kStep[3] = {Padded::kX, Padded::kY, 1};
        const float* c = &p.value[Padded::at(i, j, k)];
        Eigen::Vector3f middle[4], outward[4];
        int crossings[4] = {0, 0, 0, 0};
        for (unsigned patch = 0; patch < dual.patches; ++patch) middle[patch] = outward[patch] = Eigen::Vector3f::Zero();
        for (std::size_t e = 0; e < 12; ++e) {
          const std::uint8_t patch = dual.patch[e];
          if (patch == DualCell::kNoPatch) continue;
          const int axis = static_cast<int>(e / 4), low = detail::kCellEdges[e].low;
          Eigen::Vector3f x(static_cast<float>(low >> 2), static_cast<float>((low >> 1) & 1), static_cast<float>(low & 1));
          const float* from = c + (low >> 2) * Padded::kX + ((low >> 1) & 1) * Padded::kY + (low & 1);
          const float a = from[0], b = from[kStep[axis]];
          x[axis] = a / (a - b);
          middle[patch] += x;
          outward[patch][axis] += a < 0 ? 1.0f : -1.0f;
          ++crossings[patch];
        }
        for (unsigned patch = 0; patch < dual.patches; ++patch) {
          Eigen::Vector3f x = middle[patch] / static_cast<float>(crossings[patch]);
          const Eigen::Vector3f& way = outward[patch];
          const Local local = local_field(p, i, j, k, x);
          Eigen::Vector3f normal = local.gradient;
          if (normal.dot(way) > kAgree * normal.norm() * way.norm()) {
            const float length = normal.norm();
            x -= std::clamp(local.value / length, -kFarthest, kFarthest) / length * normal;
          }
          if (!(normal.dot(way) > kAgree * normal.norm() * way.norm())) normal = way;
          out.position.push_back(Eigen::Vector3f(static_cast<float>(i), static_cast<float>(j), static_cast<float>(k)) + x);
          out.normal.push_back(normal.normalized().cast<Real>().normalized());
        }
      }
  return meshed;
}

/// Quads round the crossed edges that begin at the block's voxels.
void mesh_edges(const Blocks& blocks, std::size_t b, std::vector<std::unique_ptr<MeshedBlock>>& meshed) {
  MeshedBlock& out = *meshed[b];
  out.quads.clear();
  const std::array<Index, 27>& around = blocks.around(b);
  struct Corner {
    std::uint8_t block;
    std::uint16_t vertex;
  };
  // The vertex of cell (i, j, k), -1 .. 7, on its edge e.
  const auto corner = [&](int i, int j, int k, unsigned e) {
    const std::size_t slot = static_cast<std::size_t>(((i >> 3) + 1) * 9 + ((j >> 3) + 1) * 3 + (k >> 3) + 1);
    const MeshedBlock& of = *meshed[around[slot]];
    const std::size_t cell = voxel_index(i & 7, j & 7, k & 7);
    const unsigned configuration = of.configuration[cell], joined = of.joined[cell];
    const std::uint8_t patch = joined == 0 ? kDualCells[configuration].patch[e] : dual_cell(configuration, joined).patch[e];
    return Corner{static_cast<std::uint8_t>(slot), static_cast<std::uint16_t>(of.first[cell] + patch)};
  };
  for (int i = 0; i < kSide; ++i)
    for (int j = 0; j < kSide; ++j)
      for (int k = 0; k < kSide; ++k) {
        const unsigned configuration = out.configuration[voxel_index(i, j, k)];
        if (configuration == 0 || configuration == 255) continue;
        const bool inside = configuration & 1u;
        const auto quad = [&](const Corner& a, Corner b1, const Corner& c, Corner d) {
          if (!inside) std::swap(b1, d);
          out.quads.push_back({{a.block, b1.block, c.block, d.block}, {a.vertex, b1.vertex, c.vertex, d.vertex}, false});
        };
        // Counter-clockwise about the axis; the cell's own offsets from the edge say which of its four it is.
        if (inside != ((configuration >> 4) & 1u))
          quad(corner(i, j - 1, k - 1, 3), corner(i, j, k - 1, 1), corner(i, j, k, 0), corner(i, j - 1, k, 2));
        if (inside != ((configuration >> 2) & 1u))
          quad(corner(i - 1, j, k - 1, 7), corner(i - 1, j, k, 6), corner(i, j, k, 4), corner(i, j, k - 1, 5));
        if (inside != ((configuration >> 1) & 1u))
          quad(corner(i - 1, j - 1, k, 11), corner(i, j - 1, k, 9), corner(i, j, k, 8), corner(i - 1, j, k, 10));
      }
}

/// Whether the surface crosses a cell of the block: its voxels and those one beyond them.
bool is_crossed(const Blocks& blocks, std::size_t b, const std::vector<std::int8_t>& side) {
  int lowest = 1, highest = -1;
  for (const std::size_t slot : {13u, 14u, 16u, 17u, 22u, 23u, 25u, 26u}) {
    const Index other = blocks.around(b)[slot];
    const int s = other == kNone ? 1 : side[other];
    lowest = std::min(lowest, s);
    highest = std::max(highest, s);
  }
  return lowest != highest || lowest == 0;
}

/// Blocks with those added that the surface reaches into from a block's rim, full of `outside`; nothing to add: no value.
bool widen(const Blocks& blocks, float outside, const Field& phi, const std::vector<std::int8_t>& side, Blocks& wider, Field& values) {
  std::vector<BlockCoord> coords;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    if (side[b] > 0 || std::none_of(blocks.around(b).begin(), blocks.around(b).end(), [](Index other) { return other == kNone; })) continue;
    for (std::size_t slot = 0; slot < 27; ++slot) {
      if (blocks.around(b)[slot] != kNone) continue;
      const int d[3] = {static_cast<int>(slot / 9) - 1, static_cast<int>(slot / 3 % 3) - 1, static_cast<int>(slot % 3) - 1};
      // Of the face, edge or corner on that side alone.
      const auto first = [&](int a) { return d[a] > 0 ? kSide - 1 : 0; };
      const auto end = [&](int a) { return d[a] < 0 ? 1 : kSide; };
      bool touches = false;
      for (int i = first(0); i < end(0) && !touches; ++i)
        for (int j = first(1); j < end(1) && !touches; ++j)
          for (int k = first(2); k < end(2) && !touches; ++k) touches = phi[b * kVoxels + voxel_index(i, j, k)] < 0;
      const BlockCoord& c = blocks.coords()[b];
      if (touches) coords.push_back({c[0] + d[0], c[1] + d[1], c[2] + d[2]});
    }
  }
  if (coords.empty()) return false;
  std::sort(coords.begin(), coords.end());
  coords.erase(std::unique(coords.begin(), coords.end()), coords.end());
  coords.insert(coords.end(), blocks.coords().begin(), blocks.coords().end());
  wider = Blocks(coords);
  values.assign(wider.size() * kVoxels, outside);
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const BlockCoord& c = blocks.coords()[b];
    const Index to = wider.block_at(Vec3(kSide * c[0], kSide * c[1], kSide * c[2]));
    std::memcpy(&values[to * kVoxels], &phi[b * kVoxels], kVoxels * sizeof(float));
  }
  return true;
}

/// Where each block whose mesh is still good lies in `last`; kNone: to be made. edges: whose quads are to be made.
std::vector<Index> still_good(const Blocks& blocks, float outside, const MeshCache& last, std::span<const Index> unchanged, std::span<const ChangedVoxels> changed,
                              std::vector<std::uint8_t>& edges) {
  if (unchanged.empty() || last.meshed.empty() || last.outside != outside) return std::vector<Index>(blocks.size(), kNone);
  CHECK(unchanged.size() == blocks.size() && (changed.empty() || changed.size() == blocks.size()));
  for (std::size_t b = 0; b < changed.size(); ++b) CHECK(changed[b].any() == (unchanged[b] == kNone));
  std::vector<ChangedVoxels> whole;
  if (changed.empty()) {
    whole.assign(blocks.size(), ChangedVoxels::none());
    for (std::size_t b = 0; b < blocks.size(); ++b)
      if (unchanged[b] == kNone) whole[b] = {};
    changed = whole;
  }
  // A value that Padded holds has changed, or a block beside it is gone.
  std::vector<std::uint8_t> anew = near_changed(blocks, changed, 1, 2);
  mark_beside_gone(last.blocks, same_places(last.blocks, blocks), anew);
  std::vector<Index> good(unchanged.begin(), unchanged.end());
  for (std::size_t b = 0; b < blocks.size(); ++b)
    if (anew[b]) good[b] = kNone;
  // Quads have corners in the block and in those before it.
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    edges[b] = 0;
    for (const std::size_t slot : {0u, 1u, 3u, 4u, 9u, 10u, 12u, 13u})
      if (const Index other = blocks.around(b)[slot]; other != kNone && anew[other]) edges[b] = 1;
  }
  return good;
}

}  // namespace

geometry::TriMesh iso_mesh(const Blocks& blocks, float outside, const Field& phi, MeshCache* last, std::span<const Index> unchanged, std::span<const ChangedVoxels> changed) {
  ZONE("skin.iso_mesh");
  CHECK_GE(outside, 0.0f);
  CHECK_EQ(phi.size(), blocks.size() * kVoxels);
  std::vector<std::int8_t> side(blocks.size());  // as MeshCache::side
  parallel_for(
      blocks.size(),
      [&](std::size_t b) {
        if (!unchanged.empty() && unchanged[b] != kNone && !last->side.empty()) {
          side[b] = last->side[unchanged[b]];
          return;
        }
        const float* v = &phi[b * kVoxels];
        int inside = 0;
        for (std::size_t k = 0; k < kVoxels; ++k) inside += off_zero(v[k]) < 0;
        side[b] = inside == 0 ? 1 : inside == static_cast<int>(kVoxels) ? -1 : 0;
      },
      64);
  Blocks wider;
  Field values;
  if (widen(blocks, outside, phi, side, wider, values)) {
    if (last) *last = {};
    return iso_mesh(wider, outside, values);
  }

  std::vector<std::unique_ptr<MeshedBlock>> meshed(blocks.size());
  std::vector<MeshCache::Count> count(blocks.size());
  std::vector<std::uint8_t> edges(blocks.size(), 1);
  const std::vector<Index> good = last ? still_good(blocks, outside, *last, unchanged, changed, edges) : std::vector<Index>(blocks.size(), kNone);
  parallel_for(
      blocks.size(),
      [&](std::size_t b) {
        if (good[b] != kNone) {
          meshed[b] = std::move(last->meshed[good[b]]);
          count[b] = last->count[good[b]];
        } else if (is_crossed(blocks, b, side)) {
          meshed[b] = mesh_cells(Padded(blocks, outside, phi, b));
          if (meshed[b]) count[b].vertices = static_cast<Index>(meshed[b]->position.size());
        }
      },
      16);
  parallel_for(
      blocks.size(),
      [&](std::size_t b) {
        if (!edges[b] || !meshed[b]) return;
        mesh_edges(blocks, b, meshed);
        count[b].quads = static_cast<Index>(meshed[b]->quads.size());
      },
      16);

  ZONE("skin.assemble");
  std::vector<Index> vertices(blocks.size() + 1, 0), quads(blocks.size() + 1, 0);
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    vertices[b + 1] = vertices[b] + count[b].vertices;
    quads[b + 1] = quads[b] + count[b].quads;
  }
  geometry::TriMesh mesh;
  mesh.positions.resize(vertices.back());
  mesh.normals.resize(vertices.back());
  mesh.triangles.resize(2 * static_cast<std::size_t>(quads.back()));
  const auto triangles_of = [&](std::size_t b) {
    std::array<Index, 27> first;  // vertices of the blocks around
    for (std::size_t slot = 0; slot < 27; ++slot) {
      const Index other = blocks.around(b)[slot];
      first[slot] = other == kNone ? kNone : vertices[other];
    }
    geometry::Triangle* out = mesh.triangles.data() + 2 * static_cast<std::size_t>(quads[b]);
    for (MeshedBlock::Quad& quad : meshed[b]->quads) {
      Index q[4];
      for (std::size_t k = 0; k < 4; ++k) q[k] = first[quad.block[k]] + quad.vertex[k];
      const auto& p = mesh.positions;
      if (edges[b]) quad.along = (p[q[0]] - p[q[2]]).squaredNorm() <= (p[q[1]] - p[q[3]]).squaredNorm();
      *out++ = {q[0], q[1], q[quad.along ? 2 : 3]};
      *out++ = {q[quad.along ? 0 : 1], q[2], q[3]};
    }
  };
  parallel_for(
      blocks.size(),
      [&](std::size_t b) {
        if (!meshed[b]) return;
        const BlockCoord& c = blocks.coords()[b];
        const Vec3 low(kSide * c[0], kSide * c[1], kSide * c[2]);
        for (std::size_t v = 0; v < meshed[b]->position.size(); ++v) mesh.positions[vertices[b] + v] = low + meshed[b]->position[v].cast<Real>();
        std::copy(meshed[b]->normal.begin(), meshed[b]->normal.end(), mesh.normals.begin() + vertices[b]);
        if (!edges[b]) triangles_of(b);  // split as they were
      },
      64);
  parallel_for(
      blocks.size(), [&](std::size_t b) { if (edges[b] && meshed[b]) triangles_of(b); }, 64);
  if (last) *last = {blocks, outside, std::move(meshed), std::move(count), std::move(side)};
  return mesh;
}

}  // namespace effuse::skin
