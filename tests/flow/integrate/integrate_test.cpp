#include "flow/integrate/integrate.h"

#include <gtest/gtest.h>

#include <cmath>

#include "flow/reference/oscillator.h"
#include "flow/reference/rigid_motion.h"

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
INSTANTIATE_TEST_SUITE_P(Implicit, IntegratorOrder, testing::Values(Claim{Scheme::kImplicitEuler, 1}));

/// angle'' = -omega0^2 sin(angle); a state's x is the angle.
struct Swing {
  Real omega0;
  void velocity_rates(Real, const OscillatorState& y, OscillatorState& k) const { k.v = -omega0 * omega0 * std::sin(y.x); }
  void position_rates(Real, const OscillatorState& y, OscillatorState& k) const { k.x = y.v; }
  void rates(Real t, const OscillatorState& y, OscillatorState& k) const {
    velocity_rates(t, y, k);
    position_rates(t, y, k);
  }
  void implicit_euler(Real, Real dt, OscillatorState& y) const {
    // Newton's method for x - x0 - dt v0 + dt^2 omega0^2 sin x = 0.
    const Real x0 = y.x, a = dt * dt * omega0 * omega0;
    for (int k = 0; k < 20; ++k) y.x -= (y.x - x0 - dt * y.v + a * std::sin(y.x)) / (1 + a * std::cos(y.x));
    y.v = (y.x - x0) / dt;
  }
};

class PendulumOrder : public testing::TestWithParam<Claim> {};

TEST_P(PendulumOrder, HalvingTheStepDividesTheErrorByTwoToTheOrder) {
  const auto [scheme, order] = GetParam();
  const reference::Pendulum exact{1.3, 2};
  const auto error = [&, scheme = scheme](Real dt) {
    const int steps = static_cast<int>(std::lround(6 / dt));
    OscillatorState y{exact.angle(0), 0};
    StepStorage<OscillatorState> storage;
    for (int i = 0; i < steps; ++i) integrate_step(scheme, Swing{exact.omega0}, i * dt, dt, y, storage);
    return std::abs(y.x - exact.angle(steps * dt));
  };
  const Real dt = order > 2 ? 2e-2 : 2e-3, coarse = error(dt), fine = error(dt / 2);
  ASSERT_GT(fine, 1e-13) << "below rounding, the slope means nothing";
  EXPECT_NEAR(std::log2(coarse / fine), order, 0.1) << coarse << " -> " << fine;
}
INSTANTIATE_TEST_SUITE_P(Schemes, PendulumOrder,
                         testing::Values(Claim{Scheme::kEuler, 1}, Claim{Scheme::kSymplecticEuler, 1}, Claim{Scheme::kMidpoint, 2}, Claim{Scheme::kRk4, 4}, Claim{Scheme::kImplicitEuler, 1}));

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
