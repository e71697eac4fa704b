#include "flow/sph/classic_lava.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"

namespace effuse::flow::sph {
namespace {

/// One solid: the half-space behind a plane.
ContactSource plane(const Vec3& point, const Vec3& normal) {
  return [=](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      const Real d = (x[i] - point).dot(normal);
      out[i] = {};
      if (d < reach) out[i] = {Vec3(x[i] - d * normal), normal, d, Vec3::Zero(), 0, 0};
    }
  };
}

std::vector<ContactSource> box(Real width, Real depth) {
  return {plane(Vec3::Zero(), Vec3::UnitZ()), plane(Vec3::Zero(), Vec3::UnitX()), plane(Vec3(width, 0, 0), -Vec3::UnitX()), plane(Vec3::Zero(), Vec3::UnitY()),
          plane(Vec3(0, depth, 0), -Vec3::UnitY())};
}

std::vector<Vec3> block(int nx, int ny, int nz, Real dx = 1, const Vec3& corner = Vec3::Zero()) {
  std::vector<Vec3> x;
  for (int k = 0; k < nz; ++k)
    for (int j = 0; j < ny; ++j)
      for (int i = 0; i < nx; ++i) x.push_back(corner + dx * Vec3(i + 0.5, j + 0.5, k + 0.5));
  return x;
}

void fill(ClassicLava& lava, const std::vector<Vec3>& x, Real T = 1400) {
  lava.add(x, std::vector<Vec3>(x.size(), Vec3::Zero()), std::vector<Real>(x.size(), T));
}

ClassicOptions quiet() {
  ClassicOptions o;
  o.gravity.setZero();
  o.air_exchange = o.ground_exchange = 0;
  o.density_diffusion = o.density_relaxation = 0;
  o.cohesion = 1;
  return o;
}

Real accelerate_pair(Real rho_factor, Real distance) {
  // Two particles whose density is set by hand, through a checkpoint: the state equation alone acts.
  ClassicLava lava(quiet(), {}, {});
  fill(lava, {Vec3::Zero(), Vec3(distance, 0, 0)});
  lava.step(1e-9);
  LavaState y = lava.state();
  const Real rho = rho_factor * lava.options().density;
  StateWriter out;
  lava.save(out);
  std::string bytes = out.bytes();
  const std::string name = "rho";
  const std::size_t at = bytes.find(name, bytes.find("v")) + name.size() + 16;
  for (int i = 0; i < 2; ++i) std::memcpy(bytes.data() + at + 8 * i, &rho, 8);
  StateReader in(bytes, "memory");
  lava.load(in);
  const LavaState& k = lava.rates();
  EXPECT_LT((k.v[0] + k.v[1]).norm(), 1e-12) << "momentum";
  return k.v[1].x();
}

TEST(ClassicLava, TwoParticlesAttractAndRepelAsTheStateEquationSays) {
  const ClassicOptions o = quiet();
  const Real m = o.density;  // dx = 1
  const SpikyKernel kernel(2);
  for (const Real factor : {1.02, 0.97}) {
    const Real rho = factor * o.density, P = o.stiffness * (rho - o.density);
    const Real expected = -m * 2 * P / (rho * rho) * kernel.dW(0.9);
    EXPECT_NEAR(accelerate_pair(factor, 0.9), expected, 1e-9 * std::abs(expected)) << factor;
    EXPECT_EQ(expected > 0, factor > 1) << "denser than rest repels";
  }
  EXPECT_EQ(accelerate_pair(1.05, 2.01), 0) << "beyond the support";
}

TEST(ClassicLava, HydrostaticColumnAtRestStaysAtRest) {
  // 6 m x 6 m x 10 m in a box, 10 particles deep. Once settled into its own weight (the state equation
  // gives by rho g H / k, here 1 %) it rests: rms speed below 1 % of sqrt(g H), every particle below 3 %,
  // level steady, pressure as deep as the lava. The rest of the motion is the zero-order error of sums
  // over 26 neighbours; it is the price of the paper's small support.
  ClassicOptions o;
  const Real H = 10, wave = std::sqrt(kGravity * H);
  o.stiffness = 100 * kGravity * H;
  o.air_exchange = o.ground_exchange = 0;
  o.viscosity.hot_nu = 4.999;
  o.viscosity.cold_nu = 5;
  ClassicLava lava(o, {}, box(6, 6));
  fill(lava, block(6, 6, 10));
  const auto level = [&] {
    Real sum = 0;
    for (const Vec3& x : lava.state().x) sum += x.z();
    return sum / static_cast<Real>(lava.size());
  };
  while (lava.time() < 6) lava.step(1);
  const Real settled = level();
  Real fastest = 0, rms = 0;
  while (lava.time() < 10) {
    fastest = std::max(fastest, lava.step(1).max_speed);
    Real sum = 0;
    for (const Vec3& v : lava.state().v) sum += v.squaredNorm();
    rms = std::max(rms, std::sqrt(sum / static_cast<Real>(lava.size())));
  }
  EXPECT_LT(rms, 0.01 * wave);
  EXPECT_LT(fastest, 0.03 * wave);
  EXPECT_NEAR(level(), settled, 0.1) << "a tenth of a spacing in 4 s";
  EXPECT_NEAR(settled, H / 2, 0.3);

  Real P = 0, z = 0, top = 0;
  int count = 0;
  for (std::size_t i = 0; i < lava.size(); ++i) {
    const Vec3& x = lava.state().x[i];
    top = std::max(top, x.z());
    if (x.z() > 1.5 || (x.head<2>() - Vec2(3, 3)).cwiseAbs().maxCoeff() > 2) continue;
    P += o.stiffness * (lava.state().rho[i] - o.density);
    z += x.z();
    ++count;
  }
  ASSERT_GT(count, 10);
  const Real expected = o.density * kGravity * (top + 0.5 - z / count);
  EXPECT_NEAR(P / count, expected, 0.1 * expected);
}

TEST(ClassicLava, HeatFlowsFromHotToColdAndIsConservedInside) {
  ClassicOptions o = quiet();
  o.diffusivity = 1e-2;
  o.stiffness = 0.01;
  o.viscosity.max = 1e-3;
  o.max_step = 1;
  ClassicLava lava(o, {}, {});
  const std::vector<Vec3> x = block(12, 5, 5);
  std::vector<Real> T(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) T[i] = x[i].x() < 6 ? 1400 : 1000;
  lava.add(x, std::vector<Vec3>(x.size(), Vec3::Zero()), T);
  const auto heat = [&] {
    Real sum = 0;
    for (const Real t : lava.state().T) sum += t;
    return sum;
  };
  const Real before = heat();
  const LavaState& k = lava.rates();
  for (std::size_t i = 0; i < lava.size(); ++i) {
    const Real x_i = lava.state().x[i].x();
    if (x_i > 5 && x_i < 6) {
      EXPECT_LT(k.T[i], 0);
    }
    if (x_i > 6 && x_i < 7) {
      EXPECT_GT(k.T[i], 0);
    }
    if (x_i < 3) {
      EXPECT_EQ(k.T[i], 0);
    }
  }
  while (lava.time() < 20) lava.step(1);
  EXPECT_NEAR(heat() / before, 1, 1e-13);
  EXPECT_LT(*std::max_element(lava.state().T.begin(), lava.state().T.end()), 1400.0 + 1e-9);
}

TEST(ClassicLava, ConductsAsTheErrorFunctionOfTheHeatEquation) {
  // T = Tm + dT erf(x / (2 sqrt(kappa t))): a step between two half-spaces, within 4 % of the step.
  ClassicOptions o = quiet();
  o.diffusivity = 0.02;
  o.stiffness = 0.01;  // nothing moves: the step may be long
  o.viscosity.max = 1e-3;
  o.max_step = 1;
  ClassicLava lava(o, {}, {});
  const std::vector<Vec3> x = block(30, 7, 7);
  std::vector<Real> T(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) T[i] = x[i].x() < 15 ? 1400 : 1200;
  lava.add(x, std::vector<Vec3>(x.size(), Vec3::Zero()), T);
  while (lava.time() < 200) lava.step(1);
  Real worst = 0;
  for (std::size_t i = 0; i < lava.size(); ++i) {
    const Vec3& p = lava.state().x[i];
    if ((p - Vec3(p.x(), 3.5, 3.5)).norm() > 1.2) continue;  // the core: full neighbourhoods
    const Real exact = 1300 - 100 * std::erf((p.x() - 15) / (2 * std::sqrt(o.diffusivity * lava.time())));
    worst = std::max(worst, std::abs(lava.state().T[i] - exact));
  }
  EXPECT_LT(worst, 0.04 * 200);
}

TEST(ClassicLava, SurfaceExchangeIsNewtonsLawPerParticleFace) {
  // One free particle: dT/dt = -h dx^2 (T - T_air) / (m c) at rest density.
  ClassicOptions o = quiet();
  o.air_exchange = 5e4;
  ClassicLava lava(o, {}, {});
  fill(lava, {Vec3::Zero()}, 1400);
  const Real expected = -o.air_exchange * (1400 - o.air_temperature) / (o.density * o.heat_capacity);
  EXPECT_NEAR(lava.rates().T[0], expected, 1e-9 * std::abs(expected));
}

TEST(ClassicLava, InnerParticlesExchangeNothingWithTheAir) {
  ClassicOptions o = quiet();
  o.air_exchange = 5e4;
  ClassicLava lava(o, {}, {});
  fill(lava, block(7, 7, 7));
  const LavaState& k = lava.rates();
  std::size_t inner = 0;
  for (std::size_t i = 0; i < lava.size(); ++i) {
    const Vec3 d = (lava.state().x[i] - Vec3(3.5, 3.5, 3.5)).cwiseAbs();
    if (d.maxCoeff() < 2.5) {
      EXPECT_EQ(k.T[i], 0);
      ++inner;
    } else if (d.maxCoeff() > 2.9) {
      EXPECT_LT(k.T[i], 0);
    }
  }
  EXPECT_EQ(inner, 125u);
}

TEST(ClassicLava, MeanVelocityViscosityIsTheLaplacianInPhysicalUnits) {
  // v_x = sin(z) inside a block: dv_x/dt = -nu sin(z) within the sum's fourth-order and lattice error.
  ClassicOptions o = quiet();
  o.viscosity.hot_nu = o.viscosity.cold_nu = 2;
  o.viscosity.hot_nu = 1.999;
  o.spacing = 0.25;
  ClassicLava lava(o, {}, {});
  const std::vector<Vec3> x = block(13, 13, 25, 0.25, Vec3(-1.625, -1.625, -3.125));
  std::vector<Vec3> v;
  for (const Vec3& p : x) v.push_back(Vec3(std::sin(p.z()), 0, 0));
  lava.add(x, v, std::vector<Real>(x.size(), 1200));
  const LavaState& k = lava.rates();
  const Real nu = o.viscosity.at(1200);
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Vec3& p = lava.state().x[i];
    if (p.head<2>().norm() > 0.3 || std::abs(p.z()) > 2 || std::abs(p.z()) < 0.5) continue;
    EXPECT_NEAR(k.v[i].x() / (-nu * std::sin(p.z())), 1, 0.06) << p.transpose();
  }
}

