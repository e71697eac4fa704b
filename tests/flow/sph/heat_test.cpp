#include "flow/sph/heat.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "flow/reference/solidification.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"

namespace effuse::flow::sph {
namespace {

/// A lattice of `across` x `across` x `layers` particles, endless in x and y, top layer first and highest: layer k has its
/// middle at depth (k + 1/2) dx below z = 0.
struct Stack {
  Stack(int across_, int layers_, Real dx_, Real support_ = 3) : across(across_), layers(layers_), dx(dx_), support(support_ * dx_) {
    for (int k = 0; k < layers; ++k)
      for (int j = 0; j < across; ++j)
        for (int i = 0; i < across; ++i) x.push_back(dx * Vec3(i + 0.5, j + 0.5, -(k + 0.5)));
    period = Vec2::Constant(across * dx);
    sky.assign(x.size(), 0);
    ground.assign(x.size(), 0);
    ground_temperature.assign(x.size(), 300);
    find_neighbors();
  }
  /// Images beyond the borders, and their originals' numbers in the lists.
  void find_neighbors() {
    std::vector<Vec3> all = x;
    std::vector<Index> original(x.size());
    std::iota(original.begin(), original.end(), Index{0});
    for (int axis = 0; axis < 2; ++axis) {
      const std::size_t now = all.size();
      for (std::size_t i = 0; i < now; ++i)
        for (const Real shift : {period[axis], -period[axis]}) {
          Vec3 y = all[i];
          y[axis] += shift;
          if (y[axis] <= -support || y[axis] >= period[axis] + support) continue;
          all.push_back(y);
          original.push_back(original[i]);
        }
    }
    ColumnGrid grid;
    grid.build(all, support);
    neighbors.find(grid, support);
    for (std::size_t i = 0; i < x.size(); ++i)
      for (const Index& j : neighbors[i]) const_cast<Index&>(j) = original[j];
  }
  std::size_t per_layer() const { return static_cast<std::size_t>(across) * across; }
  std::size_t size() const { return x.size(); }
  Real area() const { return static_cast<Real>(per_layer()) * dx * dx; }
  void expose_top(bool on = true) { std::fill_n(sky.begin(), per_layer(), on ? dx * dx : 0); }
  Heat::Surroundings around() const { return {x, neighbors, KernelKind::kWendlandC2, support, period, sky, ground, ground_temperature, dissipation}; }
  /// The layers' mean temperatures.
  std::vector<Real> profile(const Heat& heat) const {
    std::vector<Real> T(layers);
    for (std::size_t i = 0; i < size(); ++i) T[i / per_layer()] += heat.temperature()[i] / static_cast<Real>(per_layer());
    return T;
  }

