#include "flow/sph/crust_column.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numeric>
#include <random>

#include "flow/reference/solidification.h"

namespace effuse::flow::sph {
namespace {

using Cells = std::array<Real, kColumnCells>;

Real content(const Cells& H, const ColumnShape& shape) {
  Real sum = 0;
  for (int j = 0; j < kColumnCells; ++j) sum += shape.share[j] * H[j];
  return sum;
}

TEST(EnthalpyCurve, GoesThereAndBackOverTheMeltingRange) {
  const EnthalpyCurve curve;
  for (Real T = 200; T < 2000; T += 7) EXPECT_NEAR(curve.temperature(curve.enthalpy(T)), T, 1e-9);
  EXPECT_NEAR(curve.enthalpy(curve.liquidus) - curve.enthalpy(curve.solidus), curve.latent_heat + curve.heat_capacity * (curve.liquidus - curve.solidus), 1e-6);
  // The slope is that of the curve, the solid fraction linear in between.
  for (const Real T : {800.0, 1300.0, 1350.0, 1500.0}) {
    const Real H = curve.enthalpy(T);
    EXPECT_NEAR(curve.slope(H), (curve.temperature(H + 1) - curve.temperature(H - 1)) / 2, 1e-12);
    EXPECT_NEAR(curve.solid_fraction(H), std::clamp((curve.liquidus - T) / (curve.liquidus - curve.solidus), 0.0, 1.0), 1e-12);
  }
}

TEST(EnthalpyCurve, MeltsAtOneTemperatureWhenSolidusIsLiquidus) {
  EnthalpyCurve curve;
  curve.solidus = curve.liquidus = 1343.15;
  const Real solid = curve.heat_capacity * 1343.15;
  EXPECT_DOUBLE_EQ(curve.temperature(solid + 0.25 * curve.latent_heat), 1343.15);
  EXPECT_DOUBLE_EQ(curve.solid_fraction(solid + 0.25 * curve.latent_heat), 0.75);
  EXPECT_NEAR(curve.temperature(curve.enthalpy(1400)), 1400, 1e-9);
  EXPECT_NEAR(curve.temperature(curve.enthalpy(1300)), 1300, 1e-9);
}

TEST(SurfaceLaw, FaceBalancesConductionAndLossBetweenInsideAndAir) {
  for (const bool thompson_ramsey : {false, true}) {
    SurfaceLaw air;
    air.thompson_ramsey = thompson_ramsey;
    for (const Real T : {100.0, 299.0, 301.0, 900.0, 1450.0})
      for (const Real G : {1e-3, 1.0, 100.0, 1e5})
        for (const Real share : {0.1, 1.0}) {
          const Real face = air.face_temperature(T, G, share);
          EXPECT_GE(face, std::min(T, air.air_temperature));
          EXPECT_LE(face, std::max(T, air.air_temperature));
          EXPECT_NEAR(G * (T - face), share * air.flux(face), 1e-7 * (1 + share * std::abs(air.flux(face)) + G * T)) << T << ' ' << G;
        }
    for (const Real T : {400.0, 1000.0, 1400.0}) EXPECT_NEAR(air.slope(T), (air.flux(T + 1e-3) - air.flux(T - 1e-3)) / 2e-3, 1e-4);
  }
}

TEST(SurfaceLaw, EmissivityOfThompsonAndRamseyFallsWithHeat) {
  SurfaceLaw air;
  air.thompson_ramsey = true;
  EXPECT_NEAR(air.emissivity_at(1373.15), 1.0463 - 1.48144e-4 * 1373.15, 1e-12);
  EXPECT_EQ(air.emissivity_at(200), 1);
}

TEST(ColumnShape, FillsTheDepthInAGeometricSeries) {
  for (const Real finest : {1.0 / 16, 1.0 / 200, 1e-3}) {
    const ColumnShape shape(finest);
    EXPECT_NEAR(std::accumulate(shape.share.begin(), shape.share.end(), 0.0), 1, 1e-14);
    EXPECT_NEAR(shape.share[0], finest, 1e-9);
    const Real ratio = shape.share[1] / shape.share[0];
    EXPECT_GE(ratio, 1 - 1e-9);
    for (int j = 1; j < kColumnCells; ++j) EXPECT_NEAR(shape.share[j] / shape.share[j - 1], ratio, 1e-9);
    EXPECT_NEAR(shape.centre[kColumnCells - 1] + shape.share[kColumnCells - 1] / 2, 1, 1e-14);
  }
}

TEST(ColumnShape, FewerCellsFillItToo) {
  for (const int cells : {2, 5, 16}) {
    const ColumnShape shape(1.0 / 200, cells);
    EXPECT_EQ(shape.cells, cells);
    EXPECT_NEAR(std::accumulate(shape.share.begin(), shape.share.end(), 0.0), 1, 1e-14);
    EXPECT_NEAR(shape.share[0], 1.0 / 200, 1e-9);
    EXPECT_EQ(std::count(shape.share.begin(), shape.share.end(), 0.0), kColumnCells - cells);
  }
  EXPECT_NEAR(ColumnShape(1, 4).share[0], 0.25, 1e-12) << "no wider than an equal share";
}

// No latent heat, no radiation: in the end a straight profile carries dT / (sum of resistances).
TEST(CrustColumnStep, SettlesToTheSteadyFluxThroughThreeResistances) {
  const ColumnShape shape(1.0 / 200);
  EnthalpyCurve curve;
  curve.latent_heat = 0;
  const SurfaceLaw air{.emissivity = 0, .convection = 20, .air_temperature = 300};
  const Real depth = 0.3, k = 1.5, floor = 80;
  Cells H;
  H.fill(curve.enthalpy(1000));
  Real face = 0;
  ColumnLoss loss;
  const Real dt = 1e8;
  for (int step = 0; step < 3; ++step) loss = step_column(H, dt, depth, 2600, shape, curve, k, k, air, {1, floor, 1200}, face);
  // The floor's conductance begins in the middle of the last cell.
  const Real flux = (1200 - 300) / (1 / 20.0 + shape.centre[kColumnCells - 1] * depth / k + 1 / floor);
  EXPECT_NEAR(loss.convected / dt, flux, 1e-6 * flux);
  EXPECT_NEAR(-loss.ground / dt, flux, 1e-6 * flux);
  EXPECT_NEAR(face, 300 + flux / 20, 1e-4);
}

TEST(CrustColumnStep, KeepsTheBudgetAndTheBoundsForAnyStepAndAnyProfile) {
  const unsigned seed = 7;
  SCOPED_TRACE(seed);
  std::mt19937 random(seed);
  const auto uniform = [&](Real a, Real b) { return std::uniform_real_distribution<Real>(a, b)(random); };
  for (int round = 0; round < 2000; ++round) {
    EnthalpyCurve curve;
    if (round % 3 == 0) {
      curve.solidus = 1343.1;
      curve.liquidus = 1343.2;
    }
    if (round % 3 == 1) curve.solidus = curve.liquidus - 1;
    const ColumnShape shape(std::pow(10, uniform(-3, -1.3)));
    SurfaceLaw air;
    air.thompson_ramsey = round % 2;
    const ColumnEnds ends{uniform(0, 1), round % 5 == 0 ? 0 : uniform(0, 1000), uniform(280, 1500)};
    const Real depth = std::pow(10, uniform(-3, 1)), dt = std::pow(10, uniform(-3, 9)), density = 2600;
    Cells H;
    Real low = air.air_temperature, high = low;
    for (Real& h : H) {
      const Real T = round % 4 == 0 ? uniform(290, 1500) : 1343.15 + uniform(-50, 80);
      h = curve.enthalpy(T);
      low = std::min(low, T);
      high = std::max(high, T);
    }
    if (ends.ground_conductance > 0) {
      low = std::min(low, ends.ground_temperature);
      high = std::max(high, ends.ground_temperature);
    }
    const Real before = content(H, shape);
    Real face = 0;
    const ColumnLoss loss = step_column(H, dt, depth, density, shape, curve, 1.7, 2.5, air, ends, face);
    const Real lost = (loss.radiated + loss.convected + loss.ground) / (density * depth);
    const Real through = (std::abs(loss.radiated + loss.convected) + std::abs(loss.ground)) / (density * depth);  // may be much more than stays
    EXPECT_NEAR(before - content(H, shape), lost, 1e-12 * (before + through)) << round;
    // And both ends follow their laws: the bound is the solver's tolerance of 1 mK in a cell.
    const Real sky = dt * ends.sky_share * air.flux(face), conductance = dt * (2 * 2.5 / (shape.share[0] * depth) + ends.ground_conductance);
    EXPECT_NEAR(loss.radiated + loss.convected, sky, 2e-6 * std::abs(sky) + 2e-3 * conductance) << round;
    const Real ground = dt * ends.ground_conductance * (curve.temperature(H[kColumnCells - 1]) - ends.ground_temperature);
    EXPECT_NEAR(loss.ground, ground, 2e-6 * std::abs(ground) + 2e-3 * conductance) << round;
    for (const Real h : H) {
      EXPECT_GE(curve.temperature(h), low - 0.01) << round << " dt " << dt << " depth " << depth;
      EXPECT_LE(curve.temperature(h), high + 0.01) << round << " dt " << dt << " depth " << depth;
    }
    EXPECT_GE(face, std::min(low, air.air_temperature) - 0.01);
    EXPECT_LE(face, high + 0.01);
  }
}

TEST(CrustColumnStep, HalvingTheStepHalvesTheError) {
  const ColumnShape shape(1.0 / 200);
  const EnthalpyCurve curve;
  const SurfaceLaw air;
  const auto lost = [&](int steps) {
    Cells H;
    H.fill(curve.enthalpy(1423.15));
    Real face = 0;
    for (int k = 0; k < 20; ++k) step_column(H, 1, 0.1, 1560, shape, curve, 1.7, 1.7, air, {}, face);
    const Real before = content(H, shape);
    for (int k = 0; k < steps; ++k) step_column(H, 60.0 / steps, 0.1, 1560, shape, curve, 1.7, 1.7, air, {}, face);
    return before - content(H, shape);
  };
  const Real exact = 2 * lost(2000) - lost(1000);
  EXPECT_NEAR(std::log2((lost(20) - exact) / (lost(40) - exact)), 1, 0.1);
}

}  // namespace
}  // namespace effuse::flow::sph
