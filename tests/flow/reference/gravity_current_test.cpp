#include "flow/reference/gravity_current.h"

#include <gtest/gtest.h>

#include <cmath>

namespace effuse::flow::reference {
namespace {

struct Known {
  Spread spread;
  Real alpha, eta, exponent;
};
class GravityCurrentConstant : public testing::TestWithParam<Known> {};

TEST_P(GravityCurrentConstant, IsTheKnownOne) {
  const auto [spread, alpha, eta, exponent] = GetParam();
  const GravityCurrent current(spread, alpha, 2, 0.3);
  EXPECT_NEAR(current.eta(), eta, 1e-5);
  EXPECT_NEAR(current.exponent(), exponent, 1e-15);
}

// Known to five figures (Huppert prints three of the round ones: 0.894 and 0.715).
INSTANTIATE_TEST_SUITE_P(Table, GravityCurrentConstant,
                         testing::Values(Known{Spread::kPlanar, 0, 1.41124, 0.2}, Known{Spread::kPlanar, 1, 1.00101, 0.8},
                                         Known{Spread::kAxisymmetric, 0, 0.89391, 0.125}, Known{Spread::kAxisymmetric, 1, 0.71502, 0.5}));

TEST(GravityCurrent, OfARoundReleaseIsTheClosedForm) {
  const Real V = 3, nu = 0.2, t = 7;
  const GravityCurrent current(Spread::kAxisymmetric, 0, V, nu);
  EXPECT_NEAR(current.eta(), std::pow(1024 / (81 * kPi * kPi * kPi), 1.0 / 8), 1e-8);
  const Real r = current.front(t), h0 = 4 * V / (3 * kPi * r * r);
  for (Real y : {0.0, 0.3, 0.8, 0.99, 0.9999}) EXPECT_NEAR(current.depth(y * r, t), h0 * std::cbrt(1 - y * y), 1e-6 * h0) << y;
  EXPECT_EQ(current.depth(1.001 * r, t), 0);
}

TEST(GravityCurrent, OfALineReleaseHasTheKnownShape) {
  // h_t = (1/3)(h^3 h_x)_x with area 1: front 1.13286 t^(1/5), h = t^(-1/5) (9/10 (b^2 - eta^2))^(1/3).
  const GravityCurrent current(Spread::kPlanar, 0, 1, kGravity);
  EXPECT_NEAR(current.prefactor(), 1.13286, 1e-4);
  const Real t = 4, b = current.prefactor(), scale = std::pow(t, 0.2);
  for (Real x : {0.1, 0.6, 1.1}) EXPECT_NEAR(current.depth(x * scale, t), std::cbrt(0.9 * (b * b - x * x)) / scale, 1e-6);
}

TEST(GravityCurrent, HoldsItsVolume) {
  for (Spread spread : {Spread::kPlanar, Spread::kAxisymmetric})
    for (Real alpha : {0.0, 0.5, 1.0, 2.0}) {
      const GravityCurrent current(spread, alpha, 0.7, 0.01);
      const Real t = 3, front = current.front(t);
      Real volume = 0;
      const int n = 4000;
      for (int i = 0; i < n; ++i) {
        // Points crowd at the front, where the depth ends steeply.
        const Real a = 1 - std::pow(1 - static_cast<Real>(i) / n, 3), b = 1 - std::pow(1 - (i + 1.0) / n, 3), x = (a + b) / 2 * front;
        volume += current.depth(x, t) * (b - a) * front * (spread == Spread::kAxisymmetric ? 2 * kPi * x : 1);
      }
      EXPECT_NEAR(volume, current.volume(t), 1e-4 * current.volume(t)) << alpha;
    }
}

TEST(GravityCurrent, GivesTheRadiiOfTheCoolingExperiment) {
  const GravityCurrent oil(Spread::kAxisymmetric, 1, 2.2e-8, 3.56e-3);
  const Real table[6][2] = {{60, 17.5}, {120, 24.7}, {300, 39.0}, {380, 43.9}, {600, 55.2}, {1200, 78.1}};
  for (const auto& [t, r_mm] : table) EXPECT_NEAR(1000 * oil.front(t), r_mm, 0.06);
}

TEST(GravityCurrent, OfBm1IsTheLateLawOfTheTable) {
  const GravityCurrent late(Spread::kPlanar, 0, 6.6, 1e4 / 2700);
  const Real table[4][2] = {{10, 6.77}, {100, 10.73}, {300, 13.36}, {550, 15.08}};
  for (const auto& [t, x] : table) EXPECT_NEAR(late.front(t), x, 0.01) << "the table is cut, not rounded, to centimetres";
}

TEST(EarlyDamBreak, IsTheEarlyLawOfTheTable) {
  const Real table[5][2] = {{1, 7.06}, {5, 7.64}, {10, 8.06}, {25, 8.91}, {50, 9.87}};
  for (const auto& [t, x] : table) EXPECT_NEAR(early_dam_break_front(6.6, 1, 1e4 / 2700, t), x, 0.006);
}

TEST(SlopeCurrents, KeepTheirVolumeAndTheirFlux) {
  const PlanarSlopeCurrent slab{2, 0.2, 0.05};
  const Real t = 100, front = slab.front(t);
  Real area = 0;
  for (int i = 0; i < 20000; ++i) area += slab.depth((i + 0.5) / 20000 * front, t) * front / 20000;
  EXPECT_NEAR(area, slab.area, 1e-5);

  const LineSourceOnSlope line{0.01, 0.2, 0.05};
  EXPECT_NEAR(line.front(t) * line.depth(), line.flux * t, 1e-12);
}

TEST(SlopeCurrents, PointSourceGivesTheAsymptoteOfTheExperiment) {
  const PointSourceOnSlope oil{1.48e-6, 2.5 * kPi / 180, 1.13e-3};
  EXPECT_NEAR(oil.front(727), 0.880, 0.002);
  EXPECT_NEAR(oil.half_width(727), 0.288, 0.002);
}

}  // namespace
}  // namespace effuse::flow::reference
