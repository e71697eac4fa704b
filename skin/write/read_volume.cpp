#include "skin/write/read_volume.h"

#include <fmt/format.h>

#include <cmath>

#include "geometry/base/error.h"
#include "geometry/base/zones.h"
#include "skin/surface/vdb_file_internal.h"
#include "skin/surface/vdb_layout.h"

namespace effuse::skin {

namespace {

/// Values of the cells of v, background where the grid has none.
std::vector<float> dense(const openvdb::FloatGrid& grid, const geometry::GridVolume& v, const openvdb::Coord& low) {
  std::vector<float> values(v.size());
  auto at = grid.getConstAccessor();
  for (int k = 0; k < v.n[2]; ++k)
    for (int j = 0; j < v.n[1]; ++j)
      for (int i = 0; i < v.n[0]; ++i) values[v.index(i, j, k)] = at.getValue(low.offsetBy(i, j, k));
  return values;
}

}  // namespace

geometry::GridVolume read_volume_vdb(const std::filesystem::path& file, Metadata* metadata) {
  ZONE("read.volume");
  constexpr double kMostCells = 268435456;
  const Place place{file.string()};
  check_vdb_layout(file);
  openvdb::initialize();
  geometry::GridVolume v;
  try {
    openvdb::io::File in(file.string());
    in.open(false);
    if (metadata)
      if (const openvdb::MetaMap::Ptr all = in.getMetadata())
        for (auto one = all->beginMeta(); one != all->endMeta(); ++one) metadata->emplace_back(one->first, one->second->str());
    const auto find = [&](const char* name) -> openvdb::FloatGrid::Ptr {
      return in.hasGrid(name) ? openvdb::gridPtrCast<openvdb::FloatGrid>(in.readGrid(name)) : nullptr;
    };
    const openvdb::FloatGrid::Ptr density = find("density"), temperature = find("temperature");
    if (!density || !density->hasUniformVoxels()) throw InputError(place, "has no grid \"density\" of numbers on cubic voxels");
    const openvdb::CoordBBox box = density->evalActiveVoxelBoundingBox();
    if (box.empty()) return v;
    double cells = 1;
    for (int c = 0; c < 3; ++c) {
      v.n[static_cast<std::size_t>(c)] = box.dim()[c];
      cells *= box.dim()[c];
    }
    if (cells > kMostCells) throw InputError(place, fmt::format("has a box of {:.3g} voxels, at most {:.3g} are read", cells, kMostCells));
    v.cell = density->voxelSize().x();
    const openvdb::Vec3d middle = density->indexToWorld(box.min());
    v.corner = Vec3(middle.x(), middle.y(), middle.z()) - Vec3::Constant(v.cell / 2);
    v.density = dense(*density, v, box.min());
    if (temperature) v.temperature = dense(*temperature, v, box.min());
  } catch (const openvdb::Exception& error) {
    throw InputError(place, "cannot be read as VDB: " + brief_words(error.what()));
  }
  v.name = file.stem().stem().string();
  return v;
}

}  // namespace effuse::skin
