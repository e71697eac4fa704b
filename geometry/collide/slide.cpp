#include "geometry/collide/slide.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <list>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "geometry/collide/least_change.h"
#include "geometry/collide/obstacles_internal.h"
#include "geometry/collide/swept_internal.h"

namespace effuse::geometry {

namespace {

constexpr Real kTouch = 1 + 1.0 / 64;     // nearer than so many radii is touching: further than a chord may stop it
constexpr Real kKeep = 63.0 / 64;         // share of its distance that who touches keeps at least
constexpr Real kNoRoom = 0x1p-20;         // of the radius: less is none
constexpr int kMoreRounds = 64;           // for being carried and squeezed
constexpr Real kOutrun = 16;              // squeezed out of a closing wedge it gets at most so much faster than it closes
constexpr std::size_t kMostTouches = 10;

/// A surface that the particle touches.
struct Touch {
  Index obstacle = 0, triangle = 0;
  Vec3 normal = Vec3::UnitZ(), point = Vec3::Zero();  // in the world
  Real distance = 0;
};

/// A triangle that was met, and at what distance.
struct Met {
  Index obstacle = 0, triangle = 0;
  Real distance = 0;
};

struct Scratch {
  std::vector<Index> near, ahead;
  std::vector<Touch> touches;
  std::vector<Met> met;
  std::vector<Index> passed;      // obstacles that no longer hold it: started inside, or crushed by
  std::vector<HalfSpace> bounds;
  std::list<std::pair<Index, RigidMotion>> led;  // of obstacles that deform, as this particle sees them
};

Box3 around(const Vec3& x, Real r) { return {x - Vec3::Constant(r), x + Vec3::Constant(r)}; }

/// One particle on its way through one step.
class Sliding {
 public:
  Sliding(const Obstacles& obstacles, Real r, const SlideOptions& options, Scratch& scratch)
      : obstacles_(obstacles), options_(options), r_(r), room_(r), scratch_(scratch) {}
  Slid go(const Vec3& x, const Vec3& dx, const Vec3& v);

 private:
  const Obstacle& at(Index k) const { return *obstacles_.impl().all[k]; }
  const RigidMotion& motion(Index k);
  bool passed(Index k) const { return std::find(scratch_.passed.begin(), scratch_.passed.end(), k) != scratch_.passed.end(); }
  /// Of a point of obstacle k, in the whole step [m].
  Vec3 step_velocity(Index k, const Vec3& world) {
    const RigidMotion& m = motion(k);
    return m.shift() + m.turn().cross(world - (m.from().position + s_ * m.shift()));
  }
  /// Of its place [m/s].
  Vec3 velocity_at(const Touch& touch) {
    const RigidMotion& m = motion(touch.obstacle);
    return at(touch.obstacle).deforms() ? at(touch.obstacle).velocity_at(touch.triangle, m.pose(s_).body(touch.point)) : m.velocity_at(touch.point, s_);
  }
  std::optional<CollisionMesh::Nearest> nearest(Index k, const RigidPose& pose, const Vec3& x, Real reach) const;
  void find_touches();
  bool respond();
  void give_way();
  Path path();
  bool advance(const Path& path);
  void settle();

