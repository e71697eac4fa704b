#pragma once

#include "geometry/mesh/tri_mesh.h"

namespace effuse::skin {

/// Each triangle in four at its edges' middles. Shape, closedness, orientation and Euler characteristic stay; attributes
/// and normals (made unit again) are the means of an edge's ends. Two triangles an edge at most, or the mesh stays
/// shared along it all the same: a vertex an edge. Vertices: the old ones first, then edges by rising ends.
geometry::TriMesh refine(const geometry::TriMesh& mesh);

/// Mean edge length over triangles' edges [m]; 0 without triangles.
Real mean_edge(const geometry::TriMesh& mesh);

}  // namespace effuse::skin
