#include "importers/terrain/import_terrain.h"

#include <cmath>
#include <utility>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/zones.h"
#include "importers/mesh/import_mesh.h"
#include "importers/terrain/import_dem.h"

namespace effuse::importers {

namespace fs = std::filesystem;

TerrainImport terrain_from_grid(DemGrid grid, const std::string& name, const TerrainImportOptions& options) {
  const Vec3 origin = local_origin(grid.corner);
  const Vec2 corner = grid.corner - origin.head<2>();
  try {
    geometry::HeightField field(corner, grid.spacing, grid.nx, grid.ny, std::move(grid.z));
    return {geometry::Terrain::from_height_field(std::move(field), {origin, grid.crs}, options.temperature), std::move(grid.notes), std::nullopt, std::nullopt};
  } catch (const InputError& error) {
    throw InputError({name}, error.faults().front().message);
  }
}

TerrainImport import_terrain(const fs::path& file, const TerrainImportOptions& options) { return import_terrain(std::vector<fs::path>{file}, options); }

TerrainImport import_terrain(const std::vector<fs::path>& files, const TerrainImportOptions& options) {
  ZONE("import.terrain");
  CHECK(!files.empty());
  if (files.size() == 1 && !is_dem(files.front())) {
    MeshImport mesh = import_mesh(files.front(), options.mesh);
    std::vector<std::string> notes = guesses(mesh, options.mesh);
    mesh.notes.insert(mesh.notes.begin(), notes.begin(), notes.end());
    return terrain_from_mesh(std::move(mesh), files.front().string(), options);
  }
  for (const fs::path& file : files)
    if (!is_dem(file)) throw InputError({file.string()}, "is no grid of heights: only those make a mosaic");
  return terrain_from_grid(import_dem(files, options.dem), files.front().string(), options);
}

}  // namespace effuse::importers
