#pragma once

#include <cstddef>
#include <string>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::geometry {

/// What a mesh is. Edges are undirected, by vertex index: coincident vertices are different ones
/// (weld first). Triangles that name a vertex twice are counted and have no edges.
struct MeshReport {
  std::size_t vertices = 0, triangles = 0, edges = 0;
  std::size_t boundary_edges = 0;      ///< one triangle
  std::size_t non_manifold_edges = 0;  ///< three triangles or more
  std::size_t misoriented_edges = 0;   ///< two triangles that run it in the same direction
  std::size_t non_manifold_vertices = 0;  ///< triangles around it form more than one fan
  std::size_t repeated_indices = 0;    ///< triangles that name a vertex twice
  std::size_t zero_area = 0;           ///< triangles of no area with three different vertices
  std::size_t unused_vertices = 0;
  std::size_t components = 0;          ///< connected through shared vertices, of used vertices
  std::ptrdiff_t euler = 0;            ///< used vertices - edges + triangles of three different vertices

  bool closed() const { return triangles > 0 && boundary_edges == 0; }
  bool manifold() const { return non_manifold_edges == 0 && non_manifold_vertices == 0; }
  bool oriented() const { return misoriented_edges == 0; }
  /// Closed, manifold, oriented, no degenerate triangle: encloses a volume.
  bool solid() const { return closed() && manifold() && oriented() && repeated_indices == 0; }
};

/// Throws InputError when the mesh is not even well formed: an index out of range, a position that is
/// not finite, an attribute or normals of the wrong length (the first of each kind; the caller knows the
/// file and adds its name). O(n log n).
MeshReport validate(const TriMesh& mesh);

/// One line for people: "12 vertices, 20 triangles, closed, manifold, oriented, 1 component"; what is
/// wrong is counted in its place.
std::string to_string(const MeshReport& report);

}  // namespace effuse::geometry
