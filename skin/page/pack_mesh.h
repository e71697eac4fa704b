#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::skin {

/// A byte for each vertex, by a name that the page knows: "red", "glow", "temperature", ...
struct BytePlane {
  std::string name;
  std::vector<std::uint8_t> values;
};

/// A mesh in few bytes, not yet deflated; unpack.js is its reader.
///
/// Triangles go from neighbour to neighbour, each turned so that vertices seen for the first time come last; vertices are numbered
/// in that order. Positions are 16 bit in the mesh's box, normals two bytes (octahedron). Each number of a vertex is written less the
/// mean of the same number of its two parents, modulo its size: of the corners of the triangle that shows it first, those seen before, or else the vertex before it.
///
///   bytes    x, y, z: each the low bytes of all vertices, then the high ones, of the difference as zigzag;
///            the two numbers of the normal, then each plane: one byte a vertex;
///            of each corner the vertex's distance below the next new one (0: it is that), seven bits a byte, lowest first, 128: more follows
///   box      lowest and highest corner: position = low + number / 65535 (high - low)
struct PackedMesh {
  std::size_t vertices = 0, triangles = 0;
  std::array<float, 6> box{};
  std::vector<std::string> planes;
  std::string bytes;
};

/// Positions are right to half a 65535th of the box (1.5 mm in 200 m), normals to a degree. Vertices that no triangle has are left out.
/// mesh: well formed, with unit normals, each plane as long as its positions (checked). Serial, the same bytes always; about
/// four million triangles a second.
PackedMesh pack_mesh(const geometry::TriMesh& mesh, const std::vector<BytePlane>& planes);

}  // namespace effuse::skin
