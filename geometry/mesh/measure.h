#pragma once

#include "geometry/mesh/tri_mesh.h"

namespace effuse::geometry {

/// 1/6 sum of p0 . (p1 x p2) about the box's centre [m^3]: the enclosed volume of a closed mesh,
/// positive when its triangles run counter-clockwise from outside. Fixed order: same bits always.
Real signed_volume(const TriMesh& mesh);

/// Sum of triangle areas [m^2].
Real surface_area(const TriMesh& mesh);

/// Box of the positions; empty for an empty mesh.
Box3 bounds(const TriMesh& mesh);

/// Unit vertex normals, weighted by the angle of each triangle at the vertex (Thuermer & Wuethrich
/// 1998); vertices without area get +z. Fills mesh.normals. Same bits on any number of threads.
void compute_normals(TriMesh& mesh);

}  // namespace effuse::geometry
