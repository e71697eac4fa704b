#include "flow/sph/wall_backing.h"

#include <algorithm>
#include <cmath>

#include "geometry/collide/swept.h"

namespace effuse::flow::sph {

namespace {
/// Rays to the half-space beyond a wall's plane, to a ring in the midst of what adds to the drag along the plane (BoundaryTable's drag_t).
constexpr int kAzimuths = 8;
constexpr Real kDeep = 0.3;      // of the way from the plane to the end of reach: the ring's depth
constexpr Real kWide = 0.65;     // of the reach's circle there: its radius
constexpr Real kDragging = 0.6;  // of the reach: walls further off drag by a few hundredths of what near ones do, edges or not
constexpr Real kRing = 0.7;      // of the plane's circle in reach: where few rays look first
constexpr Real kBelow = 0.01;    // of the distance: just through the plane
constexpr Real kFarSide = 0.7;   // cosine between a wall's sides
constexpr Real kFacing = 0.7;    // cosine between walls face to face
}  // namespace

Real WallBacking::share(const Vec3& x, const geometry::Contact& wall, std::span<const Wall> ground) {
  const Real d = wall.distance;
  if (!(d > 0 && d < kDragging * reach_)) return 1;
  obstacles_.meeting(Box3(x - Vec3::Constant(reach_), x + Vec3::Constant(reach_)), near_);
  const Vec3 first = wall.normal.unitOrthogonal(), second = wall.normal.cross(first);
  const auto behind = [&](Real azimuth, Real depth, Real off, bool deep) {
    return hidden(x, (off * std::cos(azimuth)) * first + (off * std::sin(azimuth)) * second - depth * wall.normal, ground, deep);
  };
  const Real circle = std::sqrt(reach_ * reach_ - d * d);
  bool whole = true;
  for (int a = 0; a < 4 && whole; ++a) whole = behind(a * kPi / 2 + kPi / 7, (1 + kBelow) * d, kRing * circle, false);
  if (whole) return 1;
  const Real depth = d + kDeep * (reach_ - d), off = kWide * std::sqrt(reach_ * reach_ - depth * depth);
  int hit = 0;
  for (int a = 0; a < kAzimuths; ++a) hit += behind((a + 0.5) * 2 * kPi / kAzimuths, depth, off, true);
  return static_cast<Real>(hit) / kAzimuths;
}

/// deep: a ray that may come out of the solid again.
bool WallBacking::hidden(const Vec3& x, const Vec3& ray, std::span<const Wall> ground, bool deep) const {
  for (const Wall& wall : ground)
    if (wall.distance + wall.normal.dot(ray) < 0) return true;
  return std::any_of(near_.begin(), near_.end(), [&](Index k) {
    const geometry::Obstacle& obstacle = obstacles_[k];
    const geometry::RigidPose& pose = obstacle.motion.to();
    const Vec3 from = pose.body(x), to = pose.body(x + ray);
    const auto in = geometry::sweep(obstacle.shape, from, to, 0);
    if (!in || !deep) return in.has_value();
    // Out of the solid again: by its far side (a thin wall, a sheet) or past an edge.
    const auto out = geometry::sweep(obstacle.shape, to, from, 0);
    return !out || out->normal.dot(in->normal) < -kFarSide;
  });
}

std::optional<WallBacking::Opposite> WallBacking::opposite(const Vec3& x, const geometry::Contact& wall, Real widest) {
  if (!(wall.distance > 0 && wall.distance < widest)) return std::nullopt;
  const Vec3 ray = (widest - wall.distance) * wall.normal;
  Box3 box(x, x);
  box.extend(x + ray);
  obstacles_.meeting(box, near_);
  Real nearest = 1;
  std::optional<Opposite> found;
  for (const Index k : near_) {
    const geometry::Obstacle& obstacle = obstacles_[k];
    const geometry::RigidPose& pose = obstacle.motion.to();
    const auto hit = geometry::sweep(obstacle.shape, pose.body(x), pose.body(x + ray), 0);
    if (!hit || hit->time >= nearest) continue;
    nearest = hit->time;
    found.reset();
    if ((pose.orientation * hit->normal).dot(wall.normal) < -kFacing) found = Opposite{wall.distance + hit->time * ray.norm(), obstacle.surface};
  }
  return found;
}

}  // namespace effuse::flow::sph
