#include "geometry/motion/curve.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/error.h"
#include "geometry/base/random.h"

namespace effuse::geometry {
namespace {

using K = Key<Real>;

TEST(Curve, HoldsGoesStraightOrSmoothly) {
  const Curve<Real> step({K{1, 10, Between::kStep, 0, 0}, K{2, 20, Between::kStep, 0, 0}});
  EXPECT_EQ(step.at(0), 10);
  EXPECT_EQ(step.at(1.99), 10);
  EXPECT_EQ(step.at(2), 20);
  EXPECT_EQ(step.at(99), 20);
  const Curve<Real> line({K{1, 10, Between::kLinear, 0, 0}, K{3, 20, Between::kLinear, 0, 0}});
  EXPECT_EQ(line.at(2), 15);
  EXPECT_EQ(line.slope(2), 5);
  EXPECT_EQ(line.slope(0), 0);
  EXPECT_EQ(line.slope(4), 0);
  EXPECT_EQ(Curve<Real>(7.0).at(-3), 7);
}

TEST(Curve, CatmullRomGoesThroughItsKeysWithoutAKink) {
  std::vector<Key<Vec3>> keys;
  for (int k = 0; k < 6; ++k) {
    const Real t = k + 0.3 * (k % 2);
    keys.push_back({t, Vec3(std::sin(t), std::cos(2 * t), t), Between::kCatmullRom, Vec3::Zero(), Vec3::Zero()});
  }
  const Curve<Vec3> curve(keys);
  const Real h = 1e-6;
  for (std::size_t k = 0; k < keys.size(); ++k) EXPECT_LT((curve.at(keys[k].time) - keys[k].value).norm(), 1e-12);
  for (std::size_t k = 1; k + 1 < keys.size(); ++k) EXPECT_LT((curve.slope(keys[k].time - h) - curve.slope(keys[k].time + h)).norm(), 1e-4);
  for (Real t = 0.05; t < 5; t += 0.1) EXPECT_LT((curve.slope(t) - (curve.at(t + h) - curve.at(t - h)) / (2 * h)).norm(), 1e-6);
  // Straight motion at a constant speed stays that, whatever the keys' spacing.
  const Curve<Real> even({K{0, 0, Between::kCatmullRom, 0, 0}, K{1, 2, Between::kCatmullRom, 0, 0}, K{4, 8, Between::kCatmullRom, 0, 0}});
  for (Real t = 0; t < 4; t += 0.3) EXPECT_NEAR(even.at(t), 2 * t, 1e-12);
}

TEST(Curve, BezierTakesTheSlopesItIsGiven) {
  const Curve<Real> ease({K{0, 0, Between::kBezier, 0, 0}, K{2, 1, Between::kBezier, 0, 0}});
  EXPECT_EQ(ease.at(1), 0.5);
  EXPECT_NEAR(ease.at(0.5), 0.15625, 1e-12);  // 3 u^2 - 2 u^3
  EXPECT_NEAR(ease.slope(0), 0, 1e-12);
  const Curve<Real> thrown({K{0, 0, Between::kBezier, 0, 4}, K{2, 0, Between::kBezier, -4, 0}});
  EXPECT_NEAR(thrown.at(1), 2, 1e-12);  // a parabola
  EXPECT_NEAR(thrown.slope(0), 4, 1e-12);
  EXPECT_NEAR(thrown.slope(1.999999), -4, 1e-4);
}

TEST(Curve, TurnsAlongTheShorterArcAtAConstantRate) {
  const auto about_z = [](Real a) { return Quat(Eigen::AngleAxisd(a, Vec3::UnitZ())); };
  Quat end = about_z(1.2);
  end.coeffs() *= -3;  // the same orientation, the other sign, another length
  const TurnCurve curve({{0, about_z(0), Between::kLinear}, {2, end, Between::kStep}, {3, about_z(3), Between::kLinear}});
  for (Real t = 0; t < 2; t += 0.25) EXPECT_LT(curve.at(t).angularDistance(about_z(0.6 * t)), 1e-9);
  EXPECT_LT(curve.at(2.9).angularDistance(about_z(1.2)), 1e-9);
  EXPECT_LT(curve.at(9).angularDistance(about_z(3)), 1e-9);
}

TEST(Curve, ItsIntegralAndExtremesAreThoseOfManySamples) {
  const Curve<Real> curve({K{0, 1, Between::kCatmullRom, 0, 0}, K{1, 4, Between::kStep, 0, 0}, K{2, 0, Between::kLinear, 0, 0}, K{3, 2, Between::kBezier, 0, 9}, K{5, 2, Between::kBezier, 3, 0}});
  for (const auto& [from, to] : {std::pair{-1.0, 7.0}, {0.3, 0.7}, {0.5, 4.1}, {2.5, 2.6}, {5.5, 9.0}, {-3.0, -1.0}}) {
    const int n = 200000;
    Real sum = 0;
    for (int i = 0; i < n; ++i) sum += curve.at(from + (to - from) * (i + 0.5) / n) * (to - from) / n;
    EXPECT_NEAR(integral(curve, from, to), sum, 2e-4) << from << " to " << to;  // a jump within a sample: 4 * 8 s / n
    EXPECT_EQ(integral(curve, to, from), -integral(curve, from, to));
  }
  Real least = 1e9, most = -1e9;
  for (Real t = -1; t < 6; t += 1e-4) least = std::min(least, curve.at(t)), most = std::max(most, curve.at(t));
  EXPECT_NEAR(extremes(curve).first, least, 3e-4) << "samples 1e-4 s apart, slopes of 2 to 9";
  EXPECT_NEAR(extremes(curve).second, most, 1e-6) << "flat there";
  EXPECT_GE(extremes(curve).second, most);
  EXPECT_GT(most, 4.2) << "the case has an extreme between keys";
}

TEST(Curve, SmoothWithoutOvershootNeverLeavesItsKeysValues) {
  std::vector<Key<Real>> keys;
  for (int k = 0; k < 40; ++k) keys.push_back({k + 0.9 * random_uniform(3, 1, k), k % 5 == 0 ? 0 : 5 * random_uniform(3, 2, k), Between::kCatmullRom, 0, 0});
  const Curve<Real> loose(keys), tight(without_overshoot(keys));
  EXPECT_LT(extremes(loose).first, -0.05) << "Catmull-Rom overshoots here";
  for (std::size_t k = 0; k + 1 < keys.size(); ++k) {
    const auto [low, high] = std::minmax(keys[k].value, keys[k + 1].value);
    for (Real u = 0; u <= 1; u += 0.01) {
      const Real v = tight.at(keys[k].time + u * (keys[k + 1].time - keys[k].time));
      EXPECT_GE(v, low - 1e-12);
      EXPECT_LE(v, high + 1e-12);
    }
    if (k == 0) continue;
    EXPECT_NEAR(tight.slope(keys[k].time - 1e-9), tight.slope(keys[k].time), 1e-6) << "no kink";
  }
}

TEST(Curve, RefusesKeysOutOfOrder) {
  EXPECT_THROW(Curve<Real>({K{1, 0, Between::kLinear, 0, 0}, K{1, 2, Between::kLinear, 0, 0}}), InputError);
  EXPECT_THROW(Curve<Real>({K{1, std::nan(""), Between::kLinear, 0, 0}}), InputError);
  EXPECT_THROW(TurnCurve({{0, Quat(0, 0, 0, 0), Between::kLinear}}), InputError);
}

}  // namespace
}  // namespace effuse::geometry
