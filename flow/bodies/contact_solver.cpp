#include "flow/bodies/contact_solver.h"

#include <algorithm>
#include <cmath>

#include "flow/bodies/rigid_bodies.h"
#include "geometry/base/check.h"

namespace effuse::flow::bodies {
namespace {

/// Two unit vectors that make a right-handed frame with n.
void tangents(const Vec3& n, Vec3& t1, Vec3& t2) {
  t1 = n.cross(std::abs(n.x()) < 0.6 ? Vec3::UnitX() : Vec3::UnitY()).normalized();
  t2 = n.cross(t1);
}

}  // namespace

ContactSolver::ContactSolver(const Options& options, std::span<ContactPoint> points, std::span<const PairSurface> surfaces, std::span<SolverBody> bodies)
    : options_(options), points_(points), bodies_(bodies), places_(points.size()) {
  DCHECK(surfaces.size() == points.size());
  // The soft constraint as a damped oscillator of the reduced mass, integrated implicitly.
  const Real omega = 2 * kPi * 0.25 / options.h, zeta = 10;
  const Real a1 = 2 * zeta + options.h * omega, a2 = options.h * omega * a1;
  bias_rate_ = omega / a1;
  mass_scale_ = a2 / (1 + a2);
  impulse_scale_ = 1 / (1 + a2);

  const Index ground = static_cast<Index>(bodies.size() - 1);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const ContactPoint& p = points[i];
    Place& c = places_[i];
    c.a = p.a;
    c.b = p.b == kTerrain ? ground : p.b;
    c.on_a = p.on_a;
    c.on_b = p.on_b;
    c.n = p.normal;
    c.of_a = p.of_a;
    tangents(c.n, c.t1, c.t2);
    c.friction = surfaces[i].friction;
    c.restitution = surfaces[i].restitution;
    c.rolling = surfaces[i].rolling;
    c.push = p.push;
    c.drag1 = p.drag.dot(c.t1);
    c.drag2 = p.drag.dot(c.t2);
    c.twist = p.twist;
  }
}

void ContactSolver::prepare(int k) {
  for (Place& c : places_) {
    const SolverBody &A = bodies_[c.a], &B = bodies_[c.b];
    const Vec3 pa = A.place(c.on_a, k), pb = B.place(c.on_b, k);
    c.separation = c.n.dot(pb - pa);
    // Both impulses act at one point: no angular momentum comes from nowhere.
    const Vec3 at = c.of_a * pa + (1 - c.of_a) * pb;
    c.ra = at - A.centre(k);
    c.rb = at - B.centre(k);
    const Real im = A.im + B.im;
    const Vec3 an = c.ra.cross(c.n), a1 = c.ra.cross(c.t1), a2 = c.ra.cross(c.t2);
    const Vec3 bn = c.rb.cross(c.n), b1 = c.rb.cross(c.t1), b2 = c.rb.cross(c.t2);
    const Vec3 Aa1 = A.iI * a1, Bb1 = B.iI * b1;
    const Vec3 Aan = A.iI * an, Bbn = B.iI * bn;
    c.mass = 1 / (im + an.dot(Aan) + bn.dot(Bbn));
    c.n1 = a1.dot(Aan) + b1.dot(Bbn);
    c.n2 = a2.dot(Aan) + b2.dot(Bbn);
    const Real k11 = im + a1.dot(Aa1) + b1.dot(Bb1), k12 = a2.dot(Aa1) + b2.dot(Bb1);
    const Real k22 = im + a2.dot(A.iI * a2) + b2.dot(B.iI * b2), det = k11 * k22 - k12 * k12;
    c.t11 = k22 / det;
    c.t12 = -k12 / det;
    c.t22 = k11 / det;
    c.slide = 1 / ((k11 + k22) / 2 + std::sqrt((k11 - k22) * (k11 - k22) / 4 + k12 * k12));
    if (c.rolling > 0) c.twist_mass = (A.iI + B.iI).inverse();
    if (c.fresh) {
      c.approach = c.n.dot(relative_velocity(c));
      c.fresh = false;
    }
  }
}

void ContactSolver::warm_start() {
  for (Place& c : places_) {
    apply(c, c.push * c.n + c.drag1 * c.t1 + c.drag2 * c.t2);
    if (c.rolling > 0) {
      bodies_[c.a].twist(-c.twist);
      bodies_[c.b].twist(c.twist);
    }
  }
}

/// What stops the sliding (v1, v2), as far as the cone lets: |drag| <= mu push.
Vec2 ContactSolver::friction(const Place& c, Real v1, Real v2) const {
  Vec2 drag(c.drag1 - (c.t11 * v1 + c.t12 * v2), c.drag2 - (c.t12 * v1 + c.t22 * v2));
  const Real most = c.friction * c.push;
  if (drag.squaredNorm() > most * most) {
    // It slides: along -v, which the block's own answer, cut short, is not. The fixed point of d = cut(d - s v) is.
    drag = Vec2(c.drag1 - c.slide * v1, c.drag2 - c.slide * v2);
    const Real length = drag.norm();
    if (length > most) drag *= most / length;
  }
  return drag;
}