  const Obstacles& obstacles_;
  const SlideOptions& options_;
  Real r_, room_;
  Scratch& scratch_;
  Slid out_;
  Vec3 begin_ = Vec3::Zero();
  Vec3 wish_ = Vec3::Zero();  // [m] in a whole step
  Real s_ = 0;
  int last_ = -1;             // obstacle met last
  bool bounced_ = false;
};

std::optional<CollisionMesh::Nearest> Sliding::nearest(Index k, const RigidPose& pose, const Vec3& x, Real reach) const {
  const CollisionMesh& shape = at(k).shape;
  const Vec3 local = pose.body(x);
  // In the box of a solid it may be deep inside.
  if (shape.report().solids > 0 && shape.bounds().contains(local)) reach = std::numeric_limits<Real>::infinity();
  return shape.nearest(local, reach);
}

/// The obstacle's; of one that deforms the straight way of its place nearest to where the particle began.
const RigidMotion& Sliding::motion(Index k) {
  const Obstacle& obstacle = at(k);
  if (!obstacle.deforms()) return obstacle.motion;
  for (const auto& [number, led] : scratch_.led)
    if (number == k) return led;
  const auto place = obstacle.shape.nearest(begin_);
  const Vec3 way = obstacle.motion.duration() * obstacle.velocity_at(place->triangle, place->point);
  scratch_.led.emplace_back(k, RigidMotion({-way}, {}, obstacle.motion.duration()));
  return scratch_.led.back().second;
}

void Sliding::find_touches() {
  scratch_.touches.clear();
  const Real reach = kTouch * room_;
  obstacles_.meeting(around(out_.x, reach), scratch_.near);
  const auto add = [&](const Touch& touch) {
    for (const Touch& other : scratch_.touches)
      if (other.obstacle == touch.obstacle && other.normal.dot(touch.normal) > 1 - 1e-9) return;
    if (scratch_.touches.size() < kMostTouches) scratch_.touches.push_back(touch);
  };
  for (const Index k : scratch_.near) {
    if (passed(k)) continue;
    const RigidPose pose = motion(k).pose(s_);
    const auto found = nearest(k, pose, out_.x, reach);
    if (!found || found->distance > reach) continue;
    if (found->distance < -at(k).shape.impl().on_surface) {
      scratch_.passed.push_back(k);
      continue;
    }
    add({k, found->triangle, pose.orientation * found->normal, pose.world(found->point), std::max(Real{0}, found->distance)});
  }
  // Those met before that it has not left: in a hollow the nearest is not the only one.
  for (const Met& met : scratch_.met) {
    if (passed(met.obstacle)) continue;
    const RigidPose pose = motion(met.obstacle).pose(s_);
    const auto& [a, b, c] = at(met.obstacle).shape.impl().corners[met.triangle];
    const Vec3 local = pose.body(out_.x), point = closest_point_on_triangle(local, a, b, c).point;
    const Real distance = (local - point).norm();
    Real near = met.distance;
    for (const Touch& touch : scratch_.touches)
      if (touch.obstacle == met.obstacle) near = std::max(near, touch.distance);
    if (distance > kTouch * std::min(near, room_) || distance == 0) continue;
    add({met.obstacle, met.triangle, pose.orientation * ((local - point) / distance), pose.world(point), distance});
  }
}

/// Takes away what approaches of the wish and the velocity. False: the surfaces leave no way.
bool Sliding::respond() {
  if (out_.surface == 0 && !scratch_.touches.empty()) out_.surface = at(scratch_.touches.front().obstacle).surface;
  std::vector<HalfSpace>& bounds = scratch_.bounds;
  const auto answer = [&](Vec3& w, const Vec3& surface, const Vec3& n) {
    const Vec3 relative = w - surface;
    const Real into = -relative.dot(n);
    if (!(into > 0)) return;
    Vec3 along = relative + into * n;
    const Real speed = along.norm();
    if (speed > 0) along *= 1 - std::min(Real{1}, options_.friction * into / speed);
    w = surface + along + (bounced_ ? options_.restitution * into : Real{0}) * n;
  };
  for (const bool velocity : {false, true}) {
    Vec3& w = velocity ? out_.v : wish_;
    bounds.clear();
    Real fastest = w.norm();
    for (const Touch& touch : scratch_.touches) {
      const Vec3 surface = velocity ? velocity_at(touch) : step_velocity(touch.obstacle, touch.point);
      bounds.push_back({touch.normal, surface});
      fastest = std::max(fastest, surface.norm());
      answer(w, surface, touch.normal);
    }
    if (bounds.empty()) return true;
    const auto allowed = least_change(w, bounds, kOutrun * fastest);
    if (allowed)
      w = *allowed;
    else if (!velocity)
      return false;
    else
      w = bounds.front().velocity;  // held between surfaces that close: as the first of them
  }
  return true;
}

/// There is no room for it as large as it is: it is taken for half as large; for a point at last, when what moves
/// most goes over it.
void Sliding::give_way() {
  room_ /= 2;
  out_.squeezed = true;
  if (room_ > kNoRoom * r_) return;
  out_.crushed = true;
  Index fastest = scratch_.touches.front().obstacle;
  Real most = -1;
  for (const Touch& touch : scratch_.touches) {
    const Real speed = step_velocity(touch.obstacle, touch.point).norm();
    if (speed <= most) continue;
    most = speed;
    fastest = touch.obstacle;
  }
  scratch_.passed.push_back(fastest);
  room_ = 2 * kNoRoom * r_;
}

/// Straight on; in the frame of a turning surface that it lies on, straight along that.
Path Sliding::path() {
  int carrier = -1;
  Real most = 0;
  for (const Touch& touch : scratch_.touches) {
    if (!motion(touch.obstacle).turns()) continue;
    const Vec3 surface = step_velocity(touch.obstacle, touch.point);
    const Real away = (wish_ - surface).dot(touch.normal), speed = surface.norm();
    if (away > 1e-9 * (speed + wish_.norm()) || speed < most) continue;
    most = speed;
    carrier = static_cast<int>(touch.obstacle);
  }
  if (carrier < 0) return {.frame = {}, .start = out_.x, .way = wish_, .begin = s_};
  const auto k = static_cast<Index>(carrier);
  const RigidMotion& frame = motion(k);
  const RigidPose pose = frame.pose(s_);
  return {.frame = frame, .start = pose.body(out_.x), .way = pose.orientation.conjugate() * (wish_ - step_velocity(k, out_.x)), .begin = s_};
}

/// Goes on until it meets something. False: nothing, and the step is at its end.
bool Sliding::advance(const Path& way) {
  obstacles_.meeting(way.box(room_), scratch_.ahead);
  std::optional<Impact> first;
  Index obstacle = 0;
  Real distance = 0;
  for (const Index k : scratch_.ahead) {
    if (passed(k)) continue;
    Real rho = room_;
    for (const Touch& touch : scratch_.touches)
      if (touch.obstacle == k) rho = std::min(rho, kKeep * touch.distance);
    const auto impact = sweep_path(at(k).shape, motion(k), way, rho);
    if (!impact || (first && impact->time >= first->time)) continue;
    first = impact;
    obstacle = k;
    distance = rho;
  }
  if (!first) {
    out_.x = way.at(1);
    if (way.frame.turns()) {
      // The velocity turns with what carries it.
      const Vec3 turn = (1 - s_) * way.frame.turn();
      if (const Real angle = turn.norm(); angle > 0) out_.v = Eigen::AngleAxisd(angle, turn / angle) * out_.v;
    }
    s_ = 1;
    return false;
  }
  const Real before = s_;
  out_.x = way.at(first->time);
  s_ = first->time;
  if (way.frame.turns()) {
    const Vec3 turn = (s_ - before) * way.frame.turn();
    const Real angle = turn.norm();
    if (angle > 0) {
      const Eigen::AngleAxisd rotation(angle, turn / angle);
      wish_ = rotation * wish_;
      out_.v = rotation * out_.v;
    }
  }
  std::erase_if(scratch_.met, [&](const Met& met) { return met.obstacle == obstacle && met.triangle == first->triangle; });
  if (scratch_.met.size() >= kMostTouches) scratch_.met.erase(scratch_.met.begin());
  scratch_.met.push_back({obstacle, first->triangle, distance});
  last_ = static_cast<int>(obstacle);
  ++out_.impacts;
  out_.surface = at(obstacle).surface;
  return true;
}

/// At the step's end: out of what it overlaps, as far as there is room.
void Sliding::settle() {
  constexpr int kTries = 12;
  for (int attempt = 0; attempt < kTries; ++attempt) {
    obstacles_.meeting(around(out_.x, 2 * r_), scratch_.near);
    Vec3 push = Vec3::Zero();
    int pushing = 0, held_by = -1;
    scratch_.touches.clear();
    for (const Index k : scratch_.near) {
      if (out_.crushed && passed(k)) continue;
      const RigidPose& pose = motion(k).to();
      const auto found = nearest(k, pose, out_.x, 2 * r_);
      if (!found || found->distance >= 2 * r_) continue;
      const Vec3 normal = pose.orientation * found->normal;
      if (found->distance < 0) {
        // Out of a solid before all else, and out of the deepest first; just out, for another may be beside it.
        const Real out = 4 * at(k).shape.impl().on_surface - found->distance;
        if (held_by >= 0 && push.norm() >= out) continue;
        held_by = static_cast<int>(k);
        push = out * normal;
        continue;
      }
      scratch_.touches.push_back({k, found->triangle, normal, pose.world(found->point), found->distance});
      if (held_by >= 0 || found->distance > (1 - 1e-3) * r_) continue;
      push += (r_ - found->distance) * normal;
      ++pushing;
    }
    if (held_by < 0 && pushing == 0) return;
    // Where each push leads into the other's reach, half of it ends between them.
    if (held_by < 0) push /= attempt < 2 ? pushing : 2 * pushing;

    // Nothing may be gone through on the way out but what it is in; of the distance to others a part may go.
    const Path way{.frame = {}, .start = out_.x, .way = push, .begin = 0};
    obstacles_.meeting(way.box(r_), scratch_.ahead);
    Real share = 1;
    for (const Index k : scratch_.ahead) {
      if (static_cast<int>(k) == held_by || (out_.crushed && passed(k))) continue;
      Real rho = r_;
      for (const Touch& touch : scratch_.touches)
        if (touch.obstacle == k) rho = std::min(rho, touch.distance / 4);
      if (const auto impact = sweep_path(at(k).shape, RigidMotion(motion(k).to()), way, rho)) share = std::min(share, impact->time);
    }
    if (share < 1) share /= 2;  // something stands there: half the way to it
    out_.x += share * push;
    if (held_by < 0 && share * push.norm() < 1e-3 * r_) return;
  }
}

Slid Sliding::go(const Vec3& x, const Vec3& dx, const Vec3& v) {
  scratch_.met.clear();
  scratch_.passed.clear();
  scratch_.led.clear();
  begin_ = x;
  out_.x = x;
  out_.v = v;
  wish_ = dx;
  bool carried = false;
  for (int round = 0;; ++round) {
    find_touches();
    bounced_ = out_.impacts > 0 && !carried;
    if (out_.impacts >= options_.rounds && last_ >= 0) {
      // Rounds used up: from here on it lies still on what it met last.
      carried = out_.stopped = true;
      wish_ = step_velocity(static_cast<Index>(last_), out_.x);
    }
    if (round > options_.rounds + kMoreRounds) {
      out_.crushed = true;
      const RigidMotion& motion = this->motion(static_cast<Index>(std::max(last_, 0)));
      if (last_ >= 0) out_.x = motion.to().world(motion.pose(s_).body(out_.x));
      s_ = 1;
      break;
    }
    if (!respond()) {
      give_way();
      continue;
    }
    if (!advance(path())) break;
  }
  if (out_.impacts > 0 || !scratch_.touches.empty() || !scratch_.passed.empty()) {
    settle();
    // What the surfaces do at the end is what it does with them.
    find_touches();
    bounced_ = false;
    if (!scratch_.touches.empty()) respond();
  }
  return out_;
}

bool meets_any(const Obstacles::Impl& obstacles, const Box3& box) {
  if (!obstacles.swept.intersects(box)) return false;
  bool any = false;
  obstacles.tree.meeting(box, [&](Index k) {
    any = obstacles.place[k].swept.intersects(box);
    return !any;
  });
  return any;
}

Box3 swept_ball(const Vec3& x, const Vec3& dx, Real r) {
  const Vec3 grow = Vec3::Constant(kTouch * r);
  return {x.cwiseMin(x + dx) - grow, x.cwiseMax(x + dx) + grow};
}

Slid slide_one(const Obstacles& obstacles, const Vec3& x, const Vec3& dx, const Vec3& v, Real r, const SlideOptions& options, Scratch& scratch) {
  CHECK(x.allFinite() && dx.allFinite() && v.allFinite());
  return Sliding(obstacles, r, options, scratch).go(x, dx, v);
}

void check_options(const Obstacles& obstacles, const SlideOptions& options) {
  CHECK(obstacles.impl().up_to_date());
  CHECK_GE(options.friction, 0.0);
  CHECK_GE(options.restitution, 0.0);
  CHECK_LE(options.restitution, 1.0);
  CHECK_GE(options.rounds, 1);
}

}  // namespace

Slid slide(const Obstacles& obstacles, const Vec3& x, const Vec3& dx, const Vec3& v, Real r, const SlideOptions& options) {
  check_options(obstacles, options);
  CHECK_GT(r, 0.0);
  Scratch scratch;
  return slide_one(obstacles, x, dx, v, r, options, scratch);
}

SlideReport slide_all(const Obstacles& obstacles, std::span<Vec3> x, std::span<const Vec3> dx, std::span<Vec3> v, std::span<const Real> r,
                      const SlideOptions& options, std::span<Index> surfaces) {
  ZONE("collide.slide");
  CHECK(surfaces.empty() || surfaces.size() == x.size());
  check_options(obstacles, options);
  CHECK_EQ(dx.size(), x.size());
  CHECK_EQ(v.size(), x.size());
  CHECK(r.size() == x.size() || r.size() == 1);
  constexpr std::size_t kGrain = 256;
  std::vector<SlideReport> part((x.size() + kGrain - 1) / kGrain);
  parallel_ranges(x.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    Scratch scratch;
    SlideReport& report = part[begin / kGrain];
    for (std::size_t i = begin; i < end; ++i) {
      if (!surfaces.empty()) surfaces[i] = 0;
      const Real radius = r[r.size() == 1 ? 0 : i];
      DCHECK(radius > 0);
      if (!meets_any(obstacles.impl(), swept_ball(x[i], dx[i], radius))) {
        x[i] += dx[i];
        continue;
      }
      const Slid slid = slide_one(obstacles, x[i], dx[i], v[i], radius, options, scratch);
      if (!surfaces.empty()) surfaces[i] = slid.v != v[i] ? slid.surface : 0;
      x[i] = slid.x;
      v[i] = slid.v;
      ++report.near;
      report.met += slid.impacts > 0;
      report.squeezed += slid.squeezed;
      report.crushed += slid.crushed;
      report.stopped += slid.stopped;
    }
  });
  SlideReport all;
  for (const SlideReport& report : part) {
    all.near += report.near;
    all.met += report.met;
    all.squeezed += report.squeezed;
    all.crushed += report.crushed;
    all.stopped += report.stopped;
  }
  return all;
}

}  // namespace effuse::geometry
