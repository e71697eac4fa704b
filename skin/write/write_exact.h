#pragma once

#include "skin/write/write_mesh.h"

namespace effuse::skin {

/// Meshes whose positions are to be read back bit for bit, map coordinates above all: text with the shortest digits that give each
/// double again. As the other writers: whole or absent, InputError and ResourceError. (write_exact_ply: write_mesh.h.)

/// OFF: positions and triangles. Metadata as comments after the first line.
void write_off(const std::filesystem::path& file, const geometry::TriMesh& mesh, const Metadata& metadata = {});
/// OBJ: positions and triangles, no normals.
void write_exact_obj(const std::filesystem::path& file, const geometry::TriMesh& mesh, const Metadata& metadata = {});

}  // namespace effuse::skin
