#include "flow/sph/solids.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "flow/sph/modern_lava.h"
#include "geometry/procedural/primitives.h"
#include "tests/flow/sph/beside_solids.h"
#include "tests/flow/sph/sample_system.h"

/// Lava among obstacles.
namespace effuse::flow::sph {
namespace {

using geometry::CollisionMesh;
using geometry::Obstacles;
using geometry::RigidMotion;
using geometry::RigidPose;
using geometry::TriMesh;

/// A rectangle of two triangles around the origin, spanned by two half sides.
TriMesh plate(const Vec3& a, const Vec3& b) {
  TriMesh m;
  m.positions = {Vec3(-a - b), Vec3(a - b), Vec3(a + b), Vec3(b - a)};
  m.triangles = {{0, 1, 2}, {0, 2, 3}};
  return m;
}

void fill(ModernLava& lava, const std::vector<Vec3>& x, const Vec3& v = Vec3::Zero()) {
  lava.add(x, std::vector<Vec3>(x.size(), v), std::vector<Real>(x.size(), 1400));
}

std::uint64_t hash_of(const ModernLava& lava) {
  StateHash hash;
  lava.add_to(hash);
  return hash.value();
}

// A tray as a mesh holds lava as the ground does: at rest, level, dense, under the pressure of its depth.
TEST(Solids, ATrayHoldsLavaAtRestUnderTheWeightOfItsDepth) {
  const Real dx = 0.5, H = 8 * dx;
  ModernOptions o = thick_lava(dx, 26000, 0.05);
  Obstacles obstacles;
  obstacles.add({CollisionMesh(tray(Vec3::Zero(), Vec3(8 * dx, 8 * dx, 12 * dx))), {}, 0, 1});
  obstacles.update();
  ModernLava lava(o, {}, {ground_at(-100)}, {}, {&obstacles, {}, {}});
  fill(lava, lattice_block(8, 8, 8, dx));
  Real speed = 0;
  while (lava.time() < 3) {
    const ModernReport report = lava.step(0.05);
    if (lava.time() > 2) speed = std::max(speed, report.max_speed);
  }
  EXPECT_LT(speed, 0.01 * std::sqrt(kGravity * H));
  Real top = 0, low = 0, high = 0, sum = 0;
  int n_low = 0, n_high = 0;
  for (std::size_t i = 0; i < lava.size(); ++i) {
    const Vec3& p = lava.positions()[i];
    top = std::max(top, p.z());
    EXPECT_TRUE(p.x() > 0 && p.x() < 8 * dx && p.y() > 0 && p.y() < 8 * dx && p.z() > 0) << p.transpose();
    sum += p.z();
    if ((p.head<2>() - Vec2(4 * dx, 4 * dx)).cwiseAbs().maxCoeff() > 2 * dx) continue;  // in the middle
    if (p.z() < 2 * dx) low += lava.pressures()[i], ++n_low;
    else if (p.z() > H - 2 * dx) high += lava.pressures()[i], ++n_high;
  }
  EXPECT_NEAR(top, H - dx / 2, 0.5 * dx) << "level";
  EXPECT_NEAR(2 * sum / static_cast<Real>(lava.size()), H, 0.35 * dx) << "no layer is squeezed or held up by the walls";
  EXPECT_NEAR(low / n_low - high / n_high, o.density * kGravity * (H - 2 * dx), 0.08 * o.density * kGravity * H);
}

// A dam breaks against a wall of no thickness: none behind it, at any time.
TEST(Solids, NoneGoesThroughAWallOfNoThickness) {
  const Real dx = 0.5;
  ModernOptions o = thick_lava(dx, 50, 0.05);
  Obstacles obstacles;
  obstacles.add({CollisionMesh(plate(Vec3(0, 20, 0), Vec3(0, 0, 20))), RigidMotion(RigidPose{Vec3(6, 2, 0), Quat::Identity()}), 0, 1});
  obstacles.update();
  ModernLava lava(o, {}, {ground_at(0)}, {}, {&obstacles, {}, {}});
  fill(lava, lattice_block(8, 8, 10, dx), Vec3(8, 0, 0));
  std::size_t met = 0;
  while (lava.time() < 2) {
    met += lava.step(0.05).solids.met;
    for (const Vec3& p : lava.positions()) ASSERT_LT(p.x(), 6) << "at " << lava.time();
    for (const Vec3& p : lava.positions()) ASSERT_GT(p.z(), 0) << "at " << lava.time();
  }
  EXPECT_GT(met, 50u) << "it never came there";
}

// Lava on the two sides of a sheet: what is deep on one side leaves that on the other as it would be alone.
TEST(Solids, LavaOnTheTwoSidesOfASheetKnowsNothingOfEachOther) {
  const Real dx = 0.5;
  const auto pool = [&](bool both) {
    Obstacles obstacles;
    obstacles.add({CollisionMesh(tray(Vec3::Zero(), Vec3(12 * dx, 6 * dx, 12 * dx))), {}, 0, 1});
    obstacles.add({CollisionMesh(plate(Vec3(0, 20, 0), Vec3(0, 0, 20))), RigidMotion(RigidPose{Vec3(6 * dx, 0, 0), Quat::Identity()}), 0, 2});
    obstacles.update();
    ModernOptions o = thick_lava(dx, 26000, 0.05);
    o.viscosity_tolerance = 1e-8;
    o.divergence_tolerance = 1e-8;
    ModernLava lava(o, {}, {ground_at(-100)}, {}, {&obstacles, {}, {}});
    std::vector<Vec3> x = lattice_block(6, 6, 3, dx);
    if (both)
      for (const Vec3& p : lattice_block(6, 6, 8, dx)) x.push_back(p + Vec3(6 * dx, 0, 0));
    fill(lava, x);
    while (lava.time() < 0.5) lava.step(0.05);
    std::vector<Vec3> left(108);
    for (std::size_t i = 0; i < lava.size(); ++i)
      if (lava.ids()[i] < left.size()) left[lava.ids()[i]] = lava.positions()[i];
    return left;
  };
  const std::vector<Vec3> alone = pool(false), beside = pool(true);
  Real most = 0;
  for (std::size_t i = 0; i < alone.size(); ++i) most = std::max(most, (alone[i] - beside[i]).norm());
  EXPECT_LT(most, 0.01 * dx);
}

// A piston drives lava along a channel; what it drives stays before it, and no faster step is taken than its speed allows.
TEST(Solids, APistonPushesLavaAhead) {
  const Real dx = 0.5, speed = 2;
  ModernOptions o = thick_lava(dx, 500, 0.05);
  Obstacles obstacles;
  const std::size_t piston = obstacles.add({CollisionMesh(geometry::make_box(Vec3(-0.5, -40, -1), Vec3(0, 40, 6))), {}, 0, 1});
  obstacles.update();
  const auto at = [&](Real t) { return RigidPose{Vec3(speed * std::max(t - 0.2, 0.0), 0, 0), Quat::Identity()}; };
  ModernLava lava(o, {}, {ground_at(0)}, {}, {&obstacles, [&](Real from, Real to) {
    obstacles.move(piston, RigidMotion(at(from), at(to), to - from));
    obstacles.update();
  }, {}});
  fill(lava, lattice_block(8, 10, 5, dx));
  const Vec3 before = [&] { Vec3 m = Vec3::Zero(); for (const Vec3& p : lava.positions()) m += p; return Vec3(m / static_cast<Real>(lava.size())); }();
  while (lava.time() < 2) {
    const ModernReport report = lava.step(0.05);
    if (lava.time() > 0.4) {
      EXPECT_LE(report.dt, 1.01 * o.courant * dx / speed);
    }
    for (const Vec3& p : lava.positions()) ASSERT_GT(p.x(), at(lava.time()).position.x()) << lava.time();
  }
  Vec3 after = Vec3::Zero();
  for (const Vec3& p : lava.positions()) after += p / static_cast<Real>(lava.size());
  EXPECT_GT(after.x() - before.x(), 1.0);
}

// A blade that turns through a pool, as fast as a spacing a step: what is above and below, before and behind stays finite and on its side
// of the blade within each step; nothing is lost.
TEST(SolidsSlow, ATurningBladeStirsAPool) {
  const Real dx = 0.4;
  ModernOptions o = thick_lava(dx, 200, 0.05);
  Obstacles obstacles;
  obstacles.add({CollisionMesh(tray(Vec3(-2.4, -2.4, 0), Vec3(2.4, 2.4, 6))), {}, 0, 1});
  const std::size_t blade = obstacles.add({CollisionMesh(plate(Vec3(2, 0, 0), Vec3(0, 0, 2))), {}, 0, 2});
  obstacles.update();
  const auto at = [](Real t) { return RigidPose{Vec3(0, 0, 1), Quat(Eigen::AngleAxisd(1.5 * t, Vec3::UnitZ()))}; };
  ModernLava lava(o, {}, {ground_at(-50)}, {}, {&obstacles, [&](Real from, Real to) {
    obstacles.move(blade, RigidMotion(at(from), at(to), to - from));
    obstacles.update();
  }, {}});
  std::vector<Vec3> x = lattice_block(12, 12, 5, dx);
  for (Vec3& p : x) p += Vec3(-2.4, -2.4, 0);
  fill(lava, x);
  while (lava.time() < 1.5) {
    const std::vector<Vec3> before(lava.positions().begin(), lava.positions().end());
    const Real t = lava.time();
    const ModernReport report = lava.step(0.05);
    if (lava.size() != before.size()) continue;
    EXPECT_EQ(report.solids.crushed, 0u);
    for (const Vec3& p : lava.positions()) {
      ASSERT_TRUE(p.allFinite());
      ASSERT_TRUE(std::abs(p.x()) < 2.4 && std::abs(p.y()) < 2.4 && p.z() > 0) << p.transpose() << " at " << t;
    }
  }
  Real turned = 0;
  for (std::size_t i = 0; i < lava.size(); ++i) turned += lava.positions()[i].cross(lava.velocities()[i]).z();
  EXPECT_GT(turned / static_cast<Real>(lava.size()), 0.1) << "the pool goes round with it";
}

TEST(Solids, FarFromAllLavaTheyChangeNoBit) {
  const auto run = [](Obstacles* obstacles) {
    ModernLava lava(thick_lava(0.5, 500, 0.05), {}, {ground_at(0)}, {}, {obstacles, {}, {}});
    fill(lava, lattice_block(6, 6, 6, 0.5));
    while (lava.time() < 0.5) lava.step(0.05);
    return hash_of(lava);
  };
  Obstacles far;
  far.add({CollisionMesh(geometry::make_box(Vec3(100, 100, 0), Vec3(101, 101, 1))), {}, 0, 1});
  far.update();
  EXPECT_EQ(run(nullptr), run(&far));
}

TEST(Solids, AreTheSameBitsOnAnyNumberOfThreadsAndAfterLoading) {
  const auto steps = [](int threads, bool reload) {
    const ThreadLimit limit(threads);
    Obstacles obstacles;
    const std::size_t moving = obstacles.add({CollisionMesh(geometry::make_sphere(Vec3::Zero(), 1, 2)), {}, 0, 1});
    obstacles.update();
    const SolidOptions solids{&obstacles, [&](Real from, Real to) {
      obstacles.move(moving, RigidMotion({Vec3(4 - from, 1.5, 0.8), Quat::Identity()}, {Vec3(4 - to, 1.5, 0.8), Quat::Identity()}, to - from));
      obstacles.update();
    }, {}};
    const auto make = [&] { return ModernLava(thick_lava(0.4, 100, 0.05), {}, {ground_at(0)}, {}, solids); };
    ModernLava lava = make();
    fill(lava, lattice_block(8, 8, 6, 0.4));
    while (lava.time() < 1) lava.step(0.04);
    if (reload) {
      StateWriter out;
      lava.save(out);
      StateReader in(out.bytes(), "");
      lava = make();
      lava.load(in);
    }
    while (lava.time() < 2) lava.step(0.04);
    return hash_of(lava);
  };
  const std::uint64_t one = steps(1, false);
  EXPECT_EQ(one, steps(2, false));
  EXPECT_EQ(one, steps(2, true));
}

TEST(Solids, SleepingLavaWakesBeforeABarrelHitsIt) {
  const Real dx = 0.5;
  ModernOptions o = thick_lava(dx, 1e6, 0.05);
  o.sleep_speed = 0.05;
  o.sleep_delay = 0.2;
  o.max_step = 1;
  Obstacles obstacles;
  const std::size_t barrel = obstacles.add({CollisionMesh(geometry::make_box(Vec3(-1, -1, -1), Vec3(1, 1, 1))), {}, 0, 1});
  obstacles.update();
  const auto at = [](Real t) { return RigidPose{Vec3(-40 + 8 * t, 1, 1.2), Quat::Identity()}; };
  ModernLava lava(o, {}, {ground_at(0)}, {}, {&obstacles, [&](Real from, Real to) {
    obstacles.move(barrel, RigidMotion(at(from), at(to), to - from));
    obstacles.update();
  }, {}});
  fill(lava, lattice_block(5, 5, 3, dx));
  bool slept = false;
  while (lava.time() < 6) {
    lava.step(1);
    slept = slept || std::all_of(lava.asleep().begin(), lava.asleep().end(), [](std::uint8_t a) { return a != 0; });
    const Vec3 centre = at(lava.time()).position;
    for (const Vec3& p : lava.positions()) ASSERT_FALSE(((p - centre).cwiseAbs().array() < 0.999).all()) << p.transpose() << " is in the barrel at " << lava.time();
  }
  EXPECT_TRUE(slept);
  Real mean = 0;
  for (const Vec3& p : lava.positions()) mean += p.x() / static_cast<Real>(lava.size());
  EXPECT_GT(mean, 2) << "carried off";
}

TEST(Solids, FreeSlipHoldsLessThanNoSlip) {
  const auto travelled = [](Real friction) {
    Obstacles obstacles;
    obstacles.add({CollisionMesh(plate(Vec3(50, 0, 0), Vec3(0, 50, 0))), RigidMotion(RigidPose{Vec3(0, 0, 0), Quat::Identity()}), 0, 1});
    obstacles.update();
    ModernOptions o = thick_lava(0.5, 2000, 0.05);
    o.gravity = kGravity * Vec3(std::sin(0.3), 0, -std::cos(0.3));
    ModernLava lava(o, {}, {ground_at(-50)}, {}, {&obstacles, {}, {1, friction}});
    fill(lava, lattice_block(8, 8, 3, 0.5));
    while (lava.time() < 1) lava.step(0.05);
    Real mean = 0;
    for (const Vec3& v : lava.velocities()) mean += v.x() / static_cast<Real>(lava.size());
    return mean;
  };
  EXPECT_NEAR(travelled(0), kGravity * std::sin(0.3), 0.05 * kGravity * std::sin(0.3)) << "falls freely along it";
  EXPECT_LT(travelled(1), 0.5 * travelled(0));
}

}  // namespace
}  // namespace effuse::flow::sph
