#include "geometry/collide/slide.h"

#include <gtest/gtest.h>

#include <functional>

#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "tests/geometry/collide/truth.h"

namespace effuse::geometry {
namespace {

RigidPose pose_at(const Vec3& x, const Quat& q = Quat::Identity()) { return {x, q}; }

/// Large enough that nobody gets round it in one step.
CollisionMesh large_plate() {
  TriMesh plate;
  plate.positions = {{-1e6, -1e6, 0}, {1e6, -1e6, 0}, {1e6, 1e6, 0}, {-1e6, 1e6, 0}};
  plate.triangles = {{0, 1, 2}, {0, 2, 3}};
  return CollisionMesh(plate);
}

Obstacles of(std::vector<Obstacle> each) {
  Obstacles obstacles;
  for (Obstacle& o : each) obstacles.add(std::move(o));
  obstacles.update();
  return obstacles;
}

TEST(Slide, FreeOfEverythingItGoesWhereItWould) {
  const Obstacles obstacles = of({{CollisionMesh(make_box({0, 0, 0}, {1, 1, 1})), {}, 0, 1}});
  const Slid slid = slide(obstacles, {0.1, 0.2, 5.3}, {3.7, 0.1, -1.9}, {1, 2, 3}, 0.3);
  EXPECT_EQ(slid.x, Vec3(Vec3(0.1, 0.2, 5.3) + Vec3(3.7, 0.1, -1.9)));
  EXPECT_EQ(slid.v, Vec3(1, 2, 3));
  EXPECT_EQ(slid.impacts, 0);
}

TEST(Slide, OnAFloorTheRestOfTheWayIsAlongIt) {
  const Obstacles floor = of({{CollisionMesh(make_box({-50, -50, -1}, {50, 50, 0})), {}, 0, 4}});
  const Slid slid = slide(floor, {0, 0, 2.5}, {4, 2, -8}, {2, 1, -4}, 0.5);
  EXPECT_NEAR((slid.x - Vec3(4, 2, 0.5)).norm(), 0, 1e-9);
  EXPECT_NEAR((slid.v - Vec3(2, 1, 0)).norm(), 0, 1e-12);
  EXPECT_EQ(slid.impacts, 1);
  EXPECT_EQ(slid.surface, 4u);

  // It touched after a quarter of the way; friction takes mu times what was taken into the floor.
  const Slid rough = slide(floor, {0, 0, 2.5}, {4, 0, -8}, {2, 0, -4}, 0.5, {.friction = 0.25});
  EXPECT_NEAR(rough.v.x(), 2 - 0.25 * 4, 1e-12);
  EXPECT_NEAR(rough.x.x(), 1 + 0.75 * (4 - 0.25 * 8), 1e-9);
  const Slid stuck = slide(floor, {0, 0, 2.5}, {4, 0, -8}, {2, 0, -4}, 0.5, {.friction = std::numeric_limits<Real>::infinity()});
  EXPECT_NEAR((stuck.x - Vec3(1, 0, 0.5)).norm(), 0, 1e-9);
  EXPECT_EQ(stuck.v, Vec3(0, 0, 0));
  const Slid bounced = slide(floor, {0, 0, 2.5}, {4, 0, -8}, {2, 0, -4}, 0.5, {.restitution = 0.5});
  EXPECT_NEAR((bounced.v - Vec3(2, 0, 2)).norm(), 0, 1e-12);
  EXPECT_NEAR((bounced.x - Vec3(4, 0, 0.5 + 0.75 * 4)).norm(), 0, 1e-9);
}

TEST(Slide, ManyStepsOnAFloorNeitherSinkNorStick) {
  const Obstacles floor = of({{CollisionMesh(make_grid({-10, -10, 0}, {0.5, 0.5}, 80, 80)), {}, 0, 1}});
  Vec3 x(0.1, 0.2, 0.6), v(1, 0.7, 0);
  const Real dt = 0.01;
  for (int step = 0; step < 2000; ++step) {
    v.z() -= 9.81 * dt;
    const Slid slid = slide(floor, x, v * dt, v, 0.5);
    x = slid.x;
    v = slid.v;
    if (step > 100) {
      ASSERT_NEAR(x.z(), 0.5, 0.01) << step;
    }
  }
  EXPECT_NEAR(x.x(), 0.1 + 2000 * dt, 1e-6);
  EXPECT_NEAR(x.y(), 0.2 + 0.7 * 2000 * dt, 1e-6);
}

TEST(Slide, InACreaseItGoesAlongTheCreaseAndInACornerItStops) {
  // One mesh and one obstacle a wall: the same.
  TriMesh walls = make_grid({0, 0, 0}, {10, 10}, 1, 1);
  TriMesh upright = make_grid({0, 0, 0}, {10, 10}, 1, 1), back = upright;
  for (Vec3& x : upright.positions) x = Vec3(0, x.x(), x.y());
  for (Vec3& x : back.positions) x = Vec3(x.y(), 0, x.x());
  const Obstacles apart = of({{CollisionMesh(walls), {}, 0, 1}, {CollisionMesh(upright), {}, 0, 2}, {CollisionMesh(back), {}, 0, 3}});
  append(walls, upright);
  append(walls, back);
  const Obstacles joined = of({{CollisionMesh(walls), {}, 0, 1}});
  for (const Obstacles* corner : {&apart, &joined}) {
    const Slid crease = slide(*corner, {2, 5, 2}, {-4, 3, -4}, {-4, 3, -4}, 0.5);
    EXPECT_NEAR((crease.x - Vec3(0.5, 8, 0.5)).norm(), 0, 0.02);
    EXPECT_NEAR((crease.v - Vec3(0, 3, 0)).norm(), 0, 1e-9);
    const Slid stopped = slide(*corner, {2, 5, 2}, {-4, -12, -5}, {-4, -12, -5}, 0.5);
    EXPECT_NEAR((stopped.x - Vec3(0.5, 0.5, 0.5)).norm(), 0, 0.02);
    // Of one mesh, a wall met again is met 1/64 of the radius nearer, and that much is left of a direction's third place.
    EXPECT_NEAR(stopped.v.norm(), 0, corner == &apart ? 1e-9 : 13.6 / 64 / 64 * 10);
  }
}

TEST(Slide, AlongTheGrooveOfOneMeshItGoesAllTheWay) {
  // Two slopes that meet at 40 degrees, in one mesh: the nearest place is on one of them only.
  const Real slope = 70 * kPi / 180;
  TriMesh groove;
  for (const Real side : {-1.0, 1.0}) {
    const auto first = static_cast<Index>(groove.positions.size());
    for (const Vec2& at : {Vec2(0, -50), Vec2(20, -50), Vec2(20, 50), Vec2(0, 50)})
      groove.positions.emplace_back(side * at.x() * std::cos(slope), at.y(), at.x() * std::sin(slope));
    groove.triangles.push_back({first, first + 1, first + 2});
    groove.triangles.push_back({first, first + 2, first + 3});
  }
  const Obstacles obstacles = of({{CollisionMesh(groove), {}, 0, 1}});
  const Real deepest = 0.5 / std::cos(slope);
  for (const Real aside : {-1.0, 0.0, 0.3, 2.0}) {
    const Slid slid = slide(obstacles, {0, -20, 5}, {aside, 30, -10}, {aside, 30, -10}, 0.5);
    EXPECT_NEAR(slid.x.y(), 10, 1e-6) << aside;
    EXPECT_NEAR(slid.x.z(), deepest, 0.1) << aside;
    EXPECT_NEAR(slid.x.x(), 0, 0.1) << aside;
    EXPECT_NEAR((slid.v - Vec3(0, 30, 0)).norm(), 0, 1e-6) << aside;
    EXPECT_FALSE(slid.stopped) << aside;
  }
}

TEST(Slide, AMovingFloorCarriesAndPushes) {
  const CollisionMesh slab(make_box({-50, -50, -1}, {50, 50, 0}));
  const RigidMotion up(pose_at({0, 0, 0}), pose_at({3, 0, 2}), 0.5);
  const Obstacles lift = of({{slab, up, 0, 1}});
  const Slid slid = slide(lift, {0, 0, 1}, {0, 0, 0}, {0, 0, 0}, 0.5);
  EXPECT_NEAR((slid.x - Vec3(0, 0, 2.5)).norm(), 0, 1e-9);
  EXPECT_NEAR((slid.v - Vec3(0, 0, 4)).norm(), 0, 1e-9) << "the floor's 2 m in 0.5 s";
  const Slid stuck = slide(lift, {0, 0, 0.5}, {0, 0, -1e-3}, {0, 0, 0}, 0.5, {.friction = 1e9});
  EXPECT_NEAR((stuck.x - Vec3(3, 0, 2.5)).norm(), 0, 1e-6);
  EXPECT_NEAR((stuck.v - Vec3(6, 0, 4)).norm(), 0, 1e-6);
}

TEST(Slide, ATurningBladeSweepsWhatLiesInItsWayAlong) {
  const CollisionMesh blade(make_box({0.5, -0.05, -2}, {10, 0.05, 2})), sheet(make_grid({0.5, -2, 0}, {9.5, 4}, 1, 1));
  for (std::uint64_t k = 0; k < 400; ++k) {
    const auto u = [&](std::uint64_t stream) { return random_uniform(141, stream, k); };
    const RigidPose frame = truth::random_pose(142, k, 20);
    const Quat upright = k % 2 ? Quat::Identity() : Quat(Eigen::AngleAxisd(kPi / 2, Vec3::UnitX()));
    const Real angle = 0.5 + 2.5 * u(0), half = k % 2 ? 0.05 : 0, r = 0.01 + 0.3 * u(1);
    const auto turned = [&](Real by) { return RigidPose{frame.position, frame.orientation * Quat(Eigen::AngleAxisd(by, Vec3::UnitZ())) * upright}; };
    const RigidMotion turn(turned(0), turned(angle), 2);
    // At rest, somewhere that the blade passes.
    const Real at = 0.2 + (angle - 0.3) * u(2), out = 2 + 7 * u(3);
    if (out * std::sin(std::min(at, kPi / 2)) < half + r) continue;
    const Vec3 x = frame.world(Vec3(out * std::cos(at), out * std::sin(at), u(4) - 0.5));
    const Slid slid = slide(of({{k % 2 ? blade : sheet, turn, 0, 1}}), x, {0, 0, 0}, {0, 0, 0}, r);
    const Vec3 end = turned(angle).world(upright.conjugate() * Vec3::Zero()) - frame.position;
    ASSERT_NEAR(end.norm(), 0, 1e-12);
    const Vec3 seen = upright * turned(angle).body(slid.x);
    EXPECT_GE(seen.y(), half + 0.98 * r) << k;
    EXPECT_LE(seen.y(), half + 1.05 * r) << k << ": and no further";
    EXPECT_NEAR(seen.x(), out, 0.5 * out) << k;
    const Vec3 ahead = turned(angle).orientation * (upright.conjugate() * Vec3::UnitY());
    EXPECT_GE(slid.v.dot(ahead), seen.x() * angle / 2 * 0.999) << k << ": as fast as the blade is there";
    EXPECT_GT(slid.impacts, 0);
  }
}

TEST(Slide, BetweenPlatesThatCloseItStaysBetweenThem) {
  const CollisionMesh plate = large_plate();
  for (std::uint64_t k = 0; k < 300; ++k) {
    const Real gap = std::pow(10.0, -2 + 2.5 * random_uniform(151, 0, k)), from = 4 + 200 * random_uniform(151, 1, k);
    const RigidPose rest = truth::random_pose(152, k, 5);
    const Vec3 n = rest.orientation * Vec3::UnitZ();
    RigidPose begin = rest, end = rest;
    begin.position += from * n;
    end.position += gap * n;
    const Obstacles press = of({{plate, RigidMotion(rest), 0, 1}, {plate, RigidMotion(begin, end, 1), 0, 2}});
    const Vec3 x = rest.world({5, 3, 1.5 + (from - 3) * random_uniform(151, 2, k)});
    const Slid slid = slide(press, x, from * truth::unit(153, k), {0, 0, 0}, 1);
    const Real height = rest.body(slid.x).z();
    EXPECT_GT(height, 0) << k;
    EXPECT_LT(height, gap) << k;
    EXPECT_FALSE(slid.crushed) << k;
    EXPECT_EQ(slid.squeezed, gap < 2) << k << " gap " << gap;
    if (gap < 2) {
      EXPECT_NEAR(height, gap / 2, 0.02 * gap) << "in the middle of what room there is";
    }
  }
  // Plates that pass through one another leave no room: it is said.
  const Obstacles scissors = of({{plate, {}, 0, 1}, {plate, RigidMotion(pose_at({0, 0, 5}), pose_at({0, 0, -5}), 1), 0, 2}});
  const Slid crushed = slide(scissors, {0, 0, 2}, {0, 0, 0}, {0, 0, 0}, 0.5);
  EXPECT_TRUE(crushed.crushed);
  EXPECT_GT(crushed.x.z(), 0) << "what rests holds it";
}

TEST(Slide, StartedInsideASolidItEndsOutside) {
  const Obstacles box = of({{CollisionMesh(make_box({-2, -2, -2}, {2, 2, 2})), {}, 0, 1}});
  const Slid slid = slide(box, {0.3, 0.2, 1.4}, {0, 0, 0}, {0, 0, 0}, 0.1);
  EXPECT_NEAR((slid.x - Vec3(0.3, 0.2, 2.1)).norm(), 0, 1e-9);
}

TEST(Slide, AllAtOnceHaveTheBitsOfOneByOneOnAnyNumberOfThreads) {
  std::vector<Obstacle> each;
  for (std::uint64_t k = 0; k < 20; ++k) {
    const RigidPose from = truth::random_pose(161, k, 4), to = {from.position + 0.5 * truth::unit(163, k), truth::random_pose(164, k, 1).orientation};
    each.push_back({CollisionMesh(k % 2 ? make_torus({0, 0, 0}, 1, 0.3, 16, 8) : make_box({-1, -1, -0.1}, {1, 1, 0.1})), RigidMotion(from, to, 0.1), 0, static_cast<Index>(k + 1)});
  }
  const Obstacles obstacles = of(each);
  std::vector<Vec3> x, dx, v;
  for (std::uint64_t k = 0; k < 1000; ++k) {
    x.push_back(5 * random_uniform(165, 0, k) * truth::unit(166, k));
    dx.push_back(truth::unit(167, k));
    v.push_back(10 * dx.back());
  }
  std::string hashes[2];
  SlideReport reports[2];
  for (const int threads : {1, 3}) {
    const ThreadLimit limit(threads);
    std::vector<Vec3> at = x, speed = v;
    const std::vector<Real> r{0.1};
    reports[threads > 1] = slide_all(obstacles, at, dx, speed, r, {.friction = 0.3});
    StateHash hash;
    hash.add(std::span<const Vec3>(at));
    hash.add(std::span<const Vec3>(speed));
    hashes[threads > 1] = hash.hex();
    if (threads > 1) continue;
    for (std::size_t k = 0; k < x.size(); k += 10) EXPECT_EQ(at[k], slide(obstacles, x[k], dx[k], v[k], 0.1, {.friction = 0.3}).x);
  }
  EXPECT_EQ(hashes[0], hashes[1]);
  EXPECT_EQ(reports[0].met, reports[1].met);
  EXPECT_GT(reports[0].met, 100u);
  EXPECT_GT(reports[0].near, reports[0].met);
}

/// What one trial is: obstacles, the particle, and where it may be at the end.
struct Trial {
  Obstacles obstacles;
  Vec3 x = Vec3::Zero(), dx = Vec3::Zero();
  Real r = 1;
  std::function<Real(const Vec3&)> depth;  ///< of the right side [m]; <= 0: the wrong one
  Real kept = 1;                           ///< share of r that is kept
};

/// Never on the wrong side, in so many trials.
template <class Make>
void nobody_tunnels(std::uint64_t trials, const Make& make) {
  std::size_t met = 0, crushed = 0, stopped = 0, near = 0;
  Real least = std::numeric_limits<Real>::infinity();
  for (std::uint64_t k = 0; k < trials; ++k) {
    const Trial trial = make(k);
    const Slid slid = slide(trial.obstacles, trial.x, trial.dx, trial.dx, trial.r);
    const Real depth = trial.depth(slid.x);
    ASSERT_GT(depth, 0) << "trial " << k << " from " << trial.x.transpose() << " by " << trial.dx.norm() << " with " << slid.impacts << " impacts";
    least = std::min(least, depth / (trial.kept * trial.r));
    near += depth < 0.9 * trial.kept * trial.r;
    met += slid.impacts > 0;
    crushed += slid.crushed;
    stopped += slid.stopped;
  }
  EXPECT_GT(met, trials / 20) << "too few trials meet anything";
  EXPECT_EQ(crushed, 0u);
  EXPECT_GT(least, 0.9) << "nearer than the radius: " << near;
  testing::Test::RecordProperty("met", std::to_string(met));
  testing::Test::RecordProperty("stopped", std::to_string(stopped));
  testing::Test::RecordProperty("least_share_of_radius", std::to_string(least));
}

struct Draw {
  std::uint64_t seed, k;
  Real operator()(std::uint64_t stream) const { return random_uniform(seed, stream, k); }
  Vec3 unit(std::uint64_t stream) const { return truth::unit(seed * 1000 + stream, k); }
  Real side() const { return random_uniform(seed, 999, k) < 0.5 ? -1 : 1; }
  Real step() const { return std::pow(10.0, 4 * random_uniform(seed, 998, k)); }   // 1 .. 10,000 radii
  Real away() const { return std::pow(10.0, -1 + 3.5 * random_uniform(seed, 997, k)); }  // 0.1 .. 300 radii
};

Trial plate_trial(std::uint64_t seed, std::uint64_t k, const CollisionMesh& plate, bool moves, bool turns, Real half = 0) {
  const Draw u{seed, k};
  const Real step = u.step(), side = u.side();
  RigidPose from = truth::random_pose(seed + 1, k, 100), to = from;
  if (moves) to.position += step * u(1) * u.unit(1);
  if (turns) to.orientation = Quat(Eigen::AngleAxisd(3.1 * u(2), u.unit(2))) * from.orientation;
  const RigidMotion motion(from, to, 1);
  const Real away = u.away();
  Trial trial;
  trial.obstacles = of({{plate, motion, 0, 1}});
  trial.x = from.world({400 * (u(3) - 0.5), 400 * (u(4) - 0.5), side * (half + away)});
  // Two of three towards it.
  Vec3 way = u.unit(3);
  const Vec3 up = side * (from.orientation * Vec3::UnitZ());
  if (k % 3 && way.dot(up) > 0) way -= 2 * way.dot(up) * up;
  trial.dx = step * way;
  trial.depth = [=](const Vec3& x) { return side * motion.to().body(x).z() - half; };
  return trial;
}

void through_a_plate(std::uint64_t trials) {
  const CollisionMesh plate = large_plate(), tiles(make_grid({-64000, -64000, 0}, {2000, 2000}, 64, 64));
  nobody_tunnels(trials, [&](std::uint64_t k) { return plate_trial(200, k, k % 2 ? plate : tiles, false, false); });
}

void through_a_moving_plate(std::uint64_t trials) {
  const CollisionMesh plate = large_plate();
  nobody_tunnels(trials, [&](std::uint64_t k) { return plate_trial(201, k, plate, true, false); });
}

void through_a_turning_blade(std::uint64_t trials) {
  const CollisionMesh plate = large_plate(), blade(make_box({-1e6, -1e6, -0.05}, {1e6, 1e6, 0.05}));
  nobody_tunnels(trials, [&](std::uint64_t k) { return k % 2 ? plate_trial(202, k, plate, true, true) : plate_trial(202, k, blade, true, true, 0.05); });
}

void through_a_narrow_gap(std::uint64_t trials) {
  const CollisionMesh half(make_box({0, -1e6, -1}, {1e6, 1e6, 0})), sheet(make_grid({0, -1e6, 0}, {1e6, 2e6}, 1, 1));
  nobody_tunnels(trials, [&](std::uint64_t k) {
    const Draw u{203, k};
    const CollisionMesh& shape = k % 2 ? half : sheet;
    const Real gap = 1.98 * u(1);  // of a diameter of 2
    const RigidPose frame = truth::random_pose(204, k, 50);
    RigidPose right = frame, left = frame;
    right.position = frame.world({gap / 2, 0, 0});
    left.position = frame.world({-gap / 2, 0, k % 2 ? -1.0 : 0.0});
    left.orientation = frame.orientation * Quat(Eigen::AngleAxisd(kPi, Vec3::UnitY()));
    Trial trial;
    trial.obstacles = of({{shape, RigidMotion(right), 0, 1}, {shape, RigidMotion(left), 0, 2}});
    const Real step = u.step(), aim = u(5) < 0.5 ? 0 : 3;
    const Vec3 x(aim * (u(2) - 0.5), 10 * (u(3) - 0.5), 1 + u.away());
    trial.x = frame.world(x);
    trial.dx = frame.orientation * (step * (u(4) < 0.7 ? (Vec3(gap * (u(6) - 0.5), u(7), -0.5) - x).normalized() : u.unit(4)));
    // A ball of radius 1 over the gap is at least so high; the centre never passes below it.
    const Real lowest = std::sqrt(1 - gap * gap / 4);
    trial.depth = [=](const Vec3& end) { return frame.body(end).z(); };
    trial.kept = lowest;
    return trial;
  });
}

void out_of_a_closing_wedge(std::uint64_t trials) {
  // Two large plates hinged along a line, one of which turns towards the other.
  const CollisionMesh plate = large_plate();
  std::size_t crushed = 0, squeezed = 0;
  for (std::uint64_t k = 0; k < trials; ++k) {
    const Draw u{205, k};
    const RigidPose frame = truth::random_pose(206, k, 50);
    const Real open = 0.3 + 1.2 * u(1), closed = open * (0.05 + 0.9 * u(2));
    const auto wing = [&](Real angle) { return RigidPose{frame.position, frame.orientation * Quat(Eigen::AngleAxisd(-angle, Vec3::UnitY()))}; };
    const Obstacles wedge = of({{plate, RigidMotion(frame), 0, 1}, {plate, RigidMotion(wing(open), wing(closed), 1), 0, 2}});
    const Real along = 5 + 100 * u(3);
    const Vec3 x(along * std::cos(open / 2), 3, along * std::sin(open / 2));
    const Real step = std::pow(10.0, 3 * u(4));
    Vec3 d = step * u.unit(5);
    if (u(6) < 0.5) d = -step * x / x.norm();
    // A sheet through the hinge is in its other half on the other side of the wedge: only who stays at x > 0 is asked.
    const Slid slid = slide(wedge, frame.world(x), frame.orientation * d, {0, 0, 0}, 0.5);
    crushed += slid.crushed;
    squeezed += slid.squeezed;
    const Vec3 end = frame.body(slid.x);
    EXPECT_GT(end.z(), 0) << k;
    EXPECT_LT(wing(closed).body(slid.x).z(), 0) << k;
  }
  EXPECT_EQ(crushed, 0u);
  testing::Test::RecordProperty("squeezed", std::to_string(squeezed));
}

void into_tumbling_solids(std::uint64_t trials) {
  const CollisionMesh shapes[4] = {CollisionMesh(make_box({-2, -0.1, -1}, {2, 0.1, 1})), CollisionMesh(make_torus({0.5, 0, 0}, 1.5, 0.4, 24, 12)),
                                   CollisionMesh(make_sphere({0, 0, 0}, 1, 2)), CollisionMesh(truth::notched_block())};
  std::size_t met = 0, crushed = 0, squeezed = 0;
  for (std::uint64_t k = 0; k < trials; ++k) {
    const Draw u{207, k};
    std::vector<Obstacle> each;
    for (std::uint64_t m = 0; m < 3; ++m) {
      const RigidPose from = truth::random_pose(208 + 10 * m, k, 4);
      const RigidPose to{from.position + 3 * u(m) * u.unit(m), Quat(Eigen::AngleAxisd(3 * u(10 + m), u.unit(10 + m))) * from.orientation};
      each.push_back({shapes[(k + m) % 4], RigidMotion(from, to, 1), 0, static_cast<Index>(m + 1)});
    }
    const Vec3 x = 4 * u.unit(20), dx = std::pow(10.0, 3 * u(21)) * 0.01 * u.unit(21) - 2 * u(22) * x;
    bool free = true;
    for (const Obstacle& o : each) free &= o.shape.signed_distance(o.motion.from().body(x)) > 0;
    if (!free) continue;
    const Slid slid = slide(of(each), x, dx, dx, 0.01 + 0.2 * u(23));
    met += slid.impacts > 0;
    crushed += slid.crushed;
    squeezed += slid.squeezed;
    if (slid.crushed) continue;
    for (const Obstacle& o : each) EXPECT_GT(o.shape.signed_distance(o.motion.to().body(slid.x)), 0) << k << " squeezed " << slid.squeezed;
  }
  EXPECT_GT(met, trials / 20);
  EXPECT_LT(crushed, met / 50) << "solids that run into one another do crush some";
  testing::Test::RecordProperty("crushed", std::to_string(crushed));
}

// The hundred thousand, and some of them for every day.
constexpr std::uint64_t kAll = 100000, kSome = 3000;

TEST(TunnelSlow, NotThroughAPlateWithoutThicknessFromEitherSide) { through_a_plate(kAll); }
TEST(TunnelSlow, NotThroughAMovingPlate) { through_a_moving_plate(kAll); }
TEST(TunnelSlow, NotThroughATurningBlade) { through_a_turning_blade(kAll); }
TEST(TunnelSlow, NotThroughAGapNarrowerThanItself) { through_a_narrow_gap(kAll); }
TEST(TunnelSlow, NotOutOfAWedgeThatCloses) { out_of_a_closing_wedge(kAll); }
TEST(TunnelSlow, NotIntoSolidsThatTumbleThroughOneAnother) { into_tumbling_solids(kAll); }

TEST(Tunnel, NotThroughAPlateWithoutThicknessFromEitherSide) { through_a_plate(kSome); }
TEST(Tunnel, NotThroughAMovingPlate) { through_a_moving_plate(kSome); }
TEST(Tunnel, NotThroughATurningBlade) { through_a_turning_blade(kSome); }
TEST(Tunnel, NotThroughAGapNarrowerThanItself) { through_a_narrow_gap(kSome); }
TEST(Tunnel, NotOutOfAWedgeThatCloses) { out_of_a_closing_wedge(kSome); }
TEST(Tunnel, NotIntoSolidsThatTumbleThroughOneAnother) { into_tumbling_solids(kSome); }

}  // namespace
}  // namespace effuse::geometry
