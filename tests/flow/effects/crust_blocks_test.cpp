#include "flow/effects/crust_blocks.h"

#include <gtest/gtest.h>

#include <cmath>
#include <iostream>

#include "geometry/base/parallel.h"
#include "geometry/terrain/height_field.h"
#include "tests/flow/sph/sample_system.h"

namespace effuse::flow {
namespace {

using sph::ModernLava;
using sph::ModernOptions;

constexpr Real kDx = 0.25;

geometry::Terrain slope(Real fall) {
  std::vector<Real> z;
  for (int j = 0; j < 3; ++j)
    for (int i = 0; i < 3; ++i) z.push_back(-fall * 40 * (i - 1));
  return geometry::Terrain::from_height_field(geometry::HeightField({-40, -40}, {40, 40}, 3, 3, z));
}

ModernOptions crusting(Real mu) {
  ModernOptions o;
  o.spacing = kDx;
  o.rheology = sph::Rheology::newtonian(mu);
  o.rest_period = 0;
  o.ground_speed = 0;
  o.max_step = 0.05;
  o.heat.curve.solidus = 1273;
  o.heat.curve.liquidus = 1423;
  o.heat.curve.latent_heat = 350e3;
  o.heat.curve.heat_capacity = 1150;
  o.heat.crust_temperature = 1405;  // crust within a second, for a short test
  return o;
}

/// A sheet of hot lava on a slope, with what its crust becomes.
struct Flow {
  geometry::Terrain terrain;
  SolidWorld world;
  ModernLava lava;
  CrustBlocks blocks;
  Flow(Real fall, Real mu, const CrustBlockOptions& options, int nx = 18, int ny = 12, int nz = 4)
      : terrain(slope(fall)),
        world({}, {}, &terrain, {}, {}, true),
        lava(crusting(mu), {}, {[this](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) { terrain.contacts(x, reach, out); }}, {}, world.solids()),
        blocks(options, kDx) {
    std::vector<Vec3> x = sph::lattice_block(nx, ny, nz, kDx);
    for (Vec3& p : x) p.z() += *terrain.height(p.x(), p.y());
    lava.add(x, std::vector<Vec3>(x.size(), Vec3::Zero()), std::vector<Real>(x.size(), 1423));
  }
  void run(Real seconds) {
    const Real end = lava.time() + seconds;
    while (end - lava.time() > 1e-9) {  // a crumb of a step would leave a huge acceleration
      lava.step(std::min(0.05, end - lava.time()));
      blocks.step(lava, world, terrain);
    }
  }
  std::string hash() const {
    StateHash hash;
    lava.add_to(hash);
    world.add_to(hash);
    blocks.add_to(hash);
    return hash.hex();
  }
};

CrustBlockOptions easily() {
  CrustBlockOptions o;
  o.on = true;
  o.thickness = 0.0005;
  o.strain = 0.02;
  o.size = 1.25;
  o.depth = 0.1;
  o.density = 2080;
  o.interval = 0.2;
  return o;
}

TEST(CrustBlocksSlow, MassOfLavaAndBlocksTogetherStays) {
  Flow flow(0.2, 3000, easily());
  const Real before = flow.lava.particle_mass() * static_cast<Real>(flow.lava.size());
  flow.run(1.2);
  ASSERT_GT(flow.blocks.born(), 3u);
  const Real lava = flow.lava.particle_mass() * static_cast<Real>(flow.lava.size());
  EXPECT_NEAR(lava + flow.world.block_mass(), before, 1e-12 * before);
  EXPECT_NEAR(flow.lava.mass_taken(), flow.world.block_mass(), 1e-12 * before);
  EXPECT_NEAR(flow.blocks.mass(), flow.world.block_mass(), 1e-12 * before);
}

TEST(CrustBlocks, ABlockTakesOverTheMomentumOfItsParticles) {
  Flow flow(0.2, 3000, easily());
  for (int k = 0; k < 200; ++k) {
    flow.lava.step(0.05);
    const auto momentum = [&] {
      Vec3 p = Vec3::Zero();
      for (const Vec3& v : flow.lava.velocities()) p += flow.lava.particle_mass() * v;
      for (const Vec3& q : flow.world.bodies().momenta()) p += q;
      return p;
    };
    const Vec3 before = momentum();
    const std::size_t born = flow.blocks.born();
    flow.blocks.step(flow.lava, flow.world, flow.terrain);
    EXPECT_LT((momentum() - before).norm(), 1e-12 * (1 + before.norm()));
    if (flow.blocks.born() > born) return;
  }
  FAIL() << "no block was born";
}

// A raft on a film that flows down a plane steadily (Nusselt): its speed is the surface's, u = g sin(a) H^2 / 2 nu.
TEST(CrustBlocksSlow, ARaftGoesAsFastAsTheSurface) {
  ModernOptions o = crusting(3000);
  o.heat.on = false;
  const int nx = 28, ny = 20, nz = 6;
  o.period = Vec2(nx * kDx, ny * kDx);
  const Real H = nz * kDx, nu = 3000 / o.density;
  o.gravity = Vec3(0.02 * 9.81, 0, -9.81);
  bodies::BodyOptions body;
  body.gravity = o.gravity;
  SolidWorld world({}, {}, nullptr, body, {}, true);
  const auto ground = [](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      out[i] = {};
      if (x[i].z() < reach) out[i] = {Vec3(x[i].x(), x[i].y(), 0), Vec3::UnitZ(), x[i].z(), Vec3::Zero(), 0, 0};
    }
  };
  ModernLava lava(o, {}, {ground}, {}, world.solids());
  // With the film's own profile from the start.
  const std::vector<Vec3> x = sph::lattice_block(nx, ny, nz, kDx);
  const Real g = o.gravity.x();
  std::vector<Vec3> v;
  for (const Vec3& p : x) v.emplace_back(g / nu * (H * p.z() - p.z() * p.z() / 2), 0, 0);
  lava.add(x, v, std::vector<Real>(x.size(), 1400));
  const Real u = g * H * H / (2 * nu), t = 0.12, half = 0.7;
  std::vector<Vec3> corners;
  for (const Real z : {-t / 2, t / 2})
    for (const Vec2& c : {Vec2(-1, -0.8), Vec2(1, -0.9), Vec2(1.1, 0.7), Vec2(-0.8, 1)}) corners.emplace_back(half * c.x(), half * c.y(), z);
  world.add_block(corners, 2080 * t * 4 * half * half * 0.88, {Vec3(2, 2.5, H + kDx / 4), Quat::Identity()}, Vec3(u, 0, 0), Vec3::Zero(), 1200);
  Real sum = 0, n = 0, lowest = 1e9, highest = 0;
  while (lava.time() < 6) {
    lava.step(0.05);
    if (lava.time() < 3) continue;  // it finds its draught
    sum += world.bodies().momenta()[0].x() / world.bodies().mass(0);
    n += 1;
    lowest = std::min(lowest, world.bodies().centres()[0].z());
    highest = std::max(highest, world.bodies().centres()[0].z());
  }
  Real surface = 0, m = 0;
  for (std::size_t i = 0; i < lava.size(); ++i)
    if (lava.positions()[i].z() > H - kDx && (lava.positions()[i].head<2>() - world.bodies().centres()[0].head<2>()).norm() > 1.5) surface += lava.velocities()[i].x(), m += 1;
  // The topmost particles' middles lie half a spacing deep: u (1 - (dx / 2 H)^2).
  const Real top = surface / m / (1 - std::pow(kDx / (2 * H), 2));
  std::cout << "[ figures  ] raft " << sum / n << " m/s, surface " << top << " m/s, theory " << u << " m/s; centre between " << lowest << " and " << highest << " m of " << H << " m\n";
  EXPECT_NEAR(sum / n, top, 0.05 * u);
  EXPECT_NEAR(sum / n, u, 0.10 * u);
  EXPECT_GT(lowest, H - kDx);
  EXPECT_LT(highest, H + kDx);
}

// A slab of lava slumps down a slope; blocks ride on it.
TEST(CrustBlocksSlow, BlocksStayAtTheSurface) {
  CrustBlockOptions o = easily();
  Flow flow(0.2, 3000, o, 24, 16, 4);
  flow.run(3);
  ASSERT_GT(flow.blocks.born(), 3u);
  const bodies::RigidBodies& rafts = flow.world.bodies();
  std::size_t counted = 0, sunk = 0;
  for (bodies::BodyId id = 0; id < rafts.size(); ++id) {
    const Vec3 c = rafts.centres()[id];
    for (const Vec3& corner : rafts.shape(id).samples())
      EXPECT_GT(rafts.body_pose(id).world(corner).z(), *flow.terrain.height(c.x(), c.y()) - 0.2 * (rafts.body_pose(id).world(corner) - c).norm() - 0.02) << "under ground";
    // The lava under its middle.
    Real top = -1e9;
    for (const Vec3& p : flow.lava.positions())
      if ((p - c).head<2>().norm() < 0.6 * kDx * 2) top = std::max(top, p.z() + kDx / 2);
    if (top < -1e8) continue;  // has come off the flow
    ++counted;
    sunk += c.z() < top - 1.2 * kDx;
  }
  // The front rolls over one that has come down before it, now and then, as it does in the field.
  std::cout << "[ figures  ] " << counted << " blocks on lava, " << sunk << " of them under it\n";
  EXPECT_GT(counted, 10u);
  EXPECT_LE(10 * sunk, counted);
}

TEST(CrustBlocks, StiffOrStillCrustHasNone) {
  CrustBlockOptions o = easily();
  o.thickness = 0.2;  // far more than grows
  Flow thin(0.2, 3000, o);
  thin.run(1);
  EXPECT_EQ(thin.blocks.born(), 0u);
  Flow still(0, 1e9, easily());
  still.run(1);
  EXPECT_EQ(still.blocks.born(), 0u);
}

TEST(CrustBlocksSlow, TheSameBitsOnAnyNumberOfThreadsAndAfterACheckpoint) {
  std::string first;
  for (const int threads : {1, 3}) {
    const ThreadLimit limit(threads);
    Flow flow(0.2, 3000, easily());
    flow.run(1.2);
    ASSERT_GT(flow.blocks.born(), 0u);
    if (first.empty()) first = flow.hash();
    EXPECT_EQ(flow.hash(), first);
    if (threads == 1) continue;
    StateWriter out;
    flow.lava.save(out);
    flow.world.save(out);
    flow.blocks.save(out);
    Flow again(0.2, 3000, easily());
    StateReader in(out.bytes(), "test");
    again.lava.load(in);
    again.world.load(in);
    again.blocks.load(in);
    EXPECT_EQ(again.hash(), flow.hash());
    flow.run(0.3);
    again.run(0.3);
    EXPECT_EQ(again.hash(), flow.hash());
  }
}

TEST(CrustBlocks, OverTheEdgeTheyAreCounted) {
  CrustBlockOptions o = easily();
  Flow flow(0.2, 3000, o);
  flow.run(0.8);
  const Real mass = flow.world.block_mass();
  ASSERT_GT(mass, 0);
  EXPECT_NEAR(flow.world.drop_blocks([](const Vec3&) { return true; }), mass, 1e-9 * mass);
  EXPECT_EQ(flow.world.block_mass(), 0);
  flow.run(0.2);  // and the lava goes on
}

}  // namespace
}  // namespace effuse::flow
