#include "flow/plants/plant_fire.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/parallel.h"

namespace effuse::flow::plants {
namespace {

constexpr Real kSigma = 5.670374e-8;

TEST(PlantFire, HeatsToWhereGainAndLossAreEqual) {
  PlantFire fire({Vec3::Zero()}, {1}, {0.5}, {.ignition = 2000, .thickness = 1e-4});
  // So large a patch that it fills the sky: F = 1 to 1e-6.
  const HotPatch sky{Vec3(0, 0, 0.5), 1e6, 800};
  for (int k = 0; k < 4000; ++k) fire.step(0.25, {&sky, 1});
  const Real T = fire.temperature(0, 3), q = 0.9 * kSigma * std::pow(800, 4);
  EXPECT_NEAR(q, 30 * (T - 288.15) + 1.8 * kSigma * (std::pow(T, 4) - std::pow(288.15, 4)), 1e-3 * q);
}

TEST(PlantFire, CatchesFireWhenItsHeatOfIgnitionHasComeIn) {
  // Losses off, the flux of one patch known: the time is that of rho delta (581 + 2594 M) kJ/kg.
  const Fuel fuel{.ignition = 593, .moisture = 0.5, .density = 600, .thickness = 1e-3, .burn_time = 4, .convection = 0};
  PlantFire fire({Vec3::Zero()}, {8}, {1}, fuel);
  const HotPatch lava{Vec3(0, 0, 0.5), 1e8, 1400};  // over the lowest band's middle
  Real t = 0;
  while (fire.burnt(0, 0) == 0 && t < 100) t += 0.01, fire.step(0.01, {&lava, 1});
  const Real q = 0.9 * kSigma * std::pow(1400, 4), needed = 600 * 1e-3 * (581e3 + 0.5 * 2594e3);
  EXPECT_GT(t, needed / q);
  EXPECT_LT(t, 1.04 * needed / q) << "radiated back: at most 6 % of what comes in";
  // And burns for its time.
  Real burning = 0;
  while (fire.burnt(0, 0) < 1) burning += 0.01, fire.step(0.01, {});
  EXPECT_NEAR(burning, 4, 0.02);
}

TEST(PlantFire, ClimbsAPlantFasterThanItGoesDownAndLeapsToANearOneOnly) {
  PlantFire fire({Vec3(0, 0, 0), Vec3(2.5, 0, 0), Vec3(60, 0, 0)}, {6, 6, 6}, {1.2, 1.2, 1.2}, {});
  const HotPatch lava{Vec3(-0.6, 0, 0.3), 3, 1350};
  int first_top = 0, near = 0;
  for (int k = 0; k < 1200; ++k) {
    fire.step(0.25, {&lava, k < 400 ? std::size_t{1} : 0});
    if (!first_top && fire.burnt(0, 7) > 0) first_top = k;
    if (!near && fire.burnt(1, 4) > 0) near = k;
  }
  EXPECT_GT(first_top, 0);
  EXPECT_GT(near, 0);
  EXPECT_EQ(fire.burnt(2, 0), 0);
  EXPECT_EQ(fire.burnt_down(), 2u);
  EXPECT_EQ(fire.burning(), 0u);
  EXPECT_FALSE(fire.step(0.25, {})) << "all is over";
}

TEST(PlantFire, FarLavaChangesNothingAndThreadsNeither) {
  const auto run = [] {
    std::vector<Vec3> feet;
    for (int k = 0; k < 60; ++k) feet.push_back(Vec3(k % 10, k / 10, 0));
    PlantFire fire(feet, std::vector<Real>(60, 2), std::vector<Real>(60, 0.5), {});
    const HotPatch lava{Vec3(0, 0, 0), 2, 1400};
    for (int k = 0; k < 200; ++k) fire.step(0.1, {&lava, 1});
    StateHash hash;
    fire.add_to(hash);
    return hash.hex();
  };
  const std::string many = run();
  const ThreadLimit one(1);
  EXPECT_EQ(run(), many);
  PlantFire far({Vec3::Zero()}, {2}, {0.5}, {});
  const HotPatch lava{Vec3(100, 0, 0), 2, 1400};
  EXPECT_FALSE(far.step(0.25, {&lava, 1}));
}

TEST(HotPatches, GatherAreaAndFourthPowers) {
  const std::vector<Vec3> x = {Vec3(0.1, 0.1, 0.1), Vec3(0.3, 0.1, 0.1), Vec3(5, 0, 0), Vec3(9, 0, 0)};
  const std::vector<Real> T = {1000, 1200, 1100, 300};
  const std::vector<std::uint8_t> surface = {1, 1, 0, 1};
  const auto patches = hot_patches(x, T, surface, 0.5, 1, 400);
  ASSERT_EQ(patches.size(), 1u) << "the third lies inside, the fourth is cold";
  EXPECT_NEAR(patches[0].area, 0.5, 1e-12);
  EXPECT_NEAR(std::pow(patches[0].temperature, 4), (std::pow(1000.0, 4) + std::pow(1200.0, 4)) / 2, 1e3);
  EXPECT_NEAR(patches[0].at.x(), 0.2, 1e-12);
}

}  // namespace
}  // namespace effuse::flow::plants
