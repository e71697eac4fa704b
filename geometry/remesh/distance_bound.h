#pragma once

#include "geometry/mesh/tri_mesh.h"

namespace effuse::geometry {

/// A proven upper bound on the one-sided Hausdorff distance [m]: no point of the surface `from` lies farther from `to`. Samples
/// (distance_to) can only approach it from below.
///
/// The distance from a triangle is a convex function, so that on a convex piece it is largest at a corner. Every triangle of `from` is
/// cut, where it leaves the prism over the triangle of `to` nearest to its middle, or else in two, until each piece has all corners
/// within `enough` of one triangle.
///
///   enough  a bound this small will do [m], > 0 and finite (checked). The result is no larger than it where the search succeeds;
///           larger where a point farther off was found, whose distance it is then, or when a triangle has taken kMostPieces
///           pieces, which happens where the surfaces lie very nearly `enough` apart
///
/// Both meshes must have triangles with an area, or the result is 0 (from) or infinity (to). But for rounding, 1e-13 of the coordinates. The
/// same bits on any number of threads.
Real distance_bound(const TriMesh& from, const TriMesh& to, Real enough);

inline constexpr std::size_t kMostPieces = 20'000;

}  // namespace effuse::geometry
