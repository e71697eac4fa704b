#pragma once

#include <vector>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::skin {

struct ManifoldReport {
  std::size_t split_edges = 0;        ///< edges of four or more triangles, parted
  std::size_t split_vertices = 0;     ///< copies of vertices made
  std::size_t dropped_triangles = 0;  ///< named a vertex twice
};

/// Makes a closed, oriented set of triangles manifold without moving anything: where sheets touch in an
/// edge or a vertex each gets vertices of its own. At an edge of 2n triangles, each triangle is joined with the
/// one that follows it around the edge through the solid (so that solids which touch come apart). If both ends cannot
/// part, each pair gets a midpoint of its own.
/// Every edge must have as many triangles in one direction as in the other (checked). Changes positions and
/// triangles only; attributes and normals must be empty (checked).
ManifoldReport make_manifold(geometry::TriMesh& mesh);

}  // namespace effuse::skin
