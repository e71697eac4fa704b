#include "flow/sph/pressed.h"

#include <gtest/gtest.h>

#include <iostream>

#include "flow/sph/modern_lava.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "tests/flow/sph/beside_solids.h"
#include "tests/flow/sph/sample_system.h"
#include "tests/flow/sph/soft_block.h"

/// Lava and solids that deform.
namespace effuse::flow::sph {
namespace {

using geometry::CollisionMesh;
using geometry::Obstacles;

void fill(ModernLava& lava, const std::vector<Vec3>& x, const std::vector<Vec3>& v) { lava.add(x, v, std::vector<Real>(x.size(), 1400)); }

std::vector<Vec3> outside(const std::vector<Vec3>& x, const Vec3& low, const Vec3& high, Real by) {
  std::vector<Vec3> out;
  for (const Vec3& p : x)
    if (((p - (low + high) / 2).cwiseAbs() - (high - low) / 2).maxCoeff() > by) out.push_back(p);
  return out;
}

std::string hash_of(const ModernLava& lava) {
  StateHash hash;
  lava.add_to(hash);
  return hash.hex();
}

/// A lump of lava with a block in it that whirls and stretches in free fall, without gravity.
struct Whirl {
  Real dx = 0.25;
  Vec3 low = Vec3(0.85, 0.75, 0.65), high = Vec3(1.65, 1.75, 1.85);
  SoftBlock block;
  Obstacles obstacles;
  ModernLava lava;
  Real scale = 0;

  static ModernOptions options(Real dx) {
    ModernOptions o = thick_lava(dx, 300, 0.02);
    o.gravity = Vec3::Zero();
    o.viscosity_tolerance = 1e-9;
    return o;
  }
  static SolidOptions with(Obstacles& obstacles, SoftBlock& block) {
    obstacles.add(block.obstacle(1));
    obstacles.update();
    SolidOptions o{&obstacles, {}, {}};
    o.deforming = {{0, &block}};
    return o;
  }
  Whirl(Real youngs_modulus, Real density) : block(low, high, 3, {youngs_modulus, 0.3, density, 0.01, 0}), lava(options(dx), {}, {ground_at(-1000)}, {}, with(obstacles, block)) {
    block.solid().gravity = Vec3::Zero();
    const std::vector<Vec3> x = outside(lattice_block(10, 10, 10, dx), low, high, 0.4 * dx);
    std::vector<Vec3> v;
    for (const Vec3& p : x) v.push_back(Vec3(1, 0.5, 0) + Vec3(0.3, -0.2, 1).cross(p - Vec3(1, 1, 1)) + 0.4 * Vec3(p.x() - 1.2, 1.2 - p.y(), 0));
    fill(lava, x, v);
    for (const Vec3& u : v) scale += lava.particle_mass() * u.norm();
  }
  Vec3 momentum() const {
    Vec3 sum = block.momentum();
    for (const Vec3& v : lava.velocities()) sum += lava.particle_mass() * v;
    return sum;
  }
};

// Whatever one gives the other takes, soft or stiff, light or heavy.
void keep_their_momentum(Real youngs_modulus, Real density, int steps) {
  Whirl whirl(youngs_modulus, density);
  const Vec3 before = whirl.momentum();
  Real given = 0, worst = 0;
  for (int k = 0; k < steps; ++k) {
    const Vec3 last = whirl.momentum();
    whirl.lava.step(0.02);
    worst = std::max(worst, (whirl.momentum() - last).norm());
    given += whirl.block.given.norm();
  }
  std::cout << "E " << youngs_modulus << " Pa, " << density << " kg/m3: astray " << (whirl.momentum() - before).norm() / whirl.scale << ", in one step " << worst / whirl.scale << "; given " << given / whirl.scale
            << " of the lava's\n";
  EXPECT_LT(worst, 1e-8 * whirl.scale) << youngs_modulus << " " << density;
  EXPECT_LT((whirl.momentum() - before).norm(), 1e-7 * whirl.scale) << youngs_modulus << " " << density;
  EXPECT_GT(given, 0.001 * whirl.scale) << "nothing was given";
  // It has come from rest to the speed of the lava it lies in, or, heavy, some of the way.
  const Real mass = density * (whirl.high - whirl.low).prod(), lava = whirl.lava.particle_mass() * static_cast<Real>(whirl.lava.size());
  const Vec3 mean = whirl.block.momentum() / mass, common = before / (mass + lava);
  if (steps >= 30) {
    EXPECT_GT(mean.dot(common) / common.squaredNorm(), density > 10000 ? 0.1 : 0.5);
  }
}

TEST(PressedSolids, LavaAndASolidKeepTheirMomentumTogether) { keep_their_momentum(2e4, 1000, 5); }

TEST(PressedSolidsSlow, SoftAndStiffLightAndHeavyOnesKeepTheirMomentumWithTheLava) {
  keep_their_momentum(2e4, 1000, 30);
  keep_their_momentum(1e9, 1000, 30);
  keep_their_momentum(2e4, 100, 30);
  keep_their_momentum(1e7, 20000, 30);
}

/// A block fills the bottom of a tray, held below; lava of depth H stands on it. With nu = 0 it is a column: its top goes down by p L / E. The tray's
/// walls are free of friction, and bear 6 % of the weight all the same, whatever the lava's viscosity and the block's stiffness: what the pressure that
/// goes on beyond them as in a mirror (pressure.h) pushes along them. In a tray twice as wide they bear 3 %.
struct Column {
  Real dx = 0.25, L = 1, H = 2, wide = 2;
  SoftBlock block;
  Obstacles obstacles;
  ModernLava lava;
  std::vector<Vec3> start;

