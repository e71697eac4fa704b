#include "flow/effects/solid_world.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>

#include "flow/sph/modern_lava.h"
#include "geometry/base/parallel.h"
#include "geometry/procedural/primitives.h"
#include "tests/flow/sph/beside_solids.h"
#include "tests/flow/sph/lava_times.h"
#include "tests/flow/sph/sample_system.h"

/// What things that lava does not reach cost it.
namespace effuse::flow {
namespace {

using geometry::CollisionMesh;
using geometry::PoseKey;
using geometry::PoseTrack;
using sph::hex_of;
using sph::median;
using sph::ModernLava;
using sph::thread_seconds;

constexpr Real kSpacing = 0.5;

sph::ModernOptions options() {
  sph::ModernOptions o = sph::thick_lava(kSpacing, 2000, 1);
  o.rest_period = sph::ModernOptions().rest_period;
  o.gravity = kGravity * Vec3(0.2, 0, -0.98);
  return o;
}

void fill(ModernLava& lava, int side) {
  const std::vector<Vec3> x = sph::lattice_block(side, side, 6, kSpacing);
  lava.add(x, std::vector<Vec3>(x.size(), Vec3::Zero()), std::vector<Real>(x.size(), 1400));
}

/// Boulders in rings around lava that begins at (0, 0, 0), so that the box around all of them holds it; standing, or rolling outwards.
std::vector<PlacedObstacle> around(int count, bool moving) {
  const CollisionMesh boulder(geometry::make_sphere(Vec3::Zero(), 1, 1));
  std::vector<PlacedObstacle> all;
  for (int k = 0; k < count; ++k) {
    const Real angle = 2.4 * k, far = 50 + 2 * std::sqrt(static_cast<Real>(k));
    PoseKey key;
    key.pose.position = Vec3(10 + far * std::cos(angle), 10 + far * std::sin(angle), 0);
    std::vector<PoseKey> keys = {key};
    if (moving) {
      key.time = 10;
      key.pose.position += Vec3(5 * std::cos(angle), 5 * std::sin(angle), 0);
      keys.push_back(key);
    }
    all.push_back({"boulder", boulder, PoseTrack(std::move(keys)), 0, 1});
  }
  return all;
}

/// Standard error of a median, from the values' own scatter about it: 1.253 sigma / sqrt(n), sigma = 1.4826 of the median deviation.
double error_of_median(std::vector<double> values) {
  const double middle = median(values);
  for (double& value : values) value = std::abs(value - middle);
  return 1.253 * 1.4826 * median(values) / std::sqrt(static_cast<double>(values.size()));
}

// Processor time of steps with and without them, by turns: what else the machine does meets both. Fails when it costs more by more than the
// times' own scatter can make.
TEST(SolidWorldCostSlow, ObstaclesFarFromTheLavaCostLessThanAHundredthMore) {
  const ThreadLimit limit(1);
  struct Case {
    int count;
    bool moving;
  };
  for (const auto [count, moving] : {Case{1, false}, Case{100, false}, Case{1000, false}, Case{10000, false}, Case{1, true}, Case{100, true}}) {
    SolidWorld world(around(count, moving), {}, nullptr);
    ModernLava without(options(), {}, {sph::ground_at(0)}), with(options(), {}, {sph::ground_at(0)}, {}, world.solids());
    fill(without, 32);
    fill(with, 32);
    std::vector<double> plain, extra;
    const auto timed = [](ModernLava& lava) {
      const double before = thread_seconds();
      lava.step(0.02);
      return thread_seconds() - before;
    };
    for (int k = 0; k < 250; ++k) {
      const bool turn = k % 2 == 0;
      const double first = timed(turn ? without : with), second = timed(turn ? with : without);
      if (k < 4) continue;
      plain.push_back(turn ? first : second);
      extra.push_back(turn ? second - first : first - second);
    }
    const double share = median(extra) / median(plain), error = error_of_median(extra) / median(plain);
    std::cout << count << (moving ? " moving" : "") << " obstacles: " << 1e3 * median(plain) << " ms a step, " << 100 * share << " +- " << 100 * error << " % more with them\n";
    EXPECT_LT(share - 2 * error, 0.01) << count << (moving ? " moving" : "") << " obstacles";
    EXPECT_LT(error, 0.02) << "too noisy to say anything";
    EXPECT_EQ(hex_of(with), hex_of(without)) << "far obstacles changed the lava";
  }
}

}  // namespace
}  // namespace effuse::flow
