#include "geometry/procedural/ocean.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/error.h"
#include "geometry/mesh/validate.h"

namespace effuse::geometry {
namespace {

TEST(Ocean, WavesRunAsFastAsTheirDispersionSays) {
  for (const Real depth : {1e30, 3.0}) {
    OceanOptions o;
    o.depth = depth;
    o.steepness = 0;
    const Ocean ocean(o, {{0.5, 20, 0.6, 0.3}});
    const Real k = 2 * kPi / 20, omega = ocean.frequency(0);
    EXPECT_NEAR(omega * omega, kGravity * k * std::tanh(k * depth), 1e-12);
    // A crest moves by c t along its direction.
    const Real t = 7.3;
    const Vec2 x(3, -4), moved = x + omega / k * t * Vec2(std::cos(0.6), std::sin(0.6));
    EXPECT_NEAR(ocean.height(x, 0), ocean.height(moved, t), 1e-9);
    EXPECT_NEAR(ocean.height(x, 0), ocean.height(x, 2 * kPi / omega), 1e-9);
  }
}

TEST(Ocean, VelocityAndNormalAreThePositionsDerivatives) {
  const Ocean ocean({}, {{0.5, 20, 0.6, 0.3}, {0.2, 7, -1, 2}, {0.05, 2, 2, 1}});
  const Real h = 1e-5, t = 2.1;
  for (int n = 0; n < 20; ++n) {
    const Vec2 x(1.7 * n, -2.3 * n);
    const Ocean::Sample s = ocean.at_rest_point(x, t);
    EXPECT_LT((s.velocity - (ocean.at_rest_point(x, t + h).position - ocean.at_rest_point(x, t - h).position) / (2 * h)).norm(), 1e-7);
    const Vec3 ax = ocean.at_rest_point(x + Vec2(h, 0), t).position - ocean.at_rest_point(x - Vec2(h, 0), t).position;
    const Vec3 ay = ocean.at_rest_point(x + Vec2(0, h), t).position - ocean.at_rest_point(x - Vec2(0, h), t).position;
    EXPECT_LT((s.normal - ax.cross(ay).normalized()).norm(), 1e-7);
    EXPECT_GT(s.normal.z(), 0);
    // And the height above the place where it stands is its own.
    EXPECT_NEAR(ocean.height(s.position.head<2>(), t), s.position.z(), 1e-6);
  }
}

TEST(Ocean, SteepSeasAreFlattenedBeforeTheyFold) {
  const Ocean ocean({0, 1e30, 1}, {{2, 8, 0, 0}, {1, 4, 1, 0}});
  EXPECT_LT(ocean.steepness(), 1);
  for (int n = 0; n < 1000; ++n) EXPECT_GT(ocean.at_rest_point(Vec2(0.01 * n, 0.03 * n), 1).normal.z(), 0);
}

TEST(Ocean, AWindSeaHasTheSpectrumsHeight) {
  const std::vector<OceanWave> waves = wind_sea(10, 0.5, 60, 3);
  Real m0 = 0, mean_direction = 0;
  for (const OceanWave& w : waves) {
    m0 += w.amplitude * w.amplitude / 2;
    mean_direction += w.direction / 60;
    EXPECT_LT(std::abs(w.direction - 0.5), kPi / 2);
  }
  EXPECT_NEAR(4 * std::sqrt(m0), 0.21 * 100 / kGravity, 0.01 * 2.1);
  EXPECT_NEAR(mean_direction, 0.5, 0.25);
  EXPECT_TRUE(wind_sea(0, 0, 5, 1).empty());
  // Its heights over a wide sea scatter by sqrt(m0).
  const Ocean ocean({0, 1e30, 0}, waves);
  Real squares = 0;
  for (int n = 0; n < 4000; ++n) squares += std::pow(ocean.height(Vec2(37.1 * n, 91.7 * n), 0), 2) / 4000;
  EXPECT_NEAR(std::sqrt(squares / m0), 1, 0.1);
}

TEST(Ocean, ItsMeshIsASheet) {
  const TriMesh mesh = ocean_mesh(Ocean({}, wind_sea(8, 0, 20, 1)), Vec2(-50, -50), Vec2(50, 50), 40, 30, 3);
  EXPECT_EQ(mesh.triangles.size(), 2400u);
  EXPECT_EQ(validate(mesh).components, 1u);
  EXPECT_EQ(mesh.attributes.at("velocity").values.size(), 3 * mesh.positions.size());
}

TEST(Ocean, RefusesWavesThatCannotBe) {
  EXPECT_THROW(Ocean({}, {{1, 0, 0, 0}}), InputError);
  EXPECT_THROW(Ocean({0, -1, 0.5}, {}), InputError);
  EXPECT_THROW(Ocean({}, {{std::nan(""), 1, 0, 0}}), InputError);
}

}  // namespace
}  // namespace effuse::geometry
