#pragma once

#include <limits>

#include "geometry/mesh/tri_mesh.h"
#include "geometry/remesh/surface_distance.h"

namespace effuse::geometry {

/// A new mesh of a surface, and how far it lies from the old one.
struct Remeshed {
  TriMesh mesh;
  SurfaceDistance error;  ///< measured, both ways
  Real bound = std::numeric_limits<Real>::infinity();  ///< proven: neither lies farther from the other [m]; known of simplify() only
};

/// Triangles as near to equilateral as the surface allows, edges about `edge` [m] long (Botsch & Kobbelt 2004, A remeshing approach
/// to multiresolution modeling; CGAL): splits, collapses, flips, tangential smoothing, projection on the input. Edges sharper
/// than kSharp and borders stay where they are: cut to pieces no longer than 4/3 edge, never joined.
///
/// mesh must be sound (repair.h), else InputError; edge > 0 and finite (checked), and no more than kMostTriangles may come
/// out (InputError). Attributes and normals are blended from the input's. Linear in what comes out: about 40,000 triangles a second.
/// Not parallel: the same bits always.
Remeshed remesh(const TriMesh& mesh, Real edge);

/// The same surface in fewer triangles, no more than max_error [m] from it: edges collapse, cheapest first (Lindstrom & Turk
/// 1998, Fast and memory efficient polygonal simplification; CGAL), and a collapse is refused when
///   a vertex that the input had there would lie more than max_error from the triangles that stand for it now,
///   a new triangle, at its middle and the middles of its edges, would lie more than that from the input,
///   a triangle would fold over or become flat.
/// Collapses look at points with a tenth of max_error in hand; then the distance is proven both ways (distance_bound.h), and where it is
/// larger, all is done again with a smaller one: bound <= max_error, always.
///
/// mesh must be sound (repair.h), else InputError; max_error > 0 and finite (checked). Attributes and normals are blended
/// from the input's. About 10,000 vertices a second. Not parallel: the same bits always.
Remeshed simplify(const TriMesh& mesh, Real max_error);

inline constexpr Real kSharp = 50 * kPi / 180;                ///< as MeshSurface::kCreaseAngle
inline constexpr std::size_t kMostTriangles = 20'000'000;

}  // namespace effuse::geometry
