#include "geometry/collide/obstacles.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "geometry/collide/collision_mesh_internal.h"
#include "geometry/collide/obstacles_internal.h"

namespace effuse::geometry {

Obstacles::Obstacles() : impl_(std::make_unique<Impl>()) {}
Obstacles::~Obstacles() = default;
Obstacles::Obstacles(Obstacles&&) noexcept = default;
Obstacles& Obstacles::operator=(Obstacles&&) noexcept = default;

std::size_t Obstacles::add(Obstacle obstacle) {
  const std::size_t number = impl_->all.size();
  impl_->all.emplace_back(std::move(obstacle));
  impl_->place.emplace_back();
  impl_->changed.push_back(static_cast<Index>(number));
  ++impl_->left;
  return number;
}

void Obstacles::move(std::size_t i, const RigidMotion& motion) {
  CHECK_LT(i, size());
  CHECK(impl_->all[i].has_value());
  impl_->all[i]->motion = motion;
  impl_->changed.push_back(static_cast<Index>(i));
}

Vec3 Obstacle::velocity_at(Index triangle, const Vec3& point) const {
  if (!deforms()) return motion.velocity_at(point, 1);
  if (motion.duration() == 0) return Vec3::Zero();
  const Triangle& t = shape.mesh().triangles[triangle];
  const Vec3 w = shape.weights(triangle, point);
  return w[0] * velocity[t[0]] + w[1] * velocity[t[1]] + w[2] * velocity[t[2]];
}

void Obstacles::deform(std::size_t i, std::span<const Vec3> positions, std::span<const Vec3> velocities, Real duration, std::span<const Triangle> triangles) {
  CHECK_LT(i, size());
  CHECK(impl_->all[i].has_value());
  CHECK_EQ(velocities.size(), positions.size());
  Obstacle& o = *impl_->all[i];
  const auto anew = [&](std::span<const Triangle> faces) {
    TriMesh mesh;
    mesh.positions.assign(positions.begin(), positions.end());
    mesh.triangles.assign(faces.begin(), faces.end());
    o.shape = CollisionMesh(mesh);
    CHECK_EQ(o.shape.mesh().positions.size(), positions.size());
  };
  const std::vector<Vec3>& now = o.shape.mesh().positions;
  const bool elsewhere = !std::equal(now.begin(), now.end(), positions.begin(), positions.end());
  if (!triangles.empty()) anew(triangles);
  else if (elsewhere && !o.shape.follow(positions)) anew(std::vector<Triangle>(o.shape.impl().triangles));  // also those without area: they close it
  o.velocity.assign(velocities.begin(), velocities.end());
  o.motion = RigidMotion({}, {}, duration);
  impl_->changed.push_back(static_cast<Index>(i));
}

void Obstacles::set_temperature(std::size_t i, Real kelvin) {
  CHECK_LT(i, size());
  CHECK(impl_->all[i].has_value());
  impl_->all[i]->temperature = kelvin;
}

void Obstacles::remove(std::size_t i) {
  CHECK_LT(i, size());
  if (!impl_->all[i]) return;
  impl_->all[i].reset();
  impl_->changed.push_back(static_cast<Index>(i));
  --impl_->left;
}

void Obstacles::update() {
  if (impl_->changed.empty()) return;
  for (const Index i : impl_->changed) {
    Impl::Place& place = impl_->place[i];
    const auto& obstacle = impl_->all[i];
    place.there = obstacle.has_value();
    if (!obstacle) {
      impl_->boxes.remove(i);
      continue;
    }
    place.now = placed_box(obstacle->motion.to(), obstacle->shape.bounds());
    place.swept = obstacle->motion.swept_box(obstacle->shape.bounds());
    for (std::size_t v = 0; v < obstacle->velocity.size(); ++v) place.swept.extend(Vec3(obstacle->shape.mesh().positions[v] - obstacle->motion.duration() * obstacle->velocity[v]));
    impl_->boxes.set(i, place.swept);
  }
  impl_->changed.clear();
  if (impl_->boxes.changed()) impl_->tree = impl_->boxes.flat();
  impl_->now = impl_->swept = Box3();
  for (const Impl::Place& place : impl_->place) {
    if (!place.there) continue;
    impl_->now.extend(place.now);
    impl_->swept.extend(place.swept);
  }
}

std::size_t Obstacles::size() const { return impl_->all.size(); }
bool Obstacles::empty() const { return impl_->left == 0; }

bool Obstacles::holds(std::size_t i) const { return i < size() && impl_->all[i].has_value(); }

const Obstacle& Obstacles::operator[](std::size_t i) const {
  CHECK_LT(i, size());
  CHECK(impl_->all[i].has_value());
  return *impl_->all[i];
}

Box3 Obstacles::bounds() const {
  CHECK(impl_->up_to_date());
  return impl_->now;
}

Box3 Obstacles::swept_bounds() const {
  CHECK(impl_->up_to_date());
  return impl_->swept;
}

Box3 Obstacles::swept_bounds(std::size_t i) const {
  CHECK(impl_->up_to_date());
  CHECK(holds(i));
  return impl_->place[i].swept;
}

void Obstacles::meeting(const Box3& box, std::vector<Index>& out) const {
  CHECK(impl_->up_to_date());
  out.clear();
  impl_->tree.meeting(box, [&](Index i) {
    if (impl_->place[i].swept.intersects(box)) out.push_back(i);
    return true;
  });
  std::sort(out.begin(), out.end());
}

int Obstacles::contacts(const Vec3& point, Real reach, std::span<Contact> out) const {
  CHECK(impl_->up_to_date());
  std::fill(out.begin(), out.end(), Contact{});
  // One box test, where nothing is near; false for NaN too.
  if (out.empty() || !(impl_->now.squaredExteriorDistance(point) <= reach * reach)) return 0;

  CHECK_LE(out.size(), NearestContacts::kMost);
  NearestContacts nearest(out);
  impl_->tree.nearest(point, reach * reach, [&](Index i, Real& limit2) {
    const Obstacle& obstacle = *impl_->all[i];
    const Real gap2 = impl_->place[i].now.squaredExteriorDistance(point);
    if (gap2 > limit2) return;
    // In its box the point may be in itself, deeper than any other is away.
    const auto found = obstacle.shape.nearest(obstacle.motion.to().body(point), gap2 > 0 ? std::min(reach, std::sqrt(limit2) * (1 + 1e-12)) : reach);
    if (!found) return;
    nearest.add(*found, obstacle, i);
    if (nearest.full()) {
      const Real furthest = std::max(Real{0}, out.back().distance);
      limit2 = std::min(limit2, furthest * furthest);
    }
  });
  return static_cast<int>(nearest.count());
}

void Obstacles::contacts(std::span<const Vec3> points, Real reach, int per_point, std::span<Contact> out) const {
  ZONE("collide.contacts");
  CHECK_GE(per_point, 1);
  const auto each = static_cast<std::size_t>(per_point);
  CHECK_EQ(out.size(), points.size() * each);
  CHECK_GE(reach, 0.0);
  parallel_for(points.size(), [&](std::size_t i) { contacts(points[i], reach, out.subspan(i * each, each)); }, 512);
}

}  // namespace effuse::geometry
