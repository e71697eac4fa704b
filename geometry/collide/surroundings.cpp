#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "geometry/collide/collision_mesh_internal.h"
#include "geometry/collide/obstacles_internal.h"

/// All surfaces around a point, not the nearest alone.
namespace effuse::geometry {

using Impl = CollisionMesh::Impl;
using Feature = TrianglePoint::Feature;

namespace {
constexpr Real kFlat = 1e-3;    // [rad]: an edge this flat is no edge
constexpr std::size_t kMost = NearestContacts::kMost;
}  // namespace

void Impl::find_hollows() {
  hollow = report.parts > 1 || report.cavities > 0;
  smooth.assign(mesh.triangles.size(), 1);
  for (Index t = 0; t < mesh.triangles.size(); ++t)
    for (int side = 0; side < 3; ++side) {
      const Vec3& a = corners[t][static_cast<std::size_t>(side)];
      const Vec3& b = corners[t][static_cast<std::size_t>((side + 1) % 3)];
      const Vec3 other = normal_across(t, side, (a + b) / 2);
      // Along the side, from this face's normal to the other's: positive where the solid is convex.
      const Real bend = other.isZero() ? 1 : face_normal[t].cross(other).dot((b - a).normalized());
      if (bend > kFlat || !solid_at(t)) smooth[t] = 0;
      if (bend < -kFlat || !solid_at(t)) hollow = true;
    }
}

std::size_t Impl::surroundings(const Vec3& p, Real reach, std::span<Nearest> out) const {
  if (out.empty()) return 0;
  const auto first = nearest(p, reach);
  if (!first) return 0;
  out[0] = *first;
  if (out.size() == 1 || !hollow || first->distance < 0) return 1;

  // Whether the neighbour across a side is no nearer.
  const auto holds = [&](Index t, int side, Real distance2) {
    const Index to = across[t][static_cast<std::size_t>(side)];
    if (to == kNobody || to / 3 >= mesh.triangles.size()) return true;
    const auto& [a, b, c] = corners[to / 3];
    return (p - closest_point_on_triangle(p, a, b, c).point).squaredNorm() >= distance2 * (1 - 1e-12);
  };
  // The same for all triangles round a corner, to either side of it.
  const auto holds_around = [&](Index t, int corner, Real distance2) {
    for (const bool forward : {true, false}) {
      Index at = t;
      int side = forward ? corner : (corner + 2) % 3;
      for (int step = 0; step < 64; ++step) {
        if (!holds(at, side, distance2)) return false;
        const Index to = across[at][static_cast<std::size_t>(side)];
        if (to == kNobody || to / 3 == t) break;
        // On over the other side that has the corner.
        at = to / 3;
        side = static_cast<int>(forward ? (to % 3 + 1) % 3 : (to % 3 + 2) % 3);
        if (triangles[at][static_cast<std::size_t>(forward ? side : (side + 1) % 3)] != triangles[t][static_cast<std::size_t>(corner)])
          side = static_cast<int>(forward ? (to % 3 + 2) % 3 : (to % 3 + 1) % 3);
      }
    }
    return true;
  };
  std::array<Found, kMost> found;
  std::size_t count = 0;
  tree.nearest(p, reach * reach, [&](Index t, Real& limit2) {
    const auto& [a, b, c] = corners[t];
    const Real height = (p - a).dot(face_normal[t]);
    if (height * height > limit2 || (solid_at(t) && height <= 0)) return;
    if (smooth[t]) {
      const Vec3& n = face_normal[t];
      if ((b - a).cross(p - a).dot(n) < 0 || (c - b).cross(p - b).dot(n) < 0 || (a - c).cross(p - c).dot(n) < 0) return;
    }
    const TrianglePoint at = closest_point_on_triangle(p, a, b, c);
    const Real distance2 = (p - at.point).squaredNorm();
    if (distance2 > limit2) return;
    if (at.feature == Feature::kEdge && !holds(t, at.index, distance2)) return;
    if (at.feature == Feature::kVertex && !holds_around(t, at.index, distance2)) return;
    const auto before = [&](std::size_t k) { return distance2 != found[k].distance2 ? distance2 < found[k].distance2 : t < found[k].triangle; };
    std::size_t slot = std::min(count, kMost - 1);
    if (count == kMost && !before(slot)) return;
    count = std::min(count + 1, kMost);
    for (; slot > 0 && before(slot - 1); --slot) found[slot] = found[slot - 1];
    found[slot] = {t, at, distance2};
  });

  std::size_t kept = 1;
  const Real apart = std::cos(CollisionMesh::kApart);
  for (std::size_t k = 0; k < count && kept < out.size(); ++k) {
    const Nearest candidate = answer(found[k], p, false);
    const bool stands_apart = std::all_of(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(kept), [&](const Nearest& nearer) {
      return candidate.normal.dot(nearer.normal) < apart && (candidate.point - nearer.point).dot(nearer.normal) > -on_surface;
    });
    if (stands_apart) out[kept++] = candidate;
  }
  return kept;
}

std::size_t CollisionMesh::surroundings(const Vec3& p, Real reach, std::span<Nearest> out) const { return impl_->surroundings(p, reach, out); }

void Obstacles::surroundings(std::span<const Vec3> points, Real reach, int per_point, std::span<Contact> out) const {
  ZONE("collide.contacts");
  CHECK(impl_->up_to_date());
  CHECK(per_point >= 1 && per_point <= static_cast<int>(kMost));
  const auto each = static_cast<std::size_t>(per_point);
  CHECK_EQ(out.size(), points.size() * each);
  CHECK_GE(reach, 0.0);
  parallel_for(points.size(), [&](std::size_t i) {
    const std::span<Contact> own = out.subspan(i * each, each);
    std::fill(own.begin(), own.end(), Contact{});
    const Vec3& point = points[i];
    if (!(impl_->now.squaredExteriorDistance(point) <= reach * reach)) return;
    std::array<CollisionMesh::Nearest, kMost> around;
    NearestContacts nearest(own);
    impl_->tree.nearest(point, reach * reach, [&](Index which, Real& limit2) {
      if (impl_->place[which].now.squaredExteriorDistance(point) > limit2) return;
      const Obstacle& obstacle = *impl_->all[which];
      const std::size_t found = obstacle.shape.surroundings(obstacle.motion.to().body(point), reach, std::span(around).first(each));
      for (std::size_t k = 0; k < found; ++k) nearest.add(around[k], obstacle, which);
    });
  }, 512);
}

}  // namespace effuse::geometry