TEST(ClassicLava, PairForcesConserveMomentum) {
  ClassicLava lava(quiet(), {}, {});
  std::vector<Vec3> x = block(6, 6, 6), v;
  for (std::size_t i = 0; i < x.size(); ++i) {
    x[i] += 0.3 * Vec3(random_uniform(1, 0, i), random_uniform(1, 1, i), random_uniform(1, 2, i));
    v.push_back(Vec3(random_normal(1, 3, i), random_normal(1, 4, i), random_normal(1, 5, i)));
  }
  lava.add(x, v, std::vector<Real>(x.size(), 1300));
  Vec3 before = Vec3::Zero(), after = Vec3::Zero();
  for (const Vec3& a : v) before += a;
  for (int i = 0; i < 50; ++i) lava.step(1);
  for (const Vec3& a : lava.state().v) after += a;
  EXPECT_LT((after - before).norm(), 1e-10 * static_cast<Real>(x.size()));
}

TEST(ClassicLava, ViscosityLawMeetsItsTwoPoints) {
  const ExponentialViscosity law{0.5, 1473, 40, 1173, 1e9};
  EXPECT_NEAR(law.at(1473), 0.5, 1e-12);
  EXPECT_NEAR(law.at(1173), 40, 1e-10);
  EXPECT_NEAR(law.b() * std::exp(-law.a() * 1300), law.at(1300), 1e-9);
  EXPECT_EQ((ExponentialViscosity{0.5, 1473, 40, 1173, 15}.at(1000)), 15);
}

