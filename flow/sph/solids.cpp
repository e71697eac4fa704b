#include "flow/sph/solids.h"

#include <algorithm>
#include <array>

#include "flow/sph/particle_arrays.h"
#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::sph {

using geometry::Contact;

namespace {
Box3 widened(Box3 box, Real by) {
  if (box.isEmpty()) return box;
  return {box.min() - Vec3::Constant(by), box.max() + Vec3::Constant(by)};
}
}  // namespace

Solids::Solids(const SolidOptions& options, Real radius, Real mass) : options_(options), radius_(radius), mass_(mass) {
  CHECK_GT(radius, 0.0);
  for (const Real f : options.friction) CHECK(f >= 0 && f <= 1);
}

void Solids::restart(Real dt) {
  movable_ = before_;
  for (Movable& body : movable_) body.velocity += dt * body.acceleration;
}

void Solids::go(Real time, Real dt) {
  if (!movable_.empty() && options_.moved) options_.moved(movable_, dt);
  if (options_.move) options_.move(time, time + dt);
}

void Solids::stand(Real time, Real dt) {
  fastest_ = 0;
  before_.clear();
  if (options_.movable) options_.movable(before_);
  movable_ = before_;
  if (!options_.move) return;
  geometry::Obstacles& all = *options_.obstacles;
  if (options_.stand) {
    options_.stand(time, dt);
  } else {
    options_.move(time, time + dt);
    for (std::size_t i = 0; i < all.size(); ++i) all.move(i, all[i].motion.turned_back());
    all.update();
  }
  for (std::size_t i = 0; i < all.size(); ++i) {
    const geometry::RigidMotion& motion = all[i].motion;
    if (!motion.moves() || motion.duration() == 0) continue;
    // Around the frame's origin no point of the shape is farther out than its box's corners.
    const Box3& box = all[i].shape.bounds();
    const Real radius = box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).norm();
    fastest_ = std::max(fastest_, (motion.shift().norm() + motion.turn().norm() * radius) / motion.duration());
  }
}

void Solids::rest() {
  geometry::Obstacles& all = *options_.obstacles;
  for (std::size_t i = 0; i < all.size(); ++i)
    if (all[i].motion.moves()) all.move(i, geometry::RigidMotion(all[i].motion.to()));
  all.update();
}

void Solids::add_walls(std::span<const Vec3> x, Real reach, Walls& walls) {
  ZONE("sph.solids");
  CHECK_EQ(walls.first.size(), x.size() + 1);
  speed_ = 0;
  if (!any()) return;
  const Box3 box = widened(options_.obstacles->bounds(), reach);
  select(x.size(), [&](std::size_t k) { return box.contains(x[k]); }, near_);
  if (near_.empty()) return;
  const std::size_t n = near_.size();
  at_.resize(n);
  contacts_.resize(n * kMost);
  for (std::size_t q = 0; q < n; ++q) at_[q] = x[near_[q]];
  options_.obstacles->surroundings(at_, reach, kMost, contacts_);
  COUNT("sph.solid queries", n);

  // The lists anew, the obstacles' walls behind the ground's.
  count_.assign(x.size(), 0);
  std::size_t added = 0;
  for (std::size_t q = 0; q < n; ++q)
    for (int k = 0; k < kMost && contacts_[q * kMost + static_cast<std::size_t>(k)].any(); ++k) {
      ++count_[near_[q]];
      ++added;
    }
  if (added == 0) return;
  merged_.first.resize(x.size() + 1);
  merged_.walls.resize(walls.walls.size() + added);
  std::size_t q = 0;
  Index place = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    merged_.first[k] = place;
    for (const Wall& wall : walls[k]) merged_.walls[place++] = wall;
    if (q == n || near_[q] != k) continue;
    for (Index c = 0; c < count_[k]; ++c) {
      const Contact& contact = contacts_[q * kMost + c];
      const Real friction = contact.surface < options_.friction.size() ? options_.friction[contact.surface] : 1;
      const auto body = std::find_if(movable_.begin(), movable_.end(), [&](const Movable& m) { return m.surface == contact.surface; });
      const bool moves = body != movable_.end();
      merged_.walls[place++] = {.normal = contact.normal, .distance = contact.distance, .reach = contact.distance, .surface = contact.surface,
                                .velocity = contact.surface_velocity, .temperature = contact.surface_temperature, .friction = friction,
                                .mirrors = true, .movable = moves ? static_cast<Index>(body - movable_.begin()) : kNotMovable,
                                .arm = moves ? Vec3(contact.point - body->centre) : Vec3::Zero()};
      speed_ = std::max(speed_, contact.surface_velocity.norm());
    }
    ++q;
  }
  merged_.first.back() = place;
  std::swap(walls.first, merged_.first);
  std::swap(walls.walls, merged_.walls);
}

bool Solids::disturbs(const Vec3& x, Real reach, Real speed) const {
  if (!any() || !widened(options_.obstacles->bounds(), reach).contains(x)) return false;
  std::array<Contact, kMost> found;
  const int n = options_.obstacles->contacts(x, reach, found);
  return std::any_of(found.begin(), found.begin() + n, [&](const Contact& c) { return c.surface_velocity.norm() > speed; });
}

geometry::SlideReport Solids::slide(std::span<const Index> which, std::span<const Vec3> before, std::span<Vec3> x, std::span<Vec3> v) {
  ZONE("sph.solids");
  if (!any()) return {};
  const Box3 box = widened(options_.obstacles->swept_bounds(), radius_);
  near_.clear();
  for (const Index i : which)
    if (box.intersects(Box3(before[i].cwiseMin(x[i]), before[i].cwiseMax(x[i])))) near_.push_back(i);
  if (near_.empty()) return {};
  const std::size_t n = near_.size();
  for (auto* array : {&at_, &way_, &speed_at_}) array->resize(n);
  for (std::size_t q = 0; q < n; ++q) {
    at_[q] = before[near_[q]];
    way_[q] = x[near_[q]] - at_[q];
    speed_at_[q] = v[near_[q]];
  }
  met_.assign(n, 0);
  const geometry::SlideReport report = geometry::slide_all(*options_.obstacles, at_, way_, speed_at_, std::span(&radius_, 1), {}, met_);
  for (std::size_t q = 0; q < n; ++q) {
    if (met_[q] != 0 && options_.push && speed_at_[q] != v[near_[q]]) options_.push(met_[q], mass_ * (v[near_[q]] - speed_at_[q]), at_[q]);
    x[near_[q]] = at_[q];
    v[near_[q]] = speed_at_[q];
  }
  return report;
}

std::size_t Solids::memory() const {
  const auto bytes = [](const auto&... vectors) { return ((vectors.capacity() * sizeof(vectors[0])) + ...); };
  return bytes(near_, at_, way_, speed_at_, contacts_, count_, merged_.first, merged_.walls);
}

}  // namespace effuse::flow::sph
