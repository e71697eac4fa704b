#include "flow/effects/solid_world.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>

#include "flow/sph/modern_lava.h"
#include "geometry/procedural/primitives.h"
#include "tests/flow/sph/beside_solids.h"
#include "tests/flow/sph/sample_system.h"

/// Lava and rigid bodies moving each other.
namespace effuse::flow {
namespace {

using geometry::CollisionMesh;
using geometry::RigidPose;
using geometry::TriMesh;
using sph::ModernLava;
using sph::ModernOptions;

PlacedObstacle still(const char* name, const TriMesh& mesh) { return {name, CollisionMesh(mesh), geometry::PoseTrack(std::vector<geometry::PoseKey>(1)), 0, 1}; }

PlacedBody block(const Vec3& half, Real density, const Vec3& at) {
  PlacedBody body;
  body.name = "block";
  body.mesh = geometry::make_box(-half, half);
  body.density = density;
  body.pose.position = at;
  return body;
}

void fill(ModernLava& lava, const std::vector<Vec3>& x, const std::vector<Vec3>& v) { lava.add(x, v, std::vector<Real>(x.size(), 1400)); }

Vec3 momentum(const ModernLava& lava, const SolidWorld& world, std::size_t bodies) {
  Vec3 p = Vec3::Zero();
  for (const Vec3& v : lava.velocities()) p += lava.particle_mass() * v;
  for (std::size_t b = 0; b < bodies; ++b) p += world.bodies().momenta()[b];
  return p;
}

// A lump of lava with a block in it, that whirls and stretches in free fall without gravity: whatever one gives the other takes.
TEST(SolidWorld, LavaAndBodyKeepTheirMomentumTogether) {
  const Real dx = 0.25;
  ModernOptions o = sph::thick_lava(dx, 300, 0.02);
  o.gravity = Vec3::Zero();
  bodies::BodyOptions still;
  still.gravity = Vec3::Zero();
  const Vec3 half(0.4, 0.5, 0.6);
  for (const Real density : {260.0, 26000.0}) {
    SolidWorld world({}, {block(half, density, Vec3(1.25, 1.25, 1.25))}, nullptr, still);
    ModernLava lava(o, {}, {sph::ground_at(-1000)}, {}, world.solids());
    std::vector<Vec3> x, v;
    for (const Vec3& p : sph::lattice_block(10, 10, 10, dx))
      if (((p - Vec3(1.25, 1.25, 1.25)).cwiseAbs() - half).maxCoeff() > 0.4 * dx) {
        x.push_back(p);
        v.push_back(Vec3(1, 0.5, 0) + Vec3(0.3, -0.2, 1).cross(p - Vec3(1, 1, 1)) + 0.4 * Vec3(p.x() - 1.2, 1.2 - p.y(), 0));
      }
    fill(lava, x, v);
    const Vec3 before = momentum(lava, world, 1);
    Real scale = 0;
    for (const Vec3& u : v) scale += lava.particle_mass() * u.norm();
    Real moved = 0;
    for (int k = 0; k < 40; ++k) {
      const Vec3 last = momentum(lava, world, 1);
      lava.step(0.02);
      // What particles stopped by a surface give it comes with the body's next step; here it is in its momentum already.
      EXPECT_LT((momentum(lava, world, 1) - last).norm(), 1e-7 * scale) << "step " << k << " density " << density;
      moved = std::max(moved, world.velocity(0).norm());
    }
    EXPECT_LT((momentum(lava, world, 1) - before).norm(), 1e-6 * scale) << density;
    EXPECT_GT(moved, density < 1000 ? 0.5 : 0.02) << "nothing was given";
  }
}

// A closed box, free to go itself, with lava and a block in it, at the default tolerances.
TEST(SolidWorld, AClosedBoxAndWhatIsInItKeepTheirMomentumTogether) {
  const Real dx = 0.25;
  ModernOptions o = sph::thick_lava(dx, 300, 0.02);
  o.gravity = Vec3::Zero();
  bodies::BodyOptions weightless;
  weightless.gravity = Vec3::Zero();
  const Vec3 half(0.4, 0.5, 0.6), middle = Vec3::Constant(1.25);
  PlacedBody box = block(Vec3::Constant(1.6), 1500, middle);
  box.hull = false;
  TriMesh room = geometry::make_box(Vec3::Constant(-1.25), Vec3::Constant(1.25));
  const auto first = static_cast<Index>(box.mesh.positions.size());
  for (const Vec3& p : room.positions) box.mesh.positions.push_back(p);
  for (const auto& [a, b, c] : room.triangles) box.mesh.triangles.push_back({first + a, first + c, first + b});
  box.velocity = Vec3(-0.5, 0, 0.2);
  box.spin = Vec3(0, 0.3, 0);
  SolidWorld world({}, {box, block(half, 2000, middle)}, nullptr, weightless);
  ASSERT_NEAR(world.bodies().mass(0), 1500 * (std::pow(3.2, 3) - std::pow(2.5, 3)), 1) << "it is hollow";
  ModernLava lava(o, {}, {sph::ground_at(-1000)}, {}, world.solids());
  std::vector<Vec3> x, v;
  for (const Vec3& p : sph::lattice_block(10, 10, 8, dx))
    if (((p - middle).cwiseAbs() - half).maxCoeff() > 0.4 * dx) {
      x.push_back(p);
      v.push_back(Vec3(1, 0.5, 0) + Vec3(0.3, -0.2, 1).cross(p - middle));
    }
  fill(lava, x, v);
  const Vec3 before = momentum(lava, world, 2), box_before = world.bodies().momenta()[0];
  const Real scale = before.norm();
  for (int k = 0; k < 50; ++k) {
    lava.step(0.02);
    EXPECT_LT((momentum(lava, world, 2) - before).norm(), 1e-6 * scale) << "step " << k;
  }
  EXPECT_GT((world.bodies().momenta()[0] - box_before).norm(), 0.1 * scale) << "nothing was given";
  for (const Vec3& p : lava.positions()) EXPECT_LT(world.poses()[0].body(p).cwiseAbs().maxCoeff(), 1.25) << "out of the box";
}

// Lava slumps over pebbles that are far lighter than its particles, of 40 kg: it takes them along, it does not shoot them.
TEST(SolidWorldSlow, PebblesLighterThanAParticleGoNoFasterThanTheLava) {
  const Real dx = 0.25;
  for (const Real edge : {0.1, 0.02, 0.002}) {
    std::vector<PlacedBody> pebbles;
    for (int k = 0; k < 12; ++k) pebbles.push_back(block(Vec3::Constant(edge / 2), 2000, Vec3(1.3 + 0.2 * (k % 4), 0.4 + 0.3 * (k / 4), edge / 2)));
    SolidWorld world({still("tray", sph::tray(Vec3::Zero(), Vec3(3, 1.5, 3)))}, pebbles, nullptr);
    ModernLava lava(sph::thick_lava(dx, 300, 0.02), {}, {sph::ground_at(-100)}, {}, world.solids());
    const std::vector<Vec3> x = sph::lattice_block(4, 6, 6, dx);
    fill(lava, x, std::vector<Vec3>(x.size(), Vec3::Zero()));
    Real fastest = 0, lavas = 0;
    while (lava.time() < 2) {
      lavas = std::max(lavas, lava.step(0.02).max_speed);
      for (std::size_t b = 0; b < pebbles.size(); ++b) fastest = std::max(fastest, world.velocity(b).norm());
    }
    EXPECT_GT(fastest, 0.1) << "never reached, edge " << edge;
    EXPECT_LT(fastest, 2 * lavas) << "edge " << edge;
  }
}

struct Floating {
  Real draught = 0, level = 0, speed = 0, tilt = 0;
};
/// A cube of side 1.5 m, of so much of the lava's density, in a pool of 6 m by 6 m.
Floating float_block(Real share, Real dx, Real until) {
  ModernOptions o = sph::thick_lava(dx, 3000, 0.02);
  const Real side = 1.5, wide = 20 * dx, deep = 8 * dx;
  SolidWorld world({still("tray", sph::tray(Vec3::Zero(), Vec3(wide, wide, 3 * deep)))}, {block(Vec3::Constant(side / 2), share * o.density, Vec3(wide / 2, wide / 2, deep + side / 2 - share * side * 0.8))}, nullptr);
  ModernLava lava(o, {}, {sph::ground_at(-100)}, {}, world.solids());
  std::vector<Vec3> x;
  const Vec3 centre = world.poses()[0].position;
  for (const Vec3& p : sph::lattice_block(20, 20, 8, dx))
    if (((p - centre).cwiseAbs() - Vec3::Constant(side / 2)).maxCoeff() > 0.4 * dx) x.push_back(p);
  fill(lava, x, std::vector<Vec3>(x.size(), Vec3::Zero()));
  while (lava.time() < until) lava.step(0.02);
  Floating result;
  // The level, from the volume: what is in the pool and what the block takes of it.
  const Vec3 at = world.poses()[0].position;
  const Real bottom = at.z() - side / 2;
  // level * area = lava + side^2 (level - bottom)
  result.level = (lava.volume() - side * side * bottom) / (wide * wide - side * side);
  result.draught = (result.level - bottom) / side;
  result.speed = world.velocity(0).norm();
  result.tilt = std::acos(std::clamp((world.poses()[0].orientation * Vec3::UnitZ()).cwiseAbs().maxCoeff(), 0.0, 1.0)) * 180 / kPi;
  std::cout << "share " << share << " dx " << dx << ": draught " << result.draught << " of the side, level " << result.level << ", speed " << result.speed << ", tilt " << result.tilt << " deg, "
            << lava.size() << " particles\n";
  return result;
}

/// An upright cylinder, open at the top: a sheet of so many sides.
TriMesh tube(Real radius, Real height, int sides) {
  TriMesh m;
  for (int k = 0; k < sides; ++k)
    for (const Real z : {0.0, height}) m.positions.push_back(Vec3(radius * std::cos(2 * kPi * k / sides), radius * std::sin(2 * kPi * k / sides), z));
  m.positions.push_back(Vec3::Zero());
  const auto n = static_cast<Index>(sides);
  for (Index k = 0; k < n; ++k) {
    const Index next = (k + 1) % n;
    m.triangles.push_back({2 * k, 2 * next, 2 * k + 1});
    m.triangles.push_back({2 * next, 2 * next + 1, 2 * k + 1});
    m.triangles.push_back({2 * k, 2 * n, 2 * next});
  }
  return m;
}

struct Sinking {
  Real speed = 0, exact = 0, reynolds = 0;
};
/// A ball of radius a, twice and a half as heavy as the lava, sinks along the axis of a tube of radius a / share, a / dx = fine. What it reaches, and
/// Stokes's speed with Haberman's correction for the tube's wall (Happel & Brenner 1965, Low Reynolds Number Hydrodynamics, 7-3):
///   U = 2 a^2 (rho_ball - rho) g / (9 mu K),  K = (1 - 0.75857 s^5) / (1 - 2.1050 s + 2.0865 s^3 - 1.7068 s^5 + 0.72603 s^6),  s = share
/// The bottom and the surface are more than a tube's radius away, where they count for less than a hundredth.
Sinking sink_ball(Real share, Real fine) {
  const Real a = 1, dx = a / fine, R = a / share, H = 5 * R, mu = 40000;
  ModernOptions o = sph::thick_lava(dx, mu, 0.25);
  PlacedBody ball;
  ball.name = "ball";
  ball.mesh = geometry::make_sphere(Vec3::Zero(), a, 3);
  ball.density = 2.5 * o.density;
  ball.pose.position = Vec3(0, 0, 0.62 * H);
  const PlacedObstacle vessel = still("tube", tube(R, 1.5 * H, 96));
  SolidWorld world({vessel}, {ball}, nullptr);
  ModernLava lava(o, {}, {sph::ground_at(-100)}, {}, world.solids());
  std::vector<Vec3> x;
  const int wide = 2 * static_cast<int>(std::ceil(R / dx));
  for (Vec3 p : sph::lattice_block(wide, wide, static_cast<int>(std::lround(H / dx)), dx)) {
    p -= Vec3(wide * dx / 2, wide * dx / 2, 0);
    if (p.head<2>().norm() < R - 0.3 * dx && (p - ball.pose.position).norm() > a + 0.3 * dx) x.push_back(p);
  }
  fill(lava, x, std::vector<Vec3>(x.size(), Vec3::Zero()));
  Sinking result;
  const Real s = share, K = (1 - 0.75857 * std::pow(s, 5)) / (1 - 2.1050 * s + 2.0865 * std::pow(s, 3) - 1.7068 * std::pow(s, 5) + 0.72603 * std::pow(s, 6));
  result.exact = 2 * a * a * 1.5 * o.density * kGravity / (9 * mu * K);
  // What the lattice around it leaves open closes first, and lets it fall: ten seconds.
  const auto height = [&] { return world.poses()[0].position.z(); };
  while (lava.time() < 12) lava.step(0.25);
  const Real from = height(), begin = lava.time();
  while (lava.time() < 24) lava.step(0.25);
  result.speed = (from - height()) / (lava.time() - begin);
  result.reynolds = o.density * result.speed * a / mu;
  std::cout << "ball of " << fine << " spacings in a tube " << 1 / share << " times as wide: " << result.speed << " m/s, exact " << result.exact << " (" << 100 * (result.speed / result.exact - 1)
            << " %), wall correction " << K << ", Re " << result.reynolds << ", " << lava.size() << " particles\n";
  return result;
}

// Wanted within 10 %: -6.8 % from this start (-24.9 % without even_out.h), -8.2 % at 4.5 spacings to its radius (-19.1 %). Its start changes little:
// -7.1 % in lava that fills all but the ball's volume. Depth does: from such a start, mean of 9 to 18 s, it is off by +7 % 3.1 radii below the
// surface, -7 % at 4.8 and -27 % at 6.8 (without even_out.h -8, -29 and -48 %). That is the mark of the background pressure, which pushes unevenly
// where shear has drawn the particles' pattern out; pressure in a solved flow is otherwise of no account. What is left of it grows with depth still.
// Not the cause, each tried by itself: impulses of particles that the ball's surface stops (3e-5 of its weight); the rate of compression
// of a linear flow, made exact by its error in the step's right-hand side (1 %); several rounds of both solves, steps a quarter as long (a tenth at most).
// In disorder a quarter of the lava's first spacing off the ball holds 1.5 times its share of particles: they ride with it.
TEST(SolidWorldSlow, ABallSinksNearlyAsFastAsStokesAndHabermanSay) {
  const Sinking ball = sink_ball(0.5, 3);
  EXPECT_LT(ball.reynolds, 0.1);
  EXPECT_NEAR(ball.speed, ball.exact, 0.1 * ball.exact);
}

TEST(SolidWorldSlow, AFloatingBlockDrawsWhatArchimedesSays) {
  for (const Real share : {0.3, 0.6, 0.8}) {
    const Floating f = float_block(share, 0.25, 8);
    EXPECT_NEAR(f.draught, share, 0.05 * share);
    EXPECT_LT(f.speed, 0.05);
  }
}

}  // namespace
}  // namespace effuse::flow
