#include "flow/sph/pressure.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/flow/sph/sample_system.h"

namespace effuse::flow::sph {
namespace {

constexpr Real kRounding = 1e-13;  // of the sum of the terms' sizes
constexpr Real kNoBound = -std::numeric_limits<Real>::infinity();

struct Setup {
  const char* name;
  KernelKind kernel;
  bool periodic, walls;
};
void PrintTo(const Setup& s, std::ostream* out) { *out << s.name; }

SampleSystem sample(const Setup& setup) {
  const Real dx = 0.3;
  SampleSystem s(lattice_block(8, 8, 6, dx, 0.3, 7), dx, 2.7, setup.kernel);
  if (setup.periodic) s.period = Vec2(8 * dx, 8 * dx);
  if (setup.walls) s.solids = {plane_solid(Vec3::Zero(), Vec3::UnitZ()), plane_solid(Vec3(0, -0.1, 0), Vec3(0, 1, 0.3).normalized(), Vec3::Zero(), 1)};
  s.find();
  return s;
}

class PressureOperators : public testing::TestWithParam<Setup> {};

TEST_P(PressureOperators, GradientIsTheNegativeTransposeOfCompression) {
  const SampleSystem s = sample(GetParam());
  const std::vector<Vec3> v = random_vectors(s.size(), 1);
  std::vector<Real> q(s.size()), rate(s.size());
  std::vector<Vec3> a(s.size());
  for (std::size_t i = 0; i < s.size(); ++i) q[i] = random_normal(2, 0, i);
  compression_rate(s.system(), v, rate);
  pressure_acceleration(s.system(), q, a);
  Real left = 0, right = 0, size = 0;
  for (std::size_t i = 0; i < s.size(); ++i) {
    left += q[i] * rate[i];
    right -= v[i].dot(a[i]);
    size += std::abs(q[i] * rate[i]) + std::abs(v[i].dot(a[i]));
  }
  EXPECT_NEAR(left, right, kRounding * size);
}

TEST_P(PressureOperators, RigidMotionCompressesNothing) {
  if (GetParam().periodic || GetParam().walls) return;  // neither turns
  const SampleSystem s = sample(GetParam());
  std::vector<Vec3> v(s.size());
  std::vector<Real> rate(s.size()), scale(s.size());
  for (std::size_t i = 0; i < s.size(); ++i) v[i] = Vec3(1, -2, 3) + Vec3(0.4, 0.5, -0.3).cross(s.x[i]);
  compression_rate(s.system(), v, rate);
  for (const Real r : rate) EXPECT_LT(std::abs(r), 1e-12);
}

TEST_P(PressureOperators, MomentumAndAngularMomentumAreKept) {
  if (GetParam().walls) return;  // these take it
  const SampleSystem s = sample(GetParam());
  std::vector<Real> q(s.size());
  std::vector<Vec3> a(s.size());
  for (std::size_t i = 0; i < s.size(); ++i) q[i] = random_normal(2, 0, i);
  pressure_acceleration(s.system(), q, a);
  Vec3 sum = Vec3::Zero(), turn = Vec3::Zero();
  Real size = 0, turn_size = 0;
  for (std::size_t i = 0; i < s.size(); ++i) {
    sum += a[i];
    size += a[i].norm();
    turn += s.x[i].cross(a[i]);
    turn_size += s.x[i].norm() * a[i].norm();
  }
  EXPECT_LT(sum.norm(), kRounding * size);
  if (!GetParam().periodic) {
    EXPECT_LT(turn.norm(), kRounding * turn_size);
  }
}

TEST_P(PressureOperators, CompressionIsTheRateOfTheSummedDensity) {
  if (GetParam().walls) return;  // their lattice of layers has another slope to either side: the mirror's velocity counts twice
  SampleSystem s = sample(GetParam());
  const std::vector<Vec3> v = random_vectors(s.size(), 1), x = s.x;
  std::vector<Real> rate(s.size());
  compression_rate(s.system(), v, rate);
  const auto densities = [&](Real t) {
    for (std::size_t i = 0; i < x.size(); ++i) s.x[i] = x[i] + t * v[i];
    s.find();
    std::vector<Real> rho(s.size());
    const ParticleSystem system = s.system();
    with_kernel(system, [&](const auto& W, auto periodic) {
      for (std::size_t i = 0; i < s.size(); ++i)
        for (const Index j : s.neighbors[i]) rho[i] += s.volume() * W.W(system.separation<decltype(periodic)::value>(i, j).norm());
    });
    return rho;
  };
  const Real h = 1e-5;
  const std::vector<Real> before = densities(-h), after = densities(h);
  for (std::size_t i = 0; i < s.size(); ++i) EXPECT_NEAR((after[i] - before[i]) / (2 * h), rate[i], 1e-6);
}

INSTANTIATE_TEST_SUITE_P(Systems, PressureOperators,
                         testing::Values(Setup{"free", KernelKind::kWendlandC2, false, false}, Setup{"walls", KernelKind::kWendlandC2, false, true},
                                         Setup{"periodic", KernelKind::kWendlandC2, true, false}, Setup{"periodic with walls", KernelKind::kCubicSpline, true, true},
                                         Setup{"cubic spline", KernelKind::kCubicSpline, false, false}));

TEST(PressureAtWalls, AWallSeesTheVelocityAgainstItsOwn) {
  SampleSystem s(lattice_block(6, 6, 4, 1), 1);
  const Vec3 speed(0.2, 0, 0.7);
  s.solids = {plane_solid(Vec3::Zero(), Vec3::UnitZ(), speed)};
  s.find();
  const std::vector<Vec3> with(s.size(), speed), rest(s.size(), Vec3::Zero());
  std::vector<Real> rate(s.size());
  compression_rate(s.system(), with, rate);
  for (const Real r : rate) EXPECT_NEAR(r, 0, 1e-14) << "everything moves together";
  compression_rate(s.system(), rest, rate);
  for (std::size_t i = 0; i < s.size(); ++i)
    if (s.x[i].z() < 1) {
      EXPECT_GT(rate[i], 0.1) << "a wall that comes nearer compresses";
    }
}

/// What the solver is asked: the sign of what it leaves is checked against its bounds.
struct Question {
  SampleSystem s;
  std::vector<Vec3> v;
  std::vector<Real> rate, least, q;
  Real dt;
  PressureResult result;

