#include "flow/reference/thin_film.h"

#include <gtest/gtest.h>

#include <cmath>

#include "flow/reference/gravity_current.h"
#include "flow/reference/lister_experiment.h"

namespace effuse::flow::reference {
namespace {

// Front and depth at the wall of BM1, from an independent solution with the front at 1 mm of depth on three grids, which agree to 0.02 m.
constexpr Real kBm1[10][3] = {{1, 7.07, 1.000},    {5, 7.64, .9915},    {10, 8.07, .9609},   {25, 8.91, .8792},   {50, 9.83, .7979},
                              {100, 11.03, .7115}, {200, 12.51, .6277}, {300, 13.49, .5815}, {400, 14.26, .5502}, {550, 15.17, .5173}};

std::vector<Real> bm1_times() {
  std::vector<Real> times;
  for (const auto& row : kBm1) times.push_back(row[0]);
  return times;
}

TEST(DamBreakReference, ReproducesTheTableOfBm1) {
  const std::vector<DamBreakState> states = solve_dam_break({}, bm1_times());
  for (std::size_t k = 0; k < states.size(); ++k) {
    EXPECT_NEAR(states[k].front, kBm1[k][1], 0.02) << states[k].time;
    EXPECT_NEAR(states[k].wall_depth, kBm1[k][2], 5e-4) << states[k].time;
    Real volume = 0;
    for (Real h : states[k].h) volume += 0.05 * h;
    EXPECT_NEAR(volume, 6.6, 1e-8);
  }
}

TEST(DamBreakReference, DoesNotDependOnItsGrid) {
  const Real times[] = {10, 100};
  const auto coarse = solve_dam_break({}, times), fine = solve_dam_break({}, times, {.cell = 0.0125});
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_NEAR(coarse[k].front, fine[k].front, 0.01);
    EXPECT_NEAR(coarse[k].wall_depth, fine[k].wall_depth, 1e-3);
  }
}

TEST(DamBreakReferenceSlow, EndsAsHuppertsCurrent) {
  const DamBreak dam{1, 1, 0.01};
  const GravityCurrent late(Spread::kPlanar, 0, 1, 0.01);
  // The start is forgotten: at 40 times the dam's length 1e-4 is left of it, and the solver's own first-order errors.
  const Real times[] = {2e5};
  const auto state = solve_dam_break(dam, times, {.cell = 0.05, .domain = 80, .wet = 1e-4}).front();
  EXPECT_NEAR(state.front, late.front(times[0]), 0.005 * state.front);
  EXPECT_NEAR(state.wall_depth, late.depth(0, times[0]), 0.005 * state.wall_depth);
}

TEST(InclineReferenceSlow, ReproducesTheTableOfBm2) {
  // From an independent solution on a grid of 2.5 mm, whose widths are whole cells: half a cell of leeway on top of 1 %.
  const Real times[] = {32, 59, 122}, x[] = {.0962, .1437, .2362}, y[] = {.0688, .0938, .1288};
  const std::vector<InclineState> states = solve_incline_source({}, times);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_NEAR(states[k].front, x[k], 0.01 * x[k] + 0.00125) << times[k];
    EXPECT_NEAR(states[k].half_width, y[k], 0.01 * y[k] + 0.00125) << times[k];
    EXPECT_NEAR(states[k].volume, 1.48e-6 * times[k], 1e-12 * times[k]);
  }
}

TEST(InclineReference, DoesNotDependOnItsGrid) {
  const Real times[] = {32};
  const auto coarse = solve_incline_source({}, times).front(), fine = solve_incline_source({}, times, {.cell = 2.5e-3}).front();
  EXPECT_NEAR(coarse.front, fine.front, 0.015 * fine.front);
  EXPECT_NEAR(coarse.half_width, fine.half_width, 0.01 * fine.half_width);
  EXPECT_NEAR(coarse.back, fine.back, 0.02 * fine.front);
}

TEST(InclineReference, OnNearlyLevelGroundIsRoundAndHupperts) {
  const InclineSource source{.flux = 1e-6, .slope = 1e-6, .nu = 1e-3, .source_radius = 4e-3};
  const GravityCurrent round(Spread::kAxisymmetric, 1, source.flux, source.nu);
  const Real times[] = {25};
  const auto state = solve_incline_source(source, times, {.cell = 2.5e-3}).front();
  EXPECT_NEAR(state.front, round.front(times[0]), 0.02 * round.front(times[0]));
  EXPECT_NEAR(state.half_width, round.front(times[0]), 0.02 * round.front(times[0]));
  EXPECT_NEAR(-state.back, round.front(times[0]), 0.02 * round.front(times[0]));
}

TEST(ListerExperiment, HasItsFrontsAndWidths) {
  const Real table[6][3] = {{32, .0967, .0699}, {59, .1455, .0922}, {122, .2446, .1276}, {271, .4442, .1798}, {486, .6920, .2261}, {727, .9431, .2634}};
  const auto outlines = lister_outlines();
  ASSERT_EQ(outlines.size(), 6u);
  for (std::size_t k = 0; k < 6; ++k) {
    EXPECT_EQ(outlines[k].time, table[k][0]);
    EXPECT_EQ(outlines[k].front(), table[k][1]);
    EXPECT_EQ(outlines[k].half_width(), table[k][2]);
  }
}

}  // namespace
}  // namespace effuse::flow::reference
