#include "geometry/query/closest_point.h"

#include <algorithm>
#include <limits>

namespace effuse::geometry {

namespace {
/// Share of the way from a to b where p projects to, within [0, 1].
Real share_along(const Vec3& p, const Vec3& a, const Vec3& b) {
  const Vec3 ab = b - a;
  const Real length2 = ab.squaredNorm();
  return length2 > 0 ? std::clamp((p - a).dot(ab) / length2, Real{0}, Real{1}) : 0;
}
}  // namespace

Vec3 closest_point_on_segment(const Vec3& p, const Vec3& a, const Vec3& b) { return a + share_along(p, a, b) * (b - a); }

TrianglePoint closest_point_on_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3* const corner[3] = {&a, &b, &c};
  const Vec3 normal = (b - a).cross(c - a);

  // On which side of each side's wall (through the side, along the normal) p stands.
  Vec3 inside;
  for (int k = 0; k < 3; ++k) inside[k] = normal.dot((*corner[(k + 1) % 3] - *corner[k]).cross(p - *corner[k]));
  const Real total = inside.sum();
  if ((inside.array() > 0).all() && total > 0) {
    const Vec3 weights = Vec3(inside[1], inside[2], inside[0]) / total;
    // Along the normal down to the plane: exact where a weighted sum of far corners would round.
    const Real height = normal.dot(p - a) / normal.squaredNorm();
    return {p - height * normal, weights, TrianglePoint::Feature::kFace, 0};
  }

  // Else the nearest of the sides that p lies beyond (all three if there is no area).
  TrianglePoint best;
  Real best_distance2 = std::numeric_limits<Real>::infinity();
  for (int k = 0; k < 3; ++k) {
    if (inside[k] > 0) continue;
    const Vec3 &from = *corner[k], &to = *corner[(k + 1) % 3];
    const Real s = share_along(p, from, to);
    const Vec3 point = s == 1 ? to : Vec3(from + s * (to - from));
    const Real distance2 = (p - point).squaredNorm();
    if (!(distance2 < best_distance2)) continue;
    best_distance2 = distance2;
    best.point = point;
    best.weights = Vec3::Zero();
    best.weights[k] = 1 - s;
    best.weights[(k + 1) % 3] = s;
    best.feature = s > 0 && s < 1 ? TrianglePoint::Feature::kEdge : TrianglePoint::Feature::kVertex;
    best.index = s == 1 ? (k + 1) % 3 : k;
  }
  return best;
}

}  // namespace effuse::geometry
