#include "flow/sph/solids.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "flow/sph/particle_arrays.h"
#include "flow/sph/wall_backing.h"
#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/unstable_at.h"
#include "geometry/base/zones.h"
#include "geometry/collide/swept.h"

namespace effuse::flow::sph {

using geometry::Contact;

namespace {
Box3 widened(Box3 box, Real by) {
  if (box.isEmpty()) return box;
  return {box.min() - Vec3::Constant(by), box.max() + Vec3::Constant(by)};
}

/// Makes it so many times as heavy.
void weigh(Movable& body, Real times) {
  body.inverse_mass /= times;
  body.inverse_inertia /= times;
}

constexpr std::size_t kBlock = 64;  // particles that ask together first; they lie in memory as in space
constexpr Real kAway = 0.5;          // cosine: faces of the two sides of a plate look away from each other
constexpr std::size_t kFew = 16;    // obstacles near a block that each of its particles asks by itself

/// Fills near with the numbers k, rising, of `count` boxes box(k) that meet the box place(obstacle), grown by `by` [m], of any obstacle (or
/// whose block meets more than kFew).
template <class BoxOf, class Place>
void find_near(const geometry::Obstacles& obstacles, std::size_t count, Real by, BoxOf&& box, Place&& place, std::vector<std::uint8_t>& flags, std::vector<Index>& near) {
  near.clear();
  std::vector<Box3> blocks((count + kBlock - 1) / kBlock);
  parallel_ranges(count, kBlock, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) blocks[begin / kBlock].extend(box(k));
  });
  // All of them first: one question, where every obstacle is far.
  Box3 all;
  for (const Box3& block : blocks) all.extend(block);
  if (!all.intersects(widened(obstacles.swept_bounds(), by))) return;
  std::vector<Index> any;
  obstacles.meeting(widened(all, by), any);
  if (any.empty()) return;
  flags.assign(count, 0);
  parallel_ranges(count, kBlock, [&](std::size_t begin, std::size_t end) {
    std::vector<Index> meeting;
    obstacles.meeting(widened(blocks[begin / kBlock], by), meeting);
    if (meeting.empty()) return;
    std::array<Box3, kFew> boxes;
    if (meeting.size() <= kFew)
      for (std::size_t m = 0; m < meeting.size(); ++m) boxes[m] = widened(place(meeting[m]), by);
    for (std::size_t k = begin; k < end; ++k)
      flags[k] = meeting.size() > kFew || std::any_of(boxes.begin(), boxes.begin() + static_cast<std::ptrdiff_t>(meeting.size()), [&](const Box3& b) { return b.intersects(box(k)); });
  });
  for (std::size_t k = 0; k < count; ++k)
    if (flags[k]) near.push_back(static_cast<Index>(k));
}
}  // namespace

Solids::Solids(const SolidOptions& options, Real radius, Real mass, Real widest) : options_(options), radius_(radius), mass_(mass), widest_(widest) {
  CHECK_GT(radius, 0.0);
  for (const Real f : options.friction) CHECK(f >= 0 && f <= 1);
  for (const Real b : options.effusivity) CHECK(std::isfinite(b) && b >= 0);
  for (const SolidOptions::Deforming& each : options.deforming) {
    CHECK(each.solid && options.obstacles && options.obstacles->holds(each.obstacle));
    pressed_.emplace_back().solid = each.solid;
    pressed_.back().surface = (*options.obstacles)[each.obstacle].surface;
    drawn_.emplace_back().version = each.solid->surface_version();
    each.solid->surface().gather(each.solid->places(), drawn_.back().vertices);
    CHECK_EQ(drawn_.back().vertices.size(), (*options.obstacles)[each.obstacle].shape.mesh().positions.size());
  }
}

void Solids::restart(Real dt) {
  movable_ = before_;
  for (Movable& body : movable_) body.velocity += dt * body.acceleration;
  for (Pressed& solid : pressed_) {
    if (!solid.near) continue;
    if (predicted_ != dt) solid.solid->predict(dt, solid.free, solid.answer);
    solid.velocity = solid.free;
    solid.solid->surface().gather(solid.velocity, solid.vertices);
  }
  predicted_ = dt;
}

