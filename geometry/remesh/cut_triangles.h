#pragma once

#include "geometry/mesh/tri_mesh.h"

namespace effuse::geometry {

/// The same surface with no triangle larger than `largest` [m^2] (> 0 and finite, checked): larger ones are cut in the middle of their
/// longest edge, all at once, and again, and their neighbours as it takes to stay neighbours (Rivara 1984, Int. J. Numer. Methods Eng. 20,
/// 745-756: angles stay above half of the smallest there was). Small slivers stay as long as they are. Positions and triangles
/// only: normals and attributes are dropped. A mesh of small triangles comes back as it is. Linear in what comes out; not parallel:
/// the same bits always.
TriMesh cut_triangles(const TriMesh& mesh, Real largest);

}  // namespace effuse::geometry