TEST(Vent, LetsOutItsRateToWithinOneParticleASite) {
  ClassicOptions o;
  o.max_step = 0.05;
  Vent vent;
  vent.from = Vec3(0, 0, 0);
  vent.to = Vec3(6, 0, 0);
  vent.width = 2;
  vent.rate = 9;
  vent.temperature = 1450;
  vent.stop = 4;
  vent.ramp = 1;
  EXPECT_NEAR(vent.volume(100), 9 * 3, 1e-12);
  EXPECT_NEAR(vent.volume(1), 4.5, 1e-12);
  EXPECT_NEAR(vent.volume(2), 13.5, 1e-12);
  ClassicLava lava(o, {vent}, {plane(Vec3::Zero(), Vec3::UnitZ())});
  while (lava.time() < 5) {
    lava.step(0.1);
    EXPECT_NEAR(lava.volume(), vent.volume(lava.time()), 12.0 + 1e-9);
    for (const Vec3& x : lava.state().x) ASSERT_GE(x.z(), 0);
  }
  EXPECT_NEAR(lava.volume(), 27, 7);
  EXPECT_EQ(lava.mass_emitted(), lava.particle_mass() * static_cast<Real>(lava.size()));
}

TEST(ClassicLava, HasTheSameStateOnOneTwoAndFourThreads) {
  const auto hash = [](int threads) {
    const ThreadLimit limit(threads);
    ClassicOptions o;
    Vent vent;
    vent.width = 6;
    vent.rate = 60;
    vent.temperature = 1450;
    ClassicLava lava(o, {vent}, {plane(Vec3::Zero(), Vec3(0.3, 0, 1).normalized())});
    fill(lava, block(12, 12, 12, 1, Vec3(8, 0, 3)));
    for (int i = 0; i < 60; ++i) lava.step(1);
    StateHash h;
    lava.add_to(h);
    return h.hex();
  };
  const std::string one = hash(1);
  EXPECT_EQ(hash(2), one);
  EXPECT_EQ(hash(4), one);
}

