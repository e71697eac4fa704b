#pragma once

#include <bit>
#include <cstdint>
#include <string>
#include <vector>

#include "geometry/mesh/tri_mesh.h"

/// What the mesh writers and the preview share.
namespace effuse::skin {

/// Throws InputError naming `name` and the first fault when the mesh is not well formed: an index out of range, a
/// position, normal or attribute that is not finite (as float), an attribute or normals of the wrong length. O(n).
void require_well_formed(const std::string& name, const geometry::TriMesh& mesh);

/// One unit normal a vertex: the mesh's own, normalised (+z where one has no length), or computed when it has none.
std::vector<Vec3> unit_normals(const geometry::TriMesh& mesh);

/// The "color" attribute (width 3, linear), or null when the mesh has none of that width.
const geometry::VertexAttribute* find_color(const geometry::TriMesh& mesh);

/// Text on one line: line breaks and control characters become blanks.
std::string one_line(const std::string& text);

/// Appends the bytes of a value as they lie in memory (little-endian, checked at compile time).
template <class T>
void append_bytes(std::string& out, const T& value) {
  static_assert(std::endian::native == std::endian::little, "the files are little-endian");
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

}  // namespace effuse::skin
