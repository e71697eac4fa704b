#include "flow/reference/cooling_current.h"

#include <gtest/gtest.h>

#include <cmath>

#include "flow/reference/gravity_current.h"

namespace effuse::flow::reference {
namespace {

// Garel's silicone oil; 21 W/(m^2 K) through both faces.
constexpr CoolingCurrent kOil{.rate = 2.2e-8, .nu = 3.56e-3, .density = 964, .heat_capacity = 1500, .excess = 22, .exchange = 21};

TEST(CoolingCurrent, LosesAsAWarmPlateAtFirst) {
  const GravityCurrent current(Spread::kAxisymmetric, 1, kOil.rate, kOil.nu);
  const Real t = 0.1, area = kPi * current.front(t) * current.front(t);
  EXPECT_NEAR(kOil.loss(t), kOil.exchange * kOil.excess * area, 2e-3 * kOil.exchange * kOil.excess * area);
}

TEST(CoolingCurrent, LosesWhatItBringsInTheEndAndNeverMore) {
  EXPECT_NEAR(kOil.supply(), 0.70, 0.001);
  Real before = 0;
  for (Real t : {30.0, 100.0, 380.0, 1200.0, 2e4}) {
    const Real loss = kOil.loss(t);
    EXPECT_GT(loss, before);
    EXPECT_LT(loss, kOil.supply());
    before = loss;
  }
  EXPECT_NEAR(before, kOil.supply(), 0.01 * kOil.supply());
}

TEST(CoolingCurrent, AgreesWithAnIndependentSum) {
  // 400 elements of equal age, 200 steps each, the shape integrated apart: 0.4150, 0.6414, 0.6902 W.
  EXPECT_NEAR(kOil.loss(100), 0.4150, 0.001);
  EXPECT_NEAR(kOil.loss(380), 0.6414, 0.001);
  EXPECT_NEAR(kOil.loss(1200), 0.6902, 0.001);
}

TEST(GravityCurrent, PlaceIsWhereItsShareOfTheVolumeEnds) {
  // A round release: share 1 - (1 - y^2)^(4/3).
  const GravityCurrent release(Spread::kAxisymmetric, 0, 2, 0.1);
  for (Real y : {0.1, 0.5, 0.9, 0.99}) EXPECT_NEAR(release.place(1 - std::pow(1 - y * y, 4.0 / 3)), y, 1e-5);
  EXPECT_NEAR(release.place(1), 1, 1e-12);
  EXPECT_NEAR(release.place(0), 0, 1e-6);
}

}  // namespace
}  // namespace effuse::flow::reference
