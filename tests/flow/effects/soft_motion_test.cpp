#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>

#include "flow/effects/solid_world.h"
#include "flow/sph/modern_lava.h"
#include "tests/flow/sph/beside_solids.h"
#include "tests/flow/sph/sample_system.h"
#include "tests/flow/sph/soft_block.h"

/// How solids that deform move and bend in lava: beside what is known, and beside a rigid body.
namespace effuse::flow {
namespace {

using geometry::CollisionMesh;
using geometry::Obstacles;
using sph::ModernLava;
using sph::ModernOptions;
using sph::SoftBlock;
using sph::SolidOptions;

void fill(ModernLava& lava, const std::vector<Vec3>& x) { lava.add(x, std::vector<Vec3>(x.size(), Vec3::Zero()), std::vector<Real>(x.size(), 1400)); }

/// Sheets that stand still, and a block.
SolidOptions with(Obstacles& obstacles, const geometry::TriMesh& sheets, SoftBlock& block) {
  obstacles.add({CollisionMesh(sheets), {}, 0, 1});
  obstacles.add(block.obstacle(2));
  obstacles.update();
  SolidOptions o{&obstacles, {}, {}};
  o.deforming = {{1, &block}};
  return o;
}

/// Of a solid what is below a height: each tetrahedron by 35 places evenly in it.
Real volume_below(const fem::ElasticSolid& solid, Real z) {
  Real sum = 0;
  for (const auto& t : solid.tets()) {
    const auto& x = solid.state().x;
    const Real volume = (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]).dot(x[t[3]] - x[t[0]]) / 6;
    int below = 0, all = 0;
    for (int a = 0; a <= 4; ++a)
      for (int b = 0; a + b <= 4; ++b)
        for (int c = 0; a + b + c <= 4; ++c, ++all) {
          const auto at = [](int k) { return (k + 0.25) / 5; };
          below += at(a) * x[t[0]].z() + at(b) * x[t[1]].z() + at(c) * x[t[2]].z() + (1 - at(a) - at(b) - at(c)) * x[t[3]].z() < z;
        }
    sum += volume * below / all;
  }
  return sum;
}

struct Floating {
  Real displaced = 0, speed = 0, volume = 0;
};
/// A cube of side 1.5 m, of so much of the lava's density, is let go in a pool of 5 m by 5 m. What it displaces in the end, by its weight: the level
/// is that at which pool and block have room for the lava.
Floating float_block(Real share, Real youngs_modulus, Real begins_under, Real until) {
  const Real dx = 0.25, side = 1.5, wide = 20 * dx, deep = 8 * dx;
  ModernOptions o = sph::thick_lava(dx, 3000, 0.02);
  const Vec3 low(wide / 2 - side / 2, wide / 2 - side / 2, deep - begins_under * side), high = low + Vec3::Constant(side);
  SoftBlock block(low, high, 4, {youngs_modulus, 0.3, share * o.density, 0.02, 0});
  Obstacles obstacles;
  ModernLava lava(o, {}, {sph::ground_at(-100)}, {}, with(obstacles, sph::tray(Vec3::Zero(), Vec3(wide, wide, 3 * deep)), block));
  std::vector<Vec3> x;
  for (const Vec3& p : sph::lattice_block(20, 20, 8, dx))
    if (((p - (low + high) / 2).cwiseAbs() - Vec3::Constant(side / 2)).maxCoeff() > 0.4 * dx) x.push_back(p);
  fill(lava, x);
  while (lava.time() < until) lava.step(0.02);
  Real bottom = 0, top = 3 * deep;
  for (int k = 0; k < 50; ++k) {
    const Real level = (bottom + top) / 2;
    (level * wide * wide < lava.volume() + volume_below(block.solid(), level) ? bottom : top) = level;
  }
  Floating result;
  result.displaced = volume_below(block.solid(), bottom) / (share * side * side * side);
  result.volume = block.solid().volume() / (side * side * side);
  result.speed = (block.momentum() / (share * o.density * side * side * side)).norm();
  std::cout << "share " << share << ", E " << youngs_modulus << " Pa: displaces " << result.displaced << " of its weight, level " << bottom << ", speed " << result.speed << " m/s, volume " << result.volume << "\n";
  return result;
}

// -1.0, -0.2 and, of the soft one that the lava's pressure bends most, -5.2 %; a rigid cube (SolidWorldSlow) is off by -3.4, -0.8 and -2.9 %.
TEST(SoftMotionSlow, AFloatingBlockDrawsWhatArchimedesSays) {
  for (const auto& [share, youngs_modulus] : {std::pair(0.3, 1e6), {0.6, 1e7}, {0.8, 2e5}}) {
    const Floating f = float_block(share, youngs_modulus, 0.8 * share, 6);
    EXPECT_NEAR(f.displaced, 1, youngs_modulus < 1e6 ? 0.07 : 0.05) << share;
    EXPECT_LT(f.speed, 0.05) << share;
    EXPECT_NEAR(f.volume, 1, 0.1) << share;
  }
}

// A twentieth as heavy as the lava and soft as foam, let go under it, it comes up as a rigid body does. A draught of 7.5 cm is less than a third of
// a spacing: neither shows it; both are to lie on the lava, and still.
TEST(SoftMotionSlow, FoamHeldUnderHeavyLavaComesUpAsARigidBodyDoes) {
  const Real dx = 0.25, side = 1, wide = 3, deep = 2, share = 0.05;
  const ModernOptions o = sph::thick_lava(dx, 1000, 0.02);
  const Vec3 middle(wide / 2, wide / 2, deep - 0.6), half = Vec3::Constant(side / 2);
  const geometry::TriMesh vessel = sph::tray(Vec3::Zero(), Vec3(wide, wide, 3 * deep));
  std::vector<Vec3> x;
  for (const Vec3& p : sph::lattice_block(12, 12, 8, dx))
    if (((p - middle).cwiseAbs() - half).maxCoeff() > 0.4 * dx) x.push_back(p);
  PlacedBody body;
  body.name = "block";
  body.mesh = geometry::make_box(-half, half);
  body.density = share * o.density;
  body.pose.position = middle;
  SolidWorld world({{"tray", CollisionMesh(vessel), geometry::PoseTrack(std::vector<geometry::PoseKey>(1)), 0, 1}}, {body}, nullptr);
  ModernLava beside(o, {}, {sph::ground_at(-100)}, {}, world.solids());
  SoftBlock block(middle - half, middle + half, 3, {3e5, 0.3, share * o.density, 0.02, 0});
  Obstacles obstacles;
  ModernLava lava(o, {}, {sph::ground_at(-100)}, {}, with(obstacles, vessel, block));
  Real fastest = 0;
  for (ModernLava* each : {&beside, &lava}) {
    fill(*each, x);
    while (each->time() < 5) {
      each->step(0.02);
      for (const Vec3& v : block.velocities()) fastest = std::max(fastest, v.norm());
    }
  }
  Vec3 now = Vec3::Zero();
  for (const Vec3& p : block.places()) now += p / static_cast<Real>(block.places().size());
  const Real speed = (block.momentum() / (share * o.density * side * side * side)).norm();
  std::cout << "foam comes up from " << middle.z() << " m to " << now.z() << " m, a rigid body to " << world.poses()[0].position.z() << " m; its speed " << speed << " m/s, a node's up to " << fastest << " m/s\n";
  EXPECT_NEAR(now.z(), world.poses()[0].position.z(), 0.2 * side);
  EXPECT_GT(now.z(), lava.volume() / (wide * wide) + half.z() - 1.2 * dx);
  EXPECT_LT(fastest, 8);
  EXPECT_NEAR(block.solid().volume(), side * side * side, 0.05);
}

/// The way of a cube's middle as lava slumps against it and lifts it.
template <class Step, class Middle>
std::vector<Vec3> way_of(Step&& step, Middle&& middle) {
  std::vector<Vec3> way = {middle()};
  for (int k = 0; k < 100; ++k) {
    step();
    way.push_back(middle());
  }
  return way;
}

TEST(SoftMotionSlow, AVeryStiffOneGoesAsARigidBodyDoes) {
  const Real dx = 0.2, side = 1, share = 0.5;
  const ModernOptions o = sph::thick_lava(dx, 1000, 0.02);
  const Vec3 middle(2.4, 1.3, 0.75), half = Vec3::Constant(side / 2);
  const geometry::TriMesh vessel = sph::tray(Vec3::Zero(), Vec3(4, 2.4, 4));
  std::vector<Vec3> x;
  for (const Vec3& p : sph::lattice_block(20, 12, 10, dx))
    if ((p.x() < 1.4 || p.z() < 0.8) && ((p - middle).cwiseAbs() - half).maxCoeff() > 0.4 * dx) x.push_back(p);

  std::vector<std::vector<Vec3>> ways;
  {
    PlacedBody body;
    body.name = "block";
    body.mesh = geometry::make_box(-half, half);
    body.density = share * o.density;
    body.pose.position = middle;
    SolidWorld world({{"tray", CollisionMesh(vessel), geometry::PoseTrack(std::vector<geometry::PoseKey>(1)), 0, 1}}, {body}, nullptr);
    ModernLava lava(o, {}, {sph::ground_at(-100)}, {}, world.solids());
    fill(lava, x);
    ways.push_back(way_of([&] { lava.step(0.02); }, [&] { return world.poses()[0].position; }));
  }
  for (const Real youngs_modulus : {1e10, 1e6}) {
    SoftBlock block(middle - half, middle + half, 3, {youngs_modulus, 0.3, share * o.density, 0.01, 0});
    Obstacles obstacles;
    ModernLava lava(o, {}, {sph::ground_at(-100)}, {}, with(obstacles, vessel, block));
    fill(lava, x);
    ways.push_back(way_of([&] { lava.step(0.02); }, [&] {
      Vec3 sum = Vec3::Zero();
      Real mass = 0;
      for (std::size_t i = 0; i < block.solid().nodes(); ++i) {
        sum += block.masses()[i] * block.places()[i];
        mass += block.masses()[i];
      }
      return Vec3(sum / mass);
    }));
  }
  Real far = 0;
  std::vector<Real> apart(2, 0.0);
  for (std::size_t k = 0; k < ways[0].size(); ++k) {
    far = std::max(far, (ways[0][k] - ways[0][0]).norm());
    for (std::size_t w = 0; w < 2; ++w) apart[w] = std::max(apart[w], (ways[w + 1][k] - ways[0][k]).norm());
  }
  std::cout << "the rigid one goes " << far << " m, to " << ways[0].back().transpose() << "; of E 1e10 Pa " << apart[0] << " m from it at most, of 1e6 Pa " << apart[1] << " m\n";
  EXPECT_GT(far, 0.3);
  EXPECT_LT(apart[0], 0.05 * far);
}

// A plate held at its edges, the floor of a vessel of lava: its middle goes down as under the same weight laid on its nodes.
TEST(SoftMotionSlow, APlateUnderLavaBendsAsUnderItsWeight) {
  const Real dx = 0.2, wide = 2, thick = 0.3, deep = 1;
  const ModernOptions o = sph::thick_lava(dx, 2000, 0.02);
  const Vec3 low(0, 0, -thick), high(wide, wide, 0);
  const auto plate = [&] {
    SoftBlock block(low, high, 8, {2e6, 0.3, 1500, 0.02, 0});
    block.solid().gravity = Vec3::Zero();
    for (std::size_t i = 0; i < block.places().size(); ++i) {
      const Vec3& p = block.places()[i];
      block.solid().held()[i] = std::min({p.x(), p.y(), wide - p.x(), wide - p.y()}) < 0.01;
    }
    return block;
  };
  const auto sag = [&](SoftBlock& block) {
    Real lowest = 0;
    for (const Vec3& p : block.places())
      if ((p.head<2>() - Vec2(wide / 2, wide / 2)).norm() < 0.1 && p.z() > -thick / 2) lowest = std::min(lowest, p.z());
    return -lowest;
  };

  SoftBlock under = plate();
  Obstacles obstacles;
  ModernLava lava(o, {}, {sph::ground_at(-100)}, {}, with(obstacles, sph::tray(Vec3(0, 0, -1), Vec3(wide, wide, 4)), under));
  fill(lava, sph::lattice_block(10, 10, 5, dx));
  while (lava.time() < 1.5) lava.step(0.02);
  Real mean = 0, given = 0;
  int n = 0;
  while (lava.time() < 2) {
    const Real dt = lava.step(0.02).dt;
    mean += sag(under);
    given -= under.given.z() / dt;
    ++n;
  }
  mean /= n;
  given /= n;

  // The weight as pressure on the top's triangles, a third on each corner, more where it has gone down.
  SoftBlock loaded = plate();
  const geometry::TriMesh faces = loaded.solid().surface();
  for (int k = 0; k < 60; ++k) {
    std::vector<Vec3> load(loaded.places().size(), Vec3::Zero());
    const Real level = lava.volume() / (wide * wide) - (wide * wide * thick - loaded.solid().volume()) / (wide * wide);
    for (const geometry::Triangle& t : faces.triangles) {
      const Vec3 a = loaded.places()[t[0]], b = loaded.places()[t[1]], c = loaded.places()[t[2]], area = (b - a).cross(c - a) / 2;
      if (area.z() < 0.7 * area.norm()) continue;
      const Real pressure = o.density * kGravity * (level - (a.z() + b.z() + c.z()) / 3);
      for (const Index v : t) load[v] -= pressure * area / 3;
    }
    loaded.go(0.02 * (k + 1), load);
  }
  const Real weight = o.density * kGravity * lava.volume(), expected = sag(loaded);
  std::cout << "a plate sags by " << mean << " m under lava, by " << expected << " m under its weight: " << mean / expected << "; on what gives way lie " << given / weight << " of it\n";
  EXPECT_GT(expected, 0.02);
  EXPECT_LT(expected, 0.2 * deep);
  EXPECT_NEAR(mean, expected, 0.07 * expected);
}

}  // namespace
}  // namespace effuse::flow