  static SolidOptions with(Obstacles& obstacles, SoftBlock& block, Real wide) {
    obstacles.add({CollisionMesh(tray(Vec3(0, 0, -1), Vec3(wide, wide, 6))), {}, 0, 1});
    obstacles.add(block.obstacle(2));
    obstacles.update();
    SolidOptions o{&obstacles, {}, {}};
    o.friction = {1, 0, 1};
    o.deforming = {{1, &block}};
    return o;
  }
  Column(Real youngs_modulus, Real mu)
      : block(Vec3::Zero(), Vec3(wide, wide, L), 4, {youngs_modulus, 0, 1500, 0.05, 0}), lava(thick_lava(dx, mu, 0.05), {}, {ground_at(-100)}, {}, with(obstacles, block, wide)) {
    block.solid().gravity = Vec3::Zero();
    start.assign(block.places().begin(), block.places().end());
    for (std::size_t i = 0; i < start.size(); ++i) block.solid().held()[i] = start[i].z() < 0.01;
    std::vector<Vec3> x = lattice_block(8, 8, 8, dx);
    for (Vec3& p : x) p.z() += L;
    fill(lava, x, std::vector<Vec3>(x.size(), Vec3::Zero()));
  }
  /// Mean of its top, by area: an edge's node has half of what one within has, a corner's a quarter.
  Real sunk() {
    Real sum = 0, all = 0;
    for (std::size_t i = 0; i < start.size(); ++i) {
      if (start[i].z() < L - 0.01) continue;
      const auto share = [&](Real at) { return at < 0.01 || at > wide - 0.01 ? 0.5 : 1.0; };
      const Real area = share(start[i].x()) * share(start[i].y());
      sum += area * (L - block.places()[i].z());
      all += area;
    }
    return sum / all;
  }
};

TEST(PressedSolidsSlow, AColumnUnderLavaIsShortenedAsItsWeightSays) {
  for (const Real youngs_modulus : {1e6, 1e10}) {
    Column column(youngs_modulus, 5000);
    const Real pressure = column.lava.options().density * kGravity * column.H;
    Real speed = 0, mean = 0, pressed = 0, time = 0;
    while (column.lava.time() < 3) {
      const ModernReport report = column.lava.step(0.05);
      if (column.lava.time() < 2) continue;
      speed = std::max(speed, report.max_speed);
      mean += report.dt * column.sunk();
      pressed -= column.block.given.z();
      time += report.dt;
    }
    mean /= time;
    pressed /= time;
    const Real share = mean * youngs_modulus / (pressure * column.L), weight = pressure * column.wide * column.wide;
    std::cout << "E " << youngs_modulus << " Pa: sunk by " << share << " of p L / E, pressed by " << pressed / weight << " of the weight, lava up to " << speed << " m/s\n";
    EXPECT_NEAR(pressed / weight, 0.94, 0.03) << youngs_modulus;
    EXPECT_NEAR(share * weight / pressed, 1, 0.02) << youngs_modulus;
    EXPECT_LT(speed, 0.01 * std::sqrt(kGravity * column.H)) << youngs_modulus;
    for (const Vec3& p : column.lava.positions()) EXPECT_GT(p.z(), column.L - column.sunk() - 0.05);
  }
}

/// Lava falls on a block that is ten times as light and stands on the ground, held there.
struct Drop {
  SoftBlock block;
  Obstacles obstacles;
  ModernLava lava;
  Real fastest = 0, most = 0, smallest = 1, first = 0, largest = 0;
  std::size_t crushed = 0;

