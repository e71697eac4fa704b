#pragma once

#include <exception>
#include <memory>

#include "importers/terrain/dem_grid.h"

namespace Assimp {
class BaseImporter;
}

namespace effuse::importers {

/// What an importer of grids leaves beside assimp's scene, whose positions are float.
struct DemResult {
  DemGrid grid;              ///< exact
  std::exception_ptr fault;  ///< the InputError with its line, of which assimp keeps only the words
};

/// An importer of ESRI ASCII grids (.asc, or any file that begins as one) for registration with assimp. Reads
/// through assimp's IOSystem and makes a scene with one mesh: two triangles a cell, holes left out, positions
/// relative to the south-west post, which stands in the scene's metadata as double: "origin_x", "origin_y",
/// "cell_x", "cell_y". result (may be null) receives the exact grid.
///
/// Property "EFFUSE_DEM_STRIDE" (integer, 1): take every n-th post for the scene's mesh; the exact grid keeps all.
/// The caller owns what is returned; Importer::RegisterLoader takes it over.
Assimp::BaseImporter* make_asc_importer(std::shared_ptr<DemResult> result);

}  // namespace effuse::importers