/// Of one that has been torn to its last triangle nothing is met any more; it still takes its steps.
bool Solids::leave_gone(std::size_t k) {
  const std::size_t number = options_.deforming[k].obstacle;
  if (!pressed_[k].solid->surface().triangles.empty()) return false;
  if (options_.obstacles->holds(number)) options_.obstacles->remove(number);
  return true;
}

/// Where the solid stands, with the velocities that it has.
void Solids::stand_pressed(std::size_t k, Real dt) {
  Pressed& solid = pressed_[k];
  Drawn& drawn = drawn_[k];
  const HungSurface& surface = solid.solid->surface();
  const std::span<const Vec3> v = solid.solid->velocities();
  solid.velocity.assign(v.begin(), v.end());
  surface.gather(solid.velocity, solid.vertices);
  solid.near = false;
  if (leave_gone(k)) return;
  std::vector<Vec3> at;
  surface.gather(solid.solid->places(), at);
  const bool anew = drawn.version != solid.solid->surface_version();
  options_.obstacles->deform(options_.deforming[k].obstacle, at, solid.vertices, dt, anew ? std::span<const geometry::Triangle>(surface.triangles) : std::span<const geometry::Triangle>());
  drawn = {solid.solid->surface_version(), std::move(at)};
  for (const Vec3& u : solid.vertices) fastest_ = std::max(fastest_, u.norm());
}

namespace {
std::string said(const std::string& name) { return name.empty() ? "a solid that deforms" : fmt::format("'{}'", name); }

/// Turned inside out it would draw the lava in that is near.
void check_volume(const geometry::Obstacle& obstacle, const std::string& name, const HungSurface& surface, std::span<const Vec3> at, Real time) {
  if (!obstacle.shape.solid()) return;
  Real volume = 0;
  Vec3 middle = Vec3::Zero();
  for (const Vec3& x : at) middle += x / static_cast<Real>(at.size());
  for (const auto& [a, b, c] : surface.triangles) volume += (at[a] - middle).dot((at[b] - middle).cross(at[c] - middle)) / 6;
  if (!(volume > 0)) throw UnstableAt(fmt::format("at t = {:.6g} s {} is pressed flat, or inside out, where lava is near, around ({:.6g}, {:.6g}, {:.6g}); a stiffer one would do", time, said(name), middle.x(), middle.y(), middle.z()), middle);
}

constexpr Real kWildest = 1e4;  // radii of a particle that a place of a solid may go in a step: what has blown up goes much further

/// It would take along whatever it meets.
void check_speed(const std::string& name, std::span<const Vec3> at, std::span<const Vec3> way, Real most, Real time) {
  for (std::size_t q = 0; q < at.size(); ++q)
    if (!(way[q].norm() <= most))  // not a number: too fast
      throw UnstableAt(fmt::format("at t = {:.6g} s {} goes {:.3g} m/s at ({:.6g}, {:.6g}, {:.6g}): a shorter step of its own, more damping or another scheme would do", time,
                                   said(name), way[q].norm(), at[q].x(), at[q].y(), at[q].z()), Vec3(at[q].cwiseMax(-1e6).cwiseMin(1e6)));
}
}  // namespace

/// The solid's own step, pressed by what the solves said, and its surface on its way.
void Solids::go_pressed(std::size_t k, Real time, Real dt) {
  Pressed& solid = pressed_[k];
  Drawn& drawn = drawn_[k];
  std::vector<Vec3> forces;
  if (solid.near && predicted_ > 0) {
    forces = solid.impulses();
    for (Vec3& force : forces) force /= dt;
  }
  solid.solid->go(time + dt, forces);
  if (leave_gone(k)) return;
  const bool anew = drawn.version != solid.solid->surface_version();
  const HungSurface& surface = solid.solid->surface();
  std::vector<Vec3> at, way;
  surface.gather(solid.solid->places(), at);
  if (solid.near && !anew) check_volume((*options_.obstacles)[options_.deforming[k].obstacle], options_.deforming[k].name, surface, at, time + dt);
  if (anew) {
    // It has broken: what it was no longer tells how each vertex came.
    surface.gather(solid.solid->velocities(), way);
  } else {
    way.resize(at.size());
    for (std::size_t q = 0; q < at.size(); ++q) way[q] = (at[q] - drawn.vertices[q]) / dt;
  }
  check_speed(options_.deforming[k].name, at, way, kWildest * radius_ / dt, time + dt);
  options_.obstacles->deform(options_.deforming[k].obstacle, at, way, dt, anew ? std::span<const geometry::Triangle>(surface.triangles) : std::span<const geometry::Triangle>());
  drawn = {solid.solid->surface_version(), std::move(at)};
}

