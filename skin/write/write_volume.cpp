#include "skin/write/write_volume.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/zones.h"
#include "skin/surface/vdb_file.h"

namespace effuse::skin {

namespace {

constexpr float kLeast = 1e-4f, kLeastShare = 1e-3f;  // of density: what is thinner is nothing

template <class Grid>
typename Grid::Ptr make_grid(const geometry::GridVolume& v, const char* name) {
  auto grid = Grid::create(typename Grid::ValueType(0));
  grid->setName(name);
  grid->setSaveFloatAsHalf(true);
  auto transform = openvdb::math::Transform::createLinearTransform(v.cell);
  // Cell (0, 0, 0) of a volume is voxel (0, 0, 0), whose place is its middle.
  transform->postTranslate(openvdb::Vec3d(v.corner.x() + v.cell / 2, v.corner.y() + v.cell / 2, v.corner.z() + v.cell / 2));
  grid->setTransform(transform);
  return grid;
}

/// value(cell) of all cells that are on, in the grid's order.
template <class Grid, class Value>
void fill(Grid& grid, const geometry::GridVolume& v, const std::vector<std::uint8_t>& on, Value&& value) {
  auto at = grid.getAccessor();
  for (int k = 0; k < v.n[2]; ++k)
    for (int j = 0; j < v.n[1]; ++j)
      for (int i = 0; i < v.n[0]; ++i) {
        const std::size_t c = v.index(i, j, k);
        if (on[c]) at.setValue(openvdb::Coord(i, j, k), value(c));
      }
}

void require_finite(const std::filesystem::path& file, const char* name, const std::vector<float>& values) {
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!std::isfinite(values[i])) throw InputError(Place{file.string()}, fmt::format("{} {} of the volume is {}, which no file can hold", name, i, values[i]));
}

}  // namespace

void write_volume_vdb(const std::filesystem::path& file, const geometry::GridVolume& v, const Metadata& metadata) {
  ZONE("write.volume");
  CHECK_EQ(v.density.size(), v.size());
  CHECK(v.temperature.empty() || v.temperature.size() == v.size());
  CHECK(v.velocity.empty() || v.velocity.size() == 3 * v.size());
  require_finite(file, "density", v.density);
  require_finite(file, "temperature", v.temperature);
  require_finite(file, "velocity", v.velocity);
  openvdb::initialize();

  float most = 0;
  for (const float d : v.density) most = std::max(most, d);
  const float least = std::max(kLeast, kLeastShare * most);
  std::vector<std::uint8_t> on(v.size());
  for (std::size_t c = 0; c < v.size(); ++c) on[c] = v.density[c] >= least;

  openvdb::GridPtrVec grids;
  auto density = make_grid<openvdb::FloatGrid>(v, "density");
  density->setGridClass(openvdb::GRID_FOG_VOLUME);
  fill(*density, v, on, [&](std::size_t c) { return v.density[c]; });
  grids.push_back(density);
  if (!v.temperature.empty()) {
    auto temperature = make_grid<openvdb::FloatGrid>(v, "temperature");
    temperature->setGridClass(openvdb::GRID_FOG_VOLUME);
    fill(*temperature, v, on, [&](std::size_t c) { return v.temperature[c]; });
    grids.push_back(temperature);
  }
  if (!v.velocity.empty()) {
    auto velocity = make_grid<openvdb::Vec3SGrid>(v, "velocity");
    velocity->setVectorType(openvdb::VEC_CONTRAVARIANT_RELATIVE);
    velocity->setIsInWorldSpace(true);
    fill(*velocity, v, on, [&](std::size_t c) { return openvdb::Vec3s(v.velocity[3 * c], v.velocity[3 * c + 1], v.velocity[3 * c + 2]); });
    grids.push_back(velocity);
  }
  write_vdb_file(file, grids, metadata);
}

}  // namespace effuse::skin
