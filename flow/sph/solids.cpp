#include "flow/sph/solids.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "flow/sph/particle_arrays.h"
#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "geometry/collide/swept.h"

namespace effuse::flow::sph {

using geometry::Contact;

namespace {
Box3 widened(Box3 box, Real by) {
  if (box.isEmpty()) return box;
  return {box.min() - Vec3::Constant(by), box.max() + Vec3::Constant(by)};
}

/// Rays to the half-space beyond a wall's plane: azimuths, and a 2 x 2 midpoint rule over depth and distance from the foot, weighted by
/// what there adds to the drag along the plane (BoundaryTable's drag_t).
constexpr int kAzimuths = 8, kParts = 2;
constexpr Real kRing = 0.7;  // of the plane's circle in reach: where few rays look first

/// What stands around a particle, for its walls' backing.
class Backing {
 public:
  Backing(const geometry::Obstacles& obstacles, Real reach) : obstacles_(obstacles), reach_(reach) {}

  /// Share of a wall's half-space that is hidden from x by obstacles, or lies in the ground: 1 but beside convex edges.
  Real share(const Vec3& x, const Contact& wall, std::span<const Wall> ground) {
    const Real d = wall.distance;
    if (!(d > 0)) return 1;
    obstacles_.meeting(Box3(x - Vec3::Constant(reach_), x + Vec3::Constant(reach_)), near_);
    const Vec3 first = wall.normal.unitOrthogonal(), second = wall.normal.cross(first);
    const auto behind = [&](Real azimuth, Real depth, Real off) {
      return hidden(x, (off * std::cos(azimuth)) * first + (off * std::sin(azimuth)) * second - depth * wall.normal, ground);
    };
    const Real circle = std::sqrt(std::max(reach_ * reach_ - d * d, 0.0));
    bool whole = true;
    for (int a = 0; a < 4 && whole; ++a) whole = behind(a * kPi / 2 + kPi / 7, (1 + kBelow) * d, kRing * circle);
    if (whole) return 1;
    Real hit = 0, all = 0;
    for (int i = 0; i < kParts; ++i) {
      const Real depth = d + (i + 0.5) / kParts * (reach_ - d), widest = std::sqrt(reach_ * reach_ - depth * depth);
      for (int j = 0; j < kParts; ++j) {
        const Real off = (j + 0.5) / kParts * widest, p = 1 - (depth * depth + off * off) / (reach_ * reach_);
        const Real weight = p * p * depth * off * off * off * widest;
        for (int a = 0; a < kAzimuths; ++a) {
          all += weight;
          if (behind((a + 0.5) * 2 * kPi / kAzimuths, depth, off)) hit += weight;
        }
      }
    }
    return all > 0 ? hit / all : 1;
  }

 private:
  static constexpr Real kBelow = 0.01;  // of the distance: just through the plane

  bool hidden(const Vec3& x, const Vec3& ray, std::span<const Wall> ground) const {
    for (const Wall& wall : ground)
      if (wall.distance + wall.normal.dot(ray) < 0) return true;
    return std::any_of(near_.begin(), near_.end(), [&](Index k) {
      const geometry::Obstacle& obstacle = obstacles_[k];
      const geometry::RigidPose& pose = obstacle.motion.to();
      return geometry::sweep(obstacle.shape, pose.body(x), pose.body(x + ray), 0).has_value();
    });
  }

  const geometry::Obstacles& obstacles_;
  Real reach_;
  std::vector<Index> near_;
};
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

Real Solids::friction_of(Index surface) const { return surface < options_.friction.size() ? options_.friction[surface] : 1; }

void Solids::find_backing(std::span<const Vec3> x, Real reach, const Walls& ground) {
  ZONE("sph.solids.edges");
  backing_.assign(contacts_.size(), 1.0);
  parallel_ranges(near_.size(), 64, [&](std::size_t begin, std::size_t end) {
    Backing backing(*options_.obstacles, reach);
    for (std::size_t q = begin; q < end; ++q)
      for (std::size_t c = q * kMost; c < (q + 1) * kMost && contacts_[c].any(); ++c)
        if (friction_of(contacts_[c].surface) > 0) backing_[c] = backing.share(x[near_[q]], contacts_[c], ground[near_[q]]);
  });
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
  find_backing(x, reach, walls);
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
      const Real friction = backing_[q * kMost + c] * friction_of(contact.surface);
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
  return bytes(near_, at_, way_, speed_at_, contacts_, backing_, count_, merged_.first, merged_.walls);
}

}  // namespace effuse::flow::sph
