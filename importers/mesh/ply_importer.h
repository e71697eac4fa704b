#pragma once

#include <exception>
#include <memory>

#include "importers/mesh/ply_reader.h"

namespace Assimp {
class BaseImporter;
}

namespace effuse::importers {

/// What our PLY importer leaves beside assimp's scene, whose positions are float and attributes few.
struct PlyResult {
  PlyMesh mesh;
  std::exception_ptr fault;  ///< the InputError with its line, of which assimp keeps only the words
};

/// An importer for registration with assimp in place of its own PLY loader, which loops on a header without
/// end and aborts on legal binary files. The scene has one mesh of all polygons: its vertex v is vertex v of
/// result (may be null), relative to the middle of their box.
/// The caller owns what is returned; Importer::RegisterLoader takes it over.
Assimp::BaseImporter* make_ply_importer(std::shared_ptr<PlyResult> result);

}  // namespace effuse::importers