void ContactSolver::rub(Place& c) {
  const Vec3 v = relative_velocity(c);
  const Vec2 drag = friction(c, c.t1.dot(v), c.t2.dot(v));
  apply(c, (drag[0] - c.drag1) * c.t1 + (drag[1] - c.drag2) * c.t2);
  c.drag1 = drag[0];
  c.drag2 = drag[1];
}

/// Stops rolling and spinning, as far as the arm lets: |twist| <= rolling push.
void ContactSolver::roll(Place& c) {
  SolverBody &A = bodies_[c.a], &B = bodies_[c.b];
  Vec3 twist = c.twist - c.twist_mass * (B.w - A.w);
  const Real most = c.rolling * c.push, length = twist.norm();
  if (length > most) twist *= most / length;
  A.twist(c.twist - twist);
  B.twist(twist - c.twist);
  c.twist = twist;
}

void ContactSolver::solve(bool push) {
  for (Place& c : places_) {
    if (c.rolling > 0) roll(c);
    const Vec3 v = relative_velocity(c);
    Vec3 P = Vec3::Zero();
    Real vn = c.n.dot(v);
    if (c.friction > 0) {
      const Vec2 drag = friction(c, c.t1.dot(v), c.t2.dot(v));
      const Real d1 = drag[0] - c.drag1, d2 = drag[1] - c.drag2;
      P = d1 * c.t1 + d2 * c.t2;
      vn += c.n1 * d1 + c.n2 * d2;
      c.drag1 = drag[0];
      c.drag2 = drag[1];
    }
    Real bias = 0, scale = 1, soft = 0;
    if (c.separation > 0) {
      bias = c.separation / options_.h;  // it may close the gap, no more
    } else if (push) {
      bias = std::max(bias_rate_ * c.separation, -options_.push_speed);
      scale = mass_scale_;
      soft = impulse_scale_;
    }
    const Real total = std::max(Real{0}, c.push - c.mass * scale * (vn + bias) - soft * c.push);
    apply(c, P + (total - c.push) * c.n);
    c.push = total;
    c.most = std::max(c.most, total);
  }
}

void ContactSolver::penalty() {
  const Real omega = 2 * kPi * options_.penalty_frequency, h = options_.h;
  // All by the same speeds: a damper that saw what the spring beside it has just done would carry a share of the rest.
  for (Place& c : places_) {
    const Real force = c.separation < 0 ? -c.mass * (omega * omega * c.separation + 2 * options_.penalty_damping * omega * c.n.dot(relative_velocity(c))) : 0;
    c.push = h * std::max(Real{0}, force);
    c.most = std::max(c.most, c.push);
  }
  // Friction begins with what it was, within the new cone.
  for (Place& c : places_) {
    const Real drag = std::hypot(c.drag1, c.drag2), twist = c.twist.norm();
    const Real keep = drag > c.friction * c.push ? c.friction * c.push / drag : 1;
    c.drag1 *= keep;
    c.drag2 *= keep;
    if (twist > c.rolling * c.push) c.twist *= c.rolling * c.push / twist;
    if (c.push == 0) continue;
    apply(c, c.push * c.n + c.drag1 * c.t1 + c.drag2 * c.t2);
    if (c.rolling > 0) {
      bodies_[c.a].twist(-c.twist);
      bodies_[c.b].twist(c.twist);
    }
  }
}

void ContactSolver::rub_all() {
  for (Place& c : places_) {
    if (c.push == 0) continue;
    if (c.rolling > 0) roll(c);
    if (c.friction > 0) rub(c);
  }
}

void ContactSolver::rebound() {
  for (Place& c : places_) {
    if (c.restitution == 0 || c.approach > -options_.restitution_speed || c.most == 0) continue;
    const Real vn = c.n.dot(relative_velocity(c));
    const Real total = std::max(Real{0}, c.push - c.mass * (vn + c.restitution * c.approach));
    apply(c, (total - c.push) * c.n);
    c.push = total;
  }
}

void ContactSolver::book(std::span<const std::uint8_t> wanted, int substep, std::vector<ContactLoad>& out) const {
  for (const Place& c : places_) {
    if (c.push == 0 && c.drag1 == 0 && c.drag2 == 0) continue;
    const Vec3 P = c.push * c.n + c.drag1 * c.t1 + c.drag2 * c.t2;
    for (const bool first : {true, false}) {
      const Index i = first ? c.a : c.b;
      if (i >= wanted.size() || !wanted[i]) continue;
      const Mat3 to_body = bodies_[i].q.conjugate().toRotationMatrix();
      out.push_back({i, substep, to_body * (first ? c.ra : c.rb), to_body * (first ? Vec3(-P) : P)});
    }
  }
}

Real ContactSolver::finish() {
  Real deepest = 0;
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const Place& c = places_[i];
    points_[i].push = c.push;
    points_[i].drag = c.drag1 * c.t1 + c.drag2 * c.t2;
    points_[i].twist = c.twist;
    deepest = std::max(deepest, -c.separation);
  }
  return deepest;
}

}  // namespace effuse::flow::bodies
