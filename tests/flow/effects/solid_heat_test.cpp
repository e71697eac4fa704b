#include <gtest/gtest.h>

#include <cmath>

#include "flow/effects/solid_world.h"
#include "flow/sph/modern_lava.h"
#include "geometry/base/state_io.h"
#include "geometry/procedural/primitives.h"
#include "tests/flow/effects/scene_lines.h"
#include "tests/flow/sph/sample_system.h"

/// Obstacles and bodies that lava warms.
namespace effuse::flow {
namespace {

using geometry::CollisionMesh;
using geometry::PoseKey;
using geometry::PoseTrack;
using geometry::TriMesh;
using sph::ModernLava;
using sph::ModernOptions;

constexpr Real kCold = 300, kHot = 1450;
const Material kConcrete = {1.4, 2300, 880};

PlacedObstacle cube(const Vec3& low, const Vec3& high, const Material& material, Real temperature = kCold) {
  PlacedObstacle placed{"cube", CollisionMesh(geometry::make_box(low, high)), PoseTrack(std::vector<PoseKey>(1)), temperature, 1};
  placed.material = material;
  return placed;
}

/// Weightless lava around a cube of 0.5 m, on all its sides; nothing is lost to the air.
struct Bath {
  static constexpr Real kSpacing = 0.25;
  SolidWorld world;
  ModernLava lava;
  explicit Bath(const Material& material) : world({cube(Vec3(0.5, 0.5, 0.5), Vec3(1, 1, 1), material)}, {}, nullptr), lava(make()) {
    std::vector<Vec3> x;
    for (const Vec3& p : sph::lattice_block(6, 6, 6, kSpacing))
      if (((p - Vec3(0.75, 0.75, 0.75)).cwiseAbs().array() > 0.25).any()) x.push_back(p);
    lava.add(x, std::vector<Vec3>(x.size(), Vec3::Zero()), std::vector<Real>(x.size(), kHot));
  }
  ModernLava make() {
    ModernOptions o;
    o.spacing = kSpacing;
    o.gravity.setZero();
    o.rheology = sph::Rheology::newtonian(1e6);
    o.rest_period = 0;
    o.ground_speed = 0;
    o.max_step = 4000;
    o.heat.viscous_heating = false;
    o.heat.curve.latent_heat = 0;
    o.heat.air.emissivity = o.heat.air.convection = 0;
    const sph::ContactSource none = [](std::span<const Vec3> x, Real, std::span<geometry::Contact> out) { std::fill_n(out.begin(), x.size(), geometry::Contact{}); };
    return {o, {}, {none}, {}, world.solids()};
  }
};

TEST(SolidHeat, WhatLavaLosesTheCubeHasUntilBothAreAsWarm) {
  Bath bath(kConcrete);
  const Real before = bath.lava.heat().total_enthalpy(), capacity = 2300 * 880 * 0.125;
  const Real lava_capacity = bath.lava.particle_mass() * static_cast<Real>(bath.lava.size()) * bath.lava.options().heat.curve.heat_capacity;
  const Real end = (lava_capacity * kHot + capacity * kCold) / (lava_capacity + capacity);
  Real mean = kCold;
  while (bath.lava.time() < 3e5) {
    bath.lava.step(4000);
    const SolidWorld::Warmth& warmth = bath.world.warmth()[0];
    EXPECT_NEAR(before - bath.lava.heat().total_enthalpy(), warmth.given, 1e-9 * before);
    EXPECT_NEAR(warmth.mean, kCold + warmth.given / capacity, 1e-9 * kHot);
    EXPECT_GE(warmth.mean, mean) << "it warms up, and does not overshoot";
    EXPECT_LT(warmth.mean, end + 1);
    mean = warmth.mean;
  }
  EXPECT_NEAR(mean, end, 0.05 * (end - kCold));
  EXPECT_GT(bath.world.warmth()[0].hottest, 700);
  EXPECT_LT(bath.world.warmth()[0].hottest, kHot);
}

TEST(SolidHeat, IsSavedAndLoaded) {
  Bath one(kConcrete), other(kConcrete);
  for (int k = 0; k < 3; ++k) one.lava.step(50);
  StateWriter out;
  one.lava.save(out);
  one.world.save(out);
  StateReader in(out.bytes(), "");
  other.lava.load(in);
  other.world.load(in);
  for (int k = 0; k < 3; ++k) one.lava.step(50), other.lava.step(50);
  EXPECT_GT(one.world.warmth()[0].given, 0);
  EXPECT_EQ(one.world.warmth()[0].given, other.world.warmth()[0].given);
  EXPECT_EQ(one.world.warmth()[0].hottest, other.world.warmth()[0].hottest);
  EXPECT_EQ(one.lava.heat().total_enthalpy(), other.lava.heat().total_enthalpy());
}

// Of no material heat goes into it as into the ground, and it keeps its temperature.
TEST(SolidHeat, WithoutAMaterialACubeStaysAsColdAsItIs) {
  Bath bath({});
  for (int k = 0; k < 3; ++k) bath.lava.step(50);
  EXPECT_GT(bath.world.warmth()[0].given, 0);
  EXPECT_EQ(bath.world.warmth()[0].mean, 0);
  EXPECT_EQ((*bath.world.solids().obstacles)[0].temperature, kCold);
}

Material read(const Lines& lines, std::vector<Fault>* faults = nullptr) {
  const Node root = scene_of(lines);
  Parameters p(root);
  const Material material = read_material(p);
  if (faults) *faults = p.faults();
  else p.finish();
  return material;
}

TEST(SolidHeat, MaterialsAreNamedOrGiven) {
  EXPECT_EQ(read({}).effusivity(), 0);
  EXPECT_NEAR(read({{"material", "concrete"}}).effusivity(), std::sqrt(1.4 * 2300 * 880), 1e-9);
  EXPECT_EQ(read({{"material", "wood"}, {"density", "700"}}).density, 700);
  EXPECT_NEAR(read({{"conductivity", "2"}, {"density", "1000"}, {"heat_capacity", "500"}}).effusivity(), 1000, 1e-9);
  std::vector<Fault> faults;
  read({{"conductivity", "2"}}, &faults);
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_NE(faults[0].message.find("heat_capacity"), std::string::npos) << faults[0].message;
  read({{"material", "concret"}}, &faults);
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_NE(faults[0].message.find("concrete"), std::string::npos) << faults[0].message;
}

}  // namespace
}  // namespace effuse::flow