TEST(ClassicLava, GoesOnFromACheckpointBitForBit) {
  ClassicOptions o;
  Vent vent;
  vent.width = 6;
  vent.rate = 60;
  vent.temperature = 1450;
  const auto fresh = [&] { return ClassicLava(o, {vent}, {plane(Vec3::Zero(), Vec3(0.3, 0, 1).normalized())}); };
  ClassicLava whole = fresh();
  for (int i = 0; i < 101; ++i) whole.step(1);
  StateWriter out;
  whole.save(out);
  for (int i = 0; i < 50; ++i) whole.step(1);
  ClassicLava resumed = fresh();
  StateReader in(out.bytes(), "memory");
  resumed.load(in);
  EXPECT_TRUE(in.done());
  for (int i = 0; i < 50; ++i) resumed.step(1);
  StateHash a, b;
  whole.add_to(a);
  resumed.add_to(b);
  EXPECT_EQ(a.hex(), b.hex());

  StateReader cut(std::string_view(out.bytes()).substr(0, out.bytes().size() / 2), "memory");
  ClassicLava other = fresh();
  other.step(1);
  StateHash before, after;
  other.add_to(before);
  EXPECT_THROW(other.load(cut), InputError);
  other.add_to(after);
  EXPECT_EQ(before.hex(), after.hex()) << "untouched";
}

