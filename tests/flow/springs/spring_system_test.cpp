#include "flow/springs/spring_system.h"

#include <gtest/gtest.h>

#include <cmath>

#include "flow/springs/builders.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"

namespace effuse::flow::springs {
namespace {

constexpr Scheme kAll[] = {Scheme::kEuler, Scheme::kSymplecticEuler, Scheme::kMidpoint, Scheme::kRk4, Scheme::kImplicitEuler};

std::string name(Scheme scheme) { return std::string(kSchemeNames[static_cast<std::size_t>(scheme)]); }

/// A cube of 3^3 points, squeezed along x and spinning about z, nothing about it.
SpringBody spinning_cube(Real stiffness, Real damping) {
  SpringBody body = jello_cube(3, Vec3::Constant(-0.5), 1, 0.01, {stiffness, damping, 0});
  for (std::size_t i = 0; i < body.state.x.size(); ++i) {
    body.state.v[i] = Vec3(0, 0, 1).cross(body.state.x[i]) + Vec3(0.3, -0.2, 0.1);
    body.state.x[i].x() *= 0.9;
  }
  return body;
}

SpringState run(const SpringBody& body, Scheme scheme, Real dt, int steps, const Surroundings& around = {}) {
  SpringSystem system(body.network);
  system.surroundings = around;
  system.implicit.tolerance = 1e-12;
  SpringState y = body.state;
  StepStorage<SpringState> storage;
  for (int k = 0; k < steps; ++k) integrate_step(scheme, system, k * dt, dt, y, storage);
  return y;
}

Real largest_difference(const SpringState& a, const SpringState& b) {
  Real d = 0;
  for (std::size_t i = 0; i < a.x.size(); ++i) {
    const Real apart = (a.x[i] - b.x[i]).norm();
    if (!(apart <= d)) d = apart;  // a NaN stays
  }
  return d;
}

Vec3 momentum(const SpringNetwork& n, const SpringState& y) {
  Vec3 p = Vec3::Zero();
  for (std::size_t i = 0; i < n.size(); ++i) p += n.mass[i] * y.v[i];
  return p;
}

TEST(SpringSystem, TwoPointsFeelHookesLawAndTheDamperAlongTheSpring) {
  SpringNetwork n;
  n.mass = {2, 3};
  n.held = {0, 0};
  n.materials = {{50, 4, 0}};
  n.springs = {{0, 1, 0, 0.5}};
  const SpringState y{{Vec3(0, 0, 0), Vec3(0, 3, 4)}, {Vec3(1, 0, 0), Vec3(0, 0, 2)}};
  SpringState k;
  SpringSystem(n).rates(0, y, k);
  // l = a - b = (0, -3, -4), |l| = 5; stretched by 4.5 m; (v_a - v_b) . l/|l| = (1, 0, -2) . (0, -0.6, -0.8) = 1.6
  const Vec3 on_a = -(50 * 4.5 + 4 * 1.6) * Vec3(0, -0.6, -0.8);
  EXPECT_LT((k.v[0] - on_a / 2).norm(), 1e-12);
  EXPECT_LT((k.v[1] + on_a / 3).norm(), 1e-12);
  EXPECT_EQ(k.x[0], y.v[0]);
}

class SpringOrder : public testing::TestWithParam<std::pair<Scheme, double>> {};

TEST_P(SpringOrder, OfACubeInFreeFlight) {
  const auto [scheme, order] = GetParam();
  const SpringBody body = spinning_cube(4, 0.01);
  const Real time = 0.2;
  const SpringState exact = run(body, Scheme::kRk4, time / 4000, 4000);
  const int steps = order > 3 ? 50 : 800;
  const Real coarse = largest_difference(run(body, scheme, time / steps, steps), exact);
  const Real fine = largest_difference(run(body, scheme, time / (2 * steps), 2 * steps), exact);
  ASSERT_GT(fine, 1e-12) << "below rounding, the slope means nothing";
  EXPECT_NEAR(std::log2(coarse / fine), order, 0.1) << coarse << " -> " << fine;
}
INSTANTIATE_TEST_SUITE_P(Schemes, SpringOrder,
                         testing::Values(std::pair{Scheme::kEuler, 1.0}, std::pair{Scheme::kSymplecticEuler, 1.0}, std::pair{Scheme::kMidpoint, 2.0},
                                         std::pair{Scheme::kRk4, 4.0}, std::pair{Scheme::kImplicitEuler, 1.0}),
                         [](const auto& each) { return name(each.param.first); });

TEST(SpringSystem, EverySchemeKeepsTheMomentumOfACubeInFreeFlight) {
  const SpringBody body = spinning_cube(40, 0.02);
  const Vec3 before = momentum(body.network, body.state);
  for (const Scheme scheme : kAll) EXPECT_LT((momentum(body.network, run(body, scheme, 1e-3, 300)) - before).norm(), 1e-9 * before.norm()) << name(scheme);
}

TEST(SpringSystem, EnergyDriftsAsTheorySays) {
  // Undamped, a twentieth of the stable step. Euler gains, RK4 and implicit Euler lose, the symplectic one keeps, midpoint gains less than Euler.
  const SpringBody body = spinning_cube(40, 0);
  const Real dt = 0.05 * longest_stable_step(Scheme::kSymplecticEuler, SpringSystem(body.network).spectrum(body.state));
  const auto energy = [&](const SpringState& y) { return kinetic_energy(body.network, y) + spring_energy(body.network, y); };
  const Real before = energy(body.state);
  const auto drift = [&](Scheme scheme) { return energy(run(body, scheme, dt, 2000)) / before - 1; };
  const Real euler = drift(Scheme::kEuler), symplectic = drift(Scheme::kSymplecticEuler), midpoint = drift(Scheme::kMidpoint), rk4 = drift(Scheme::kRk4),
             implicit = drift(Scheme::kImplicitEuler);
  EXPECT_TRUE(euler > 1 || !std::isfinite(euler)) << euler;
  EXPECT_LT(std::abs(symplectic), 0.05);
  EXPECT_GT(midpoint, 0);
  EXPECT_LT(midpoint, 0.5);
  EXPECT_LT(rk4, 0);
  EXPECT_GT(rk4, -0.05);
  EXPECT_LT(implicit, -0.1);
}

TEST(SpringSystem, AnExplicitStepBlowsUpWhereTheSpectrumSays) {
  // Bisection of symplectic Euler's limit on an undamped cube, nudged from rest: 2 / omega.
  SpringBody body = jello_cube(4, Vec3::Zero(), 1, 0.01, {300, 0, 0});
  for (std::size_t i = 0; i < body.state.v.size(); ++i)
    for (int a = 0; a < 3; ++a) body.state.v[i][a] = 1e-6 * random_normal(5, static_cast<std::uint64_t>(a), i);
  const SpringSystem::Spectrum spectrum = SpringSystem(body.network).spectrum(body.state);
  const Real limit = longest_stable_step(Scheme::kSymplecticEuler, spectrum);
  EXPECT_DOUBLE_EQ(limit, 2 / spectrum.omega);
  Real low = 0.5 * limit, high = 2 * limit;
  while (high / low > 1.01) {
    const Real dt = std::sqrt(low * high);
    const SpringState y = run(body, Scheme::kSymplecticEuler, dt, 1500);
    const Real moved = largest_difference(y, body.state);
    (moved < 1e-2 ? low : high) = dt;
  }
  EXPECT_NEAR(low / limit, 1, 0.1);
}

TEST(SpringSystem, ImplicitEulerStandsAnyStiffnessAtFrameLongSteps) {
  for (const Real stiffness : {1e2, 1e7}) {
    SpringBody body = jello_cube(4, Vec3(-0.5, -0.5, 1), 1, 0.01, {stiffness, 0.1, 0});
    Surroundings around;
    around.gravity = {0, 0, -9.81};
    around.walls = {{Vec3::UnitZ(), 0}};
    around.response.stiffness = stiffness;
    around.response.damping = 0.1;
    SpringSystem system(body.network);
    system.surroundings = around;
    SpringState y = body.state;
    StepStorage<SpringState> storage;
    Real fastest = 0;
    for (int k = 0; k < 240; ++k) {
      integrate_step(Scheme::kImplicitEuler, system, 0, 1.0 / 24, y, storage);
      EXPECT_TRUE(system.implicit_report().converged) << stiffness << " step " << k;
      for (const Vec3& v : y.v) fastest = std::max(fastest, v.norm());
    }
    EXPECT_LT(fastest, 6) << "a fall from 1 m reaches 4.4 m/s";
    EXPECT_LT(kinetic_energy(body.network, y), 1e-6) << "ten seconds later it rests";
    for (const Vec3& x : y.x) EXPECT_GT(x.z(), -0.2);
  }
}

TEST(SpringSystemSlow, LargeNetworksAreSolvedIterativelyToTheSameStep) {
  // 9^3 points are solved by conjugate gradients; Newton's method ends where the direct solve's does: at the minimum.
  SpringBody body = jello_cube(9, Vec3(0, 0, 0.02), 1, 0.01, {1e4, 1, 0});
  for (Vec3& x : body.state.x) x.x() *= 0.8;
  Surroundings around;
  around.gravity = {0, 0, -9.81};
  around.walls = {{Vec3::UnitZ(), 0}};
  around.response.stiffness = 1e4;
  SpringSystem system(body.network);
  system.surroundings = around;
  system.implicit.tolerance = 1e-9;
  SpringState y = body.state;
  const Real dt = 1.0 / 24;
  system.implicit_euler(0, dt, y);
  EXPECT_TRUE(system.implicit_report().converged) << system.implicit_report().iterations;
  // At the minimum the new velocities are the old ones and dt times the rates there, dampers along the old directions.
  SpringNetwork undamped = body.network;
  undamped.materials[0].damping = 0;
  SpringBody same = body;
  same.network = undamped;
  SpringSystem plain(undamped);
  plain.surroundings = around;
  plain.implicit.tolerance = 1e-9;
  SpringState z = body.state, k;
  plain.implicit_euler(0, dt, z);
  plain.rates(0, z, k);
  Real worst = 0, fastest = 0;
  for (std::size_t i = 0; i < z.v.size(); ++i) {
    worst = std::max(worst, (z.v[i] - body.state.v[i] - dt * k.v[i]).norm());
    fastest = std::max(fastest, z.v[i].norm());
  }
  EXPECT_LT(worst, 1e-5 * fastest);
}

TEST(SpringSystem, ImplicitEulerRightsACubeTurnedInsideOut) {
  SpringBody body = jello_cube(4, Vec3::Constant(-0.5), 1, 0.01, {1e4, 1, 0});
  for (Vec3& x : body.state.x) x = -0.3 * x;
  const SpringState y = run(body, Scheme::kImplicitEuler, 1.0 / 24, 240);
  for (const Vec3& x : y.x) EXPECT_LT(x.norm(), 2);
  EXPECT_LT(spring_energy(body.network, y), spring_energy(body.network, body.state) / 10);
}

TEST(SpringSystem, PointsRestOnAPenaltyWallWhereWeightAndSpringAgree) {
  SpringNetwork n;
  n.mass = {2};
  n.held = {0};
  SpringBody body{n, {{Vec3(0, 0, 0.1)}, {Vec3::Zero()}}, {}, {}, {}};
  Surroundings around;
  around.gravity = {0, 0, -10};
  around.response.stiffness = 1000;
  around.response.damping = 30;
  around.walls = {{Vec3::UnitZ(), 0}};
  for (const Scheme scheme : {Scheme::kSymplecticEuler, Scheme::kRk4, Scheme::kImplicitEuler})
    EXPECT_NEAR(run(body, scheme, 1e-3, 5000, around).x[0].z(), -2 * 10 / 1000.0, 1e-6) << name(scheme);
  // The same as a contact with a plane.
  around.walls.clear();
  around.contacts = {{0, Vec3::Zero(), Vec3::UnitZ(), Vec3::Zero()}};
  for (const Scheme scheme : {Scheme::kSymplecticEuler, Scheme::kRk4, Scheme::kImplicitEuler})
    EXPECT_NEAR(run(body, scheme, 1e-3, 5000, around).x[0].z(), -2 * 10 / 1000.0, 1e-6) << name(scheme);
}

TEST(SpringSystem, FrictionHoldsBelowItsAngleAndLetsGoAbove) {
  SpringNetwork n;
  n.mass = {1};
  n.held = {0};
  const Real angle = 0.3;
  const Vec3 normal(std::sin(angle), 0, std::cos(angle));
  SpringBody body{n, {{-9.81 * std::cos(angle) / 1e4 * normal}, {Vec3::Zero()}}, {}, {}, {}};
  Surroundings around;
  around.gravity = {0, 0, -9.81};
  around.response.stiffness = 1e4;
  around.response.damping = 100;
  around.contacts = {{0, Vec3::Zero(), normal, Vec3::Zero()}};
  for (const Scheme scheme : {Scheme::kRk4, Scheme::kImplicitEuler}) {
    around.response.friction = 0.9 * std::tan(angle);
    const Real slides = run(body, scheme, 1e-3, 1000, around).v[0].norm();
    EXPECT_NEAR(slides, 9.81 * (std::sin(angle) - around.response.friction * std::cos(angle)), 0.15) << name(scheme);  // after 1 s; below the damper's bound it creeps
    around.response.friction = 1.1 * std::tan(angle);
    // Held by a damper of 100 N s/m: it creeps at m g sin / 100.
    EXPECT_LT(run(body, scheme, 1e-3, 1000, around).v[0].norm(), 1.01 * 9.81 * std::sin(angle) / 100) << name(scheme);
  }
}

TEST(SpringSystem, HeldPointsMoveAsTheyAreTold) {
  SpringBody body = jello_cube(2, Vec3::Zero(), 1, 0.1, {100, 1, 0});
  for (std::size_t i = 0; i < 4; ++i) {
    body.network.held[i] = 1;
    body.state.v[i] = {0, 0, 0.5};
  }
  for (const Scheme scheme : kAll) {
    const SpringState y = run(body, scheme, 1e-3, 1000);
    for (std::size_t i = 0; i < 4; ++i) EXPECT_LT((y.x[i] - body.state.x[i] - Vec3(0, 0, 0.5)).norm(), 1e-9) << name(scheme);
    EXPECT_GT(y.x[7].z(), 1.2) << name(scheme);
  }
}

TEST(SpringSystem, TheSameBitsOnOneThreadAndOnTwo) {
  const SpringBody body = spinning_cube(400, 0.1);
  for (const Scheme scheme : kAll) {
    SpringState one, two;
    {
      ThreadLimit limit(1);
      one = run(body, scheme, 1e-3, 20);
    }
    {
      ThreadLimit limit(2);
      two = run(body, scheme, 1e-3, 20);
    }
    for (std::size_t i = 0; i < one.x.size(); ++i) ASSERT_EQ(one.x[i], two.x[i]) << name(scheme);
  }
}

TEST(SpringSystem, OverstretchedSpringsTearAndTheRestStays) {
  SpringBody body = jello_cube(3, Vec3::Zero(), 1, 0.1, {100, 1, 0.5});
  const std::size_t before = body.network.springs.size();
  EXPECT_EQ(tear(body.network, body.state.x), 0u);
  for (std::size_t i = 18; i < 27; ++i) body.state.x[i].x() += 2;  // the last layer along x
  const std::size_t torn = tear(body.network, body.state.x);
  EXPECT_GT(torn, 0u);
  EXPECT_EQ(body.network.springs.size() + torn, before);
  for (const Spring& s : body.network.springs) EXPECT_EQ(s.a >= 18, s.b >= 18);
}

TEST(SpringSystem, RefusesNetworksThatDoNotHangTogether) {
  SpringBody body = jello_cube(2, Vec3::Zero(), 1, 0.1, {100, 1, 0});
  SpringNetwork n = body.network;
  n.springs[0].b = n.springs[0].a;
  EXPECT_THROW(SpringSystem{n}, InputError);
  n = body.network;
  n.mass[3] = 0;
  EXPECT_THROW(SpringSystem{n}, InputError);
  n = body.network;
  n.springs[5].b = 99;
  EXPECT_THROW(SpringSystem{n}, InputError);
}

}  // namespace
}  // namespace effuse::flow::springs
