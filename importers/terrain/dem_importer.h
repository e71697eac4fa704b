#pragma once

#include <exception>
#include <filesystem>
#include <memory>
#include <vector>

#include "importers/terrain/dem_grid.h"
#include "importers/terrain/dem_options.h"

namespace Assimp {
class BaseImporter;
}

namespace effuse::importers {

/// What an importer of grids leaves beside assimp's scene, whose positions are float.
struct DemResult {
  DemGrid grid;              ///< exact
  std::exception_ptr fault;  ///< the InputError with its line, of which assimp keeps only the words
};

/// How, and what besides the file that assimp is asked for.
struct DemRequest {
  DemOptions options;
  std::vector<std::filesystem::path> more;  ///< further files of the mosaic
};

/// An importer of grids of heights (all that import_dem reads, by ending, or as ESRI ASCII and XYZ by the first bytes) for
/// registration with assimp. Texts are read through assimp's IOSystem, others where they lie. Makes a scene with one mesh:
/// two triangles a cell, holes left out, positions in metres relative to the south-west post, which stands in the scene's
/// metadata as double: "origin_x", "origin_y", "cell_x", "cell_y", and "crs" (its first 1000 bytes). result (may be null)
/// receives the exact grid.
///
/// Property "EFFUSE_DEM_STRIDE" (integer): take every n-th post for the scene's mesh; absent: as many as make it about
/// 256 posts wide. The exact grid keeps all.
/// The caller owns what is returned; Importer::RegisterLoader takes it over.
Assimp::BaseImporter* make_dem_importer(std::shared_ptr<DemResult> result, DemRequest request = {});

}  // namespace effuse::importers