void Solids::go(Real time, Real dt) {
  try {
    for (std::size_t k = 0; k < pressed_.size(); ++k) go_pressed(k, time, dt);
  } catch (...) {
    options_.obstacles->update();  // who reports it may ask where they are
    throw;
  }
  if (!movable_.empty() && options_.moved) {
    std::vector<Movable> moved = movable_;
    for (std::size_t b = 0; b < moved.size(); ++b) weigh(moved[b], 1 / heavier_[b]);
    options_.moved(moved, dt);
  }
  if (options_.move) options_.move(time, time + dt);
  if (!pressed_.empty()) options_.obstacles->update();
}

void Solids::stand(Real time, Real dt) {
  fastest_ = 0;
  before_.clear();
  if (options_.movable) options_.movable(before_);
  number_.clear();
  heavier_.clear();
  for (Movable& body : before_) {
    if (body.surface >= number_.size()) number_.resize(body.surface + 1, kNotMovable);
    number_[body.surface] = static_cast<Index>(heavier_.size());
    heavier_.push_back(std::max(1.0, mass_ * body.inverse_mass));
    weigh(body, heavier_.back());
  }
  movable_ = before_;
  predicted_ = 0;
  geometry::Obstacles& all = *options_.obstacles;
  for (std::size_t k = 0; k < pressed_.size(); ++k) stand_pressed(k, dt);
  if (!pressed_.empty()) all.update();
  if (!options_.move) return;
  if (options_.stand) {
    options_.stand(time, dt);
  } else {
    options_.move(time, time + dt);
    for (std::size_t i = 0; i < all.size(); ++i)
      if (all.holds(i) && !all[i].deforms()) all.move(i, all[i].motion.turned_back());
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
    if (all.holds(i) && all[i].moves()) all.move(i, geometry::RigidMotion(all[i].motion.to()));
  all.update();
}

void Solids::look_behind(std::span<const Vec3> x, Real reach, const Walls& ground) {
  ZONE("sph.solids.edges");
  backing_.assign(contacts_.size(), 1.0);
  across_.assign(contacts_.size(), kNothingAcross);
  parallel_ranges(near_.size(), 64, [&](std::size_t begin, std::size_t end) {
    WallBacking backing(*options_.obstacles, reach);
    for (std::size_t q = begin; q < end; ++q)
      for (std::size_t c = q * kMost; c < (q + 1) * kMost && contacts_[c].any(); ++c) {
        if (friction_of(contacts_[c].surface) == 0) continue;
        backing_[c] = backing.share(x[near_[q]], contacts_[c], ground[near_[q]]);
        if (const auto opposite = backing.opposite(x[near_[q]], contacts_[c], widest_)) {
          // Between a wall that holds lava and one that lets it slip lies half a channel between two that hold it.
          across_[c] = friction_of(opposite->surface) > 0 ? opposite->width : 2 * opposite->width;
        }
      }
  });
}

void Solids::add_walls(std::span<const Vec3> x, Real reach, Walls& walls) {
  ZONE("sph.solids");
  CHECK_EQ(walls.first.size(), x.size() + 1);
  speed_ = 0;
  if (!any()) return;
  find_near(*options_.obstacles, x.size(), reach, [&](std::size_t k) { return Box3(x[k], x[k]); },
            [&](Index o) { return geometry::placed_box((*options_.obstacles)[o].motion.to(), (*options_.obstacles)[o].shape.bounds()); }, flags_, near_);
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
  look_behind(x, reach, walls);
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
      const Index body = number_of(contact.surface);
      const Index solid = pressed_of(contact.surface);
      const bool moves = body != kNotMovable, bends = solid != kNotMovable;
      Vec3 arm = moves ? Vec3(contact.point - movable_[body].centre) : Vec3(Vec3::Zero());
      const Index triangle = bends ? triangle_of(solid, contact.point, arm) : kNotMovable;
      if (bends) pressed_[solid].near = true;
      merged_.walls[place++] = {.normal = contact.normal, .distance = contact.distance, .reach = contact.distance, .surface = contact.surface, .triangle = triangle,
                                .velocity = contact.surface_velocity, .temperature = contact.surface_temperature, .effusivity = effusivity_of(contact.surface), .friction = friction, .across = across_[q * kMost + c],
                                .mirrors = true, .movable = bends ? solid : body,
                                .arm = arm};
      speed_ = std::max(speed_, contact.surface_velocity.norm());
    }
    ++q;
  }
  merged_.first.back() = place;
  for (std::size_t k = 0; k < pressed_.size(); ++k)
    if (pressed_[k].near) know(k);
  std::swap(walls.first, merged_.first);
  std::swap(walls.walls, merged_.walls);
}