TEST(ClassicLava, RetriesASmallerStepAndGivesUpWithTheStateAsItWas) {
  // A step far beyond stability: two particles pushed into each other at 50 spacings a second.
  ClassicOptions o = quiet();
  o.courant = 1e6;
  o.max_step = 10;
  ClassicLava lava(o, {}, {});
  lava.add(std::vector<Vec3>{Vec3(0, 0, 0), Vec3(3, 0, 0)}, std::vector<Vec3>{Vec3(50, 0, 0), Vec3(-50, 0, 0)}, std::vector<Real>{1400, 1400});
  const StepReport report = lava.step(10);
  EXPECT_GT(report.retries, 0);
  EXPECT_LT(report.dt, 0.011) << "half a spacing at 50 spacings a second";
  // And one that no halving saves: a speed that leaves the half spacing even in dt_max / 256.
  ClassicLava wild(o, {}, {});
  wild.add(std::vector<Vec3>{Vec3(0, 0, 0)}, std::vector<Vec3>{Vec3(1e6, 0, 0)}, std::vector<Real>{1400});
  EXPECT_THROW(wild.step(10), UnstableError);
  EXPECT_EQ(wild.state().x[0], Vec3(0, 0, 0));
  EXPECT_EQ(wild.time(), 0);
}

TEST(ClassicLava, GivesUpAStageThatIsNotFitToAskForRatesAndTriesASmallerStep) {
  // Forces that no step size suits: the stages of the finer schemes would look for neighbours at the ends of the
  // world, or nowhere at all.
  for (const Scheme scheme : {Scheme::kSymplecticEuler, Scheme::kMidpoint, Scheme::kRk4}) {
    ClassicOptions o = quiet();
    o.scheme = scheme;
    o.gravity = Vec3(0, 0, -1e308);
    ClassicLava lava(o, {}, {});
    fill(lava, {Vec3::Zero(), Vec3(0.5, 0, 0)});
    EXPECT_THROW(lava.step(1), UnstableError) << kSchemeNames[static_cast<int>(scheme)];
    EXPECT_EQ(lava.time(), 0);
    EXPECT_EQ(lava.state().x[1], Vec3(0.5, 0, 0));
  }
}

TEST(ClassicLava, EndsRatherThanStandStillWhenTheStepShrinksToNothing) {
  ClassicLava lava(quiet(), {}, {});
  lava.add(std::vector<Vec3>{Vec3::Zero()}, std::vector<Vec3>{Vec3(1e12, 0, 0)}, std::vector<Real>{1400});
  EXPECT_THROW(lava.step(1), UnstableError);
}

TEST(ClassicLava, TakesOutWhatFallsOverTheEdgeOfTheGroundAndCountsIt) {
  // A table of 8 m, tilted, that ends at x = 8; lava slides over its edge.
  const auto inside = [](const Vec3& p) { return p.x() < 8; };
  const ContactSource slope = plane(Vec3::Zero(), Vec3(0.5, 0, 1).normalized());
  const ContactSource table = [&](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) {
    slope(x, reach, out);
    for (std::size_t i = 0; i < x.size(); ++i)
      if (!inside(x[i])) out[i] = geometry::Contact{};
  };
  ClassicOptions o;
  o.viscosity = {0.1, 1473.15, 0.2, 1173.15, 0.2};
  ClassicLava lava(o, {}, {table}, inside);
  fill(lava, block(4, 4, 3, 1, Vec3(3, 0, -1)));
  std::size_t left = 0;
  Real lowest = 0;
  while (lava.time() < 12) {
    left += lava.step(1).left;
    for (const Vec3& x : lava.state().x) lowest = std::min(lowest, x.z());
  }
  EXPECT_GT(left, 20u);
  EXPECT_EQ(lava.mass_left(), static_cast<Real>(left) * lava.particle_mass());
  EXPECT_EQ(lava.mass_emitted(), lava.mass_left() + static_cast<Real>(lava.size()) * lava.particle_mass());
  EXPECT_GT(lowest, -20) << "nothing falls for ever";
}

