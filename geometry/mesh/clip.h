#pragma once

#include "geometry/mesh/tri_mesh.h"

namespace effuse::geometry {

/// The part of a mesh where normal . (x - point) >= 0: triangles that cross the plane are cut along it, in one new vertex for each
/// edge, so that no crack opens; attributes and normals are interpolated there. What was closed is open at the cut. Vertices that nobody uses go;
/// the others keep their order. Indices must be in range (checked). O(n log n).
TriMesh clip(const TriMesh& mesh, const Vec3& point, const Vec3& normal);

/// The part of a mesh between low and high, in x and y.
TriMesh crop(TriMesh mesh, const Vec2& low, const Vec2& high);

}  // namespace effuse::geometry