  int across, layers;
  Real dx, support;
  std::vector<Vec3> x;
  Vec2 period;
  Neighbors neighbors;
  std::vector<Real> sky, ground, ground_temperature, dissipation;
};

/// Conduction alone.
HeatOptions plain() {
  HeatOptions options;
  options.curve.latent_heat = 0;
  options.crust = false;
  options.longest_interval = 0;
  return options;
}

Real lost(const HeatBudget& b) { return b.radiated + b.convected + b.ground - b.dissipated; }

TEST(Heat, StepOfTemperatureSpreadsAsTheErrorFunction) {
  const Stack stack(6, 28, 0.1);  // 1008 particles
  const HeatOptions options = plain();
  Heat heat(options, stack.dx, 2600);
  const Real T1 = 1400, T2 = 500, kappa = options.conductivity / (2600 * options.curve.heat_capacity);
  for (std::size_t i = 0; i < stack.size(); ++i) heat.born(i < stack.size() / 2 ? T1 : T2);
  const Real time = std::pow(2.5 * stack.dx, 2) / kappa;  // erf's width: five spacings
  for (int k = 0; k < 50; ++k) heat.step(time / 50, stack.around());
  const auto T = stack.profile(heat);
  Real worst = 0;
  for (int k = 0; k < stack.layers; ++k) {
    const Real z = (k + 0.5 - stack.layers / 2) * stack.dx;
    worst = std::max(worst, std::abs(T[k] - ((T1 + T2) / 2 + (T2 - T1) / 2 * std::erf(z / (2 * std::sqrt(kappa * time))))));
  }
  EXPECT_LT(worst / (T1 - T2), 0.005);  // the bar is 2 %
}

TEST(HeatSlow, TwoConductivitiesMeetAtTheContactTemperature) {
  const Stack stack(6, 40, 0.1);
  HeatOptions options = plain();
  options.solid_conductivity = 9 * options.conductivity;  // b three times as large
  const Real T1 = 600, T2 = 1400, Ti = (3 * T1 + T2) / 4, c = options.curve.heat_capacity;
  // Melts, without latent heat, at the very temperature that the interface keeps: so the jump of k stays there.
  options.curve.solidus = options.curve.liquidus = Ti;
  Heat heat(options, stack.dx, 2600);
  for (std::size_t i = 0; i < stack.size(); ++i) heat.born(i < stack.size() / 2 ? T1 : T2);
  const Real kappa = options.conductivity / (2600 * c), time = std::pow(1.5 * stack.dx, 2) / kappa;
  for (int k = 0; k < 50; ++k) heat.step(time / 50, stack.around());
  const reference::ContactOfHalfSpaces exact{T1, T2, 3, 1, 9 * kappa, kappa};
  const auto T = stack.profile(heat);
  Real worst = 0;
  for (int k = 0; k < stack.layers; ++k) {
    const Real z = (k + 0.5 - stack.layers / 2) * stack.dx;
    if (std::abs(z) > 8 * stack.dx) continue;  // beyond, the solid's end is felt
    worst = std::max(worst, std::abs(T[k] - exact.temperature(z, time)));
  }
  EXPECT_LT(worst / (T2 - T1), 0.02);
  // Linear on either side: k dT/dx continuous.
  const int m = stack.layers / 2;
  EXPECT_NEAR((9 * T[m - 1] + T[m]) / 10, Ti, 0.01 * (T2 - T1));
}

TEST(HeatSlow, FreezingFrontFollowsNeumann) {
  // 1150 degC melt under a wall of 25 degC, one melting point; the wall a perfect cooler on the crust columns.
  Stack stack(6, 36, 0.01);
  stack.expose_top();
  HeatOptions options;
  options.curve = {1150, 350e3, 1343.15, 1343.15};
  options.conductivity = 1.5;
  options.air = {.emissivity = 0, .thompson_ramsey = false, .convection = 1e7, .air_temperature = 298.15};
  Heat heat(options, stack.dx, 2600);
  for (std::size_t i = 0; i < stack.size(); ++i) heat.born(1423.15);
  const reference::FreezingFront exact(298.15, 1343.15, 1423.15, 350e3, 1150, 1.5 / (2600 * 1150));
  Real t = 0;
  for (const Real end : {600.0, 3600.0, 7200.0}) {
    for (; t < end - 1e-6; t += 60) heat.step(60, stack.around());
    const auto solid = heat.solid_fraction();
    const Real front = std::accumulate(solid.begin(), solid.end(), 0.0) * std::pow(stack.dx, 3) / stack.area();
    EXPECT_NEAR(front / exact.front(t), 1, 0.03) << t;
  }
}

TEST(Heat, LumpRadiatesAsTheClosedForm) {
  HeatOptions options = plain();
  options.curve.heat_capacity = 1150;
  options.air = {.emissivity = 0.9, .thompson_ramsey = false, .convection = 0, .air_temperature = 0};
  const std::vector<Real> sky = {1};
  const std::vector<Vec3> x = {Vec3::Zero()};
  ColumnGrid grid;
  grid.build(x, 3);
  Neighbors nobody;
  nobody.find(grid, 3);
  for (const Real dt : {1.0, 60.0, 3600.0}) {
    Heat heat(options, 1, 2600);
    heat.born(1360);
    Real t = 0;
    for (const Real end : {3600.0, 86400.0}) {
      for (; t < end - 1e-6; t += dt) heat.step(dt, {x, nobody, KernelKind::kWendlandC2, 3, Vec2::Zero(), sky, {}, {}, {}});
      EXPECT_NEAR(heat.temperature()[0] / reference::radiative_cooling(1360, 0.9, 2600, 1150, 1, t), 1, 1e-3) << "dt " << dt << " t " << t;
    }
  }
}

TEST(Heat, GroundTakesWhatTwoHalfSpacesExchange) {
  Stack stack(6, 24, 0.05);
  std::fill_n(stack.ground.begin(), stack.per_layer(), stack.dx * stack.dx);
  HeatOptions options = plain();
  Heat heat(options, stack.dx, 2600);
  for (std::size_t i = 0; i < stack.size(); ++i) heat.born(1400);
  const Real b = std::sqrt(options.conductivity * 2600 * options.curve.heat_capacity);
  const reference::ContactOfHalfSpaces exact{.T_left = 300, .T_right = 1400, .b_left = options.ground_effusivity, .b_right = b};
  Real t = 0, taken = 0;
  for (const Real end : {1.0, 60.0, 600.0, 3600.0, 36000.0}) {
    const Real dt = end / 60;
    while (t < end - 1e-6) {
      taken += heat.step(std::min(dt, end - t), stack.around()).ground;
      t = std::min(t + dt, end);
    }
    // The integral of q ~ 1/sqrt(t) is 2 q t.
    EXPECT_NEAR(taken / (2 * exact.flux(t) * t * stack.area()), 1, 0.03) << t;
  }
}

class CrustOnHalfSpace : public testing::TestWithParam<Real> {};
TEST_P(CrustOnHalfSpace, MeetsTheOneDimensionalReferenceAtAnySpacing) {
  const Real dx = GetParam();
  const Stack made(6, std::max(4, static_cast<int>(0.8 / dx)), dx);
  Stack stack = made;
  stack.expose_top();
  const reference::CoolingHalfSpace lava;
  HeatOptions options;
  options.conductivity = lava.conductivity;
  options.air = {.emissivity = lava.emissivity, .thompson_ramsey = false, .convection = lava.convection, .air_temperature = lava.air_temperature};
  Heat heat(options, dx, lava.density);
  for (std::size_t i = 0; i < stack.size(); ++i) heat.born(lava.T0);
  const std::vector<Real> times = {60, 300, 600, 1800, 3600, 10800};
  const auto exact = cool(lava, times);
  const Real before = heat.total_enthalpy();
  Real t = 0, out = 0;
  for (std::size_t k = 0; k < times.size(); ++k) {
    while (t < times[k] - 1e-6) {
      const Real dt = std::min(std::max(1.0, 0.05 * t), times[k] - t);
      out += lost(heat.step(dt, stack.around()));
      t += dt;
    }
    EXPECT_NEAR((heat.surface_temperature()[0] - kZeroCelsius) / (exact[k].surface_temperature - kZeroCelsius), 1, 0.03) << t;  // the bar: 5 %
    EXPECT_NEAR(out / (stack.area() * exact[k].lost), 1, 0.03) << t;
    if (exact[k].crust < 0.8 * dx) {
      EXPECT_NEAR(heat.crust_thickness()[0] / exact[k].crust, 1, 0.05) << t;
    }
    EXPECT_NEAR(before - heat.total_enthalpy(), out, 1e-11 * before) << t;
    EXPECT_LE(*std::max_element(heat.temperature().begin(), heat.temperature().end()), lava.T0 + 1e-6);
  }
  // The skin is far colder than the particle as a whole, except where that is a skin itself.
  EXPECT_LT(heat.surface_temperature()[0], heat.temperature()[0] - 50);
}
INSTANTIATE_TEST_SUITE_P(Spacings, CrustOnHalfSpace, testing::Values(0.05, 0.1, 0.5));

TEST(Heat, LumpWithoutCrustLosesMoreThanTwiceTheHeatWhichIsWhatTheCrustIsFor) {
  const reference::CoolingHalfSpace lava;
  const std::vector<Real> times = {300};
  const auto exact = cool(lava, times);
  Stack stack(6, 4, 0.1);
  stack.expose_top();
  for (const bool crust : {false, true}) {
    HeatOptions options;
    options.crust = crust;
    options.conductivity = lava.conductivity;
    options.air = {.emissivity = lava.emissivity, .thompson_ramsey = false, .convection = lava.convection, .air_temperature = lava.air_temperature};
    Heat heat(options, 0.1, lava.density);
    for (std::size_t i = 0; i < stack.size(); ++i) heat.born(lava.T0);
    Real out = 0;
    for (int k = 0; k < 300; ++k) out += lost(heat.step(1, stack.around()));
    const Real ratio = out / stack.area() / exact[0].lost;
    EXPECT_TRUE(crust ? std::abs(ratio - 1) < 0.02 : ratio > 2) << ratio;
  }
}

/// A cloud in disorder: every surrounding at once.
struct Cloud {
  explicit Cloud(unsigned seed, std::size_t n = 600) : random(seed) {
    const int side = static_cast<int>(std::ceil(std::cbrt(static_cast<Real>(n))));
    for (int k = 0; k < static_cast<int>(n); ++k)  // a lattice of 0.1 m, shaken
      x.push_back(0.1 * Vec3(k % side + uniform(0, 0.6), k / side % side + uniform(0, 0.6), k / side / side + uniform(0, 0.6)));
    grid.build(x, 0.3);
    neighbors.find(grid, 0.3);
    for (std::size_t i = 0; i < n; ++i) {
      sky.push_back(i % 3 == 0 ? uniform(0, 0.03) : 0);
      ground.push_back(i % 4 == 0 ? uniform(0, 0.01) : 0);
      ground_temperature.push_back(uniform(290, 700));
      T.push_back(uniform(310, 1500));
      dissipation.push_back(uniform(0, 5e4));
    }
  }
  Real uniform(Real a, Real b) { return std::uniform_real_distribution<Real>(a, b)(random); }
  Heat make(const HeatOptions& options) const {
    Heat heat(options, 0.1, 2600);
    for (const Real t : T) heat.born(t);
    return heat;
  }
  Heat::Surroundings around(bool warm = true) const {
    return {x, neighbors, KernelKind::kWendlandC2, 0.3, Vec2::Zero(), sky, ground, ground_temperature, warm ? std::span<const Real>(dissipation) : std::span<const Real>()};
  }
  Heat::Surroundings closed() const { return {x, neighbors, KernelKind::kWendlandC2, 0.3, Vec2::Zero(), {}, {}, {}, {}}; }

