#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <vector>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::geometry {

/// Pairs of triangles that meet where they should not, each {smaller, larger} index, in ascending order:
///
///   no vertex shared     they have a point in common
///   one vertex shared    they have another point in common
///   two vertices shared  they lie in one plane, on the same side of their edge (a fold of 180 degrees)
///   all three shared     always
///
/// Vertices at exactly equal positions count as one, so that sheets which only touch, in vertices or edges of both, do not
/// meet (skin's meshes have such places, and separate vertices there). Decided exactly from the coordinates as they are.
/// Triangles without area are left out (validate() counts them).
/// Indices must be in range, positions finite (checked). O(n log n + pairs whose boxes overlap); 100 bytes a triangle and 8
/// a pair. The same pairs on any number of threads.
///
/// at_most: of n triangles in one place there are n^2 / 2 pairs; the search ends when it has found so many, which are then any.
std::vector<std::array<Index, 2>> self_intersections(const TriMesh& mesh, std::size_t at_most = std::numeric_limits<std::size_t>::max());

}  // namespace effuse::geometry