/// What the solves ask of a solid that is near.
void Solids::know(std::size_t k) {
  Pressed& solid = pressed_[k];
  const HungSurface& surface = solid.solid->surface();
  solid.triangles = (*options_.obstacles)[options_.deforming[k].obstacle].shape.mesh().triangles;
  solid.mobility.assign(surface.size(), 0);
  for (std::size_t q = 0; q < surface.size(); ++q)
    for (Index i = surface.first[q]; i < surface.first[q + 1]; ++i)
      if (!solid.solid->held()[surface.point[i]]) solid.mobility[q] += surface.weight[i] * surface.weight[i] / solid.solid->masses()[surface.point[i]];
}

Index Solids::pressed_of(Index surface) const {
  const auto each = std::find_if(pressed_.begin(), pressed_.end(), [&](const Pressed& p) { return p.surface == surface; });
  return each == pressed_.end() ? kNotMovable : static_cast<Index>(each - pressed_.begin());
}

/// The triangle of pressed_[k] that is nearest to a place, and the place on it.
Index Solids::triangle_of(std::size_t k, const Vec3& at, Vec3& weights) const {
  const geometry::CollisionMesh& shape = (*options_.obstacles)[options_.deforming[k].obstacle].shape;
  const auto nearest = shape.nearest(at);
  weights = shape.weights(nearest->triangle, nearest->point);
  return nearest->triangle;
}

void Solids::part(std::span<const Vec3> x, const Walls& walls, Neighbors& neighbors) {
  ZONE("sph.solids");
  if (!any() || near_.empty()) return;
  const geometry::Obstacles& obstacles = *options_.obstacles;
  // Each sees a face of the plate, and the other behind it. Round an edge they see faces that do not look away from each other.
  const auto on_two_sides = [&](Index i, Index j) {
    for (const Wall& mine : walls[i]) {
      if (!mine.mirrors || mine.reach + mine.normal.dot(x[j] - x[i]) >= 0) continue;
      for (const Wall& other : walls[j])
        if (other.mirrors && other.reach + other.normal.dot(x[i] - x[j]) < 0 && mine.normal.dot(other.normal) < -kAway) return true;
    }
    return false;
  };
  const auto stand_between = [&](Index i, Index j) {
    std::vector<Index> meeting;
    Box3 box(x[i], x[i]);
    box.extend(x[j]);
    obstacles.meeting(box, meeting);
    return std::any_of(meeting.begin(), meeting.end(), [&](Index o) {
      const geometry::RigidPose& pose = obstacles[o].motion.to();
      return geometry::sweep(obstacles[o].shape, pose.body(x[i]), pose.body(x[j]), 0).has_value();
    });
  };
  std::vector<std::vector<Index>> hidden(near_.size());  // of those with higher numbers
  parallel_for(near_.size(), [&](std::size_t q) {
    for (const Index j : neighbors[near_[q]])
      if (j > near_[q] && on_two_sides(near_[q], j) && stand_between(near_[q], j)) hidden[q].push_back(j);
  }, 64);
  // Who is hidden from whom, both ways, sorted.
  std::vector<std::uint64_t> pairs;
  const auto key = [](Index i, Index j) { return (static_cast<std::uint64_t>(i) << 32) | j; };
  for (std::size_t q = 0; q < near_.size(); ++q)
    for (const Index j : hidden[q]) {
      pairs.push_back(key(near_[q], j));
      pairs.push_back(key(j, near_[q]));
    }
  if (pairs.empty()) return;
  std::sort(pairs.begin(), pairs.end());
  std::vector<Index> which;
  for (const std::uint64_t pair : pairs)
    if (const auto i = static_cast<Index>(pair >> 32); which.empty() || which.back() != i) which.push_back(i);
  neighbors.drop(which, [&](std::size_t k, Index j) { return std::binary_search(pairs.begin(), pairs.end(), key(which[k], j)); });
  COUNT("sph.parted pairs", pairs.size() / 2);
}

