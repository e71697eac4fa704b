#include "flow/particles/density_grid.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/parallel.h"
#include "geometry/base/random.h"

namespace effuse::flow::particles {
namespace {

TEST(DensityGrid, ARayThroughTheMiddleOfAParticleMeetsItsOpacity) {
  const std::vector<Vec3> x = {Vec3(3, -2, 7)};
  const std::vector<Real> radius = {1}, opacity = {0.4}, temperature = {800};
  DensityGridOptions o;
  o.cell = 0.05;
  const geometry::GridVolume g = density_grid(x, radius, opacity, temperature, o);
  const Vec3 at = (x[0] - g.corner) / g.cell;
  Real depth = 0;
  for (int i = 0; i < g.n[0]; ++i) depth += g.cell * g.density[g.index(i, static_cast<int>(at.y()), static_cast<int>(at.z()))];
  EXPECT_NEAR(1 - std::exp(-depth), 0.4, 0.005);
  EXPECT_EQ(g.temperature[g.index(static_cast<int>(at.x()), static_cast<int>(at.y()), static_cast<int>(at.z()))], 800.0f);
}

TEST(DensityGrid, WhatIsSmallerThanACellKeepsItsExtinctionTimesVolume) {
  const auto all = [](Real cell) {
    std::vector<Vec3> x;
    for (std::uint64_t k = 0; k < 300; ++k) x.push_back(10 * Vec3(random_uniform(1, 1, k), random_uniform(1, 2, k), random_uniform(1, 3, k)));
    DensityGridOptions o;
    o.cell = cell;
    const geometry::GridVolume g = density_grid(x, std::vector<Real>(300, 0.2), std::vector<Real>(300, 0.3), {}, o);
    EXPECT_TRUE(g.temperature.empty());
    Real sum = 0;
    for (const float d : g.density) sum += d * std::pow(g.cell, 3);
    return sum;
  };
  EXPECT_NEAR(all(0.8) / all(0.05), 1, 0.05);
}

TEST(DensityGrid, IsNoFinerThanToldAndTheSameOnAnyThreads) {
  std::vector<Vec3> x;
  std::vector<Real> radius, opacity;
  for (std::uint64_t k = 0; k < 2000; ++k) {
    x.push_back(50 * Vec3(random_uniform(1, 1, k), random_uniform(1, 2, k), random_uniform(1, 3, k)));
    radius.push_back(0.3 + random_uniform(1, 4, k));
    opacity.push_back(random_uniform(1, 5, k));
  }
  DensityGridOptions o;
  o.most_cells = 50000;
  std::vector<float> of[2];
  for (const int k : {0, 1}) {
    const ThreadLimit limit(k + 1);
    const geometry::GridVolume g = density_grid(x, radius, opacity, {}, o);
    EXPECT_LE(g.size(), 50000u);
    of[k] = g.density;
  }
  EXPECT_EQ(of[0], of[1]);
  EXPECT_EQ(density_grid({}, {}, {}, {}).size(), 0u);
}

}  // namespace
}  // namespace effuse::flow::particles
