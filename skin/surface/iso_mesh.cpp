#include "skin/surface/iso_mesh.h"

#include <openvdb/openvdb.h>
#include <openvdb/tools/VolumeToMesh.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::skin {

namespace {

/// Values nearer to zero than this [voxels] are moved here: a surface through a lattice point would collapse
/// all the cells around it into triangles of no area.
constexpr float kLeast = 1.0f / 64;

openvdb::FloatGrid::Ptr to_grid(const Blocks& blocks, float outside, const Field& phi) {
  auto grid = openvdb::FloatGrid::create(outside);
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  using Leaf = openvdb::FloatTree::LeafNodeType;
  static_assert(Leaf::SIZE == kVoxels && Leaf::DIM == kSide);
  std::vector<Leaf*> leaves(blocks.size(), nullptr);
  std::vector<std::uint8_t> deep(blocks.size(), 0);
  parallel_for(
      blocks.size(),
      [&](std::size_t b) {
        const float* values = &phi[b * kVoxels];
        // The blocks beside one that the surface crosses must be there too, down to the last voxel.
        const auto sided = [&](Index other) {
          if (other == kNone) return 1;
          const float* v = &phi[other * kVoxels];
          const auto [low, high] = std::minmax_element(v, v + kVoxels);
          return *high < 0 ? -1 : *low >= 0 ? 1 : 0;
        };
        int sum = 0;
        for (const Index other : blocks.around(b)) sum += sided(other);
        if (sum == 27) return;
        deep[b] = sum == -27;
        if (deep[b]) return;
        const BlockCoord& c = blocks.coords()[b];
        auto* leaf = new Leaf(openvdb::Coord(kSide * c[0], kSide * c[1], kSide * c[2]), outside, false);
        for (std::size_t v = 0; v < kVoxels; ++v) {
          const float value = values[v];
          leaf->setValueOn(static_cast<openvdb::Index>(v), std::abs(value) >= kLeast ? value : value < 0 ? -kLeast : kLeast);
        }
        leaves[b] = leaf;
      },
      16);
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const BlockCoord& c = blocks.coords()[b];
    if (leaves[b]) grid->tree().addLeaf(leaves[b]);
    if (deep[b]) grid->tree().addTile(1, openvdb::Coord(kSide * c[0], kSide * c[1], kSide * c[2]), -outside, false);
  }
  return grid;
}

}  // namespace

geometry::TriMesh iso_mesh(const Blocks& blocks, float outside, const Field& phi) {
  ZONE("skin.iso_mesh");
  geometry::TriMesh mesh;
  if (blocks.size() == 0) return mesh;
  const auto grid = to_grid(blocks, outside, phi);
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec3I> triangles;
  std::vector<openvdb::Vec4I> quads;
  openvdb::tools::volumeToMesh(*grid, points, triangles, quads, 0.0, 0.0);

  mesh.positions.resize(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) mesh.positions[i] = Vec3(points[i].x(), points[i].y(), points[i].z());
  mesh.triangles.resize(triangles.size() + 2 * quads.size());
  for (std::size_t i = 0; i < triangles.size(); ++i) mesh.triangles[i] = {triangles[i][0], triangles[i][2], triangles[i][1]};
  parallel_for(quads.size(), [&](std::size_t i) {
    // OpenVDB runs clockwise from outside.
    const Index a = quads[i][0], b = quads[i][3], c = quads[i][2], d = quads[i][1];
    const auto& p = mesh.positions;
    const bool along_ac = (p[a] - p[c]).squaredNorm() <= (p[b] - p[d]).squaredNorm();
    geometry::Triangle* out = &mesh.triangles[triangles.size() + 2 * i];
    out[0] = along_ac ? geometry::Triangle{a, b, c} : geometry::Triangle{a, b, d};
    out[1] = along_ac ? geometry::Triangle{a, c, d} : geometry::Triangle{b, c, d};
  });
  return mesh;
}

}  // namespace effuse::skin
