#include "geometry/fracture/convex_clip.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace effuse::geometry {
namespace {

bool before(const Vec3& a, const Vec3& b) { return std::tuple(a.x(), a.y(), a.z()) < std::tuple(b.x(), b.y(), b.z()); }

/// The same bits whichever end is named first.
Vec3 cut_point(Vec3 a, Real da, Vec3 b, Real db) {
  if (before(b, a)) std::swap(a, b), std::swap(da, db);
  return a + (b - a) * (da / (da - db));
}

/// Corners in order around the plane's normal, each once. Fewer than three: not a polygon.
std::vector<Vec3> cap_polygon(std::vector<Vec3> points, const Vec3& normal, Real tolerance) {
  std::sort(points.begin(), points.end(), before);
  std::vector<Vec3> distinct;
  for (const Vec3& p : points)
    if (std::none_of(distinct.begin(), distinct.end(), [&](const Vec3& q) { return (p - q).norm() <= tolerance; })) distinct.push_back(p);
  if (distinct.size() < 3) return {};
  Vec3 middle = Vec3::Zero();
  for (const Vec3& p : distinct) middle += p;
  middle /= static_cast<Real>(distinct.size());
  const Vec3 u = normal.unitOrthogonal(), v = normal.cross(u);
  std::vector<std::pair<Real, Vec3>> round;
  for (const Vec3& p : distinct) round.emplace_back(std::atan2((p - middle).dot(v), (p - middle).dot(u)), p);
  std::stable_sort(round.begin(), round.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Vec3> out;
  for (const auto& [angle, p] : round) out.push_back(p);
  return out;
}

}  // namespace

void clip(std::vector<Vec3>& polygon, const Vec3& normal, Real offset, Real tolerance) {
  std::vector<Vec3> out;
  const std::size_t n = polygon.size();
  const auto side_of = [&](const Vec3& p) {
    const Real d = normal.dot(p) - offset;
    return std::abs(d) <= tolerance ? 0.0 : d;
  };
  bool inside = false;
  for (std::size_t k = 0; k < n; ++k) {
    const Vec3 &a = polygon[k], &b = polygon[(k + 1) % n];
    const Real da = side_of(a), db = side_of(b);
    if (da < 0) inside = true;
    if (da <= 0) out.push_back(a);
    if ((da < 0 && db > 0) || (da > 0 && db < 0)) out.push_back(cut_point(a, da, b, db));
  }
  // A polygon that only touches the plane, or lies in it, is not inside; the cap stands for the latter.
  if (!inside || out.size() < 3) out.clear();
  polygon.swap(out);
}

void clip(std::vector<ClipPolygon>& solid, const Vec3& normal, Real offset, Index side, Real tolerance) {
  Real most = -std::numeric_limits<Real>::infinity(), least = -most;
  for (const ClipPolygon& polygon : solid)
    for (const Vec3& p : polygon.corners) {
      most = std::max(most, normal.dot(p) - offset);
      least = std::min(least, normal.dot(p) - offset);
    }
  if (most <= tolerance) return;
  if (least >= -tolerance) {
    solid.clear();
    return;
  }
  std::vector<Vec3> border;
  for (ClipPolygon& polygon : solid) {
    clip(polygon.corners, normal, offset, tolerance);
    for (const Vec3& p : polygon.corners)
      if (std::abs(normal.dot(p) - offset) <= 2 * tolerance) border.push_back(p);
  }
  std::erase_if(solid, [](const ClipPolygon& polygon) { return polygon.corners.empty(); });
  ClipPolygon cap{cap_polygon(std::move(border), normal, tolerance), side};
  if (!cap.corners.empty()) solid.push_back(std::move(cap));
}

std::vector<ClipPolygon> box_polygons(const Box3& box) {
  std::vector<ClipPolygon> out;
  const auto corner = [&](int k) { return Vec3(k & 1 ? box.max().x() : box.min().x(), k & 2 ? box.max().y() : box.min().y(), k & 4 ? box.max().z() : box.min().z()); };
  constexpr int kLoops[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  for (const auto& loop : kLoops) {
    ClipPolygon polygon;
    for (const int k : loop) polygon.corners.push_back(corner(k));
    out.push_back(std::move(polygon));
  }
  return out;
}

}  // namespace effuse::geometry
