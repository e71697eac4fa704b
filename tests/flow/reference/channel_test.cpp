#include "flow/reference/channel.h"

#include <gtest/gtest.h>

#include <cmath>

namespace effuse::flow::reference {
namespace {

constexpr Real kDegree = kPi / 180;

// Midpoint rule with n cells.
template <class F>
Real integral(const F& f, Real a, Real b, int n = 2000) {
  Real sum = 0;
  for (int i = 0; i < n; ++i) sum += f(a + (i + 0.5) * (b - a) / n);
  return sum * (b - a) / n;
}

// How far u_t = nu u_yy + force is from being met, by central differences of relative width 1e-3.
template <class U>
Real residual(const U& u, Real y, Real t, Real nu, Real force, Real width) {
  const Real dy = 1e-3 * width, dt = 1e-3 * t;
  const Real rate = (u(y, t + dt) - u(y, t - dt)) / (2 * dt), bend = (u(y + dy, t) - 2 * u(y, t) + u(y - dy, t)) / (dy * dy);
  return rate - nu * bend - force;
}

TEST(PlanePoiseuille, SolvesTheEquationFromRestToTheSteadyProfile) {
  const PlanePoiseuille flow{0.05, 1, 0.1};
  EXPECT_NEAR(flow.peak(), 0.0625, 1e-15);
  const auto u = [&](Real y, Real t) { return flow.velocity(y, t); };
  for (Real t : {0.05, 0.5, 3.0})
    for (Real y : {0.1, 0.3, 0.5}) EXPECT_NEAR(residual(u, y, t, flow.nu, flow.force, flow.width), 0, 1e-5 * flow.force) << y << " " << t;
  EXPECT_EQ(flow.velocity(0.3, 0), 0);
  // Long before diffusion arrives the middle falls freely.
  EXPECT_NEAR(flow.velocity(0.5, 0.02), flow.force * 0.02, 1e-9);
  for (Real t : {0.02, 1.0}) EXPECT_NEAR(flow.velocity(0, t), 0, 1e-12);
  EXPECT_NEAR(flow.velocity(0.3, 100), flow.velocity(0.3), 1e-12);
}

TEST(PlanePoiseuille, FluxIsTheIntegralOfTheProfile) {
  const PlanePoiseuille flow{2, 0.3, 0.01};
  for (Real t : {0.05, 1.0, 4.0}) EXPECT_NEAR(integral([&](Real y) { return flow.velocity(y, t); }, 0, flow.width), flow.flux(t), 1e-6 * flow.flux());
  EXPECT_NEAR(integral([&](Real y) { return flow.velocity(y); }, 0, flow.width), flow.flux(), 1e-6 * flow.flux());
}

TEST(Couette, SolvesTheEquationAndBothOfItsFormsAgree) {
  const Couette flow{2, 0.5, 0.02};
  const auto u = [&](Real y, Real t) { return flow.velocity(y, t); };
  for (Real t : {0.1, 0.5, 4.0})
    for (Real y : {0.1, 0.3, 0.45}) EXPECT_NEAR(residual(u, y, t, flow.nu, 0, flow.width), 0, 2e-4) << y << " " << t;
  // Images of the plate hand over to the series where 2 sqrt(nu t) is a quarter of the gap.
  const Real t = flow.width * flow.width / (64 * flow.nu);
  for (Real y : {0.05, 0.2, 0.4, 0.49}) EXPECT_NEAR(flow.velocity(y, t * (1 - 1e-12)), flow.velocity(y, t * (1 + 1e-12)), 1e-9);
  EXPECT_NEAR(flow.velocity(flow.width, 0.2), flow.speed, 1e-12);
  EXPECT_NEAR(flow.velocity(0, 0.2), 0, 1e-12);
  EXPECT_NEAR(flow.velocity(0.2, 1e3), flow.velocity(0.2), 1e-12);
  EXPECT_NEAR(integral([&](Real y) { return flow.velocity(y); }, 0, flow.width), flow.flux(), 1e-12);
}

TEST(NusseltFilm, HasTheSpeedsOfTheLavaTable) {
  // rho 2600, mu 1000, 5 degrees: surface and mean speed at depths 0.5, 1 and 2 m.
  const Real nu = 1000.0 / 2600;
  const Real table[3][3] = {{0.5, 0.2779, 0.1852}, {1, 1.1115, 0.7410}, {2, 4.446, 2.964}};
  for (const auto& [depth, surface, mean] : table) {
    const NusseltFilm film{depth, 5 * kDegree, nu};
    EXPECT_NEAR(film.surface_speed(), surface, 5e-4 * surface);
    EXPECT_NEAR(film.mean_speed(), mean, 5e-4 * mean);
    EXPECT_NEAR(integral([&](Real y) { return film.velocity(y); }, 0, depth), film.flux(), 1e-6 * film.flux());
  }
}

TEST(NusseltFilm, ItsSurfaceIsFreeOfStressWhileItStarts) {
  const NusseltFilm film{1, 10 * kDegree, 0.4};
  const Real step = 1e-5;
  EXPECT_NEAR((film.velocity(1, 0.3) - film.velocity(1 - step, 0.3)) / step, 0, 1e-3 * film.surface_speed());
  EXPECT_NEAR(film.velocity(1, 50), film.surface_speed(), 1e-9);
}

TEST(BinghamFilm, WithoutStrengthIsNusseltsAndAtItsStrengthStandsStill) {
  BinghamFilm film{0.8, 7 * kDegree, 2600, 1500, 0};
  const NusseltFilm newtonian{film.depth, film.slope, film.mu / film.density};
  EXPECT_NEAR(film.flux(), newtonian.flux(), 1e-12);
  EXPECT_NEAR(film.velocity(0.3), newtonian.velocity(0.3), 1e-12);
  film.yield = film.wall_stress() * 1.0001;
  EXPECT_EQ(film.flux(), 0);
  EXPECT_EQ(film.velocity(0.5), 0);
  EXPECT_EQ(film.jeffreys_mean(), 0);
}

TEST(BinghamFilm, StressIsYieldStrengthAtThePlugsLowerEdgeAndTheMeanIsJeffreys) {
  BinghamFilm film{0.8, 7 * kDegree, 2600, 1500, 0};
  film.yield = 0.4 * film.wall_stress();
  EXPECT_NEAR(film.sheared_depth(), 0.6 * film.depth, 1e-12);
  // Anywhere below: weight of what lies above = yield strength + mu u'.
  for (Real y : {0.1, 0.3, 0.45}) {
    const Real shear = (film.velocity(y + 1e-6) - film.velocity(y - 1e-6)) / 2e-6;
    EXPECT_NEAR(film.density * kGravity * std::sin(film.slope) * (film.depth - y), film.yield + film.mu * shear, 1e-3);
  }
  EXPECT_NEAR(integral([&](Real y) { return film.velocity(y); }, 0, film.depth), film.flux(), 1e-6 * film.flux());
  EXPECT_NEAR(film.flux(), film.depth * film.jeffreys_mean(), 1e-12);
}

}  // namespace
}  // namespace effuse::flow::reference