  Question(SampleSystem system, std::vector<Vec3> start, Real step) : s(std::move(system)), v(std::move(start)), rate(s.size(), 0.0), least(s.size(), 0.0), q(s.size(), 0.0), dt(step) {}
  void solve(Real tolerance = 1e-9) {
    // Old pressures have acted.
    PressureSolver solver;
    result = solver.solve(s.system(), rate, least, dt, tolerance, 5000, v, q);
  }
  /// dt (D v - rate), by particle.
  std::vector<Real> excess() const {
    std::vector<Real> out(s.size());
    compression_rate(s.system(), v, out);
    for (std::size_t i = 0; i < s.size(); ++i) out[i] = dt * (out[i] - rate[i]);
    return out;
  }
};

void expect_complementary(const Question& question, Real tolerance) {
  const std::vector<Real> excess = question.excess();
  Real square = 0;
  for (std::size_t i = 0; i < question.s.size(); ++i) {
    EXPECT_GE(question.q[i], question.least[i]);
    const bool bound = question.q[i] <= question.least[i];
    const Real error = bound ? std::max(excess[i], 0.0) : excess[i];
    square += error * error;
  }
  const Real rms = std::sqrt(square / static_cast<Real>(question.s.size()));
  EXPECT_LE(rms, tolerance) << "D v <= rate, with equality where q is off its bound";
  EXPECT_NEAR(rms, question.result.error, 1e-3 * tolerance) << "the error is what it says";
}

TEST(PressureSolver, ReachesTheBoundOrTheRateEverywhere) {
  for (const bool periodic : {false, true}) {
    for (const Real scale : {0.01, 1.0, 100.0}) {
      Question question(sample({"", KernelKind::kWendlandC2, periodic, true}), {}, 0.02);
      question.v = random_vectors(question.s.size(), 3);
      for (Vec3& v : question.v) v *= scale;
      for (std::size_t i = 0; i < question.s.size(); ++i) {
        question.rate[i] = scale * random_normal(4, 0, i);
        question.least[i] = -scale * random_uniform(4, 5, i);
        question.q[i] = scale * random_normal(4, 9, i);  // some of them below their bound
      }
      const Real tolerance = scale * 1e-8;
      question.solve(tolerance);
      EXPECT_TRUE(question.result.converged) << question.result.iterations;
      expect_complementary(question, tolerance);
    }
  }
}

TEST(PressureSolver, WithoutBoundsIsAProjectionThatTakesEnergyAndKeepsMomentum) {
  Question question(sample({"", KernelKind::kWendlandC2, false, false}), {}, 0.02);
  question.v = random_vectors(question.s.size(), 3);
  std::fill(question.least.begin(), question.least.end(), kNoBound);
  const std::vector<Vec3> before = question.v;
  question.solve(1e-10);
  EXPECT_TRUE(question.result.converged);
  for (const Real e : question.excess()) EXPECT_LT(std::abs(e), 1e-8);
  Vec3 momentum = Vec3::Zero();
  Real energy_before = 0, energy = 0, cross = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    momentum += question.v[i] - before[i];
    energy_before += before[i].squaredNorm();
    energy += question.v[i].squaredNorm();
    cross += question.v[i].dot(before[i] - question.v[i]);
  }
  EXPECT_LT(momentum.norm(), 1e-12 * std::sqrt(energy_before * static_cast<Real>(before.size())));
  EXPECT_LT(energy, energy_before);
  EXPECT_NEAR(cross, 0, 1e-6 * energy_before) << "what is left is orthogonal to what was taken";
}

TEST(PressureSolver, HoldsAColumnAtRestWithThePressureOfItsDepth) {
  // One step of gravity, taken away whole: q = g (H - z), 12 particles deep.
  const Real dx = 0.5, g = kGravity, dt = 0.01;
  SampleSystem s(lattice_block(6, 6, 12, dx), dx);
  s.period = Vec2(3, 3);
  s.solids = {plane_solid(Vec3::Zero(), Vec3::UnitZ())};
  s.find();
  Question question(std::move(s), {}, dt);
  question.v.assign(question.s.size(), Vec3(0, 0, -dt * g));
  question.solve();
  EXPECT_TRUE(question.result.converged);
  expect_complementary(question, 1e-9);
  // By layers: the wall mirrors the lowest one's pressure where it should go on growing, which leaves a zigzag of less than a layer's
  // weight; two layers together have it right to 2 % of that of all.
  std::vector<Real> off(12);
  for (std::size_t i = 0; i < question.s.size(); ++i) {
    off[i / 36] += (question.q[i] - g * (12 * dx - question.s.x[i].z())) / 36;
    EXPECT_LT(question.v[i].norm(), 1e-6 * dt * g) << "z " << question.s.x[i].z();
  }
  for (std::size_t k = 0; k < 12; ++k) {
    EXPECT_LT(std::abs(off[k]), g * dx) << "layer " << k;
    if (k > 0) {
      EXPECT_LT(std::abs(off[k] + off[k - 1]) / 2, 0.02 * g * 12 * dx) << "layer " << k;
    }
  }
}

TEST(PressureSolver, DoesNotHoldTogetherWhatFliesApart) {
  // Two halves of a block, each rigid, on their way apart: no pressure, no change. Towards one another: stopped.
  for (const Real sign : {1.0, -1.0}) {
    Question question(SampleSystem(lattice_block(8, 4, 4, 1), 1), {}, 0.01);
    for (const Vec3& x : question.s.x) question.v.push_back(Vec3(x.x() > 4 ? sign : -sign, 0, 0));
    const std::vector<Vec3> before = question.v;
    question.solve();
    Real change = 0, most = 0;
    for (std::size_t i = 0; i < before.size(); ++i) {
      change = std::max(change, (question.v[i] - before[i]).norm());
      most = std::max(most, question.q[i]);
    }
    if (sign > 0) {
      EXPECT_EQ(most, 0);
      EXPECT_EQ(change, 0);
    } else {
      EXPECT_GT(most, 0);
      expect_complementary(question, 1e-9);
    }
  }
}

TEST(PressureSolver, WarmStartWithTheSolutionHasNothingToDo) {
  Question question(sample({"", KernelKind::kWendlandC2, true, true}), {}, 0.02);
  question.v = random_vectors(question.s.size(), 3);
  const std::vector<Vec3> start = question.v;
  question.solve(1e-10);
  const std::vector<Real> q = question.q;
  // The same again, the old pressure applied first.
  std::vector<Vec3> a(q.size());
  pressure_acceleration(question.s.system(), q, a);
  for (std::size_t i = 0; i < q.size(); ++i) question.v[i] = start[i] + question.dt * a[i];
  question.solve(1e-9);
  EXPECT_EQ(question.result.iterations, 0);
  EXPECT_EQ(question.q, q);
}

TEST(PressureSolver, FixedParticlesKeepTheirVelocitiesAndPushOthers) {
  // A block of fixed particles drives into free ones: those give way or go along, its own velocities stay to the bit.
  SampleSystem s(lattice_block(8, 4, 4, 1), 1);
  for (const Vec3& x : s.x) s.fixed.push_back(x.x() < 3);
  Question question(std::move(s), {}, 0.05);
  for (std::size_t i = 0; i < question.s.size(); ++i) question.v.push_back(question.s.fixed[i] ? Vec3(1, 0, 0) : Vec3(Vec3::Zero()));
  question.solve(1e-8);
  EXPECT_TRUE(question.result.converged);
  Real pushed = 0;
  for (std::size_t i = 0; i < question.s.size(); ++i) {
    if (question.s.fixed[i]) {
      EXPECT_EQ(question.v[i], Vec3(1, 0, 0));
    } else {
      pushed += question.v[i].x();
      EXPECT_LT(question.v[i].norm(), 1.5);
    }
  }
  EXPECT_GT(pushed, 0);
}

TEST(PressureSolver, ParticlesAloneAndNoParticlesAreLeftAlone) {
  Question question(SampleSystem({Vec3::Zero(), Vec3(10, 0, 0)}, 1), {Vec3(1, 2, 3), Vec3(-3, 0, 1)}, 0.01);
  question.q = {5, 0};
  question.solve();
  EXPECT_TRUE(question.result.converged);
  EXPECT_EQ(question.v[0], Vec3(1, 2, 3));
  EXPECT_EQ(question.q, (std::vector<Real>{0, 0})) << "nothing presses on them";
  Question nobody(SampleSystem({}, 1), {}, 0.01);
  nobody.solve();
  EXPECT_TRUE(nobody.result.converged);
}

TEST(PressureSolver, TwoParticlesAtOnePlaceDoNotUpsetIt) {
  std::vector<Vec3> x = lattice_block(4, 4, 4, 1, 0.1);
  x[5] = x[6];
  Question question(SampleSystem(x, 1), {}, 0.01);
  question.v = random_vectors(question.s.size(), 3);
  question.solve();
  EXPECT_TRUE(question.result.converged);
  for (const Vec3& v : question.v) EXPECT_TRUE(v.allFinite());
  expect_complementary(question, 1e-9);
}

}  // namespace
}  // namespace effuse::flow::sph
