#include "flow/effects/met_things.h"

#include <algorithm>

namespace effuse::flow {

using geometry::RigidMotion;
using geometry::RigidPose;

MetThings::MetThings(const World& world) {
  const auto number = [&] { return static_cast<Index>(obstacles_.size() + 1); };
  if (world.obstacles)
    for (const PlacedObstacle& each : *world.obstacles) {
      obstacles_.add({each.shape, RigidMotion{each.track.at(0), each.track.at(0), 1}, each.temperature, number()});
      tracks_.push_back(each.track);
    }
  if (!world.bodies) return;
  for (std::size_t b = 0; b < world.bodies->size(); ++b) {
    const PlacedBody& each = (*world.bodies)[b];
    if (each.cells) continue;
    obstacles_.add({geometry::CollisionMesh(each.mesh), RigidMotion{each.pose, each.pose, 1}, each.temperature, number()});
    bodies_.push_back(b);
    to_.push_back(each.pose);
  }
  from_ = to_;
}

void MetThings::meet(const std::vector<Effect*>& others) {
  for (const Effect* other : others)
    if (!bodies_.empty() && !mover_ && !other->body_poses().empty()) mover_ = other;
}

/// The bodies as their effect has them now, if it has moved on.
void MetThings::look() {
  if (!mover_ || mover_->time() == to_time_) return;
  const std::vector<RigidPose> poses = mover_->body_poses();
  from_ = to_;
  from_time_ = to_time_;
  to_time_ = mover_->time();
  for (std::size_t k = 0; k < bodies_.size(); ++k) to_[k] = poses[bodies_[k]];
}

void MetThings::move(Real t, Real dt) {
  if (obstacles_.empty()) return;
  look();
  const Real way = dt > 0 ? dt : 1;
  for (std::size_t k = 0; k < tracks_.size(); ++k) obstacles_.move(k, {tracks_[k].at(t), tracks_[k].at(t + dt), way});
  const auto at = [&](std::size_t k, Real time) {
    const Real u = to_time_ > from_time_ ? std::clamp((time - from_time_) / (to_time_ - from_time_), 0.0, 1.0) : 1;
    return RigidPose{from_[k].position + u * (to_[k].position - from_[k].position), from_[k].orientation.slerp(u, to_[k].orientation)};
  };
  for (std::size_t k = 0; k < bodies_.size(); ++k) obstacles_.move(tracks_.size() + k, {at(k, t), at(k, t + dt), way});
  obstacles_.update();
}

void MetThings::add_planes(const geometry::Terrain* terrain, std::span<const Vec3> x, Real reach, Real thickness, std::vector<PlaneContact>& out) {
  const auto take = [&](int per_point) {
    for (std::size_t q = 0; q < found_.size(); ++q) {
      const std::size_t i = q / static_cast<std::size_t>(per_point);
      const geometry::Contact& c = found_[q];
      if (c.any()) out.push_back({static_cast<Index>(i), Vec3(x[i] + (thickness - c.distance) * c.normal), c.normal, c.surface_velocity});
    }
  };
  if (terrain) {
    found_.resize(x.size());
    terrain->contacts(x, reach, found_);
    take(1);
  }
  if (obstacles_.empty()) return;
  constexpr int kPerPoint = 3;
  found_.resize(kPerPoint * x.size());
  obstacles_.contacts(x, reach, kPerPoint, found_);
  take(kPerPoint);
}

void MetThings::save(StateWriter& out) const {
  out.value("bodies_from", from_time_);
  out.value("bodies_to", to_time_);
  std::vector<Real> numbers;
  for (const auto* poses : {&from_, &to_})
    for (const RigidPose& p : *poses) numbers.insert(numbers.end(), {p.position.x(), p.position.y(), p.position.z(), p.orientation.w(), p.orientation.x(), p.orientation.y(), p.orientation.z()});
  out.array("bodies_poses", numbers);
}

void MetThings::load(StateReader& in) {
  std::vector<Real> v;
  in.value("bodies_from", from_time_);
  in.value("bodies_to", to_time_);
  in.array("bodies_poses", v);
  if (v.size() != 14 * bodies_.size()) throw InputError(Place{"bodies"}, "the checkpoint holds another number of bodies");
  std::size_t at = 0;
  for (auto* poses : {&from_, &to_})
    for (RigidPose& p : *poses) {
      p = {Vec3(v[at], v[at + 1], v[at + 2]), Quat(v[at + 3], v[at + 4], v[at + 5], v[at + 6])};
      at += 7;
    }
}

}  // namespace effuse::flow
