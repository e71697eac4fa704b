#pragma once

#include "geometry/base/types.h"

namespace effuse::geometry {

/// Where on a triangle (a, b, c) a point lies.
///
///   weights  of a, b, c; they sum to 1; exactly 0 beyond a feature
///   feature  kVertex: index is the corner (0..2); kEdge: index k is the side from corner k to corner k + 1
struct TrianglePoint {
  enum class Feature { kFace, kEdge, kVertex };
  Vec3 point = Vec3::Zero();
  Vec3 weights = Vec3::Zero();
  Feature feature = Feature::kFace;
  int index = 0;
};

/// The point of triangle (a, b, c) nearest to p, and the feature it lies on. A triangle of no area gives a
/// point on one of its sides.
TrianglePoint closest_point_on_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c);

/// The point of the segment from a to b nearest to p.
Vec3 closest_point_on_segment(const Vec3& p, const Vec3& a, const Vec3& b);

}  // namespace effuse::geometry
