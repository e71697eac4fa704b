#include "samples/study/measure.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace effuse::study {
namespace {

constexpr Real kNan = std::numeric_limits<Real>::quiet_NaN();
constexpr Real kInf = std::numeric_limits<Real>::infinity();

TEST(Measure, ErrorsAreThoseOfTheirFormulas) {
  const std::vector<Real> reference = {3, 4}, measured = {3, 4.5};
  EXPECT_NEAR(relative_error(1.03, 1), 0.03, 1e-15);
  EXPECT_NEAR(relative_error(-1.1, -1), 0.1, 1e-15);
  EXPECT_DOUBLE_EQ(relative_l2_error(measured, reference), 0.1);  // sqrt(0.25 / 25)
  EXPECT_DOUBLE_EQ(relative_max_error(measured, reference), 0.125);
  EXPECT_DOUBLE_EQ(nrmse(measured, reference), std::sqrt(0.125));  // rms sqrt(0.25 / 2) over a range of 1
  EXPECT_DOUBLE_EQ(relative_l2_error(reference, measured, [](Real x) { return x; }), 0.1);
}

TEST(Measure, OneValueThatIsNotFiniteSpoilsEveryError) {
  const std::vector<Real> reference = {3, 4, 5}, measured = {3, kNan, 5};
  EXPECT_TRUE(std::isnan(relative_error(kNan, 1)));
  EXPECT_TRUE(std::isnan(relative_l2_error(measured, reference)));
  EXPECT_TRUE(std::isnan(relative_max_error(measured, reference)));
  EXPECT_TRUE(std::isnan(nrmse(measured, reference)));
  const std::vector<Real> x = {1, 2, 3};
  EXPECT_TRUE(std::isnan(fit_power_law(x, measured).exponent));
  EXPECT_TRUE(std::isnan(fit_prefactor(x, measured, 1)));
}

TEST(Measure, FitGivesAPowerLawBack) {
  const std::vector<Real> x = spaced_log(0.1, 500, 40);
  std::vector<Real> y(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) y[i] = 0.894 * std::pow(x[i], 0.125);
  const PowerLaw law = fit_power_law(x, y);
  EXPECT_NEAR(law.exponent, 0.125, 1e-12);
  EXPECT_NEAR(law.prefactor, 0.894, 1e-12);
  EXPECT_NEAR(law.scatter, 0, 1e-12);
  EXPECT_NEAR(law(7), 0.894 * std::pow(7, 0.125), 1e-12);
  EXPECT_NEAR(fit_prefactor(x, y, 0.125), 0.894, 1e-12);
}

TEST(Measure, FitLeavesOutWhatLiesOutsideItsRange) {
  std::vector<Real> x = spaced(1, 100, 100), y(100);
  for (std::size_t i = 0; i < 100; ++i) y[i] = x[i] < 20 ? 1000 : 2 * std::sqrt(x[i]);
  EXPECT_NEAR(fit_power_law(x, y, 20, 100).exponent, 0.5, 1e-12);
  EXPECT_LT(fit_power_law(x, y).exponent, 0);
}

TEST(Measure, FitOfScatteredPointsIsTheLeastSquaresLine) {
  // log y = log x + {+d, -2d, +d} at log x = 0, 1, 2: symmetric, so the slope stays and the mean is unmoved.
  const Real d = 0.01;
  const std::vector<Real> x = {1, std::exp(1.0), std::exp(2.0)}, y = {std::exp(d), std::exp(1 - 2 * d), std::exp(2 + d)};
  const PowerLaw law = fit_power_law(x, y);
  EXPECT_NEAR(law.exponent, 1, 1e-12);
  EXPECT_NEAR(law.prefactor, 1, 1e-12);
  EXPECT_NEAR(law.scatter, std::sqrt(2.0) * d, 1e-12);
}

TEST(Measure, InterpolatesBetweenPointsAndNowhereElse) {
  const std::vector<Real> x = {0, 1, 1, 3}, y = {0, 2, 5, 9};
  EXPECT_DOUBLE_EQ(interpolate(x, y, 0), 0);
  EXPECT_DOUBLE_EQ(interpolate(x, y, 0.25), 0.5);
  EXPECT_DOUBLE_EQ(interpolate(x, y, 2), 7);
  EXPECT_DOUBLE_EQ(interpolate(x, y, 3), 9);
  EXPECT_TRUE(std::isnan(interpolate(x, y, -0.1)));
  EXPECT_TRUE(std::isnan(interpolate(x, y, 3.1)));
  EXPECT_TRUE(std::isnan(interpolate(x, y, kNan)));
  const std::vector<Real> one = {2};
  EXPECT_DOUBLE_EQ(interpolate(one, one, 2), 2);
  EXPECT_TRUE(std::isnan(interpolate(one, one, 1)));
  const std::vector<Real> t = {1, 100}, r = {2, 20};  // 2 sqrt(t)
  EXPECT_NEAR(interpolate_log(t, r, 9), 6, 1e-12);
}

TEST(Measure, SpacesValuesFromFirstToLast) {
  EXPECT_EQ(spaced(1, 3, 3), (std::vector<Real>{1, 2, 3}));
  const std::vector<Real> ratios = spaced_log(1, 100, 3);
  EXPECT_EQ(ratios.front(), 1);
  EXPECT_NEAR(ratios[1], 10, 1e-12);
  EXPECT_EQ(ratios.back(), 100);
}

TEST(Measure, ProfileAveragesInBinsAndLeavesEmptyOnesOut) {
  const std::vector<Real> x = {0.1, 0.3, 2.5, -1, 3.0, kNan}, y = {1, 3, 7, 100, 100, 100};
  const Profile p = profile(x, y, 0, 3, 3);
  ASSERT_EQ(p.x.size(), 2u);
  EXPECT_DOUBLE_EQ(p.x[0], 0.2);
  EXPECT_DOUBLE_EQ(p.y[0], 2);
  EXPECT_DOUBLE_EQ(p.spread[0], 1);
  EXPECT_EQ(p.count[0], 2u);
  EXPECT_DOUBLE_EQ(p.y[1], 7);
  EXPECT_EQ(p.count[1], 1u);
}

/// A block of particles on a lattice, [0, nx) x [0, ny) x [0, nz) spacings.
std::vector<Vec3> block(int nx, int ny, int nz, Real spacing) {
  std::vector<Vec3> x;
  for (int i = 0; i < nx; ++i)
    for (int j = 0; j < ny; ++j)
      for (int k = 0; k < nz; ++k) x.emplace_back((i + 0.5) * spacing, (j + 0.5) * spacing, (k + 0.5) * spacing);
  return x;
}

TEST(Measure, FrontOfABlockIsItsFace) {
  const std::vector<Vec3> x = block(20, 6, 4, 0.1);
  EXPECT_NEAR(front_position(x, Vec3::UnitX(), 0.1), 2.0, 1e-12);
  EXPECT_NEAR(front_position(x, Vec3::UnitX(), 0.1, 0.4), 2.0, 1e-12);
  EXPECT_NEAR(front_position(x, -Vec3::UnitX(), 0.1), 0.0, 1e-12);
  EXPECT_NEAR(front_position(x, Vec3::UnitY(), 0.1), 0.6, 1e-12);
}

TEST(Measure, SprayIsNoFrontWhereDepthIsAskedFor) {
  std::vector<Vec3> x = block(20, 6, 4, 0.1);
  x.emplace_back(5.05, 0.05, 0.05);
  EXPECT_NEAR(front_position(x, Vec3::UnitX(), 0.1), 5.1, 1e-12);
  EXPECT_NEAR(front_position(x, Vec3::UnitX(), 0.1, 0.15), 2.0, 1e-12);
  EXPECT_EQ(front_position(x, Vec3::UnitX(), 0.1, 1.0), -kInf) << "nothing is that deep";
  EXPECT_EQ(front_position({}, Vec3::UnitX(), 0.1), -kInf);
}

TEST(Measure, FrontRadiusIsThatOfADisc) {
  std::vector<Vec3> x;
  for (const Vec3& p : block(60, 60, 3, 0.1))
    if ((p - Vec3(3, 3, 0)).head<2>().norm() < 2.5) x.push_back(p);
  EXPECT_NEAR(front_radius(x, Vec3(3, 3, 0), 0.1), 2.5, 0.05 + 1e-12);
  EXPECT_NEAR(front_radius(x, Vec3(3, 3, 0), 0.1, 0.15), 2.5, 0.1);
  x.emplace_back(3, 3 + 2.85, 0.05);
  EXPECT_NEAR(front_radius(x, Vec3(3, 3, 0), 0.1), 2.9, 1e-12);
  EXPECT_LT(front_radius(x, Vec3(3, 3, 0), 0.1, 0.02), 2.7) << "one particle in a ring of 178 cells";
}

TEST(Measure, AParticleThatIsNowhereSpoilsTheFront) {
  std::vector<Vec3> x = block(4, 4, 4, 0.1);
  x[7].y() = kNan;
  EXPECT_TRUE(std::isnan(front_position(x, Vec3::UnitX(), 0.1)));
  EXPECT_TRUE(std::isnan(front_radius(x, Vec3::Zero(), 0.1)));
  x[7] = Vec3(1e300, 0, 0);  // far out, but somewhere
  EXPECT_GT(front_position(x, Vec3::UnitX(), 0.1), 1e299);
}

}  // namespace
}  // namespace effuse::study
