#pragma once

#include <cstddef>

#include "geometry/mesh/tri_mesh.h"
#include "geometry/terrain/height_field.h"

namespace effuse::geometry {

/// The surface of a height field in few triangles: no post lies more than max_error [m] (and rounding, 1e-11
/// of the heights) above or below them.
///
/// Greedy insertion: from two triangles over the whole grid, the post with the largest error of all becomes a vertex, and
/// the triangulation is made Delaunay again, until no error is above max_error; each triangle keeps its worst post, a heap
/// the worst of all (Garland & Heckbert 1995, Fast polygonal approximation of terrains and height fields, CMU-CS-95-181,
/// algorithm III). Plane coordinates are whole numbers of posts and all tests of orientation and circles exact.
///
/// The mesh covers exactly the cells with four heights: every post on the rim of a hole is a vertex, and since a side of
/// a cell holds no other post in the circle over it, it is an edge of any Delaunay triangulation. Straight outer borders
/// keep only the vertices they need. max_error = 0 keeps every post that does not lie on the plane of its neighbours.
///
/// max_error finite and >= 0 (checked). Vertices are posts of the field, normals are the field's. The same bits on any
/// number of threads. A million posts of rough terrain take a second or two.
TriMesh triangulate(const HeightField& field, Real max_error);

/// How far a mesh without overhangs lies above or below a height field.
struct VerticalError {
  Real at_posts = 0;          ///< largest at the posts that triangles cover [m]
  Vec2 where = Vec2::Zero();  ///< the post
  Real between = 0;           ///< largest anywhere on the covered ground, whose cells are bilinear [m]; >= at_posts
  std::size_t uncovered = 0;  ///< posts of whole cells that no triangle covers
};

/// Measured triangle by triangle, independently of how the mesh came about. Between posts the difference is bilinear on
/// what a triangle and a cell share, so that it is largest at a post or on a triangle's edge, where it is a parabola from
/// line to line of the grid. A mesh whose positions are out of range is not allowed.
VerticalError vertical_error(const HeightField& field, const TriMesh& mesh);

/// What no triangulation of the posts gets below between them: the largest distance of a bilinear cell from its own two
/// triangles, |z00 - z10 - z01 + z11| / 4 [m].
Real twist_error(const HeightField& field);

}  // namespace effuse::geometry
