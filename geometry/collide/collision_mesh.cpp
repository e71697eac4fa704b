#include "geometry/collide/collision_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/collide/collision_mesh_internal.h"

namespace effuse::geometry {

using Impl = CollisionMesh::Impl;
using Feature = TrianglePoint::Feature;

Vec3 Impl::normal_across(Index triangle, int side, const Vec3& at) const {
  Index from = 3 * triangle + static_cast<Index>(side);
  // Through neighbours without area, by the side that passes nearest.
  for (int step = 0; step < 16; ++step) {
    const Index to = across[from / 3][from % 3];
    if (to == kNobody) return Vec3::Zero();
    const Index neighbour = to / 3;
    if (neighbour < mesh.triangles.size()) return face_normal[neighbour];
    Real least = std::numeric_limits<Real>::infinity();
    for (Index k = 0; k < 3; ++k) {
      if (k == to % 3) continue;
      const Triangle& t = triangles[neighbour];
      const Real distance2 = (at - closest_point_on_segment(at, mesh.positions[t[k]], mesh.positions[t[(k + 1) % 3]])).squaredNorm();
      if (distance2 < least) {
        least = distance2;
        from = 3 * neighbour + k;
      }
    }
  }
  return Vec3::Zero();
}

Vec3 Impl::pseudonormal(Index triangle, const TrianglePoint& at) const {
  Vec3 n = face_normal[triangle];
  if (at.feature == Feature::kEdge) n += normal_across(triangle, at.index, at.point);
  if (at.feature == Feature::kVertex) n = fan_normal[fan[triangle][at.index]];
  const Real length = n.norm();
  return length > 1e-9 ? Vec3(n / length) : face_normal[triangle];
}

Impl::Found Impl::find(const Vec3& p, Real reach) const {
  Found found;
  tree.nearest(p, reach * reach, [&](Index triangle, Real& limit2) {
    const auto& [a, b, c] = corners[triangle];
    const TrianglePoint at = closest_point_on_triangle(p, a, b, c);
    const Real distance2 = (p - at.point).squaredNorm();
    if (distance2 > limit2 || distance2 > found.distance2 || (distance2 == found.distance2 && triangle > found.triangle)) return;
    found = {triangle, at, distance2};
    limit2 = distance2;
  });
  return found;
}

CollisionMesh::Nearest Impl::answer(const Found& found, const Vec3& p, bool inside) const {
  Nearest result;
  const Vec3 offset = p - found.at.point;
  const Real distance = std::sqrt(found.distance2);
  result.point = found.at.point;
  result.triangle = found.triangle;
  result.solid = solid_at(found.triangle);
  result.distance = inside ? -distance : distance;
  if (distance <= on_surface) {
    result.normal = pseudonormal(found.triangle, found.at);
    if (!result.solid && offset.dot(result.normal) < 0) result.normal = -result.normal;
  } else {
    result.normal = offset / result.distance;
  }
  return result;
}

Real Impl::depth(const Crossing& solid, const Vec3& p, Found& found) const {
  found = {};
  solid.tree.nearest(p, std::numeric_limits<Real>::infinity(), [&](Index member, Real& limit2) {
    const Index triangle = solid.members[member];
    const auto& [a, b, c] = corners[triangle];
    const TrianglePoint at = closest_point_on_triangle(p, a, b, c);
    const Real distance2 = (p - at.point).squaredNorm();
    if (distance2 > limit2 || distance2 > found.distance2 || (distance2 == found.distance2 && triangle > found.triangle)) return;
    found = {triangle, at, distance2};
    limit2 = distance2;
  });
  const Real distance = std::sqrt(found.distance2);
  return (p - found.at.point).dot(pseudonormal(found.triangle, found.at)) < 0 ? -distance : distance;
}

int Impl::holder(const Vec3& p, Found& found) const {
  int which = -1;
  Real least = std::numeric_limits<Real>::infinity();
  for (std::size_t k = 0; k < crossing.size(); ++k) {
    if (!crossing[k].box.contains(p)) continue;
    Found here;
    const Real distance = depth(crossing[k], p, here);
    if (distance >= -on_surface || -distance >= least) continue;
    least = -distance;
    found = here;
    which = static_cast<int>(k);
  }
  return which;
}

CollisionMesh::Nearest Impl::way_out(const Vec3& p) const {
  // A little beyond the surface: where two solids touch, out of one is into the other.
  const auto beyond = [&](Index triangle, const TrianglePoint& place) { return Vec3(place.point + 8 * on_surface * pseudonormal(triangle, place)); };
  // Leaving by turns: out of the solid that is left soonest, until no other holds the place.
  constexpr int kTurns = 16;
  Found best, step;
  holder(p, step);
  const Found first = step;
  for (int turn = 0; turn < kTurns; ++turn) {
    const Found here = step;
    if (holder(beyond(here.triangle, here.at), step) >= 0) continue;
    best = here;
    best.distance2 = (p - here.at.point).squaredNorm();
    break;
  }
  // Or straight to a nearer place of the surface that no other solid holds.
  tree.nearest(p, best.distance2, [&](Index triangle, Real& limit2) {
    if (!solid_at(triangle)) return;
    const auto& [a, b, c] = corners[triangle];
    const TrianglePoint place = closest_point_on_triangle(p, a, b, c);
    const Real distance2 = (p - place.point).squaredNorm();
    Found other;
    if (distance2 > limit2 || distance2 >= best.distance2 || holder(beyond(triangle, place), other) >= 0) return;
    best = {triangle, place, distance2};
    limit2 = distance2;
  });
  return answer(best.triangle == kNobody ? first : best, p, true);
}

std::optional<CollisionMesh::Nearest> Impl::nearest(const Vec3& p, Real reach) const {
  if (!p.allFinite() || !(reach >= 0)) return std::nullopt;
  if (!crossing.empty()) {
    Found other;
    if (holder(p, other) >= 0) {
      const Nearest out = way_out(p);
      return -out.distance <= reach ? std::optional(out) : std::nullopt;
    }
  }
  const Found found = find(p, reach);
  if (found.triangle == kNobody) return std::nullopt;
  const bool inside = solid_at(found.triangle) && (p - found.at.point).dot(pseudonormal(found.triangle, found.at)) < 0;
  return answer(found, p, inside);
}

CollisionMesh::CollisionMesh(const TriMesh& mesh) {
  auto impl = std::make_shared<Impl>();
  impl->prepare(mesh);
  impl_ = std::move(impl);
}

std::optional<CollisionMesh::Nearest> CollisionMesh::nearest(const Vec3& p, Real reach) const { return impl_->nearest(p, reach); }

Vec3 CollisionMesh::weights(Index triangle, const Vec3& p) const {
  const auto& [a, b, c] = impl_->corners[triangle];
  const Vec3 u = b - a, v = c - a, w = p - a;
  const Real uu = u.squaredNorm(), uv = u.dot(v), vv = v.squaredNorm(), wu = w.dot(u), wv = w.dot(v), d = uu * vv - uv * uv;
  if (!(d > 0)) return Vec3::Constant(Real{1} / 3);
  const Real second = (vv * wu - uv * wv) / d, third = (uu * wv - uv * wu) / d;
  return {1 - second - third, second, third};
}

Real CollisionMesh::signed_distance(const Vec3& p, Real reach) const {
  const auto found = nearest(p, reach);
  return found ? found->distance : std::numeric_limits<Real>::infinity();
}

bool CollisionMesh::inside(const Vec3& p) const {
  if (impl_->report.solids == 0 || !impl_->bounds.contains(p)) return false;
  return signed_distance(p) < 0;
}

bool CollisionMesh::follow(std::span<const Vec3> positions) {
  CHECK_EQ(positions.size(), impl_->mesh.positions.size());
  if (impl_->report.parts != 1 || impl_->triangles.size() != impl_->mesh.triangles.size()) return false;
  // Others may hold what this one has been.
  auto next = impl_.use_count() == 1 ? std::const_pointer_cast<Impl>(impl_) : std::make_shared<Impl>(*impl_);
  next->follow(positions);
  impl_ = std::move(next);
  return true;
}

const TriMesh& CollisionMesh::mesh() const { return impl_->mesh; }
const Box3& CollisionMesh::bounds() const { return impl_->bounds; }
const CollisionReport& CollisionMesh::report() const { return impl_->report; }
bool CollisionMesh::solid() const { return impl_->report.sheets == 0; }

std::string to_string(const CollisionReport& r) {
  std::string text = fmt::format("{} triangles: {} solids", r.triangles, r.solids);
  if (r.turned > 0) text += fmt::format(" ({} turned outward)", r.turned);
  text += fmt::format(", {} sheets", r.sheets);
  if (r.cavities > 0) text += fmt::format(", {} cavities", r.cavities);
  if (r.crossing > 0) text += fmt::format("; {} solids that others may reach into", r.crossing);
  if (r.flipped > 0) text += fmt::format("; {} triangles flipped", r.flipped);
  if (r.dropped > 0) text += fmt::format("; {} triangles without area dropped", r.dropped);
  if (r.doubled > 0) text += fmt::format("; {} doubled triangles dropped", r.doubled);
  if (r.merged_vertices > 0) text += fmt::format("; {} vertices merged", r.merged_vertices);
  return text;
}

}  // namespace effuse::geometry
