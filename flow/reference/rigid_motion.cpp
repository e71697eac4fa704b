#include "flow/reference/rigid_motion.h"

#include <array>
#include <cmath>

#include "geometry/base/check.h"

namespace effuse::flow::reference {

JacobiElliptic jacobi_elliptic(Real u, Real m) {
  CHECK(m >= 0 && m < 1);
  // a, c of the arithmetic-geometric mean; c falls quadratically: sixteen are plenty for any double below 1.
  constexpr int kMost = 16;
  std::array<Real, kMost + 1> a{}, c{};
  a[0] = 1;
  c[0] = std::sqrt(m);
  Real b = std::sqrt(1 - m);
  int n = 0;
  while (n < kMost && std::abs(c[n]) > 1e-16 * a[n]) {
    a[n + 1] = (a[n] + b) / 2;
    c[n + 1] = (a[n] - b) / 2;
    b = std::sqrt(a[n] * b);
    ++n;
  }
  Real phi = std::ldexp(a[n] * u, n);
  for (; n > 0; --n) phi = (phi + std::asin(c[n] / a[n] * std::sin(phi))) / 2;
  const Real sn = std::sin(phi);
  return {sn, std::cos(phi), std::sqrt(1 - m * sn * sn)};
}

Real Pendulum::period() const {
  CHECK(omega0 > 0 && amplitude > 0 && amplitude < kPi);
  return 4 * std::comp_ellint_1(std::sin(amplitude / 2)) / omega0;
}

Real Pendulum::angle(Real t) const {
  CHECK(omega0 > 0 && amplitude > 0 && amplitude < kPi);
  const Real k = std::sin(amplitude / 2);
  return 2 * std::asin(k * jacobi_elliptic(std::comp_ellint_1(k) - omega0 * t, k * k).sn);
}

Real FreeTop::energy() const { return moments.dot(spin0.cwiseAbs2()) / 2; }
Real FreeTop::momentum() const { return moments.cwiseProduct(spin0).norm(); }

namespace {

/// Amplitudes about the axes (low, middle, high), where low and high are told apart by which of them carries dn.
struct Ellipse {
  int with_cn, with_dn;
  Real cn, sn, dn;  // amplitudes
  Real rate, m;     // tau = rate t, parameter
};

Ellipse ellipse(const FreeTop& top) {
  const Vec3& I = top.moments;
  CHECK(0 < I[0] && I[0] < I[1] && I[1] < I[2]);
  const Real e2 = 2 * top.energy(), m2 = top.momentum() * top.momentum();
  const bool around_high = m2 >= e2 * I[1];
  const int c = around_high ? 0 : 2, d = around_high ? 2 : 0;
  const Real of_c = (e2 * I[d] - m2) / (I[d] - I[c]), of_d = (m2 - e2 * I[c]) / (I[d] - I[c]);
  Ellipse e;
  e.with_cn = c;
  e.with_dn = d;
  e.cn = std::sqrt(std::max(Real{0}, of_c / I[c]));
  e.sn = std::sqrt(std::max(Real{0}, (e2 * I[d] - m2) / (I[1] * (I[d] - I[1]))));
  e.dn = std::sqrt(std::max(Real{0}, of_d / I[d]));
  e.rate = std::sqrt((I[d] - I[1]) * (m2 - e2 * I[c]) / (I[0] * I[1] * I[2]));
  e.m = (I[1] - I[c]) * (e2 * I[d] - m2) / ((I[d] - I[1]) * (m2 - e2 * I[c]));
  CHECK(e.m < 1);  // the separatrix itself has no period
  return e;
}

}  // namespace

Vec3 FreeTop::spin(Real t) const {
  const Ellipse e = ellipse(*this);
  if (e.sn == 0) return spin0;  // about one axis
  // A half turn about the middle axis makes the component with dn positive.
  const Real side = spin0[e.with_dn] < 0 ? -1 : 1;
  const Real phi = std::atan2(spin0[1] / e.sn, side * spin0[e.with_cn] / e.cn);
  const JacobiElliptic j = jacobi_elliptic(std::ellint_1(std::sqrt(e.m), phi) + e.rate * t, e.m);
  Vec3 w;
  w[e.with_cn] = side * e.cn * j.cn;
  w[1] = e.sn * j.sn;
  w[e.with_dn] = side * e.dn * j.dn;
  return w;
}

Real FreeTop::period() const {
  const Ellipse e = ellipse(*this);
  return 4 * std::comp_ellint_1(std::sqrt(e.m)) / e.rate;
}

}  // namespace effuse::flow::reference