  explicit Drop(Real youngs_modulus) : block(Vec3::Zero(), Vec3(1, 1, 1), 3, {youngs_modulus, 0.3, 260, 0.01, 0}), lava(thick_lava(0.25, 100, 0.05), {}, {ground_at(0)}, {}, Whirl::with(obstacles, block)) {
    for (std::size_t i = 0; i < block.places().size(); ++i) block.solid().held()[i] = block.places()[i].z() < 0.01;
    std::vector<Vec3> x = lattice_block(5, 5, 5, 0.25);
    for (Vec3& p : x) p += Vec3(-0.1, -0.1, 1.5);
    fill(lava, x, std::vector<Vec3>(x.size(), Vec3(0, 0, -3)));
    first = largest = energy();
  }
  /// Of both, where they are and as they go [J].
  Real energy() {
    Real sum = block.solid().elastic_energy(block.places());
    for (std::size_t i = 0; i < block.places().size(); ++i) sum += block.masses()[i] * (block.velocities()[i].squaredNorm() / 2 + kGravity * block.places()[i].z());
    for (std::size_t i = 0; i < lava.size(); ++i) sum += lava.particle_mass() * (lava.velocities()[i].squaredNorm() / 2 + kGravity * lava.positions()[i].z());
    return sum;
  }
  void run(Real until) {
    while (lava.time() < until) {
      const ModernReport report = lava.step(0.05);
      largest = std::max(largest, energy());
      fastest = std::max(fastest, report.max_speed);
      for (const Vec3& v : block.velocities()) most = std::max(most, v.norm());
      smallest = std::min(smallest, block.solid().volume());
      crushed += report.solids.crushed;
    }
  }
};

// Soft, hard as wood, harder than rock: neither lava nor block runs away.
TEST(PressedSolidsSlow, SoftAndStiffOnesStayStableUnderLavaThatFallsOnThem) {
  for (const Real youngs_modulus : {1.5e5, 1e7, 1e11}) {
    Drop drop(youngs_modulus);
    drop.run(1.5);
    std::cout << "E " << youngs_modulus << " Pa: lava up to " << drop.fastest << " m/s, block up to " << drop.most << " m/s, its volume from " << drop.smallest << " to " << drop.block.solid().volume() << ", energy up to "
              << drop.largest / drop.first << " of what there was\n";
    EXPECT_LT(drop.fastest, 8) << youngs_modulus;  // free fall from 2.75 m, after 3 m/s: 7.9
    EXPECT_LT(drop.largest, 1.01 * drop.first) << youngs_modulus;
    EXPECT_EQ(drop.crushed, 0u);
    EXPECT_GT(drop.block.solid().volume(), youngs_modulus < 1e6 ? 0.7 : 0.98);
    EXPECT_LT(drop.block.solid().volume(), 1.05);
    EXPECT_GT(drop.block.steps, 20);
  }
}

// A jelly that the falling lava has energy enough to press flat: told, with the place, before it is turned inside out.
TEST(PressedSolids, OneThatIsPressedFlatEndsTheRun) {
  Drop drop(2e4);
  try {
    drop.run(1.5);
    ADD_FAILURE() << "it stood";
  } catch (const UnstableError& error) {
    EXPECT_NE(std::string(error.what()).find("pressed flat, or inside out"), std::string::npos) << error.what();
  }
}

TEST(PressedSolids, FarFromAllLavaTheyChangeNoBit) {
  const auto run = [](bool with) {
    SoftBlock block(Vec3(100, 100, 0), Vec3(101, 101, 1), 2, {1e5, 0.3, 1000, 0, 0});
    Obstacles obstacles;
    SolidOptions solids = with ? Whirl::with(obstacles, block) : SolidOptions{};
    ModernLava lava(thick_lava(0.5, 500, 0.05), {}, {ground_at(0)}, {}, solids);
    const std::vector<Vec3> x = lattice_block(6, 6, 6, 0.5);
    fill(lava, x, std::vector<Vec3>(x.size(), Vec3::Zero()));
    while (lava.time() < 0.5) lava.step(0.05);
    EXPECT_EQ(block.steps > 0, with);
    return hash_of(lava);
  };
  EXPECT_EQ(run(false), run(true));
}

// Torn to its last triangle between two steps or within one, it is met no more and goes on stepping.
TEST(PressedSolids, OneThatIsGoneIsLeftAlone) {
  Whirl whirl(1e5, 1000);
  for (int k = 0; k < 3; ++k) whirl.lava.step(0.02);
  whirl.block.lose_surface();
  const int before = whirl.block.steps;
  for (int k = 0; k < 3; ++k) whirl.lava.step(0.02);
  EXPECT_EQ(whirl.block.steps, before + 3);
  EXPECT_EQ(whirl.block.given, Vec3::Zero());
  EXPECT_TRUE(whirl.obstacles.empty());
}

TEST(PressedSolids, AreTheSameBitsOnAnyNumberOfThreads) {
  const auto run = [](int threads) {
    const ThreadLimit limit(threads);
    Whirl whirl(1e5, 1000);
    for (int k = 0; k < 6; ++k) whirl.lava.step(0.02);
    StateHash hash;
    whirl.lava.add_to(hash);
    hash.add(whirl.block.places());
    return hash.hex();
  };
  EXPECT_EQ(run(1), run(2));
}

}  // namespace
}  // namespace effuse::flow::sph