TEST(ClassicLava, HeatNeitherOvershootsTheAirNorTheNeighboursHoweverFastItFlows) {
  ClassicOptions o = quiet();
  o.diffusivity = 50;
  o.air_exchange = 1e8;
  o.max_step = 10;
  ClassicLava lava(o, {}, {});
  const std::vector<Vec3> x = block(5, 4, 4);
  std::vector<Real> T(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) T[i] = x[i].x() < 2 ? 1400 : 1000;
  lava.add(x, std::vector<Vec3>(x.size(), Vec3::Zero()), T);
  for (int i = 0; i < 100; ++i) {
    const StepReport report = lava.step(10);
    ASSERT_LE(report.max_temperature, 1400 + 1e-9);
    ASSERT_GE(report.min_temperature, o.air_temperature - 1e-9);
  }
}

TEST(ClassicLava, AParticleOnTheSecondOfTwoSolidsIsCoveredByIt) {
  // The underside of a block exchanges nothing with the air where the ground is, whichever source tells of it.
  const auto cooling = [](std::vector<ContactSource> ground) {
    ClassicOptions o = quiet();
    o.air_exchange = 5e4;
    ClassicLava lava(o, {}, std::move(ground));
    fill(lava, block(7, 7, 4));
    Real sum = 0;
    for (const Real rate : lava.rates().T) sum += rate;
    return sum;
  };
  const ContactSource floor = plane(Vec3::Zero(), Vec3::UnitZ()), wall = plane(Vec3(-100, 0, 0), Vec3::UnitX());
  EXPECT_LT(cooling({}), cooling({floor})) << "without a floor it cools from below, too";
  EXPECT_EQ(cooling({wall, floor}), cooling({floor}));
}

TEST(ClassicLava, HashSeesAllThatACheckpointHolds) {
  // Two vents' worth of state that differs only in which site carries a particle: equal now, not later.
  ClassicOptions o;
  Vent vent;
  vent.width = 6;
  vent.rate = 60;
  vent.temperature = 1450;
  ClassicLava lava(o, {vent}, {plane(Vec3::Zero(), Vec3::UnitZ())});
  for (int i = 0; i < 80; ++i) lava.step(1);
  ASSERT_GT(lava.size(), 0u);
  StateWriter out;
  lava.save(out);
  StateHash before;
  lava.add_to(before);
  for (const std::string name : {"site", "number", "outward", "ground_bound", "next_id", "emitted", "left", "rest_born", "max_acceleration"}) {
    std::string bytes = out.bytes();
    // An entry: the name's length, the name, the element's size, the count, the elements.
    const std::uint64_t length = name.size();
    const std::string head = std::string(reinterpret_cast<const char*>(&length), 8) + name;
    const std::size_t at = bytes.find(head);
    ASSERT_NE(at, std::string::npos) << name;
    bytes[at + head.size() + 16] ^= 1;
    ClassicLava other(o, {vent}, {plane(Vec3::Zero(), Vec3::UnitZ())});
    StateReader in(bytes, "memory");
    try {
      other.load(in);
    } catch (const InputError&) {
      continue;  // refused outright
    }
    StateHash after;
    other.add_to(after);
    EXPECT_NE(after.hex(), before.hex()) << name;
  }
}

TEST(ClassicLava, ASteepViscosityLawFarFromItsPointsIsStillANumber) {
  const ExponentialViscosity steep{0.5, 1000, 4, 999.99, 15};
  EXPECT_GT(steep.at(1473), 0);
  ClassicOptions o = quiet();
  o.viscosity = steep;
  ClassicLava lava(o, {}, {});
  fill(lava, {Vec3::Zero(), Vec3(0.9, 0, 0)}, 1473);
  EXPECT_TRUE(lava.rates().v[0].allFinite());
}

