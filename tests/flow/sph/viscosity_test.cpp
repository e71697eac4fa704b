#include "flow/sph/viscosity.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "tests/flow/sph/sample_system.h"

namespace effuse::flow::sph {
namespace {

constexpr Real kRho = 2600;

std::vector<Real> contrast(std::size_t n, Real orders, std::uint64_t seed = 6) {
  std::vector<Real> mu(n);
  for (std::size_t i = 0; i < n; ++i) mu[i] = std::pow(10.0, orders * random_uniform(seed, 0, i));
  return mu;
}

SampleSystem sample(bool periodic, bool walls, Real jitter = 0.3) {
  const Real dx = 0.3;
  SampleSystem s(lattice_block(8, 8, 6, dx, jitter, 7), dx, 3);
  if (periodic) s.period = Vec2(8 * dx, 8 * dx);
  if (walls) s.solids = {plane_solid(Vec3::Zero(), Vec3::UnitZ(), Vec3(0.5, 0, 0)), plane_solid(Vec3(0, -0.1, 0), Vec3(0, 1, 0.3).normalized(), Vec3::Zero(), 1)};
  s.find();
  return s;
}

// ---- the operator ----

TEST(ViscousAcceleration, KeepsMomentumAndAngularMomentumAtAnyContrast) {
  for (const bool periodic : {false, true}) {
    const SampleSystem s = sample(periodic, false);
    const std::vector<Vec3> v = random_vectors(s.size(), 2);
    std::vector<Vec3> a(s.size());
    viscous_acceleration(s.system(), kRho, contrast(s.size(), 9), 0, v, a);
    Vec3 sum = Vec3::Zero(), turn = Vec3::Zero();
    Real size = 0, turn_size = 0;
    for (std::size_t i = 0; i < s.size(); ++i) {
      sum += a[i];
      size += a[i].norm();
      turn += s.x[i].cross(a[i]);
      turn_size += s.x[i].norm() * a[i].norm();
    }
    EXPECT_LT(sum.norm(), 1e-13 * size);
    if (!periodic) {
      EXPECT_LT(turn.norm(), 1e-13 * turn_size);
    }
  }
}

TEST(ViscousAcceleration, OfARigidMotionIsNothing) {
  const SampleSystem s = sample(false, false);
  std::vector<Vec3> v(s.size()), a(s.size()), random_a(s.size());
  for (std::size_t i = 0; i < s.size(); ++i) v[i] = Vec3(3, -1, 2) + Vec3(0.3, -0.5, 0.8).cross(s.x[i]);
  const std::vector<Real> mu = contrast(s.size(), 9);
  viscous_acceleration(s.system(), kRho, mu, 0, v, a);
  viscous_acceleration(s.system(), kRho, mu, 0, random_vectors(s.size(), 2), random_a);
  Real most = 0, size = 0;
  for (std::size_t i = 0; i < s.size(); ++i) {
    most = std::max(most, a[i].norm());
    size = std::max(size, random_a[i].norm());
  }
  EXPECT_LT(most, 1e-13 * size);
}

TEST(ViscousAcceleration, IsSymmetricAndTakesEnergyOnly) {
  const SampleSystem s = sample(true, false);
  const std::vector<Vec3> u = random_vectors(s.size(), 2), v = random_vectors(s.size(), 3);
  const std::vector<Real> mu = contrast(s.size(), 9);
  std::vector<Vec3> au(s.size()), av(s.size());
  viscous_acceleration(s.system(), kRho, mu, 0, u, au);
  viscous_acceleration(s.system(), kRho, mu, 0, v, av);
  Real left = 0, right = 0, size = 0, taken = 0;
  for (std::size_t i = 0; i < s.size(); ++i) {
    left += v[i].dot(au[i]);
    right += u[i].dot(av[i]);
    size += std::abs(v[i].dot(au[i]));
    taken -= u[i].dot(au[i]);
  }
  EXPECT_NEAR(left, right, 1e-13 * size);
  EXPECT_GT(taken, 0);
}

/// Error of the operator for parabolic shear in 40 directions: v = e (n . x)^2 / 2, of which lap v = e.
struct OperatorError {
  Real bias = 0, along = 0, rms = 0;  // of the part along e over nu, less 1: mean and rms; of the whole vector: rms
};
OperatorError shear_in_40_directions(Real supports, Real jitter) {
  const Real dx = 0.5, nu = 3;
  const int half = 4;  // inner particles see whole neighbourhoods
  SampleSystem s(lattice_block(2 * half + 3, 2 * half + 3, 2 * half + 3, dx, jitter), dx, supports);
  const Vec3 center = Vec3::Constant((half + 1.5) * dx);
  const std::vector<Real> mu(s.size(), kRho * nu);
  std::vector<Vec3> v(s.size()), a(s.size());
  OperatorError error;
  int count = 0;
  for (std::uint64_t k = 0; k < 40; ++k) {
    const std::vector<Vec3> draw = random_vectors(2, k);
    const Vec3 n = draw[0].normalized(), e = draw[1].cross(n).normalized();
    for (std::size_t i = 0; i < s.size(); ++i) v[i] = std::pow(n.dot(s.x[i] - center), 2) / 2 * e;
    viscous_acceleration(s.system(), kRho, mu, 0, v, a);
    for (std::size_t i = 0; i < s.size(); ++i) {
      // The operator is linear in x: a Galilean shift and a linear shear come on top away from the centre, and count nothing in truth.
      if ((s.x[i] - center).cwiseAbs().maxCoeff() > (jitter > 0 ? 1.7 : 0.5) * dx) continue;
      const Real along = a[i].dot(e) / nu - 1;
      error.bias += along;
      error.along += along * along;
      error.rms += (a[i] / nu - e).squaredNorm();
      ++count;
    }
  }
  error.bias /= count;
  error.rms = std::sqrt(error.rms / count);
  error.along = std::sqrt(error.along / count);
  return error;
}

TEST(ViscousAcceleration, IsRightForShearInAnyDirectionOnALatticeAndWithJitter) {
  // The docstring's figures; at the default support bias below 2 %, rms below 10 % with jitter are asked.
  struct Claim {
    Real supports, jitter, rms, along, bias;
  };
  for (const Claim& claim : {Claim{3, 0, 0.0125, 0.01, 0.01}, Claim{3, 0.1, 0.06, 0.035, 0.02}, Claim{2.6, 0, 0.05, 0.03, 0.02}, Claim{2.6, 0.1, 0.11, 0.07, 0.02},
                             Claim{2, 0, 0.175, 0.12, 0.09}, Claim{2, 0.1, 0.26, 0.17, 0.09}}) {
    const OperatorError error = shear_in_40_directions(claim.supports, claim.jitter);
    EXPECT_LT(error.rms, claim.rms) << claim.supports << " spacings, jitter " << claim.jitter;
    EXPECT_LT(error.along, claim.along) << claim.supports << " spacings, jitter " << claim.jitter;
    EXPECT_LT(std::abs(error.bias), claim.bias) << claim.supports << " spacings, jitter " << claim.jitter;
  }
}

TEST(ViscousAcceleration, LinearShearOverAWallIsInEquilibrium) {
  // Layers on a lattice, deep fluid, no slip and slip. The force of each half is nu * shear / dx times some number near 1: what is left
  // must be small against that, and its sum over the layers (the stress that the wall feels) right.
  const Real dx = 0.5, nu = 3, shear = 2;
  for (const Real supports : {3.0, 2.6}) {
    for (const Real slip : {0.0, 0.8}) {
      SampleSystem s(lattice_block(8, 8, 8, dx), dx, supports);
      s.period = Vec2(4, 4);
      s.solids = {plane_solid(Vec3::Zero(), Vec3::UnitZ())};
      s.find();
      std::vector<Vec3> v(s.size()), a(s.size());
      for (std::size_t i = 0; i < s.size(); ++i) v[i] = Vec3(shear * (s.x[i].z() + slip), 0, 0);
      const std::vector<Real> mu(s.size(), kRho * nu);
      viscous_acceleration(s.system(), kRho, mu, slip, v, a);
      Real wall = 0;
      for (std::size_t i = 0; i < s.size(); ++i) {
        if (s.x[i].z() > 8 * dx - s.support) continue;  // the free surface pulls
        wall += a[i].x() * dx / 64;
        EXPECT_LT(a[i].norm(), 0.1 * nu * shear / dx) << "z " << s.x[i].z() << " support " << supports << " slip " << slip;
      }
      // At 2.6 the lattice above the cut is too stiff by 3 %, the wall is not.
      EXPECT_NEAR(wall, 0, (supports == 3 ? 0.01 : 0.035) * nu * shear) << "support " << supports << " slip " << slip;
    }
  }
}

// ---- the solver ----

/// |b - A v| over |b| in the norm of the inverse diagonal blocks, or as they are, whichever is larger; from viscous_acceleration
/// alone.
Real true_residual(const SampleSystem& s, std::span<const Real> mu, Real slip, Real dt, std::span<const Vec3> v0, std::span<const Vec3> v) {
  const std::size_t n = s.size();
  const auto apply = [&](std::span<const Vec3> in) {
    std::vector<Vec3> out(n);
    viscous_acceleration(s.system(), kRho, mu, slip, in, out);
    for (std::size_t i = 0; i < n; ++i) out[i] = in[i] - dt * out[i];
    return out;
  };
  const std::vector<Vec3> zero = apply(std::vector<Vec3>(n, Vec3::Zero()));  // minus what the moving walls do
  const std::vector<Vec3> Av = apply(v);
  Real r2 = 0, b2 = 0, plain_r2 = 0, plain_b2 = 0;
  for (std::size_t i = 0; i < n; ++i) {
    if (!s.fixed.empty() && s.fixed[i]) continue;
    Mat3 block;
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<Vec3> unit(n, Vec3::Zero());
      unit[i][axis] = 1;
      block.col(axis) = apply(unit)[i] - zero[i];
    }
    const Mat3 inverse = block.inverse();
    const Vec3 b = v0[i] - zero[i], r = v0[i] - Av[i];
    r2 += r.dot(inverse * r);
    b2 += b.dot(inverse * b);
    plain_r2 += r.squaredNorm();
    plain_b2 += b.squaredNorm();
  }
  return std::sqrt(std::max(r2 / b2, plain_r2 / plain_b2));
}

TEST(ViscositySolver, TheResidualIsWhatItSays) {
  SampleSystem s(lattice_block(5, 5, 4, 0.3, 0.2), 0.3);
  s.solids = {plane_solid(Vec3::Zero(), Vec3::UnitZ(), Vec3(2, 0, 0))};
  s.find();
  const std::vector<Vec3> v0 = random_vectors(s.size(), 2);
  const std::vector<Real> mu = contrast(s.size(), 4);
  for (const Real tolerance : {1e-2, 1e-4, 1e-8}) {
    ViscositySolver solver;
    std::vector<Vec3> v = v0;
    const ViscosityResult result = solver.solve(s.system(), kRho, mu, 0.1, 0.05, v0, tolerance, 1000, v);
    EXPECT_TRUE(result.converged);
    EXPECT_LE(result.residual, tolerance);
    EXPECT_NEAR(true_residual(s, mu, 0.1, 0.05, v0, v), result.residual, 1e-3 * result.residual + 1e-13);
  }
  // Cut short, it says so.
  ViscositySolver solver;
  std::vector<Vec3> v = v0;
  const ViscosityResult result = solver.solve(s.system(), kRho, mu, 0.1, 0.05, v0, 1e-8, 3, v);
  EXPECT_FALSE(result.converged);
  EXPECT_EQ(result.iterations, 3);
  EXPECT_NEAR(true_residual(s, mu, 0.1, 0.05, v0, v), result.residual, 1e-3 * result.residual);
}

TEST(ViscositySolver, WarmStartWithTheSolutionHasNothingToDo) {
  const SampleSystem s = sample(true, true);
  const std::vector<Vec3> v0 = random_vectors(s.size(), 2);
  const std::vector<Real> mu = contrast(s.size(), 4);
  ViscositySolver solver;
  std::vector<Vec3> v = v0;
  ASSERT_TRUE(solver.solve(s.system(), kRho, mu, 0, 0.05, v0, 1e-10, 1000, v).converged);
  EXPECT_EQ(solver.solve(s.system(), kRho, mu, 0, 0.05, v0, 1e-9, 1000, v).iterations, 0);
}

TEST(ViscositySolver, OneParticleIsBrakedAsTheFormulaSays) {
  const Real dx = 0.5, mu = 1e4, dt = 0.3, slip = 0.2, d = 0.31;
  SampleSystem s({Vec3(1, 2, d)}, dx);
  const Vec3 wall_speed(0.4, -0.3, 0.1);
  s.solids = {plane_solid(Vec3::Zero(), Vec3::UnitZ(), wall_speed)};
  s.find();
  s.walls.walls[0].friction = 1.7;
  const Vec3 v0(3, -2, -1);
  std::vector<Vec3> v{v0};
  ViscositySolver solver;
  ASSERT_TRUE(solver.solve(s.system(), kRho, std::vector<Real>{mu}, slip, dt, std::vector<Vec3>{v0}, 1e-14, 10, v).converged);
  const BoundaryTable::Row row = s.table.at(d);
  const Real along = 1 / (1 + dt * mu / kRho * 1.7 * row.drag_t / (d + slip)), across = 1 / (1 + dt * mu / kRho * row.drag_n / d);
  const Vec3 expected = wall_speed + (v0 - wall_speed).cwiseProduct(Vec3(along, along, across));
  EXPECT_LT((v[0] - expected).norm(), 1e-12);

  // Infinite slip: no drag along.
  v = {v0};
  solver.solve(s.system(), kRho, std::vector<Real>{mu}, std::numeric_limits<Real>::infinity(), dt, std::vector<Vec3>{v0}, 1e-14, 10, v);
  EXPECT_NEAR(v[0].x(), v0.x(), 1e-12);
  EXPECT_NEAR(v[0].z(), expected.z(), 1e-12);
}

TEST(ViscositySolver, TwoParticlesExchangeMomentumAsTheFormulaSays) {
  // Approaching along their line: with c = dt 2 V mu_12 w r^2 / rho and u their relative speed, u -> u / (1 + c) of the harmonic mean.
  const Real dx = 0.5, r = 0.6, dt = 0.3, mu1 = 10, mu2 = 1e5;
  SampleSystem s({Vec3::Zero(), Vec3(r, 0, 0)}, dx);
  const std::vector<Vec3> v0{Vec3(1, 0.5, 0), Vec3(-1, 0.5, 0)};
  std::vector<Vec3> v = v0;
  ViscositySolver solver;
  ASSERT_TRUE(solver.solve(s.system(), kRho, std::vector<Real>{mu1, mu2}, 0, dt, v0, 1e-14, 10, v).converged);
  const Real mean = 2 * mu1 * mu2 / (mu1 + mu2), c = 2 * dt / kRho * s.volume() * mean * ViscousWeight(s.support)(r * r) * r * r;
  EXPECT_NEAR(v[0].x() - v[1].x(), 2 / (1 + c), 1e-12);
  EXPECT_NEAR(v[0].y(), 0.5, 1e-14) << "sideways nothing";
}

/// Cold lava beside hot lava: a column of each, and a plane cut through touching particles.
struct Contrast {
  SampleSystem s;
  std::vector<Real> mu;
};
Contrast touching(Real ratio, bool mixed) {
  SampleSystem s(lattice_block(8, 8, 8, 0.3, 0.2), 0.3);
  std::vector<Real> mu(s.size());
  for (std::size_t i = 0; i < s.size(); ++i) mu[i] = (mixed ? random_uniform(3, 0, i) < 0.5 : s.x[i].x() < 1.2) ? 100 * ratio : 100;
  return {std::move(s), std::move(mu)};
}

TEST(ViscositySolver, ConvergesAtAContrastOfOneToABillionKeepsMomentumAndStaysBounded) {
  for (const bool mixed : {false, true}) {
    const Contrast c = touching(1e9, mixed);
    const std::vector<Vec3> v0 = random_vectors(c.s.size(), 2);
    std::vector<Vec3> v = v0;
    ViscositySolver solver;
    const Real tolerance = 1e-4;  // the default
    const ViscosityResult result = solver.solve(c.s.system(), kRho, c.mu, 0, 0.1, v0, tolerance, 1000, v);
    EXPECT_TRUE(result.converged) << result.iterations << " iterations, residual " << result.residual;
    Vec3 momentum = Vec3::Zero();
    Real size = 0, energy0 = 0, energy = 0, fastest0 = 0, fastest = 0;
    for (std::size_t i = 0; i < v.size(); ++i) {
      momentum += v[i] - v0[i];
      size += v0[i].norm();
      energy0 += v0[i].squaredNorm();
      energy += v[i].squaredNorm();
      fastest0 = std::max(fastest0, v0[i].norm());
      fastest = std::max(fastest, v[i].norm());
    }
    EXPECT_LT(momentum.norm(), 2 * tolerance * size);
    EXPECT_LT(energy, energy0);
    EXPECT_LE(fastest, fastest0);
  }
}

TEST(ViscositySolver, ColdLavaMovesAsARigidBody) {
  // What no tolerance on the residual alone promises: within the cold half nothing is left of the shear.
  const Contrast c = touching(1e9, false);
  std::vector<Vec3> v0(c.s.size());
  for (std::size_t i = 0; i < v0.size(); ++i) v0[i] = Vec3(c.s.x[i].z(), 0, 0);
  std::vector<Vec3> v = v0;
  ViscositySolver solver;
  ASSERT_TRUE(solver.solve(c.s.system(), kRho, c.mu, 0, 0.1, v0, 1e-6, 1000, v).converged);
  // Strain rate of the cold part, relative to the start's: (v_ij . x_ij) / r^2.
  Real most = 0;
  for (std::size_t i = 0; i < c.s.size(); ++i)
    for (const Index j : c.s.neighbors[i]) {
      if (c.mu[i] < 1e3 || c.mu[j] < 1e3) continue;
      const Vec3 d = c.s.x[i] - c.s.x[j];
      most = std::max(most, std::abs((v[i] - v[j]).dot(d)) / d.squaredNorm());
    }
  EXPECT_LT(most, 1e-3) << "against 1/s";
}

TEST(ViscositySolver, AStepOfAMillionSecondsIsAHarmlessOne) {
  // Nothing left but rigid motion; over a wall, nothing at all.
  for (const bool walls : {false, true}) {
    SampleSystem s(lattice_block(6, 6, 6, 0.3, 0.2), 0.3);
    if (walls) s.solids = {plane_solid(Vec3::Zero(), Vec3::UnitZ())};
    s.find();
    const std::vector<Vec3> v0 = random_vectors(s.size(), 2);
    std::vector<Vec3> v = v0;
    ViscositySolver solver;
    const ViscosityResult result = solver.solve(s.system(), kRho, std::vector<Real>(s.size(), 1e4), 0, 1e6, v0, 1e-4, 1000, v);
    EXPECT_TRUE(result.converged);
    Real fastest = 0;
    for (const Vec3& u : v) fastest = std::max(fastest, u.norm());
    EXPECT_LT(fastest, walls ? 1e-3 : 1);
  }
}

TEST(ViscositySolver, FixedParticlesKeepTheirVelocityAndDragOthersAlong) {
  SampleSystem s(lattice_block(6, 6, 6, 0.3, 0.2), 0.3);
  for (const Vec3& x : s.x) s.fixed.push_back(x.z() < 0.6);
  s.find();
  const Vec3 drive(0.7, -0.2, 0);
  std::vector<Vec3> v0(s.size(), Vec3::Zero()), v(s.size(), Vec3::Zero());
  for (std::size_t i = 0; i < s.size(); ++i)
    if (s.fixed[i]) v0[i] = v[i] = drive;
  ViscositySolver solver;
  const std::vector<Real> mu(s.size(), 1e6);
  const ViscosityResult result = solver.solve(s.system(), kRho, mu, 0, 1e4, v0, 1e-8, 1000, v);
  EXPECT_TRUE(result.converged);
  for (std::size_t i = 0; i < s.size(); ++i) {
    if (s.fixed[i]) EXPECT_EQ(v[i], drive);
    else EXPECT_LT((v[i] - drive).norm(), 1e-3) << "after ten thousand seconds they go along";
  }
}

TEST(ViscositySolver, AllFixedOrNobodyIsDoneAtOnce) {
  SampleSystem s(lattice_block(3, 3, 3, 0.3), 0.3);
  s.fixed.assign(s.size(), 1);
  std::vector<Vec3> v = random_vectors(s.size(), 2);
  const std::vector<Vec3> before = v;
  ViscositySolver solver;
  EXPECT_TRUE(solver.solve(s.system(), kRho, std::vector<Real>(s.size(), 10), 0, 1, before, 1e-6, 100, v).converged);
  EXPECT_EQ(v, before);
  SampleSystem nobody({}, 0.3);
  std::vector<Vec3> none;
  EXPECT_TRUE(solver.solve(nobody.system(), kRho, {}, 0, 1, none, 1e-6, 100, none).converged);
}

TEST(ViscositySolver, AtRestNothingIsDone) {
  const SampleSystem s = sample(false, false);
  const std::vector<Vec3> zero(s.size(), Vec3::Zero());
  std::vector<Vec3> v = zero;
  ViscositySolver solver;
  const ViscosityResult result = solver.solve(s.system(), kRho, contrast(s.size(), 9), 0, 1, zero, 1e-6, 100, v);
  EXPECT_TRUE(result.converged);
  EXPECT_EQ(result.iterations, 0);
  EXPECT_EQ(v, zero);
}

}  // namespace
}  // namespace effuse::flow::sph
