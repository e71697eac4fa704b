#include "flow/integrate/integrate.h"

#include <gtest/gtest.h>

#include <cmath>

#include "flow/reference/oscillator.h"

namespace effuse::flow {
namespace {

Real oscillator_error(Scheme scheme, Real dt) {
  const Oscillator exact{1.3, 1, 0.4};
  const int steps = static_cast<int>(std::lround(6 / dt));
  OscillatorState y = exact.at(0);
  StepStorage<OscillatorState> storage;
  for (int i = 0; i < steps; ++i) integrate_step(scheme, exact, i * dt, dt, y, storage);
  const OscillatorState truth = exact.at(steps * dt);
  return std::hypot(y.x - truth.x, (y.v - truth.v) / exact.omega);
}

struct Claim {
  Scheme scheme;
  double order;
};
class IntegratorOrder : public testing::TestWithParam<Claim> {};

TEST_P(IntegratorOrder, HalvingTheStepDividesTheErrorByTwoToTheOrder) {
  const auto [scheme, order] = GetParam();
  const double coarse = oscillator_error(scheme, 0.01), fine = oscillator_error(scheme, 0.005);
  ASSERT_GT(fine, 1e-13) << "below rounding, the slope means nothing";
  EXPECT_NEAR(std::log2(coarse / fine), order, 0.1) << coarse << " -> " << fine;
}
INSTANTIATE_TEST_SUITE_P(Explicit, IntegratorOrder,
                         testing::Values(Claim{Scheme::kEuler, 1}, Claim{Scheme::kSymplecticEuler, 1}, Claim{Scheme::kMidpoint, 2}, Claim{Scheme::kRk4, 4}));

TEST(Integrator, SymplecticEulerKeepsTheEnergyOfTenThousandPeriodsBoundedAndEulerDoesNot) {
  const Oscillator exact{1, 1, 0};
  const auto energy_after = [&](Scheme scheme, int steps) {
    OscillatorState y = exact.at(0);
    StepStorage<OscillatorState> storage;
    for (int i = 0; i < steps; ++i) integrate_step(scheme, exact, 0, 0.1, y, storage);
    return y.x * y.x + y.v * y.v;
  };
  EXPECT_NEAR(energy_after(Scheme::kSymplecticEuler, 600000), 1, 0.1);
  EXPECT_GT(energy_after(Scheme::kEuler, 1000), 1e3);
}

}  // namespace
}  // namespace effuse::flow
