#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "importers/mesh/mesh_frame.h"
#include "importers/read_apart.h"

namespace effuse::importers {

struct MeshOptions {
  UpAxis up = UpAxis::kUnknown;  ///< the file's axis that points up; unknown: as it says, or else z
  Real metres_per_unit = 0;      ///< of the file's numbers; 0: as it says, or else 1
  ReadLimits limits;             ///< of its parser
};

struct MeshImport {
  geometry::TriMesh mesh;          ///< all meshes of the file as one, node transforms applied, metres, z up
  MeshFrame frame;                 ///< what the file said of its coordinates; up and unit are applied, the origin is not
  std::vector<std::string> notes;  ///< what was done: one line each
};

/// Any mesh assimp reads (OBJ, PLY, STL, OFF, glTF/GLB, COLLADA, FBX, ...), triangulated, exact duplicates
/// of positions welded, turned to z up and scaled to metres. PLY is read by a loader of ours registered with
/// assimp (its own hangs and aborts, STACK D). Vertex attributes of PLY and GLB are kept: normals,
/// colour ("color", linear light), scalars by their names, name_x/_y/_z as one attribute of width 3,
/// glTF's _NAME as "name".
///
/// Up axis and unit: glTF (y, metres) and X3D (y, metres) by their standards, 3DS (z) by its own, COLLADA and FBX by what stands in the
/// file, files of ours by their comments; other formats say nothing.
/// Digits: PLY is read in double; OBJ, OFF and ASCII STL are shifted to whole metres before assimp parses them, so that map
/// coordinates stay exact to 1 mm. All other formats pass through assimp's floats, as binary STL and glTF hold them anyway: far
/// from the origin they come in steps, which a note tells.
///
/// Throws InputError: missing, empty, unreadable, no triangles, positions not finite, index out of range; with
/// limits.apart also when they are passed, or the parser crashes.
MeshImport import_mesh(const std::filesystem::path& file, const MeshOptions& options = {});

/// What neither the file nor the options say of its coordinates, and how large it would be otherwise: a warning each.
std::vector<std::string> guesses(const MeshImport& import, const MeshOptions& options);

}  // namespace effuse::importers
