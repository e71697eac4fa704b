#pragma once

#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "skin/tessellate/surface_walk.h"
#include "skin/tessellate/voronoi.h"

/// For the .cpp files of this folder: better triangles without other neighbours.
namespace effuse::skin {

/// Fans: vertices 0 .. centers - 1 are centres, the others nodes.
struct Fans {
  std::size_t centers = 0;
  std::vector<Spot> spots;
  std::vector<Vec3> up;  ///< unit normals of the surface there
  std::vector<geometry::Triangle> triangles;
};

/// Sine of a triangle's least angle, 0 .. sin 60 deg; where it looks away from `up` (any length), about -1 or less: -1 plus that sine times
/// the cosine between them.
Real triangle_quality(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& up);

/// Shrinks borders (edges between nodes) shorter than `length` [m] to a node, shortest first, where the mesh stays manifold (the
/// link condition: the ends have no neighbours in common but the two centres), fans keep three triangles and the worst
/// triangle around gets no worse. only_below: only those of a triangle of less than this quality.
/// Takes the nodes out. Returns how many.
std::size_t merge_short_borders(Fans& fans, const SurfaceWalk& walk, Real length, Real only_below = 2);

/// Moves vertices of triangles thinner than options.min_angle, or folded, along the surface to where the worst triangle round them
/// is better. Nodes stay within options.wander of where they were. In the order of the vertices, sweep after sweep.
/// Returns how many were moved.
std::size_t move_for_angles(Fans& fans, const SurfaceWalk& walk, Real spacing, const VoronoiOptions& options);

}  // namespace effuse::skin