TEST(ClassicLava, SchemesConvergeToTheSameDroppingBlock) {
  // A block let fall onto a plane for a moment, with each scheme: half a second later they agree.
  std::vector<Real> heights;
  for (const Scheme scheme : {Scheme::kEuler, Scheme::kSymplecticEuler, Scheme::kMidpoint, Scheme::kRk4}) {
    ClassicOptions o;
    o.scheme = scheme;
    o.max_step = 0.002;
    ClassicLava lava(o, {}, {plane(Vec3::Zero(), Vec3::UnitZ())});
    fill(lava, block(5, 5, 5));
    while (lava.time() < 0.5 - 1e-9) lava.step(0.5 - lava.time());
    Real z = 0;
    for (const Vec3& x : lava.state().x) z += x.z() / static_cast<Real>(lava.size());
    heights.push_back(z);
  }
  for (const Real z : heights) EXPECT_NEAR(z, heights.back(), 0.005);
  EXPECT_LT(heights.back(), 2.49) << "it fell";
}

TEST(Surface, FindsTheSkinOfABlockASheetAndABall) {
  const auto flags = [](const std::vector<Vec3>& x) {
    ColumnGrid grid;
    Neighbors neighbors;
    grid.build(x, 2);
    neighbors.find(grid, 2);
    std::vector<std::uint8_t> surface(x.size());
    std::vector<Vec3> outward(x.size());
    find_surface(x, neighbors, 2, {}, surface, outward);
    return std::pair(surface, outward);
  };
  const std::vector<Vec3> cube = block(9, 9, 9);
  const auto [on_cube, out_of_cube] = flags(cube);
  for (std::size_t i = 0; i < cube.size(); ++i) {
    const Real depth = 4.5 - (cube[i] - Vec3(4.5, 4.5, 4.5)).cwiseAbs().maxCoeff();
    EXPECT_EQ(on_cube[i] == 1, depth < 1) << cube[i].transpose();
    if (depth < 1) {
      EXPECT_GT(out_of_cube[i].dot(cube[i] - Vec3(4.5, 4.5, 4.5)), 0);
    }
  }
  const auto [on_sheet, out_of_sheet] = flags(block(9, 9, 1));
  for (const std::uint8_t s : on_sheet) EXPECT_EQ(s, 1);

  std::vector<Vec3> ball;
  for (std::size_t i = 0; i < 20000; ++i) {
    // A jittered lattice: no particle is where a perfect lattice would have it.
    const Vec3 p = Vec3(static_cast<Real>(i % 27) - 13, static_cast<Real>(i / 27 % 27) - 13, static_cast<Real>(i / 729) - 13) +
                   0.3 * (Vec3(random_uniform(3, 0, i), random_uniform(3, 1, i), random_uniform(3, 2, i)) - Vec3(0.5, 0.5, 0.5));
    if (p.norm() < 10) ball.push_back(p);
  }
  const auto [on_ball, out_of_ball] = flags(ball);
  std::size_t missed = 0, outer = 0, false_alarms = 0, inner = 0;
  for (std::size_t i = 0; i < ball.size(); ++i) {
    const Real r = ball[i].norm();
    if (r > 9.4) outer += 1, missed += !on_ball[i];
    if (r < 8) inner += 1, false_alarms += on_ball[i];
    if (r > 9.4 && on_ball[i]) {
      EXPECT_GT(out_of_ball[i].dot(ball[i]) / r, 0.7);
    }
  }
  EXPECT_LT(static_cast<Real>(missed), 0.02 * static_cast<Real>(outer));
  EXPECT_LT(static_cast<Real>(false_alarms), 0.01 * static_cast<Real>(inner));
}

}  // namespace
}  // namespace effuse::flow::sph
