#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "geometry/terrain/terrain.h"

namespace effuse::importers {

struct TerrainImportOptions {
  Real temperature = 288.15;  ///< of the ground [K]
  std::string crs;            ///< overrides what the file or its .prj says
  bool y_up = false;          ///< meshes: y is up in the file (formats that say so themselves need no telling)
};

/// What was done to the file on the way in, for people: one line each ("3 nodata cells left as holes").
struct TerrainImport {
  geometry::Terrain terrain;
  std::vector<std::string> notes;
};

/// Reads a DEM grid (ESRI ASCII; other rasters later) or a mesh of any format assimp reads as ground.
///
/// Both go through assimp: grids by an importer of ours registered with it (dem_importer.h). The local frame's
/// origin is, in x and y, the south-west corner of the covered area rounded down to whole metres, in z 0;
/// it is subtracted in double and kept in the terrain's Georeference. A .prj beside the grid gives the CRS.
///
/// An open mesh whose surface faces down on the whole is turned over, with a note.
///
/// Throws InputError naming the file, and the line where there is one: missing, empty, truncated, not
/// a number, wrong counts, fewer than 2x2 posts, nothing but nodata.
TerrainImport import_terrain(const std::filesystem::path& file, const TerrainImportOptions& options = {});

}  // namespace effuse::importers
