#include "importers/terrain/import_terrain.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/zones.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "importers/mesh/import_mesh.h"
#include "importers/terrain/import_dem.h"

namespace effuse::importers {

namespace fs = std::filesystem;

namespace {

/// The origin of the local frame: whole metres, so that it is exact in any text.
Vec3 origin_below(const Vec2& south_west) { return Vec3(std::floor(south_west.x()), std::floor(south_west.y()), 0); }

/// Ground faces up: sum of area vectors [m^2], twice.
Vec3 facing(const geometry::TriMesh& mesh) {
  Vec3 sum = Vec3::Zero();
  for (const auto& [a, b, c] : mesh.triangles) sum += (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]);
  return sum;
}

}  // namespace

TerrainImport terrain_from_mesh(MeshImport import, const std::string& name, const TerrainImportOptions& options) {
  geometry::TriMesh& mesh = import.mesh;
  std::optional<geometry::RepairReport> repairs;
  if (options.repair) {
    repairs = geometry::repair(mesh, options.repairs);
    for (std::string& line : geometry::to_lines(*repairs)) import.notes.push_back(std::move(line));
    if (mesh.triangles.empty()) throw InputError({name}, "holds no triangle with an area");
  }
  const bool open = !(repairs ? repairs->after : geometry::validate(mesh)).closed();
  if (const UpAxis up = guess_up(mesh); open && (up == UpAxis::kX || up == UpAxis::kY) && options.mesh.up == UpAxis::kUnknown)
    import.notes.push_back(fmt::format("the surface stands upright: {} may be up in this file ({}), and --up {} would turn it", name_of(up),
                                       import.frame.source.empty() ? "which does not say" : "though " + import.frame.source + " says otherwise", name_of(up)));
  if (open && facing(mesh).z() < 0) {
    for (geometry::Triangle& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
    for (Vec3& normal : mesh.normals) normal = -normal;
    import.notes.push_back("the surface faced down: every triangle was turned over");
  }
  if (import.frame.origin != Vec3::Zero())
    import.notes.push_back(fmt::format("placed on the map at {:.10g}, {:.10g}, {:.10g} by {}", import.frame.origin.x(), import.frame.origin.y(), import.frame.origin.z(), import.frame.source));
  const Vec3 south_west = geometry::bounds(mesh).min();
  const Vec3 local = origin_below(south_west.head<2>());
  for (Vec3& position : mesh.positions) position -= local;
  try {
    return {geometry::Terrain::from_mesh(std::move(mesh), {local + import.frame.origin, options.dem.crs.empty() ? import.frame.crs : options.dem.crs}, options.temperature), std::move(import.notes), std::move(repairs)};
  } catch (const InputError& error) {
    throw InputError({name}, error.faults().front().message);
  }
}

TerrainImport terrain_from_grid(DemGrid grid, const std::string& name, const TerrainImportOptions& options) {
  const Vec3 origin = origin_below(grid.corner);
  const Vec2 corner = grid.corner - origin.head<2>();
  try {
    geometry::HeightField field(corner, grid.spacing, grid.nx, grid.ny, std::move(grid.z));
    return {geometry::Terrain::from_height_field(std::move(field), {origin, grid.crs}, options.temperature), std::move(grid.notes), std::nullopt};
  } catch (const InputError& error) {
    throw InputError({name}, error.faults().front().message);
  }
}

TerrainImport import_terrain(const fs::path& file, const TerrainImportOptions& options) { return import_terrain(std::vector<fs::path>{file}, options); }

TerrainImport import_terrain(const std::vector<fs::path>& files, const TerrainImportOptions& options) {
  ZONE("import.terrain");
  CHECK(!files.empty());
  if (files.size() == 1 && !is_dem(files.front())) return terrain_from_mesh(import_mesh(files.front(), options.mesh), files.front().string(), options);
  for (const fs::path& file : files)
    if (!is_dem(file)) throw InputError({file.string()}, "is no grid of heights: only those make a mosaic");
  return terrain_from_grid(import_dem(files, options.dem), files.front().string(), options);
}

}  // namespace effuse::importers
