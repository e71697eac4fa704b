#include <fmt/format.h>
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/surface/level_set_impl.h"
#include "skin/surface/vdb_file.h"
#include "skin/surface/vdb_layout.h"

namespace effuse::skin {

namespace fs = std::filesystem;

namespace {

constexpr float kBand = 3;  // [voxels] half width of the level set
constexpr int kNodes = 5;   // of a block at every second voxel: 0, 2, 4, 6, 8

/// Blocks as a grid of OpenVDB in the world. value(block, voxel) and on(block, voxel); blocks of nothing on are left out,
/// or a tile `deep` if every value is that.
template <class Grid, class Value, class On>
typename Grid::Ptr make_grid(const LevelSet::Impl& s, const char* name, openvdb::GridClass kind, const typename Grid::ValueType& background,
                             Value&& value, On&& on) {
  using Leaf = typename Grid::TreeType::LeafNodeType;
  auto grid = Grid::create(background);
  grid->setName(name);
  grid->setGridClass(kind);
  grid->setSaveFloatAsHalf(true);
  auto transform = openvdb::math::Transform::createLinearTransform(s.voxel);
  const Vec3& o = s.particles.origin();
  transform->postTranslate(openvdb::Vec3d(o.x(), o.y(), o.z()));
  grid->setTransform(transform);

  std::vector<Leaf*> leaves(s.blocks.size());
  parallel_for(
      s.blocks.size(),
      [&](std::size_t b) {
        const BlockCoord& c = s.blocks.coords()[b];
        auto* leaf = new Leaf(openvdb::Coord(kSide * c[0], kSide * c[1], kSide * c[2]), background, false);
        for (std::size_t v = 0; v < kVoxels; ++v) {
          const auto at = static_cast<openvdb::Index>(v);
          leaf->setValueOnly(at, value(b * kVoxels + v));
          leaf->setActiveState(at, on(b * kVoxels + v));
        }
        leaves[b] = leaf;
      },
      16);
  for (Leaf* leaf : leaves) grid->tree().addLeaf(leaf);
  grid->pruneGrid();
  return grid;
}

openvdb::GridPtrVec grids_of(const LevelSet::Impl& s) {
  ZONE("skin.vdb_grids");
  const Field distance = distances(s.blocks, s.outside, s.phi, kBand);
  const float h = static_cast<float>(s.voxel);
  openvdb::GridPtrVec grids;
  grids.push_back(make_grid<openvdb::FloatGrid>(
      s, "surface", openvdb::GRID_LEVEL_SET, kBand * h, [&](std::size_t i) { return distance[i] * h; },
      [&](std::size_t i) { return std::abs(distance[i]) < kBand; }));
  grids.push_back(make_grid<openvdb::FloatGrid>(
      s, "density", openvdb::GRID_FOG_VOLUME, 0.0f, [&](std::size_t i) { return std::clamp(0.5f - distance[i], 0.0f, 1.0f); },
      [&](std::size_t i) { return distance[i] < 0.5f; }));

  // Temperature and velocity inside and near the surface, from every second voxel: their averages reach over eight.
  const ParticleGrid::Carried& carried = s.particles.carried();
  if (s.blocks.size() > 0 && carried.temperature < 0 && carried.velocity < 0) return grids;
  const auto wanted = [&](std::size_t i) { return distance[i] < 2; };
  std::vector<Index> first_node(s.blocks.size(), kNone);
  std::vector<Vec3> nodes;
  for (std::size_t b = 0; b < s.blocks.size(); ++b) {
    const float* d = &distance[b * kVoxels];
    if (*std::min_element(d, d + kVoxels) >= 2) continue;
    first_node[b] = static_cast<Index>(nodes.size());
    const BlockCoord& c = s.blocks.coords()[b];
    for (int i = 0; i < kNodes; ++i)
      for (int j = 0; j < kNodes; ++j)
        for (int k = 0; k < kNodes; ++k) nodes.emplace_back(kSide * c[0] + 2 * i, kSide * c[1] + 2 * j, kSide * c[2] + 2 * k);
  }
  const std::vector<float> values = nodes.empty() ? std::vector<float>{} : carried_at(s, std::move(nodes));
  const std::size_t width = static_cast<std::size_t>(carried.width);
  // Trilinear: a voxel lies on a node or halfway between two in each direction.
  const auto at = [&](std::size_t index, int offset) {
    const std::size_t v = index % kVoxels, i = v >> 6, j = (v >> 3) & 7, k = v & 7;
    float sum = 0, used = 0;
    for (std::size_t x = i / 2; x <= (i + 1) / 2; ++x)
      for (std::size_t y = j / 2; y <= (j + 1) / 2; ++y)
        for (std::size_t z = k / 2; z <= (k + 1) / 2; ++z, ++used)
          sum += values[(first_node[index / kVoxels] + (x * kNodes + y) * kNodes + z) * width + static_cast<std::size_t>(offset)];
    return sum / used;
  };
  if (carried.temperature >= 0 || s.blocks.size() == 0)
    grids.push_back(make_grid<openvdb::FloatGrid>(
        s, "temperature", openvdb::GRID_FOG_VOLUME, 0.0f, [&](std::size_t i) { return wanted(i) ? at(i, carried.temperature) : 0.0f; },
        wanted));
  if (carried.velocity >= 0 || s.blocks.size() == 0) {
    auto velocity = make_grid<openvdb::Vec3SGrid>(
        s, "velocity", openvdb::GRID_UNKNOWN, openvdb::Vec3s(0),
        [&](std::size_t i) {
          if (!wanted(i)) return openvdb::Vec3s(0);
          return openvdb::Vec3s(at(i, carried.velocity), at(i, carried.velocity + 1), at(i, carried.velocity + 2));
        },
        wanted);
    velocity->setVectorType(openvdb::VEC_CONTRAVARIANT_RELATIVE);
    velocity->setIsInWorldSpace(true);
    grids.push_back(velocity);
  }
  return grids;
}

}  // namespace

void write_vdb(const fs::path& file, const LevelSet& surface, const std::vector<std::pair<std::string, std::string>>& metadata) {
  ZONE("skin.write_vdb");
  openvdb::initialize();
  openvdb::GridPtrVec grids;
  try {
    grids = grids_of(surface.impl());
  } catch (const openvdb::ArithmeticError& e) {
    throw InputError(Place{file.string()}, fmt::format("voxels of {:.3g} cannot be written as OpenVDB ({}): positions and radii in a smaller unit would do", surface.voxel(), brief_words(e.what())));
  }
  write_vdb_file(file, grids, metadata);
}

std::vector<std::string> describe_vdb(const fs::path& file) {
  check_vdb_layout(file);
  openvdb::initialize();
  std::vector<std::string> lines;
  try {
    openvdb::io::File in(file.string());
    in.open(false);
    // Headers only: what the writer noted of its grids, not the voxels themselves.
    const openvdb::GridPtrVecPtr grids = in.readAllGridMetadata();
    for (const openvdb::GridBase::Ptr& grid : *grids) {
      std::string line = fmt::format("{}: {}, {}, voxel {:.6g} m", brief_words(grid->getName().c_str()),
                                     openvdb::GridBase::gridClassToMenuName(grid->getGridClass()), brief_words(grid->valueType().c_str()),
                                     grid->voxelSize().x());
      if (const auto count = grid->getMetadata<openvdb::Int64Metadata>(openvdb::GridBase::META_FILE_VOXEL_COUNT))
        line += fmt::format(", {} active voxels", count->value());
      const auto min = grid->getMetadata<openvdb::Vec3IMetadata>(openvdb::GridBase::META_FILE_BBOX_MIN);
      const auto max = grid->getMetadata<openvdb::Vec3IMetadata>(openvdb::GridBase::META_FILE_BBOX_MAX);
      if (min && max && min->value().x() <= max->value().x()) {
        const openvdb::Vec3d low = grid->indexToWorld(openvdb::Coord(min->value())),
                             high = grid->indexToWorld(openvdb::Coord(max->value()));
        line += fmt::format(", bounds ({:.6g}, {:.6g}, {:.6g}) to ({:.6g}, {:.6g}, {:.6g})", low.x(), low.y(), low.z(), high.x(), high.y(),
                            high.z());
      }
      lines.push_back(std::move(line));
    }
  } catch (const std::exception& e) {
    throw InputError(Place{file.string()}, fmt::format("damaged OpenVDB file: {}", brief_words(e.what())));
  }
  return lines;
}

}  // namespace effuse::skin
