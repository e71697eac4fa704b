#include "flow/bodies/rotor.h"

#include <cmath>
#include <stdexcept>

#include "flow/integrate/integrate.h"
#include "geometry/base/check.h"
#include "geometry/motion/pose_track.h"

namespace effuse::flow::bodies {
namespace {

/// sin and cos of a small angle by their series, to rounding: what a substep turns by, many times a step.
void sine_cosine(Real x, Real& s, Real& c) {
  if (std::abs(x) > 0.25) {
    s = std::sin(x);
    c = std::cos(x);
    return;
  }
  const Real y = x * x;
  s = x * (1 - y / 6 * (1 - y / 20 * (1 - y / 42 * (1 - y / 72 * (1 - y / 110)))));
  c = 1 - y / 2 * (1 - y / 12 * (1 - y / 30 * (1 - y / 56 * (1 - y / 90 * (1 - y / 132)))));
}

/// The kinetic energy falls into b_k^2 / (2 I_k), k = 1..3, with b = R^T L in body axes; each alone turns the body about axis k at the
/// constant rate b_k / I_k, and b the other way. b is made from L anew in every step: the world's L does not change.
Quat split(Quat q, const Vec3& L, const Vec3& I, Real dt) {
  Vec3 b = q.conjugate() * L;
  const auto part = [&](int k, Real h) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    Real s, c;
    sine_cosine(h * b[k] / I[k] / 2, s, c);
    // q (c + s e_k)
    const Vec3 u = q.vec();
    const Real w = q.w();
    q.w() = c * w - s * u[k];
    q.vec()[k] = c * u[k] + s * w;
    q.vec()[i] = c * u[i] + s * u[j];
    q.vec()[j] = c * u[j] - s * u[i];
    const Real cc = 1 - 2 * s * s, ss = 2 * s * c, bi = b[i], bj = b[j];
    b[i] = cc * bi + ss * bj;
    b[j] = cc * bj - ss * bi;
  };
  part(0, dt / 2);
  part(1, dt / 2);
  part(2, dt);
  part(1, dt / 2);
  part(0, dt / 2);
  return q.normalized();
}

/// v = dt w(exp(v / 2) q): the turn of the step. F(v) = v - dt w(exp(v/2) q) = 0.
Quat midpoint(const Quat& q, const Vec3& L, const Vec3& I, Real dt) {
  const auto F = [&](const Vec3& v) { return Vec3(v - dt * angular_velocity(geometry::rotation_by(v / 2) * q, L, I)); };
  Vec3 v = dt * angular_velocity(q, L, I);
  Vec3 f = F(v);
  for (int k = 0; k < 50; ++k) {
    // Newton's, with a Jacobian by differences: three more evaluations, and no turn is too large for it to be tried.
    Mat3 J;
    const Real e = 1e-7 * (1 + v.norm());
    for (int c = 0; c < 3; ++c) J.col(c) = (F(v + e * Vec3::Unit(c)) - f) / e;
    const Vec3 change = J.partialPivLu().solve(f);
    v -= change;
    f = F(v);
    if (!(change.norm() > 1e-15 * (1 + v.norm()))) break;
  }
  return (geometry::rotation_by(v) * q).normalized();
}

struct Turn {
  Eigen::Vector4d q;  // x y z w
};
[[maybe_unused]] void add_scaled_velocities(Turn&, Real, const Turn&) {}
void add_scaled_positions(Turn& y, Real a, const Turn& k) { y.q += a * k.q; }

struct TurnRates {
  Vec3 L, I;
  void rates(Real, const Turn& y, Turn& k) const {
    const Quat q = Quat(y.q).normalized();
    const Vec3 w = angular_velocity(q, L, I);
    k.q = (Quat(0, w.x() / 2, w.y() / 2, w.z() / 2) * Quat(y.q)).coeffs();
  }
  void velocity_rates(Real, const Turn&, Turn& k) const { k.q.setZero(); }
  void position_rates(Real t, const Turn& y, Turn& k) const { rates(t, y, k); }
};

}  // namespace

Quat turn_freely(RotorScheme scheme, const Quat& q, const Vec3& L, const Vec3& moments, Real dt) {
  DCHECK(moments.minCoeff() > 0);
  switch (scheme) {
    case RotorScheme::kSplitting: return split(q, L, moments, dt);
    case RotorScheme::kMidpoint: return midpoint(q, L, moments, dt);
    case RotorScheme::kRk4: {
      Turn y{q.coeffs()};
      StepStorage<Turn> storage;
      integrate_step(Scheme::kRk4, TurnRates{L, moments}, 0, dt, y, storage);
      return Quat(y.q).normalized();
    }
    case RotorScheme::kSymplecticEuler: return (geometry::rotation_by(dt * angular_velocity(q, L, moments)) * q).normalized();
  }
  throw std::logic_error("turn_freely: no such scheme");
}

}  // namespace effuse::flow::bodies
