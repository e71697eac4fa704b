#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "flow/sph/modern_lava.h"
#include "geometry/procedural/primitives.h"
#include "tests/flow/sph/beside_solids.h"
#include "tests/flow/sph/sample_system.h"

/// Lava along upright walls, beside exact solutions.
namespace effuse::flow::sph {
namespace {

using geometry::CollisionMesh;
using geometry::Obstacles;
using geometry::TriMesh;

constexpr Real kSpacing = 0.2, kNu = 1;

struct Duct {
  int wide, deep;       // particles
  Real first, second;   // friction of its walls
  Real error;           // of what passes, at most
};

/// What runs down an open duct of width w and depth H, F the acceleration: half of a closed one of height 2 H (White, Viscous Fluid Flow),
/// a = w / 2:   Q = 2 F H a^3 / (3 nu) (1 - 192 a / (pi^5 H) sum_odd tanh(n pi H / (2 a)) / n^5).
Real exact_discharge(Real w, Real H, Real F) {
  const Real a = w / 2;
  Real sum = 0;
  for (int n = 1; n < 200; n += 2) sum += std::tanh(n * kPi * H / (2 * a)) / std::pow(n, 5);
  return 2 * F * H * a * a * a / (3 * kNu) * (1 - 192 * a / (std::pow(kPi, 5) * H) * sum);
}

class DuctTest : public testing::TestWithParam<Duct> {};

TEST_P(DuctTest, PassesWhatTheSeriesSays) {
  const Duct duct = GetParam();
  const Real w = duct.wide * kSpacing, H = duct.deep * kSpacing, tilt = 0.05;
  ModernOptions o = thick_lava(kSpacing, kNu * ModernOptions().density, 0.05);
  o.gravity = kGravity * Vec3(std::sin(tilt), 0, -std::cos(tilt));
  o.period = Vec2(6 * kSpacing, 0);
  Obstacles obstacles;
  obstacles.add({CollisionMesh(geometry::make_box(Vec3(-90, -9, -1), Vec3(90, 0, 19))), {}, 0, 1});
  obstacles.add({CollisionMesh(geometry::make_box(Vec3(-90, w, -1), Vec3(90, w + 9, 19))), {}, 0, 2});
  obstacles.update();
  ModernLava lava(o, {}, {ground_at(0)}, {}, {&obstacles, {}, {1, duct.first, duct.second}});
  const std::vector<Vec3> x = lattice_block(6, duct.wide, duct.deep, kSpacing);
  lava.add(x, std::vector<Vec3>(x.size(), Vec3::Zero()), std::vector<Real>(x.size(), 1400));
  Real passed = 0;
  int steps = 0;
  while (lava.time() < 2) {
    lava.step(0.05);
    if (lava.time() < 1) continue;
    for (const Vec3& v : lava.velocities()) passed += v.x() * kSpacing * kSpacing / 6;
    ++steps;
  }
  // A wall that lets lava slip is the middle of a duct twice as wide.
  const bool slips = duct.first * duct.second == 0;
  const Real exact = slips ? exact_discharge(2 * w, H, kGravity * std::sin(tilt)) / 2 : exact_discharge(w, H, kGravity * std::sin(tilt));
  EXPECT_NEAR(passed / steps, exact, duct.error * exact) << passed / steps / exact;
}

// Before walls face to face and films against upright walls had their own factors: -11, +12, -2 and -2 %.
INSTANTIATE_TEST_SUITE_P(Narrow, DuctTest, testing::Values(Duct{3, 5, 1, 1, 0.10}, Duct{3, 10, 1, 1, 0.04}, Duct{6, 5, 1, 1, 0.10}, Duct{6, 10, 1, 1, 0.04}, Duct{3, 8, 0, 1, 0.08}));

// At rest in a vessel of obstacles: the walls' mirrored pressure holds lava in the corners as it does elsewhere.
TEST(DuctTest, LavaAtRestInAVesselHardlyCirculates) {
  const int wide = 8, deep = 6;
  const Real w = wide * kSpacing;
  TriMesh vessel = geometry::make_box(Vec3::Zero(), Vec3(w, w, 3 * deep * kSpacing));
  std::erase_if(vessel.triangles, [&](const geometry::Triangle& t) { return std::all_of(t.begin(), t.end(), [&](Index v) { return vessel.positions[v].z() > 0; }); });
  Obstacles obstacles;
  obstacles.add({CollisionMesh(vessel), {}, 0, 1});
  obstacles.update();
  ModernLava lava(thick_lava(kSpacing, kNu * ModernOptions().density, 0.05), {}, {ground_at(-100)}, {}, {&obstacles, {}, {}});
  const std::vector<Vec3> x = lattice_block(wide, wide, deep, kSpacing);
  lava.add(x, std::vector<Vec3>(x.size(), Vec3::Zero()), std::vector<Real>(x.size(), 1400));
  while (lava.time() < 2) lava.step(0.05);
  Real mean = 0, most = 0;
  for (const Vec3& v : lava.velocities()) {
    mean += v.norm() / static_cast<Real>(lava.size());
    most = std::max(most, v.norm());
  }
  const Real unit = kGravity * kSpacing * kSpacing / kNu;
  // 0.010 and 0.026; with moments of walls trimmed, and the walls' pushes not mirrored, 0.018 and 0.117.
  EXPECT_LT(mean / unit, 0.014);
  EXPECT_LT(most / unit, 0.05);
}

}  // namespace
}  // namespace effuse::flow::sph
