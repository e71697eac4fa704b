#include <gtest/gtest.h>

#include <cmath>

#include "flow/sph/heat.h"

namespace effuse::flow::sph {
namespace {

HeatOptions plain() {
  HeatOptions o;
  o.curve.latent_heat = 0;
  o.air = {0, false, 20, 300};
  o.ground_effusivity = 0;
  o.longest_interval = 1e6;  // nobody is near
  return o;
}

/// A lone particle of 0.1 m, one face of it bare: m c dT/dt = -h A (T - T_water), and an exponential.
TEST(Quench, ALumpUnderWaterCoolsByTheWatersLaw) {
  HeatOptions o = plain();
  o.crust = false;
  Heat wet(o, 0.1, 2600), dry(o, 0.1, 2600);
  wet.born(1200);
  dry.born(1200);
  const std::vector<Vec3> x = {Vec3::Zero()};
  const Neighbors nobody;
  const std::vector<Real> sky = {0.01};
  const std::vector<std::uint8_t> under = {1};
  Heat::Surroundings around{x, nobody, KernelKind::kWendlandC2, 0.3, Vec2::Zero(), sky, {}, {}, {}};
  HeatBudget all;
  for (int k = 0; k < 100; ++k) {
    dry.step(1, around);
    Heat::Surroundings water = around;
    water.wet = under;
    water.water = {0, false, 500, 290};
    const HeatBudget b = wet.step(1, water);
    all.convected += b.convected;
    all.quenched += b.quenched;
  }
  const Real capacity = 2600 * 1e-3 * o.curve.heat_capacity;
  // Implicit steps of 0.004 of the cooling time at most: half of that of the fall, 140 K.
  EXPECT_NEAR(wet.temperature()[0], 290 + 910 * std::exp(-500 * 0.01 * 100 / capacity), 0.002 * 140);
  EXPECT_NEAR(dry.temperature()[0], 300 + 900 * std::exp(-20 * 0.01 * 100 / capacity), 0.1);
  EXPECT_NEAR(all.quenched, all.convected, 1e-9 * all.convected);  // but for what Newton's method left
  EXPECT_NEAR(all.quenched, capacity * (1200 - wet.temperature()[0]), 1e-9 * all.quenched);
}

/// A crust's face in boiling water is near the water's temperature, and its column loses what it says.
TEST(Quench, ACrustsFaceChillsAndItsHeatIsBooked) {
  Heat heat(plain(), 0.2, 2600);
  heat.born(1400);
  const std::vector<Vec3> x = {Vec3::Zero()};
  const Neighbors nobody;
  const std::vector<Real> sky = {0.04};
  std::vector<std::uint8_t> under = {0};
  const auto run = [&](int steps) {
    HeatBudget sum;
    for (int k = 0; k < steps; ++k) {
      Heat::Surroundings around{x, nobody, KernelKind::kWendlandC2, 0.6, Vec2::Zero(), sky, {}, {}, {}};
      around.wet = under;
      around.water = {0, false, 5000, 290};
      const HeatBudget b = heat.step(0.5, around);
      sum.convected += b.convected;
      sum.quenched += b.quenched;
    }
    return sum;
  };
  const Real before = heat.total_enthalpy();
  const HeatBudget dry = run(40);
  EXPECT_EQ(dry.quenched, 0);
  EXPECT_GT(heat.surface_temperature()[0], 1100);
  under[0] = 1;
  const HeatBudget wet = run(40);
  EXPECT_LT(heat.surface_temperature()[0], 420);
  EXPECT_NEAR(wet.quenched, wet.convected, 1e-9 * wet.convected);
  EXPECT_NEAR(before - heat.total_enthalpy(), dry.convected + wet.convected, 1e-9 * before);
}

}  // namespace
}  // namespace effuse::flow::sph