  std::mt19937 random;
  std::vector<Vec3> x;
  ColumnGrid grid;
  Neighbors neighbors;
  std::vector<Real> sky, ground, ground_temperature, T, dissipation;
};

TEST(Heat, PairsKeepTheEnergyAndMakeNoNewExtremes) {
  const Cloud cloud(11);
  HeatOptions options;
  options.solid_conductivity = 3;
  Heat heat = cloud.make(options);
  const Real before = heat.total_enthalpy();
  const auto [low, high] = std::minmax_element(cloud.T.begin(), cloud.T.end());
  for (const Real dt : {100.0, 1000.0, 1e5}) {
    const HeatBudget budget = heat.step(dt, cloud.closed());
    EXPECT_GT(budget.conduction_passes, 0);
    EXPECT_NEAR(heat.total_enthalpy() / before, 1, 1e-13);
    for (const Real T : heat.temperature()) {
      EXPECT_GE(T, *low - 1e-9);
      EXPECT_LE(T, *high + 1e-9);
    }
  }
}

TEST(HeatSlow, BudgetClosesWithEverythingAtOnceAndAnyStep) {
  for (const bool crust : {false, true}) {
    Cloud cloud(12);
    HeatOptions options;
    options.crust = crust;
    Heat heat = cloud.make(options);
    Real sum = 0;
    const Real before = heat.total_enthalpy();
    for (const Real dt : {0.01, 0.1, 1.0, 7.0, 60.0, 1e3, 3e5}) {
      HeatBudget budget = heat.step(dt, cloud.around());
      sum += lost(budget);
      EXPECT_NEAR(before - heat.total_enthalpy(), sum, 1e-11 * before) << dt;
      EXPECT_GT(budget.dissipated, 0);
    }
    for (const Real T : heat.temperature()) EXPECT_TRUE(std::isfinite(T) && T > 280) << T;
  }
}

TEST(Heat, NothingCoolsBelowItsSurroundingsInAStepOfAYear) {
  for (const bool crust : {false, true}) {
    const Cloud cloud(13, 200);
    HeatOptions options;
    options.crust = crust;
    Heat heat = cloud.make(options);
    const Real coldest = 290;
    heat.step(3e7, cloud.around(false));
    for (std::size_t i = 0; i < heat.size(); ++i) {
      EXPECT_GE(heat.temperature()[i], coldest - 0.01);
      EXPECT_LE(heat.temperature()[i], 1500 + 0.01);
      EXPECT_GE(heat.surface_temperature()[i], coldest - 0.01);
    }
  }
}

TEST(Heat, SameBitsOnAnyNumberOfThreads) {
  const Cloud cloud(14, 3000);
  const auto run = [&](int threads) {
    ThreadLimit limit(threads);
    Heat heat = cloud.make({});
    Real sum = 0;
    for (int k = 0; k < 5; ++k) sum += lost(heat.step(40, cloud.around()));
    StateHash hash;
    heat.add_to(hash);
    hash.add(sum);
    return hash.hex();
  };
  EXPECT_EQ(run(1), run(4));
}

TEST(Heat, SmallStepsThatPutWorkOffAgreeWithLargeOnes) {
  Stack stack(6, 5, 0.1);
  stack.expose_top();
  std::vector<Real> face, out;
  for (const Real dt : {0.05, 2.0}) {
    HeatOptions options;
    Heat heat(options, stack.dx, 1560);
    for (std::size_t i = 0; i < stack.size(); ++i) heat.born(1423.15);
    Real sum = 0;
    int passes = 0;
    for (int k = 0; k < std::lround(300 / dt); ++k) {
      const HeatBudget budget = heat.step(dt, stack.around());
      sum += lost(budget);
      passes += budget.conduction_passes;
    }
    face.push_back(heat.surface_temperature()[0]);
    out.push_back(sum);
    EXPECT_LE(passes, 6);  // once a minute
  }
  EXPECT_NEAR(face[0] / face[1], 1, 0.005);
  EXPECT_NEAR(out[0] / out[1], 1, 0.01);
}

TEST(Heat, NeighboursAreNotAskedForBetweenExchanges) {
  Stack stack(6, 4, 0.1);
  stack.expose_top();
  Heat heat({}, stack.dx, 2600);
  for (std::size_t i = 0; i < stack.size(); ++i) heat.born(1423.15);
  const Neighbors none;
  const Heat::Surroundings blind{{}, none, KernelKind::kWendlandC2, 0, Vec2::Zero(), stack.sky, {}, {}, {}};
  int steps = 0;
  for (; !heat.conducts(1); ++steps) EXPECT_EQ(heat.step(1, blind).conduction_passes, 0);
  EXPECT_GT(steps, 30);
  EXPECT_EQ(heat.step(1, stack.around()).conduction_passes, 1);
  EXPECT_FALSE(heat.conducts(1));
}

TEST(Heat, BuriedCrustStaysForAWhileThenRelaxesIntoOneValueAndBeginsAnew) {
  Stack stack(6, 4, 0.1);
  stack.expose_top();
  Heat heat({}, stack.dx, 2600);
  for (std::size_t i = 0; i < stack.size(); ++i) heat.born(1423.15);
  for (int k = 0; k < 100; ++k) heat.step(1, stack.around());
  const Real cold = heat.surface_temperature()[0];
  EXPECT_LT(cold, 1050);
  EXPECT_EQ(heat.columns(), stack.per_layer());

  // Surface detection flickers for a second: the skin is still there.
  stack.expose_top(false);
  Real before = heat.total_enthalpy(), out = lost(heat.step(1, stack.around()));
  EXPECT_EQ(heat.columns(), stack.per_layer());
  EXPECT_EQ(heat.crust_thickness()[0], 0);
  EXPECT_EQ(heat.surface_temperature()[0], heat.temperature()[0]);
  stack.expose_top();
  out += lost(heat.step(1, stack.around()));
  EXPECT_LT(heat.surface_temperature()[0], cold + 150);

  // Overrun for good. What was pending is booked, nothing else leaves.
  stack.expose_top(false);
  for (int k = 0; k < 100; ++k) out += lost(heat.step(1, stack.around()));
  EXPECT_EQ(heat.columns(), 0u);
  EXPECT_NEAR(before - heat.total_enthalpy(), out, 1e-12 * before);
  EXPECT_TRUE(heat.profile(0).empty());

  // Laid open again: as hot outside as within.
  const Real T = heat.temperature()[0];
  stack.expose_top();
  heat.step(1e-3, stack.around());
  EXPECT_EQ(heat.columns(), stack.per_layer());
  EXPECT_GT(heat.surface_temperature()[0], T - 60);
}

TEST(Heat, AnEdgeWithTwoFacesLosesFromBoth) {
  HeatOptions options;
  const std::vector<Vec3> x = {Vec3::Zero(), Vec3(10, 0, 0), Vec3(20, 0, 0)};
  const std::vector<Real> sky = {0.005, 0.01, 0.02};  // half a face, one, two
  const Neighbors none;
  Heat heat(options, 0.1, 2600);
  for (int i = 0; i < 3; ++i) heat.born(1400);
  for (int k = 0; k < 50; ++k) heat.step(1, {x, none, KernelKind::kWendlandC2, 0.3, Vec2::Zero(), sky, {}, {}, {}});
  const auto H = heat.enthalpy();
  const Real start = options.curve.enthalpy(1400);
  EXPECT_NEAR((start - H[2]) / (start - H[1]), 2, 0.05);
  EXPECT_GT((start - H[0]) / (start - H[1]), 0.5);  // what is hidden feeds the exposed half
  EXPECT_LT((start - H[0]) / (start - H[1]), 0.8);
  EXPECT_LE(heat.crust_thickness()[2], 0.05);
}

TEST(Heat, KeepCarriesTheCrustAlong) {
  Stack stack(6, 4, 0.1);
  stack.expose_top();
  Heat heat({}, stack.dx, 2600);
  for (std::size_t i = 0; i < stack.size(); ++i) heat.born(1400 + 0.1 * static_cast<Real>(i));
  for (int k = 0; k < 20; ++k) heat.step(1, stack.around());
  std::vector<Real> face(heat.surface_temperature().begin(), heat.surface_temperature().end());
  const auto profile = heat.profile(7);
  std::vector<Index> which;
  for (std::size_t i = stack.size(); i-- > 0;)
    if (i % 3 != 0) which.push_back(static_cast<Index>(i));
  heat.keep(which);
  ASSERT_EQ(heat.size(), which.size());
  std::size_t exposed = 0;
  for (std::size_t k = 0; k < which.size(); ++k) {
    EXPECT_EQ(heat.surface_temperature()[k], face[which[k]]);
    EXPECT_EQ(heat.profile(k).empty(), which[k] >= stack.per_layer());
    exposed += which[k] < stack.per_layer();
    if (which[k] == 7) {
      ASSERT_EQ(heat.profile(k).size(), profile.size());
      for (std::size_t j = 0; j < profile.size(); ++j) EXPECT_EQ(heat.profile(k)[j].temperature, profile[j].temperature);
    }
  }
  EXPECT_EQ(heat.columns(), exposed);
}

TEST(Heat, ACheckpointGoesOnToTheSameBitsAndABrokenOneIsRefused) {
  const Cloud cloud(15);
  Heat heat = cloud.make({});
  for (int k = 0; k < 3; ++k) heat.step(20, cloud.around());
  StateWriter out;
  heat.save(out);
  Heat other({}, 0.1, 2600);
  StateReader in(out.bytes(), "here");
  other.load(in);
  EXPECT_TRUE(in.done());
  for (Heat* h : {&heat, &other}) h->step(33, cloud.around());
  StateHash a, b;
  heat.add_to(a);
  other.add_to(b);
  EXPECT_EQ(a.hex(), b.hex());

  // Fewer crusts than particles that own one.
  Heat none = cloud.make({});
  StateWriter mixed;
  mixed.text("model", "heat 1");
  mixed.array("enthalpy", std::vector<Real>(2, 1e6));
  mixed.array("contact_time", std::vector<Real>(2, 0));
  mixed.array("column_of", std::vector<Index>{0, ~Index{0}});
  mixed.array("columns", std::vector<CrustColumn>());
  mixed.array("owner", std::vector<Index>());
  mixed.value("pair_time", Real{0});
  for (const char* name : {"temperature", "surface_temperature", "crust_thickness", "solid_fraction"}) mixed.array(name, std::vector<Real>(2, 1000));
  StateReader broken(mixed.bytes(), "here");
  EXPECT_THROW(none.load(broken), InputError);
  EXPECT_EQ(none.size(), cloud.T.size());
}

TEST(Heat, OffMeansNothingIsComputed) {
  const Cloud cloud(16, 50);
  HeatOptions options;
  options.on = false;
  Heat heat = cloud.make(options);
  const HeatBudget budget = heat.step(1e4, cloud.around());
  EXPECT_EQ(lost(budget), 0);
  EXPECT_EQ(budget.conduction_passes, 0);
  EXPECT_FALSE(heat.conducts(1e9));
  for (std::size_t i = 0; i < heat.size(); ++i) EXPECT_EQ(heat.temperature()[i], cloud.T[i]);
}

}  // namespace
}  // namespace effuse::flow::sph
