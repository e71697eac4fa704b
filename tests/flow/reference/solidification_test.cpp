#include "flow/reference/solidification.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace effuse::flow::reference {
namespace {

TEST(ContactOfHalfSpaces, FluxIsContinuousAtTheInterfaceAndDrivesTheProfile) {
  const ContactOfHalfSpaces two{.T_left = 300, .T_right = 1400, .b_left = 2100, .b_right = 1500, .kappa_left = 8e-7, .kappa_right = 5e-7};
  const Real t = 1000, h = 1e-6;
  // b = k / sqrt(kappa): k dT/dx on either side, by differences.
  const Real left = 2100 * std::sqrt(8e-7) * (two.temperature(-h, t) - two.temperature(-2 * h, t)) / h;
  const Real right = 1500 * std::sqrt(5e-7) * (two.temperature(2 * h, t) - two.temperature(h, t)) / h;
  EXPECT_NEAR(left / two.flux(t), 1, 1e-4);
  EXPECT_NEAR(right / two.flux(t), 1, 1e-4);
  EXPECT_NEAR(two.temperature(1e-12, t), two.interface_temperature(), 1e-6);
}

struct Root {
  Real stefan, lambda;
};
class StefanRoot : public testing::TestWithParam<Root> {};
TEST_P(StefanRoot, SolvesTheOnePhaseEquation) {
  const auto [stefan, lambda] = GetParam();
  const FreezingFront front(0, 1, 1, 1 / stefan, 1, 1);
  EXPECT_NEAR(front.lambda(), lambda, 6e-6);
  EXPECT_NEAR(front.lambda() * std::exp(std::pow(front.lambda(), 2)) * std::erf(front.lambda()), stefan / std::sqrt(kPi), 1e-12);
}
INSTANTIATE_TEST_SUITE_P(Table, StefanRoot, testing::Values(Root{.25, .34008}, Root{.5, .46479}, Root{1, .62006}, Root{1.5, .72321}, Root{2, .80060}, Root{3, .91375}));

TEST(FreezingFront, OfLavaAtAnHourIsSevenCentimetresDeep) {
  const FreezingFront front(298.15, 1343.15, 1423.15, 350e3, 1150, 1.5 / (2600 * 1150));
  EXPECT_NEAR(front.lambda(), 0.8637, 5e-5);
  EXPECT_NEAR(front.front(3600), 0.0734, 5e-5);
  EXPECT_NEAR(front.temperature(front.front(3600), 3600), 1343.15, 1e-9);
  // Stefan's condition: the jump of the flux frees the latent heat.  rho L ds/dt = [k dT/dx]
  const Real t = 3600, s = front.front(t), h = 1e-7, k = 1.5, rho = 2600;
  const Real jump = k * (front.temperature(s - h, t) - front.temperature(s - 2 * h, t) - front.temperature(s + 2 * h, t) + front.temperature(s + h, t)) / h;
  EXPECT_NEAR(jump / (rho * 350e3 * s / (2 * t)), 1, 1e-4);
}

TEST(RadiativeCooling, ObeysItsDifferentialEquation) {
  const Real eps = 0.9, rho = 2600, c = 1150, d = 1, t = 3600, h = 1;
  const auto T = [&](Real time) { return radiative_cooling(1360, eps, rho, c, d, time); };
  const Real rate = (T(t + h) - T(t - h)) / (2 * h);
  EXPECT_NEAR(rate / (-eps * kStefanBoltzmann * std::pow(T(t), 4) / (rho * c * d)), 1, 1e-6);
  EXPECT_NEAR(T(0), 1360, 1e-9);
}

constexpr std::array<Real, 4> kTimes = {10, 60, 600, 3600};

TEST(CoolingHalfSpaceSolver, HalvingStepsAndCellsMovesNothingMuch) {
  CoolingHalfSpace lava;
  const auto coarse = cool(lava, kTimes);
  lava.refinement = 2;
  const auto fine = cool(lava, kTimes);
  for (std::size_t k = 0; k < kTimes.size(); ++k) {
    EXPECT_NEAR(coarse[k].surface_temperature, fine[k].surface_temperature, 0.1);
    EXPECT_NEAR(coarse[k].crust / fine[k].crust, 1, 2e-3);
    EXPECT_NEAR(coarse[k].lost / fine[k].lost, 1, 2e-4);
  }
}

// Without latent heat and with a linear law of loss there is a closed form: Carslaw & Jaeger 1959, section 2.7,
//   (T - Ta)/(T0 - Ta) = exp(H^2 kappa t) erfc(H sqrt(kappa t)) at the face,  H = h / k.
TEST(CoolingHalfSpaceSolver, MeetsTheClosedFormOfPureConvection) {
  CoolingHalfSpace lava;
  lava.emissivity = 0;
  lava.latent_heat = 0;
  const auto moments = cool(lava, kTimes);
  for (const CoolingMoment& m : moments) {
    const Real y = lava.convection / lava.conductivity * std::sqrt(lava.conductivity / (lava.density * lava.heat_capacity) * m.t);
    const Real exact = lava.air_temperature + (lava.T0 - lava.air_temperature) * std::exp(y * y) * std::erfc(y);
    EXPECT_NEAR(m.surface_temperature, exact, 0.05) << m.t;
  }
}

}  // namespace
}  // namespace effuse::flow::reference