bool Solids::disturbs(const Vec3& x, Real reach, Real speed) const {
  if (!any() || !widened(options_.obstacles->bounds(), reach).contains(x)) return false;
  std::array<Contact, kMost> found;
  const int n = options_.obstacles->contacts(x, reach, found);
  return std::any_of(found.begin(), found.begin() + n, [&](const Contact& c) { return c.surface_velocity.norm() > speed; });
}

geometry::SlideReport Solids::slide(std::span<const Index> which, std::span<const Vec3> before, std::span<Vec3> x, std::span<Vec3> v,
                                    std::vector<Vec3>* wanted) {
  ZONE("sph.solids");
  if (!any()) return {};
  find_near(*options_.obstacles, which.size(), 2 * radius_, [&](std::size_t k) { return Box3(before[which[k]].cwiseMin(x[which[k]]), before[which[k]].cwiseMax(x[which[k]])); },
            [&](Index o) { return options_.obstacles->swept_bounds(o); }, flags_, near_);
  if (near_.empty()) return {};
  if (wanted) wanted->assign(x.begin(), x.end());
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
    if (met_[q] != 0 && speed_at_[q] != v[near_[q]]) push(met_[q], mass_ * (v[near_[q]] - speed_at_[q]), at_[q]);
    x[near_[q]] = at_[q];
    v[near_[q]] = speed_at_[q];
  }
  return report;
}

/// What a particle stopped at a place has given a surface.
void Solids::push(Index surface, const Vec3& impulse, const Vec3& at) {
  const Index k = pressed_of(surface);
  if (k == kNotMovable) {
    if (!options_.push) return;
    const Index body = number_of(surface);  // none: an obstacle, or a piece that came in this step
    const Real heavier = body != kNotMovable ? heavier_[body] : 1;
    options_.push(surface, impulse / heavier, heavier > 1 ? before_[body].centre : at);
    return;
  }
  Vec3 weights;
  const Index triangle = triangle_of(k, at, weights);
  Deformable& solid = *pressed_[k].solid;
  const HungSurface& hung = solid.surface();
  for (int c = 0; c < 3; ++c) {
    const Index q = (*options_.obstacles)[options_.deforming[k].obstacle].shape.mesh().triangles[triangle][static_cast<std::size_t>(c)];
    for (Index i = hung.first[q]; i < hung.first[q + 1]; ++i) solid.push(hung.point[i], weights[c] * hung.weight[i] * impulse);
  }
}

void Solids::warm(std::span<const Index> touches, std::span<const Real> given, std::span<const Real> temperature) {
  if (!options_.heated) return;
  std::vector<Real> heat(1, 0.0), hottest(1, 0.0);
  for (std::size_t i = 0; i < given.size(); ++i) {
    if (given[i] == 0 && temperature[i] == 0) continue;
    if (touches[i] >= heat.size()) {
      heat.resize(touches[i] + 1, 0.0);
      hottest.resize(heat.size(), 0.0);
    }
    heat[touches[i]] += given[i];
    hottest[touches[i]] = std::max(hottest[touches[i]], temperature[i]);
  }
  options_.heated(heat, hottest);
}

std::size_t Solids::memory() const {
  const auto bytes = [](const auto&... vectors) { return ((vectors.capacity() * sizeof(vectors[0])) + ...); };
  return bytes(near_, at_, way_, speed_at_, contacts_, backing_, across_, count_, flags_, merged_.first, merged_.walls);
}

}  // namespace effuse::flow::sph
