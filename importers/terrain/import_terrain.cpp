#include "importers/terrain/import_terrain.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "geometry/base/error.h"
#include "geometry/base/zones.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "importers/assimp_reader.h"
#include "importers/input_file.h"
#include "importers/mesh/import_mesh.h"
#include "importers/terrain/dem_importer.h"
#include "importers/terrain/esri_ascii.h"
#include "importers/terrain/projection.h"

namespace effuse::importers {

namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t kGridLimit = std::uint64_t{8} << 30;  // bytes
constexpr int kOverviewPosts = 256;                           // a side, of the mesh in assimp's scene: the exact grid is what counts

/// The origin of the local frame: whole metres, so that it is exact in any text.
Vec3 origin_below(const Vec2& south_west) { return Vec3(std::floor(south_west.x()), std::floor(south_west.y()), 0); }

TerrainImport from_grid(DemGrid grid, const std::string& name, const TerrainImportOptions& options) {
  const Vec3 origin = origin_below(grid.corner);
  const Vec2 corner = grid.corner - origin.head<2>();
  try {
    geometry::HeightField field(corner, grid.spacing, grid.nx, grid.ny, std::move(grid.z));
    return {geometry::Terrain::from_height_field(std::move(field), {origin, grid.crs}, options.temperature), std::move(grid.notes)};
  } catch (const InputError& error) {
    throw InputError({name}, error.faults().front().message);
  }
}

DemGrid read_grid(const fs::path& file, const std::string& bytes) {
  ZONE("import.grid");
  const auto result = std::make_shared<DemResult>();
  AssimpReader reader;
  reader.add(make_asc_importer(result), "asc");
  reader.set_integer("EFFUSE_DEM_STRIDE", std::max(1, static_cast<int>(std::sqrt(static_cast<double>(bytes.size()) / 4) / kOverviewPosts)));
  // The ending tells assimp who reads: a grid under another name is one all the same.
  fs::path name = file;
  if (lower_extension(file) != ".asc") name += ".asc";
  try {
    reader.read(name, bytes, 0);
  } catch (const InputError&) {
    if (!result->fault) throw;
  }
  if (result->fault) std::rethrow_exception(result->fault);
  return std::move(result->grid);
}

/// Ground faces up: sum of area vectors [m^2], twice.
Vec3 facing(const geometry::TriMesh& mesh) {
  Vec3 sum = Vec3::Zero();
  for (const auto& [a, b, c] : mesh.triangles) sum += (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]);
  return sum;
}

TerrainImport from_mesh(MeshImport import, const std::string& name, const TerrainImportOptions& options) {
  geometry::TriMesh& mesh = import.mesh;
  if (options.y_up) {
    for (std::vector<Vec3>* vectors : {&mesh.positions, &mesh.normals})
      for (Vec3& v : *vectors) v = Vec3(v.x(), -v.z(), v.y());
    import.notes.push_back("turned from y up to z up, as asked");
  }
  const bool open = !geometry::validate(mesh).closed();
  const Vec3 face = facing(mesh);
  if (open && std::abs(face.y()) > 2 * std::abs(face.z()))
    import.notes.push_back("the surface stands upright: y may be up in this file (y_up)");
  if (open && face.z() < 0) {
    for (geometry::Triangle& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
    for (Vec3& normal : mesh.normals) normal = -normal;
    import.notes.push_back("the surface faced down: every triangle was turned over");
  }
  const Vec3 origin = origin_below(geometry::bounds(mesh).min().head<2>());
  for (Vec3& position : mesh.positions) position -= origin;
  try {
    return {geometry::Terrain::from_mesh(std::move(mesh), {origin, options.crs}, options.temperature), std::move(import.notes)};
  } catch (const InputError& error) {
    throw InputError({name}, error.faults().front().message);
  }
}

}  // namespace

TerrainImport import_terrain(const fs::path& file, const TerrainImportOptions& options) {
  ZONE("import.terrain");
  const std::string extension = lower_extension(file);
  {
    const std::string bytes = read_input(file, kGridLimit, "a terrain");
    if (extension == ".asc" || looks_like_esri_ascii(bytes)) {
      DemGrid grid = read_grid(file, bytes);
      grid.crs = options.crs.empty() ? read_projection(file, grid.notes) : options.crs;
      return from_grid(std::move(grid), file.string(), options);
    }
  }
  for (const char* raster : {".tif", ".tiff", ".hgt", ".bil", ".dem", ".flt", ".vrt", ".img", ".nc", ".grd"})
    if (extension == raster)
      throw InputError({file.string()}, fmt::format("rasters ending in {} are not read: turn it into an ESRI ASCII grid in metres "
                                                    "(gdal_translate -of AAIGrid IN OUT.asc), or give a mesh",
                                                    extension));

  return from_mesh(import_mesh(file), file.string(), options);
}

}  // namespace effuse::importers
