#include "flow/sph/modern_lava.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>

#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "tests/flow/sph/sample_system.h"

namespace effuse::flow::sph {
namespace {

/// One solid: the half-space behind a plane.
ContactSource plane(const Vec3& point, const Vec3& normal, const Vec3& velocity = Vec3::Zero(), Index surface = 0) {
  return [=](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      const Real d = (x[i] - point).dot(normal);
      out[i] = {};
      if (d < reach) out[i] = {Vec3(x[i] - d * normal), normal, d, velocity, 0, surface};
    }
  };
}
ContactSource floor_at(Real z = 0) { return plane(Vec3(0, 0, z), Vec3::UnitZ()); }

/// Isothermal, Newtonian.
ModernOptions isothermal(Real spacing, Real mu) {
  ModernOptions o;
  o.spacing = spacing;
  o.rheology = Rheology::newtonian(mu);
  o.heat.on = false;
  o.rest_period = 0;
  return o;
}

void fill(ModernLava& lava, const std::vector<Vec3>& x, const Vec3& v = Vec3::Zero(), Real T = 1400) {
  lava.add(x, std::vector<Vec3>(x.size(), v), std::vector<Real>(x.size(), T));
}
void fill(ModernLava& lava, std::vector<Vec3> x, const Vec3& corner, const Vec3& v, Real T) {
  for (Vec3& p : x) p += corner;
  fill(lava, x, v, T);
}

std::uint64_t hash_of(const ModernLava& lava) {
  StateHash hash;
  lava.add_to(hash);
  return hash.value();
}
std::string saved(const ModernLava& lava) {
  StateWriter out;
  lava.save(out);
  return out.bytes();
}
Vec3 mean(std::span<const Vec3> values) {
  Vec3 sum = Vec3::Zero();
  for (const Vec3& v : values) sum += v;
  return sum / static_cast<Real>(values.size());
}
Real fastest(const ModernLava& lava) {
  Real most = 0;
  for (const Vec3& v : lava.velocities()) most = std::max(most, v.norm());
  return most;
}
bool finite(const ModernLava& lava) {
  for (std::size_t i = 0; i < lava.size(); ++i)
    if (!lava.positions()[i].allFinite() || !lava.velocities()[i].allFinite() || !std::isfinite(lava.pressures()[i]) || !std::isfinite(lava.temperatures()[i])) return false;
  return true;
}
std::size_t sleepers(const ModernLava& lava) { return static_cast<std::size_t>(std::count(lava.asleep().begin(), lava.asleep().end(), 1)); }

// ---- rest ----

/// A layer 10 particles deep on a floor, endless in x and y.
void expect_rest(Real jitter, Real settle, Real until) {
  const Real dx = 0.5, H = 10 * dx, wave = std::sqrt(kGravity * H);
  ModernOptions o = isothermal(dx, 2600);
  o.period = Vec2(6 * dx, 6 * dx);
  o.max_step = 0.05;
  // What the solves leave moves: at rest nothing else does.
  o.divergence_tolerance = o.viscosity_tolerance = 1e-6;
  ModernLava lava(o, {}, {floor_at()});
  fill(lava, lattice_block(6, 6, 10, dx, jitter));
  while (lava.time() < settle) lava.step(0.05);
  const Real level = mean(lava.positions()).z();
  Real speed = 0;
  std::vector<Real> p(10, 0.0);  // mean by layer over time
  int samples = 0;
  while (lava.time() < until) {
    speed = std::max(speed, lava.step(0.05).max_speed);
    ++samples;
  }
  EXPECT_LT(speed, 1e-3 * wave);
  EXPECT_NEAR(mean(lava.positions()).z(), level, 0.1 * dx);
  EXPECT_NEAR(level, H / 2, 0.25 * dx) << "settled";
  // Pressure against depth: straight line through the particles, half a layer from the bottom and the top left out.
  Real sum_d = 0, sum_p = 0, worst = 0;
  int n = 0;
  const Real top = 2 * mean(lava.positions()).z();
  for (std::size_t i = 0; i < lava.size(); ++i) {
    const Real depth = top - lava.positions()[i].z();
    sum_d += depth;
    sum_p += lava.pressures()[i] / (o.density * kGravity);
    worst = std::max(worst, std::abs(lava.pressures()[i] / (o.density * kGravity) - depth));
    ++n;
  }
  EXPECT_NEAR(sum_p / n, sum_d / n, 0.02 * H) << "the mean pressure is that of the mean depth";
  EXPECT_LT(worst, 1.2 * dx) << "no particle's is off by much more than a layer";
}

TEST(ModernLavaSlow, ALayerOnALatticeRestsUnderItsPressure) { expect_rest(0, 0.5, 3); }
TEST(ModernLavaSlow, ALayerOnALatticeRestsForTenSecondsUnderItsPressure) { expect_rest(0, 2, 12); }

// ---- films ----

struct Film {
  Real flux = 0, exact = 0, surface = 0, surface_exact = 0;
};
/// A film `layers` deep on a slope, endless, from rest to steady, with steps of at most `step` H^2/nu.
Film run_film(int layers, Real slope_deg, Real step, Real supports = 3, Real jitter = 0, Real until = 3) {
  const Real dx = 0.2, H = layers * dx, nu = 4, theta = slope_deg * kPi / 180, g = kGravity;
  ModernOptions o = isothermal(dx, 2600 * nu);
  o.support = supports;
  o.gravity = g * Vec3(std::sin(theta), 0, -std::cos(theta));
  o.period = Vec2(6 * dx, 6 * dx);
  const Real time = H * H / nu;
  o.max_step = step * time;
  o.courant = 1e3;  // steps as asked
  ModernLava lava(o, {}, {floor_at()});
  fill(lava, lattice_block(6, 6, layers, dx, jitter));
  while (lava.time() < until * time) lava.step(o.max_step);
  Film film;
  film.exact = g * std::sin(theta) * H * H * H / (3 * nu);
  film.surface_exact = g * std::sin(theta) * H * H / (2 * nu);
  film.flux = mean(lava.velocities()).x() * H;
  Real top = 0;
  for (std::size_t i = 0; i < lava.size(); ++i)
    if (lava.positions()[i].z() > top) {
      top = lava.positions()[i].z();
      film.surface = lava.velocities()[i].x();
    }
  return film;
}

class FilmLayers : public testing::TestWithParam<int> {};
TEST_P(FilmLayers, HaveNusseltsFlux) {
  const Film film = run_film(GetParam(), 10, 0.1);
  EXPECT_NEAR(film.flux, film.exact, 0.03 * film.exact);
}
INSTANTIATE_TEST_SUITE_P(Layers, FilmLayers, testing::Values(1, 2, 3, 4, 5, 6));

TEST(ModernLava, AStepTenTimesLongerChangesASteadyFilmByLessThanTwoPercent) {
  for (const Real slope : {5.0, 25.0}) {
    const Film small = run_film(5, slope, 0.05), large = run_film(5, slope, 0.5);
    EXPECT_NEAR(large.flux, small.flux, 0.02 * small.flux) << slope << " degrees";
    EXPECT_NEAR(large.surface, small.surface, 0.02 * small.surface) << slope << " degrees";
  }
}

TEST(ModernLavaSlow, FilmsTenDeepHaveNusseltsFluxAndSurfaceSpeedFromDisorderToo) {
  for (const Real slope : {5.0, 25.0})
    for (const Real jitter : {0.0, 0.1}) {
      const Film film = run_film(10, slope, 0.05, 3, jitter, 4);
      EXPECT_NEAR(film.flux, film.exact, 0.03 * film.exact) << slope << " degrees, jitter " << jitter;
      EXPECT_NEAR(film.surface, film.surface_exact, 0.03 * film.surface_exact) << slope << " degrees, jitter " << jitter;
    }
}

TEST(ModernLavaSlow, ThinFilmsHoldOnToTheGroundByTheirStrengthOnly) {
  // Bingham films on 25 degrees, 1.5 m deep: flux over that of the exact film, by layers and by strength over wall stress.
  struct BinghamFilm {
    int layers;
    Real r, within;
  };
  for (const BinghamFilm& film : {BinghamFilm{3, 0.4, 0.08}, BinghamFilm{4, 0.4, 0.08}, BinghamFilm{6, 0.5, 0.05}, BinghamFilm{6, 0.7, 0.1}, BinghamFilm{10, 0.5, 0.05}}) {
    const Real slope = 25 * kPi / 180, depth = 1.5, dx = depth / film.layers, mu = 4000;
    ModernOptions o = isothermal(dx, mu);
    o.density = 1069;
    o.gravity = kGravity * Vec3(std::sin(slope), 0, -std::cos(slope));
    const Real wall_stress = o.density * kGravity * std::sin(slope) * depth;
    o.rheology.yield.kind = YieldKind::kConstant;
    o.rheology.yield.tau = film.r * wall_stress;
    o.rheology.regularisation = 1000;
    o.rheology.mu_max = 1e10;
    o.max_step = 1;
    o.period = Vec2::Constant(7 * dx);
    ModernLava lava(o, {}, {floor_at()});
    fill(lava, lattice_block(7, 7, film.layers, dx));
    while (lava.time() < 60) lava.step(60 - lava.time());
    // Buckingham: plug of r of the depth.
    const Real exact = wall_stress * depth * depth / (3 * mu) * (1 - 1.5 * film.r + 0.5 * std::pow(film.r, 3));
    const Real flux = mean(lava.velocities()).x() * depth;
    EXPECT_NEAR(flux / exact, 1, film.within) << film.layers << " layers, r = " << film.r;
  }
}

// ---- spreading ----

Real dam_break_front(Real dx, Real until) {
  // BM1: 1 m deep, 6.6 m long, nu 3.704 m^2/s, a wall behind.
  ModernOptions o = isothermal(dx, 1e4);
  o.density = 2700;
  o.period = Vec2(0, 6 * dx);
  ModernLava lava(o, {}, {floor_at(), plane(Vec3::Zero(), Vec3::UnitX(), Vec3::Zero(), 1)});
  fill(lava, lattice_block(static_cast<int>(std::lround(6.6 / dx)), 6, static_cast<int>(std::lround(1 / dx)), dx));
  while (lava.time() < until) lava.step(until - lava.time());
  Real front = 0;
  for (const Vec3& x : lava.positions()) front = std::max(front, x.x());
  return front + dx / 2;
}
TEST(ModernLava, ADamBreakReachesItsFrontAfterTenSeconds) {
  EXPECT_NEAR(dam_break_front(0.2, 10), 8.07, 0.04 * 8.07) << "five particles deep; 3 % at ten";
}
TEST(ModernLavaSlow, ADamBreakReachesItsFrontAfterFiftySeconds) { EXPECT_NEAR(dam_break_front(0.1, 50), 9.83, 0.03 * 9.83); }

// ---- free fall, impact, overlap, extremes ----

TEST(ModernLava, ADropFallsFreelyAndLands) {
  ModernOptions o = isothermal(0.1, 100);
  o.max_step = 0.01;
  ModernLava lava(o, {}, {floor_at()});
  std::vector<Vec3> x = lattice_block(4, 4, 4, 0.1);
  fill(lava, x, Vec3(0, 0, 2), Vec3(0.3, 0, 0), 1400);
  const Vec3 start = mean(lava.positions());
  Real t = 0, z = start.z(), vz = 0;
  while (t < 0.5) {
    const Real dt = lava.step(0.01).dt;
    t += dt;
    vz -= kGravity * dt;
    z += vz * dt;
    Real worst = 0;
    for (const Vec3& v : lava.velocities()) worst = std::max(worst, (v - Vec3(0.3, 0, vz)).norm());
    // Momentum is kept to the viscosity solve's tolerance.
    EXPECT_LT(worst, 10 * o.viscosity_tolerance * std::hypot(0.3, vz)) << "no force but gravity";
  }
  EXPECT_NEAR(mean(lava.positions()).z(), z, 1e-3 * 1.2);
  EXPECT_NEAR(z, start.z() - kGravity * t * t / 2, kGravity * t * 0.01);
  EXPECT_NEAR(mean(lava.positions()).x(), start.x() + 0.3 * t, 1e-4);
  while (lava.time() < 4) lava.step(0.01);
  Real lowest = 1e9, highest = 0;
  for (const Vec3& p : lava.positions()) {
    lowest = std::min(lowest, p.z());
    highest = std::max(highest, p.z());
  }
  EXPECT_GE(lowest, 0.24 * o.spacing);
  EXPECT_LT(highest, 0.35) << "it has spread";
  EXPECT_LT(fastest(lava), 0.1);
}

TEST(ModernLavaSlow, HeavyOverlapAtTheStartDoesNotExplode) {
  // Four times too dense, two of them at one place: the correction gives way without giving speed.
  ModernOptions o = isothermal(0.1, 500);
  ModernLava lava(o, {}, {floor_at()});
  std::vector<Vec3> x = lattice_block(8, 8, 8, 0.1 / std::cbrt(4.0), 0.05);
  x[3] = x[4];
  for (Vec3& p : x) p.z() += 0.05;
  fill(lava, x);
  Real speed = 0, error = 0;
  while (lava.time() < 1) {
    const ModernReport report = lava.step(0.02);
    speed = std::max(speed, report.max_speed);
    error = report.density_error;
  }
  EXPECT_TRUE(finite(lava));
  EXPECT_LT(speed, 2 * std::sqrt(2 * kGravity * 0.6)) << "twice what falling from its height gives";
  EXPECT_LT(error, 0.03) << "of 3 at the start";
}

class Extremes : public testing::TestWithParam<Real> {};
TEST_P(Extremes, ABlockThatDropsOntoASlopeStaysFiniteAndAboveItAndGainsNoSpeed) {
  const Real mu = GetParam();
  ModernOptions o = isothermal(0.1, mu);
  o.gravity = kGravity * Vec3(std::sin(0.3), 0, -std::cos(0.3));
  ModernLava lava(o, {}, {floor_at()});
  fill(lava, lattice_block(6, 6, 6, 0.1), Vec3(0, 0, 0.3), Vec3(0, 0, -1), 1400);
  Real speed = 0;
  int steps = 0;
  while (lava.time() < 1 && steps < 2000) {
    speed = std::max(speed, lava.step(0.05).max_speed);
    ++steps;
  }
  EXPECT_LT(steps, 2000) << "at " << lava.time();
  EXPECT_TRUE(finite(lava));
  // Energy: 1 m/s, 0.9 m of fall at most, and 1 s down the slope.
  EXPECT_LT(speed, 1.5 * std::sqrt(1 + 2 * kGravity * 0.9) + kGravity * std::sin(0.3));
  for (const Vec3& x : lava.positions()) EXPECT_GT(x.z(), 0.12 * o.spacing);
}
INSTANTIATE_TEST_SUITE_P(Viscosities, Extremes, testing::Values(1e-3, 1, 1e3, 1e6, 1e9));

TEST(ModernLava, ColdLavaBesideHotLavaIsCarriedWithoutBreakingAnything) {
  // 900 beside 1200 degC, 1 : 10^9: bounded, and momentum as gravity and nothing else gives it (in the air).
  ModernOptions o;
  o.spacing = 0.1;
  o.rheology.melt = exponential_melt(1200 + kZeroCelsius, 100, 900 + kZeroCelsius, 1e11);
  o.rheology.crystals.kind = CrystalKind::kNone;
  o.rheology.mu_max = 1e12;
  o.heat.on = false;
  ModernLava lava(o, {}, {});
  const std::vector<Vec3> x = lattice_block(6, 6, 6, 0.1, 0.1);
  std::vector<Real> T;
  for (const Vec3& p : x) T.push_back(kZeroCelsius + (p.x() < 0.3 ? 900 : 1200));
  std::vector<Vec3> v;
  for (const Vec3& p : x) v.push_back(Vec3(0, p.x() > 0.3 ? 0.5 : 0, -p.x()));
  lava.add(x, v, T);
  const Vec3 start = mean(v);
  Real most = 0;
  for (const Vec3& u : v) most = std::max(most, u.norm());
  while (lava.time() < 0.2) lava.step(0.02);
  EXPECT_TRUE(finite(lava));
  EXPECT_LT((mean(lava.velocities()) - start - lava.time() * o.gravity).norm(), 10 * 1e-3 * most) << "ten steps";
  Real fast = 0;
  for (const Vec3& u : lava.velocities()) fast = std::max(fast, (u - lava.time() * o.gravity).norm());
  EXPECT_LT(fast, 1.05 * most) << "seen by somebody who falls along";
}

TEST(ModernLava, CreepGoesAsOneOverItsViscosity) {
  // Re ~ 1e-10: flux in proportion to 1 / mu over six orders, steps of a day.
  Real flux[2];
  int k = 0;
  for (const Real mu : {1e6, 1e12}) {
    ModernOptions o = isothermal(0.2, mu);
    o.rheology.mu_max = 1e13;
    o.gravity = kGravity * Vec3(std::sin(0.1), 0, -std::cos(0.1));
    o.period = Vec2(6 * o.spacing, 6 * o.spacing);
    o.max_step = 1e5;
    ModernLava lava(o, {}, {floor_at()});
    fill(lava, lattice_block(6, 6, 5, 0.2));
    for (int step = 0; step < 30; ++step) lava.step(1e-2 * mu / 1e6);
    flux[k++] = mean(lava.velocities()).x() * mu;
  }
  EXPECT_NEAR(flux[0], 2600 * kGravity * std::sin(0.1) / 3, 0.03 * flux[0]);
  EXPECT_NEAR(flux[1], flux[0], 0.01 * flux[0]);
}

// ---- walls that move ----

TEST(ModernLava, APistonPushesAndABeltDragsLavaAlong) {
  // A wall comes in at 0.2 m/s: nothing is left behind it, and the lava in front is pushed along.
  auto place = std::make_shared<Real>(0);
  const Vec3 speed(0.2, 0, 0);
  const ContactSource piston = [place, speed](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) {
    plane(Vec3(*place, 0, 0), Vec3::UnitX(), speed, 1)(x, reach, out);
  };
  ModernOptions o = isothermal(0.1, 100);
  o.period = Vec2(0, 6 * o.spacing);
  o.max_step = 0.02;
  ModernLava lava(o, {}, {floor_at(), piston});
  fill(lava, lattice_block(10, 6, 4, 0.1));
  const Real before = mean(lava.positions()).x();
  while (lava.time() < 2) {
    lava.step(0.02);
    *place = speed.x() * lava.time();
    for (const Vec3& x : lava.positions()) ASSERT_GT(x.x(), *place - 0.02) << "within a step's way";
  }
  EXPECT_GT(mean(lava.positions()).x(), before + 0.2);

  // A floor that slides: the layer on it goes along.
  ModernLava belt(o, {}, {plane(Vec3::Zero(), Vec3::UnitZ(), Vec3(0, 0.3, 0))});
  fill(belt, lattice_block(6, 6, 4, 0.1));
  while (belt.time() < 10) belt.step(0.02);
  for (const Vec3& v : belt.velocities()) EXPECT_NEAR(v.y(), 0.3, 0.01);
}

TEST(ModernLava, AWallThatComesFromAfarIsMetByLavaThatStandsStill) {
  for (const Real known : {std::numeric_limits<Real>::infinity(), 0.2}) {
    auto place = std::make_shared<Real>(-0.7);
    const ContactSource piston = [place](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) {
      plane(Vec3(*place, 0, 0), Vec3::UnitX(), Vec3(0.2, 0, 0), 1)(x, reach, out);
    };
    ModernOptions o = isothermal(0.1, 1000);
    o.gravity = Vec3::Zero();
    o.max_step = 0.05;
    o.ground_speed = known;
    ModernLava lava(o, {}, {piston});
    fill(lava, lattice_block(4, 4, 4, 0.1));
    while (lava.time() < 4.5) {
      lava.step(0.05);
      *place = -0.7 + 0.2 * lava.time();
      for (const Vec3& x : lava.positions()) ASSERT_GT(x.x(), *place - 0.02) << "at " << lava.time() << " s";
    }
    EXPECT_NEAR(mean(lava.velocities()).x(), 0.2, 0.03);
  }
}

// ---- short steps ----

TEST(ModernLava, ShorterStepsDoNotLoseWhatAStepAdds) {
  // Thrown sideways in empty space: however little gravity adds in a step, and however loose the tolerance, it adds up.
  for (const Real step : {5e-5, 1e-3}) {
    ModernOptions o = isothermal(0.1, 1000);
    o.viscosity_tolerance = 1e-2;
    ModernLava lava(o, {}, {});
    fill(lava, lattice_block(4, 4, 4, 0.1), Vec3::Zero(), Vec3(5, 0, 0), 1400);
    for (int k = 0; k < 40; ++k) lava.step(step);
    EXPECT_NEAR(mean(lava.velocities()).z(), -kGravity * 40 * step, 0.02 * kGravity * 40 * step) << "steps of " << step;
  }
}

TEST(ModernLavaSlow, AColumnRestsInStepsOfAnyLength) {
  for (const Real step : {0.05, 5e-3, 5e-4}) {
    ModernOptions o = isothermal(0.1, 100);
    o.period = Vec2(0.8, 0.8);
    ModernLava lava(o, {}, {floor_at()});
    fill(lava, lattice_block(8, 8, 10, 0.1));
    while (lava.time() < 0.5) lava.step(step);
    Real fastest = 0, pressure = 0;
    for (std::size_t i = 0; i < lava.size(); ++i) {
      fastest = std::max(fastest, lava.velocities()[i].norm());
      pressure += lava.pressures()[i] / static_cast<Real>(lava.size());
    }
    EXPECT_LT(fastest, 1e-3 * std::sqrt(kGravity)) << "steps of " << step;
    EXPECT_NEAR(pressure, o.density * kGravity / 2, 0.03 * o.density * kGravity / 2) << "steps of " << step;
  }
}

TEST(ModernLava, ASolveThatIsCutShortIsTriedAgainOrTold) {
  ModernOptions o = isothermal(0.1, 1000);
  o.max_iterations = 1;
  o.min_step = 1e-3;
  o.max_step = 0.02;
  ModernLava lava(o, {}, {floor_at()});
  fill(lava, lattice_block(8, 8, 8, 0.1));
  bool told = false;
  try {
    for (int k = 0; k < 5; ++k) {
      const ModernReport report = lava.step(0.02);
      EXPECT_GE(report.dt, o.min_step);
      EXPECT_LE(report.viscosity_residual, 10 * o.viscosity_tolerance);
      told = told || !report.solved;
    }
  } catch (const UnstableError&) {
    told = true;
  }
  EXPECT_TRUE(told);
}

TEST(ModernLava, FreeSlipGroundLetsAFilmFallLikeABlock) {
  ModernOptions o = isothermal(0.1, 1e4);
  o.slip_length = std::numeric_limits<Real>::infinity();
  o.gravity = Vec3(1, 0, -9);
  o.period = Vec2(6 * o.spacing, 6 * o.spacing);
  o.courant = 100;
  ModernLava lava(o, {}, {floor_at()});
  fill(lava, lattice_block(6, 6, 4, 0.1));
  while (lava.time() < 1) lava.step(0.05);
  for (const Vec3& v : lava.velocities()) EXPECT_NEAR(v.x(), lava.time(), 1e-3);
}

// ---- vents, edges, mass ----

Vent crater(Real rate, Real width = 0.5, const Vec3& at = Vec3::Zero()) {
  Vent vent;
  vent.from = vent.to = at;
  vent.width = width;
  vent.rate = rate;
  vent.temperature = 1420;
  return vent;
}

TEST(ModernLava, VentsLetOutTheirVolumeWhateverTheSteps) {
  for (const Real step : {0.5, 0.07}) {
    Vent fissure = crater(0.05);
    fissure.from = Vec3(-0.6, 0, 0);
    fissure.to = Vec3(0.6, 0, 0);
    fissure.width = 0.2;
    fissure.ramp = 1;
    fissure.stop = 5;
    ModernOptions o = isothermal(0.1, 500);
    o.max_step = step;
    ModernLava lava(o, {fissure}, {floor_at()});
    std::size_t emitted = 0;
    while (lava.time() < 6) emitted += lava.step(std::min(step, 6 - lava.time())).emitted;
    const Real sites = static_cast<Real>(fissure.lattice(o.spacing).size());
    EXPECT_NEAR(lava.volume(), fissure.volume(lava.time()), sites * 1e-3) << "one particle a site";
    EXPECT_EQ(emitted, lava.size());
    EXPECT_NEAR(lava.mass_emitted(), lava.volume() * o.density, 1e-6);
    EXPECT_EQ(lava.mass_left(), 0);
    for (const Vec3& x : lava.positions()) EXPECT_GT(x.z(), 0.12 * o.spacing);
    EXPECT_TRUE(finite(lava));
  }
}

TEST(ModernLava, WhatLeavesOverAnEdgeIsCountedAndMassKept) {
  // A table of 1 m, poured over: what falls is taken out, what stays and what left add up.
  ModernOptions o = isothermal(0.1, 50);
  const auto inside = [](const Vec3& x) { return x.head<2>().norm() < 1; };
  const ContactSource table = [inside](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) {
    floor_at()(x, reach, out);
    for (std::size_t i = 0; i < x.size(); ++i)
      if (!inside(x[i])) out[i] = {};
  };
  ModernLava lava(o, {crater(0.25)}, {table}, inside);
  std::size_t left = 0;
  while (lava.time() < 6) left += lava.step(0.1).left;
  EXPECT_GT(left, 100u);
  EXPECT_NEAR(lava.mass_left(), static_cast<Real>(left) * lava.particle_mass(), 1e-6);
  EXPECT_NEAR(lava.mass_emitted(), lava.mass_left() + lava.volume() * o.density, 1e-6 * lava.mass_emitted());
  Real lowest = 0;
  for (const Vec3& x : lava.positions()) lowest = std::min(lowest, x.z());
  EXPECT_GT(lowest, -16 * 0.1 * 10) << "they go within some steps";
}

TEST(ModernLava, TheLastAwakeMayLeave) {
  // A particle runs off a steep table, alone, and with sleepers that stay behind.
  for (const bool with_sleepers : {false, true}) {
    ModernOptions o = isothermal(0.2, 1000);
    o.sleep_speed = 2e-3;
    o.sleep_delay = 0.5;
    o.max_step = 0.05;
    const auto inside = [](const Vec3& p) { return p.x() < 1; };
    const ContactSource table = [](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) {
      plane(Vec3::Zero(), Vec3::UnitZ())(x, reach, out);
      for (std::size_t i = 0; i < x.size(); ++i)
        if (x[i].x() >= 1) out[i] = {};
    };
    ModernLava lava(o, {}, {table}, inside);
    if (with_sleepers) fill(lava, {Vec3(-3, 0, 0.1)}, Vec3::Zero(), Vec3::Zero(), 1400);
    while (with_sleepers && sleepers(lava) == 0 && lava.time() < 20) lava.step(0.05);
    fill(lava, {Vec3(0.9, 0, 1.1)}, Vec3::Zero(), Vec3(6, 0, 0), 1400);
    const Real t = lava.time();
    while (lava.time() < t + 8) lava.step(0.05);
    EXPECT_EQ(lava.size(), with_sleepers ? 1u : 0u);
  }
}

TEST(ModernLava, StiffLavaIsNotHeatedByWhatPressureLeaves) {
  // A heap of 1e10 Pa s whose vent has closed frees next to nothing.
  ModernOptions o = isothermal(0.2, 1e10);
  o.heat.on = true;
  o.heat.viscous_heating = true;
  o.max_step = 0.1;
  Vent vent = crater(0.5, 0.8);
  vent.stop = 2;
  ModernLava lava(o, {vent}, {floor_at()});
  while (lava.time() < 2.2) lava.step(0.1);
  const auto height = [&] {
    Real sum = 0;
    for (const Vec3& x : lava.positions()) sum += x.z() * lava.particle_mass() * kGravity;
    return sum;
  };
  const Real before = height();
  Real heated = 0;
  while (lava.time() < 7) heated += lava.step(0.1).heat.dissipated;
  const Real fallen = before - height(), all = static_cast<Real>(lava.size()) * lava.particle_mass() * kGravity;
  EXPECT_LT(heated, std::max(fallen, 0.0) + 0.02 * all) << "two centimetres' fall; " << fallen << " J freed";
}

// ---- determinism, checkpoints ----

/// Everything on: two vents, heat, crust, sleep, a slope.
ModernLava everything() {
  ModernOptions o;
  o.spacing = 0.2;
  o.rheology.melt = exponential_melt(1200 + kZeroCelsius, 1e3, 1000 + kZeroCelsius, 1e6);
  o.crust_viscosity = 1e6;
  o.crust_strength = 1e4;
  o.sleep_speed = 0.05;
  o.sleep_delay = 0.5;
  o.rest_period = 1;
  Vent first = crater(0.4, 0.8), second = crater(0.2, 0.4, Vec3(2, 0, -0.2));
  first.stop = 3;
  second.start = 1;
  ModernLava lava(o, {first, second}, {plane(Vec3::Zero(), Vec3(0.1, 0, 1).normalized())});
  // Cold enough to fall asleep where it lies.
  fill(lava, lattice_block(4, 4, 2, 0.2), Vec3(-4, 0, 0.42), Vec3::Zero(), 1000 + kZeroCelsius);
  return lava;
}

TEST(ModernLava, GivesTheSameBitsOnOneAndTwoThreads) {
  std::uint64_t hash[2];
  for (const int threads : {1, 2}) {
    const ThreadLimit limit(threads);
    ModernLava lava = everything();
    while (lava.time() < 2.5) lava.step(0.1);
    hash[threads - 1] = hash_of(lava);
  }
  EXPECT_EQ(hash[0], hash[1]);
}

TEST(ModernLava, ARunResumedGoesOnToTheBit) {
  ModernLava lava = everything();
  for (int step = 0; step < 21; ++step) lava.step(0.1);  // not at a multiple of the sorting
  const std::string bytes = saved(lava);
  ModernLava resumed = everything();
  StateReader in(bytes, "memory");
  resumed.load(in);
  EXPECT_TRUE(in.done());
  EXPECT_EQ(hash_of(resumed), hash_of(lava));
  EXPECT_EQ(resumed.time(), lava.time());
  for (int step = 0; step < 25; ++step) {
    lava.step(0.1);
    resumed.step(0.1);
    ASSERT_EQ(hash_of(resumed), hash_of(lava)) << "after " << step + 1 << " steps more";
  }
  EXPECT_GT(sleepers(lava), 0u) << "sleep has been tested";
  EXPECT_EQ(saved(resumed), saved(lava));
  EXPECT_EQ(resumed.mass_emitted(), lava.mass_emitted());
}

TEST(ModernLava, ABrokenCheckpointIsAnInputErrorAndLeavesEverythingAsItWas) {
  ModernLava lava = everything();
  for (int step = 0; step < 8; ++step) lava.step(0.1);
  const std::string bytes = saved(lava);
  lava.step(0.1);
  const std::string now = saved(lava);
  for (std::size_t cut = 0; cut < bytes.size(); cut += 1 + bytes.size() / 40) {
    StateReader in(std::string_view(bytes).substr(0, cut), "cut.state");
    EXPECT_THROW(lava.load(in), InputError) << cut << " of " << bytes.size() << " bytes";
    ASSERT_EQ(saved(lava), now) << "untouched after " << cut << " bytes";
  }
  // Another model's name; an array that is short of one particle.
  std::string other = bytes;
  const std::size_t name = other.find("modern");
  ASSERT_NE(name, std::string::npos);
  other[name] = 'x';
  StateReader in(other, "other.state");
  EXPECT_THROW(lava.load(in), InputError);
  EXPECT_EQ(saved(lava), now);
  lava.step(0.1);
  EXPECT_TRUE(finite(lava));
}

TEST(ModernLava, UnstableErrorLeavesParticlesWhereTheyWere) {
  ModernOptions o = isothermal(0.1, 10);
  o.min_step = 1e-3;
  ModernLava lava(o, {}, {floor_at()});
  fill(lava, lattice_block(4, 4, 4, 0.1));
  lava.step(0.01);
  fill(lava, {Vec3(2, 0, 1)}, Vec3(1e6, 0, 0));
  std::map<std::uint64_t, std::pair<Vec3, Vec3>> before;
  for (std::size_t i = 0; i < lava.size(); ++i) before[lava.ids()[i]] = {lava.positions()[i], lava.velocities()[i]};
  const Real time = lava.time();
  EXPECT_THROW(lava.step(0.01), UnstableError);
  EXPECT_EQ(lava.time(), time);
  ASSERT_EQ(lava.size(), before.size());
  for (std::size_t i = 0; i < lava.size(); ++i) EXPECT_EQ((std::pair<Vec3, Vec3>(lava.positions()[i], lava.velocities()[i])), before[lava.ids()[i]]);
}

TEST(ModernLavaDeathTest, RefusesWhatIsNotFinite) {
  ModernLava lava(isothermal(1, 10), {}, {});
  const Real nan = std::numeric_limits<Real>::quiet_NaN();
  EXPECT_DEATH(fill(lava, {Vec3(nan, 0, 0)}), "CHECK");
  EXPECT_DEATH(fill(lava, {Vec3::Zero()}, Vec3(0, std::numeric_limits<Real>::infinity(), 0)), "CHECK");
  EXPECT_DEATH(fill(lava, {Vec3::Zero()}, Vec3::Zero(), nan), "CHECK");
  EXPECT_DEATH(lava.step(0), "CHECK");
  ModernOptions o = isothermal(1, 10);
  o.period = Vec2(3, 0);
  EXPECT_DEATH(ModernLava(o, {}, {}), "CHECK") << "shorter than two supports";
}

TEST(ModernLava, WithoutParticlesStepsAreTimeThatPasses) {
  ModernLava lava(isothermal(1, 10), {}, {floor_at()});
  for (int step = 0; step < 20; ++step) EXPECT_EQ(lava.step(0.5).dt, 0.5);
  EXPECT_NEAR(lava.time(), 10, 1e-12);
}

// ---- sleep ----

/// Lava with a yield strength: a cake of it on level ground comes to rest. Stiff (1e8 Pa s) as long as it is not pushed.
ModernOptions sleepy() {
  ModernOptions o = isothermal(0.2, 1e4);
  o.rheology.yield.kind = YieldKind::kConstant;
  o.rheology.yield.tau = 4000;
  o.rheology.mu_max = 1e8;
  o.sleep_speed = 2e-3;
  o.sleep_delay = 2;
  o.max_step = 0.25;
  return o;
}
ModernLava cake(int length, std::vector<Vent> vents = {}) {
  ModernLava lava(sleepy(), std::move(vents), {floor_at()});
  fill(lava, lattice_block(length, 6, 3, 0.2));
  return lava;
}
void let_sleep(ModernLava& lava) {
  while (sleepers(lava) < lava.size() && lava.time() < 100) lava.step(0.5);
  ASSERT_EQ(sleepers(lava), lava.size()) << "fastest " << fastest(lava) << " m/s";
}

TEST(ModernLava, AFlowThatHasStoppedFallsAsleepAndCostsNothing) {
  ModernLava lava = cake(12);
  let_sleep(lava);
  const std::vector<Vec3> x(lava.positions().begin(), lava.positions().end());
  ModernReport report;
  for (int step = 0; step < 20; ++step) {
    report = lava.step(0.5);
    EXPECT_EQ(report.awake, 0u);
    EXPECT_EQ(report.neighbor_pairs, 0u);
    EXPECT_EQ(report.pressure_iterations + report.viscosity_iterations + report.density_iterations, 0);
  }
  EXPECT_EQ(fastest(lava), 0);
  // Memory order may change, nobody's place does.
  Vec3 drift = mean(lava.positions()) - mean(x);
  EXPECT_LT(drift.norm(), 1e-12);
  EXPECT_EQ(sleepers(lava), lava.size());
}

TEST(ModernLava, SleepersCoolInLongStepsAsTheyWouldInShortOnesAndTheBudgetCloses) {
  // The same cake, asleep for ten minutes, its heat 80 s at a time and 5 s at a time.
  Real cooled[2];
  for (const bool fine : {false, true}) {
    ModernOptions o = sleepy();
    o.heat.on = true;
    o.max_step = fine ? 0.3125 : 5;
    ModernLava lava(o, {}, {floor_at()});
    fill(lava, lattice_block(8, 6, 3, 0.2), Vec3::Zero(), Vec3::Zero(), 1300);
    let_sleep(lava);
    const auto mean = [&] {
      Real sum = 0;
      for (const Real T : lava.temperatures()) sum += T / static_cast<Real>(lava.size());
      return sum;
    };
    const Real before = mean(), enthalpy = lava.heat().total_enthalpy();
    Real lost = 0;
    const int steps = 7 * 16 * (fine ? 16 : 1);
    for (int step = 0; step < steps; ++step) {
      const ModernReport report = lava.step(5);
      EXPECT_EQ(report.awake, 0u);
      lost += report.heat.radiated + report.heat.convected + report.heat.ground - report.heat.dissipated;
    }
    cooled[fine] = before - mean();
    EXPECT_NEAR(enthalpy - lava.heat().total_enthalpy(), lost, 1e-6 * std::abs(lost));
  }
  EXPECT_GT(cooled[0], 5);
  EXPECT_NEAR(cooled[0], cooled[1], 0.02 * cooled[1]);
}

TEST(ModernLava, PressuresAreThereWhileSomeSleepAndHeatCrossesAll) {
  Vent vent = crater(0.05, 0.4, Vec3(0.6, 0.6, 0));
  vent.start = 100;
  ModernOptions o = sleepy();
  o.heat.on = true;
  o.heat.longest_interval = 0.1;
  ModernLava lava(o, {vent}, {floor_at()});
  fill(lava, lattice_block(30, 6, 3, 0.2));
  let_sleep(lava);
  while (lava.time() < 100) lava.step(100 - lava.time());
  bool some = false;
  while (lava.time() < 102) {
    const ModernReport report = lava.step(0.25);
    some = some || (report.awake > 0 && report.awake < lava.size());
    for (const Real p : lava.pressures()) ASSERT_TRUE(std::isfinite(p) && p >= 0);
  }
  EXPECT_TRUE(some);
}

TEST(ModernLava, HeatThatIsCaughtUpOnWhenLavaIsAddedIsInTheNextReport) {
  ModernOptions o = sleepy();
  o.heat.on = true;
  o.max_step = 5;
  ModernLava lava(o, {}, {floor_at()});
  fill(lava, lattice_block(8, 6, 3, 0.2), Vec3::Zero(), Vec3::Zero(), 1300);
  let_sleep(lava);
  const auto lost = [](const ModernReport& r) { return r.heat.radiated + r.heat.convected + r.heat.ground - r.heat.dissipated; };
  // Between two of its long steps.
  while (lost(lava.step(5)) == 0) {}
  const Real enthalpy = lava.heat().total_enthalpy();
  for (int k = 0; k < 7; ++k) EXPECT_EQ(lost(lava.step(5)), 0);
  fill(lava, {Vec3(9, 9, 0.1)}, Vec3::Zero(), Vec3::Zero(), 1300);
  const Real brought = lava.heat().particle_mass() * lava.heat().enthalpy().back();
  const Real gone = lost(lava.step(0.1));
  EXPECT_GT(gone, 0);
  EXPECT_NEAR(enthalpy + brought - lava.heat().total_enthalpy(), gone, 1e-6 * gone);
}

TEST(ModernLava, ANewVentWakesWhatItTouches) {
  Vent vent = crater(0.05, 0.4, Vec3(0.6, 0.6, 0));
  vent.start = 100;
  ModernLava lava = cake(30, {vent});
  const std::size_t old = lava.size();
  let_sleep(lava);
  while (lava.time() < 99.9) lava.step(100 - lava.time());
  std::size_t woken = 0;
  while (lava.time() < 103) {
    lava.step(0.25);
    std::size_t now = 0;
    for (std::size_t i = 0; i < lava.size(); ++i) {
      if (lava.ids()[i] >= old || lava.asleep()[i]) continue;
      ++now;
    }
    woken = std::max(woken, now);
  }
  EXPECT_GT(lava.size(), old + 10);
  EXPECT_GT(woken, 10u);
  EXPECT_TRUE(finite(lava));
}

TEST(ModernLava, AMovingWallWakesTheSleepersItRunsInto) {
  auto place = std::make_shared<Real>(-5);
  auto speed = std::make_shared<Real>(0);
  const ContactSource piston = [place, speed](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) {
    plane(Vec3(*place, 0, 0), Vec3::UnitX(), Vec3(*speed, 0, 0), 1)(x, reach, out);
  };
  ModernLava lava(sleepy(), {}, {floor_at(), piston});
  fill(lava, lattice_block(12, 6, 3, 0.2));
  let_sleep(lava);
  Real left = 1e9;
  for (const Vec3& x : lava.positions()) left = std::min(left, x.x());
  *place = left - 0.5;
  *speed = 0.1;
  for (int step = 0; step < 60; ++step) {
    lava.step(0.2);
    *place += 0.2 * *speed;
  }
  EXPECT_LT(sleepers(lava), lava.size());
  std::size_t behind = 0;
  for (const Vec3& x : lava.positions()) behind += x.x() < *place - 0.02;
  EXPECT_EQ(behind, 0u) << "the wall went through";
}

TEST(ModernLava, ALoadWakesSleepersAndTheyMoveAndSettleAgain) {
  ModernLava lava = cake(12);
  let_sleep(lava);
  const std::size_t old = lava.size();
  const auto mean_x = [&] {
    Real sum = 0;
    for (std::size_t i = 0; i < lava.size(); ++i)
      if (lava.ids()[i] < old) sum += lava.positions()[i].x();
    return sum / static_cast<Real>(old);
  };
  const Real before = mean_x();
  // A pile three times as high is set down beside it.
  fill(lava, lattice_block(5, 6, 9, 0.2), Vec3(-1.1, 0, 0), Vec3::Zero(), 1400);
  std::size_t fewest = old;
  const Real t = lava.time();
  while (lava.time() < t + 20) {
    lava.step(0.25);
    std::size_t asleep = 0;
    for (std::size_t i = 0; i < lava.size(); ++i) asleep += lava.ids()[i] < old && lava.asleep()[i];
    fewest = std::min(fewest, asleep);
  }
  EXPECT_LT(fewest, old - 20);
  EXPECT_GT(mean_x(), before + 0.003);
}

TEST(ModernLava, LavaFlowsOverSleepersWithoutSinkingIn) {
  ModernLava lava = cake(16);
  let_sleep(lava);
  const std::size_t old = lava.size();
  Real top = 0;
  for (const Vec3& x : lava.positions()) top = std::max(top, x.z());
  fill(lava, lattice_block(4, 4, 2, 0.2), Vec3(1.2, 0.2, top + 0.1), Vec3::Zero(), 1400);
  const Real t = lava.time();
  Real densest = 0;
  while (lava.time() < t + 20) {
    lava.step(0.25);
    if (lava.time() > t + 5)
      for (std::size_t i = 0; i < lava.size(); ++i)
        if (!lava.asleep()[i]) densest = std::max(densest, lava.densities()[i]);
  }
  EXPECT_TRUE(finite(lava));
  Real lowest = 1e9;
  for (std::size_t i = 0; i < lava.size(); ++i)
    if (lava.ids()[i] >= old) lowest = std::min(lowest, lava.positions()[i].z());
  EXPECT_LT(densest, 1.1);
  EXPECT_GT(lowest, top - 0.15) << "not into the upper layer";
}

TEST(ModernLava, ViewsAreOfOneSizeAndPointsAreTheSkins) {
  ModernLava lava = everything();
  for (int step = 0; step < 12; ++step) lava.step(0.1);
  const std::size_t n = lava.size();
  ASSERT_GT(n, 10u);
  for (const std::size_t size : {lava.positions().size(), lava.velocities().size(), lava.pressures().size(), lava.temperatures().size(), lava.viscosities().size(),
                                 lava.surface().size(), lava.asleep().size(), lava.densities().size(), lava.ids().size(), lava.heat().size()})
    EXPECT_EQ(size, n);
  const geometry::Points points = lava.points();
  for (const std::size_t size : {points.position.size(), points.radius.size(), points.velocity.size(), points.temperature.size(), points.crust.size(), points.age.size(),
                                 points.id.size(), points.surface.size(), points.rest.size(), points.rest2.size()})
    EXPECT_EQ(size, n);
  for (const Real c : points.crust) EXPECT_TRUE(c >= 0 && c <= 1);
  for (const Real age : points.age) EXPECT_TRUE(age >= 0 && age <= lava.time());
  for (const Real T : points.temperature) EXPECT_TRUE(T > 200 && T < 1425);
}

}  // namespace
}  // namespace effuse::flow::sph
