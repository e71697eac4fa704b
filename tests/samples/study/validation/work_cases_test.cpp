#include "samples/study/validation/work_cases.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/base/random.h"
#include "samples/study/validation/setups.h"

namespace effuse::study {
namespace {

constexpr Real kInfinity = std::numeric_limits<Real>::infinity();

TEST(WorkPrecision, TheFrontierIsOfRunsThatNoOtherBeatsInBothSecondsAndError) {
  const std::vector<WorkPoint> best =
      frontier(std::vector<WorkPoint>{{"d", 8, 0.01}, {"dear", 9, 0.02}, {"a", 1, 0.08}, {"blew up", 0.5, kInfinity}, {"wrong", 2, 0.09}, {"b", 2, 0.04}, {"nan", 0.1, std::nan("")}});
  ASSERT_EQ(best.size(), 3u);
  EXPECT_EQ(best[0].setting + best[1].setting + best[2].setting, "abd");
  EXPECT_TRUE(frontier({}).empty());
}

TEST(WorkPrecision, SecondsForAnErrorFollowAPowerLawBetweenRuns) {
  // seconds = 1e-4 / error^2
  const std::vector<WorkPoint> runs = {{"", 1, 0.01}, {"", 100, 0.001}};
  EXPECT_NEAR(seconds_for(runs, 0.002), 25, 1e-9);
  EXPECT_NEAR(seconds_for(runs, 0.01), 1, 1e-12);
  EXPECT_NEAR(seconds_for(runs, 0.001), 100, 1e-9);
  EXPECT_EQ(seconds_for(runs, 0.5), 1) << "nothing cheaper was tried";
  EXPECT_EQ(seconds_for(runs, 0.0009), kInfinity) << "not reached";
  EXPECT_EQ(seconds_for({}, 1), kInfinity);
}

TEST(WorkPrecision, RatiosAreTakenAtErrorsThatBothReach) {
  const std::vector<WorkPoint> one = {{"", 1, 0.01}, {"", 10, 0.001}}, other = {{"", 5, 0.1}, {"", 50, 0.01}, {"", 500, 0.005}};
  const std::vector<TimeRatio> ratios = time_ratios(one, other);
  ASSERT_EQ(ratios.size(), 3u);
  EXPECT_EQ(ratios[0].error, 0.005);
  EXPECT_NEAR(ratios[0].ratio, 2.0 / 500, 1e-12);
  EXPECT_EQ(ratios[1].error, 0.01);
  EXPECT_NEAR(ratios[1].ratio, 1.0 / 50, 1e-12);
  EXPECT_EQ(ratios[2].error, 0.1);
  EXPECT_NEAR(ratios[2].ratio, 1.0 / 5, 1e-12);
  EXPECT_TRUE(time_ratios(one, {}).empty());
}

flow::sph::ClassicOptions fluid() {
  flow::sph::ClassicOptions options;
  options.spacing = 0.5;
  options.viscosity.hot_nu = options.viscosity.cold_nu = options.viscosity.max = 1;
  options.gravity = Vec3(1, 0.5, -kGravity);
  options.air_exchange = options.ground_exchange = 0;
  return options;
}

TEST(PeriodicClassic, AFilmWithoutSidesMovesAsOne) {
  // All particles of a layer do the same: no side is felt, which a step of open border would show at once.
  const flow::sph::ClassicOptions options = fluid();
  PeriodicClassic flow(options, Vec2::Constant(2), block(Vec3::Zero(), {4, 4, 5}, 0.5));
  flow.run_until(0.5);
  ASSERT_GT(flow.steps(), 20);
  EXPECT_EQ(flow.lava().size(), 9 * 80u);
  EXPECT_GT(flow.seconds(), 0);
  for (std::size_t i = 0; i < 80; ++i) {
    const std::size_t first = i - i % 16;
    EXPECT_LT((flow.velocities()[i] - flow.velocities()[first]).norm(), 1e-11) << i;
    EXPECT_GT(flow.velocities()[i].x(), 0.02);
    EXPECT_GE(flow.positions()[i].x(), 0);
    EXPECT_LT(flow.positions()[i].x(), 2);
  }
}

TEST(PeriodicClassic, ATwicelyRepeatedFlowDoesTwiceWhatOneDoes) {
  // In disorder: the flow in a box of one period beside the same flow, given twice, in a box of two.
  flow::sph::ClassicOptions options = fluid();
  options.surface_interval = 1;
  std::vector<Vec3> one = block(Vec3::Zero(), {4, 4, 4}, 0.5);
  for (std::size_t i = 0; i < one.size(); ++i) one[i] += 0.1 * Vec3(random_uniform(7, 0, i), random_uniform(7, 1, i), random_uniform(7, 2, i));
  for (Vec3& p : one)
    for (const int axis : {0, 1}) p[axis] -= 2 * std::floor(p[axis] / 2);
  std::vector<Vec3> two = one;
  for (const Vec3& p : one) two.push_back(p + Vec3(2, 0, 0));
  PeriodicClassic single(options, Vec2(2, 2), one), twin(options, Vec2(4, 2), two);
  single.run_until(0.2);
  twin.run_until(0.2);
  ASSERT_GT(single.steps(), 10);
  for (std::size_t i = 0; i < one.size(); ++i) {
    // To rounding, which disorder lets grow.
    EXPECT_LT((single.velocities()[i] - twin.velocities()[i]).norm(), 1e-9) << i;
    EXPECT_LT((single.velocities()[i] - twin.velocities()[one.size() + i]).norm(), 1e-9) << i;
  }
}

TEST(PeriodicClassicDeathTest, RefusesAPeriodShorterThanTwoSupports) {
  EXPECT_DEATH(PeriodicClassic(fluid(), Vec2(1.5, 2), block(Vec3::Zero(), {3, 4, 4}, 0.5)), "");
}

}  // namespace
}  // namespace effuse::study
