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

constexpr std::size_t kBlock = 64;  // particles that ask together first; they lie in memory as in space
constexpr std::size_t kFew = 16;    // obstacles near a block that each of its particles asks by itself

/// Fills near with the numbers k, rising, of `count` boxes box(k) that meet the box place(obstacle), grown by `by` [m], of any obstacle (or
/// whose block meets more than kFew).
template <class BoxOf, class Place>
void find_near(const geometry::Obstacles& obstacles, std::size_t count, Real by, BoxOf&& box, Place&& place, std::vector<std::uint8_t>& flags, std::vector<Index>& near) {
  flags.assign(count, 0);
  const Box3 everything = widened(obstacles.swept_bounds(), by);
  parallel_ranges(count, kBlock, [&](std::size_t begin, std::size_t end) {
    Box3 block;
    for (std::size_t k = begin; k < end; ++k) block.extend(box(k));
    if (!block.intersects(everything)) return;
    std::vector<Index> meeting;
    obstacles.meeting(widened(block, by), meeting);
    if (meeting.empty()) return;
    std::array<Box3, kFew> boxes;
    if (meeting.size() <= kFew)
      for (std::size_t m = 0; m < meeting.size(); ++m) boxes[m] = widened(place(obstacles[meeting[m]]), by);
    for (std::size_t k = begin; k < end; ++k)
      flags[k] = meeting.size() > kFew || std::any_of(boxes.begin(), boxes.begin() + static_cast<std::ptrdiff_t>(meeting.size()), [&](const Box3& b) { return b.intersects(box(k)); });
  });
  near.clear();
  for (std::size_t k = 0; k < count; ++k)
    if (flags[k]) near.push_back(static_cast<Index>(k));
}

/// Rays to the half-space beyond a wall's plane, to a ring in the midst of what adds to the drag along the plane (BoundaryTable's drag_t).
constexpr int kAzimuths = 8;
constexpr Real kDeep = 0.3;      // of the way from the plane to the end of reach: the ring's depth
constexpr Real kWide = 0.65;     // of the reach's circle there: its radius
constexpr Real kDragging = 0.6;  // of the reach: walls further off drag by a few hundredths of what near ones do, edges or not
constexpr Real kRing = 0.7;      // of the plane's circle in reach: where few rays look first

/// What stands around a particle, for its walls' backing.
class Backing {
 public:
  Backing(const geometry::Obstacles& obstacles, Real reach) : obstacles_(obstacles), reach_(reach) {}

  /// Share of a wall's half-space that is hidden from x by obstacles, or lies in the ground: 1 but beside convex edges.
  Real share(const Vec3& x, const Contact& wall, std::span<const Wall> ground) {
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

 private:
  static constexpr Real kBelow = 0.01;    // of the distance: just through the plane
  static constexpr Real kFarSide = 0.7;   // cosine between a wall's sides

  /// deep: a ray that may come out of the solid again.
  bool hidden(const Vec3& x, const Vec3& ray, std::span<const Wall> ground, bool deep) const {
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
    for (std::size_t i = 0; i < all.size(); ++i)
      if (all.holds(i)) all.move(i, all[i].motion.turned_back());
    all.update();
  }
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!all.holds(i)) continue;
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
    if (all.holds(i) && all[i].motion.moves()) all.move(i, geometry::RigidMotion(all[i].motion.to()));
  all.update();
}

Real Solids::friction_of(Index surface) const {
  if (options_.friction_by) return options_.friction_by(surface);
  return surface < options_.friction.size() ? options_.friction[surface] : 1;
}

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
  find_near(*options_.obstacles, x.size(), reach, [&](std::size_t k) { return Box3(x[k], x[k]); },
            [](const geometry::Obstacle& o) { return geometry::placed_box(o.motion.to(), o.shape.bounds()); }, flags_, near_);
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
  find_near(*options_.obstacles, which.size(), 2 * radius_, [&](std::size_t k) { return Box3(before[which[k]].cwiseMin(x[which[k]]), before[which[k]].cwiseMax(x[which[k]])); },
            [](const geometry::Obstacle& o) { return o.motion.swept_box(o.shape.bounds()); }, flags_, near_);
  if (near_.empty()) return {};
  for (Index& k : near_) k = which[k];
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
  return bytes(near_, at_, way_, speed_at_, contacts_, backing_, count_, flags_, merged_.first, merged_.walls);
}

}  // namespace effuse::flow::sph
