#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "geometry/terrain/terrain.h"
#include "importers/terrain/dem_grid.h"
#include "importers/terrain/dem_options.h"

namespace effuse::importers {

struct TerrainImportOptions {
  Real temperature = 288.15;  ///< of the ground [K]
  DemOptions dem;             ///< of grids; of a mesh only crs counts: its name
  bool y_up = false;          ///< meshes: y is up in the file (formats that say so themselves need no telling)
};

/// What was done to the file on the way in, for people: one line each ("3 nodata cells left as holes").
struct TerrainImport {
  geometry::Terrain terrain;
  std::vector<std::string> notes;
};

/// Reads a DEM grid of any format and place (import_dem.h) or a mesh of any format assimp reads as ground.
///
/// Both go through assimp: grids by an importer of ours registered with it (dem_importer.h). The local frame's
/// origin is, in x and y, the south-west corner of the covered area rounded down to whole metres, in z 0;
/// it is subtracted in double and kept in the terrain's Georeference, with the CRS.
///
/// An open mesh whose surface faces down on the whole is turned over, with a note.
///
/// Throws InputError naming the file, and the line where there is one: missing, empty, truncated, not
/// a number, wrong counts, fewer than 2x2 posts, nothing but nodata.
TerrainImport import_terrain(const std::filesystem::path& file, const TerrainImportOptions& options = {});
/// Several grids as a mosaic; one file may be a mesh.
TerrainImport import_terrain(const std::vector<std::filesystem::path>& files, const TerrainImportOptions& options = {});

/// The height field of a grid, in its local frame.
TerrainImport terrain_from_grid(DemGrid grid, const std::string& name, const TerrainImportOptions& options = {});

}  // namespace effuse::importers
