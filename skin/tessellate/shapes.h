#pragma once

#include <cstddef>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::skin {

/// Shape of a mesh's triangles.
struct TriangleShapes {
  Real thin = 0;           ///< share whose least angle is under 5 degrees
  Real least_angle = 0;    ///< [deg]; 0 without triangles
  std::size_t folded = 0;  ///< that look away from the sum of their corners' normals
};
/// mesh: with normals (checked).
TriangleShapes triangle_shapes(const geometry::TriMesh& mesh);

/// Moves the vertices of triangles thinner than min_angle [deg], or folded, along the mesh as it was, by up to `wander` [m], where that
/// makes the worst triangle round them better. Neighbours stay; a moved vertex gets the normal and attributes of its new place. Round
/// clusters of drops one triangle of a dual mesh in two hundred is thinner than 5 degrees, one in forty thousand after this.
///   mesh  closed or not, with normals (checked), each vertex in a triangle (checked)
/// Vertices take their turns: serial but for the search for thin triangles. The same bits always.
/// Returns how many it moved.
std::size_t widen_thin(geometry::TriMesh& mesh, Real min_angle, Real wander);

/// Moves vertices that lie on a surface so that the triangles' mean height over it is zero round each: flat triangles between points of
/// a round surface enclose less than it does. Over an edge p q with normals m, n the surface rises by  s = (q - p) . (n - m) / 8  in the
/// middle (the sagitta), over a triangle by (s_1 + s_2 + s_3) / 3 on average, over a vertex by the mean of its triangles, weighted by area:
/// so far it goes along its normal, though never farther than half its shortest edge. Edges whose normals differ by more than 70 degrees do
/// not count: they are sharp. Of a sphere nine tenths of the missing volume or more come back.
///   mesh  with the surface's normals (checked), which stay as they are
void lift_facets(geometry::TriMesh& mesh);

}  // namespace effuse::skin
