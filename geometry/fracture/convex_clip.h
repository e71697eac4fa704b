#pragma once

#include <span>
#include <vector>

#include "geometry/fracture/cell_layout.h"

/// A convex solid as loose polygons, cut by planes.
namespace effuse::geometry {

inline constexpr Index kOuterFace = ~Index{0};

/// Corners counter-clockwise from outside; side: number of the side that cut it, kOuterFace: the solid's own surface.
struct ClipPolygon {
  std::vector<Vec3> corners;
  Index side = kOuterFace;
};

/// What of the convex solid lies at normal . x <= offset; the cut is closed by a polygon of `side`. Corners within `tolerance` [m] of the
/// plane count as on it and stay where they are. Edges that two polygons share are cut at the same point, to the last bit.
/// Nothing is cut: polygons are unchanged. Everything is: they are emptied.
void clip(std::vector<ClipPolygon>& solid, const Vec3& normal, Real offset, Index side, Real tolerance);

/// Of a polygon what lies at normal . x <= offset; empty: nothing.
void clip(std::vector<Vec3>& polygon, const Vec3& normal, Real offset, Real tolerance);

/// The polygons of a box.
std::vector<ClipPolygon> box_polygons(const Box3& box);

}  // namespace effuse::geometry
