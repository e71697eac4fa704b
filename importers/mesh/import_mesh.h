#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::importers {

struct MeshImport {
  geometry::TriMesh mesh;          ///< all meshes of the file as one, node transforms applied, z up
  std::vector<std::string> notes;  ///< what was done: one line each
};

/// Any mesh assimp reads (OBJ, PLY, STL, OFF, glTF/GLB, COLLADA, ...), triangulated, exact duplicates
/// of positions welded, glTF turned from y up to z up. PLY is read by a loader of ours registered with
/// assimp (its own hangs and aborts, STACK D). Vertex attributes of PLY and GLB are kept: normals,
/// colour ("color", linear light), scalars by their names, name_x/_y/_z as one attribute of width 3,
/// glTF's _NAME as "name".
/// Throws InputError: missing, empty, unreadable, no triangles, positions not finite, index out of range.
MeshImport import_mesh(const std::filesystem::path& file);

}  // namespace effuse::importers
