#include "flow/reference/gravity_current.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/base/check.h"

namespace effuse::flow::reference {
namespace {

// phi and M at some y, or their rates.
using Shape = std::array<Real, 2>;

template <class Rates>
void runge_kutta_step(const Rates& rates, Real at, Real step, Shape& y) {
  const auto moved = [&y](const Shape& k, Real a) { return Shape{y[0] + a * k[0], y[1] + a * k[1]}; };
  const Shape k1 = rates(at, y), k2 = rates(at + step / 2, moved(k1, step / 2)), k3 = rates(at + step / 2, moved(k2, step / 2)),
              k4 = rates(at + step, moved(k3, step));
  for (std::size_t i = 0; i < 2; ++i) y[i] += step / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
}

constexpr int kStepsOuter = 2000, kStepsInner = 4000;
constexpr Real kStart = 1e-4;      // s = (1 - y)^(1/3) where the series of the front hands over
constexpr Real kInnermost = 1e-7;  // y; the volume within is added as a cylinder

Real power(Real base, Real exponent) { return std::pow(base, exponent); }

}  // namespace

GravityCurrent::GravityCurrent(Spread spread, Real alpha, Real q, Real nu) : spread_(spread), alpha_(alpha), q_(q), k_(kGravity / (3 * nu)) {
  CHECK_GT(q, 0);
  CHECK_GT(nu, 0);
  CHECK_GE(alpha, 0);
  const bool round = spread == Spread::kAxisymmetric;
  exponent_ = (3 * alpha + 1) / (round ? 8 : 5);
  const Real c = exponent_;
  const auto ring = [round](Real y) { return round ? y : 1; };
  const auto slope = [&](Real y, const Shape& f) { return -(c * y + alpha * f[1] / (ring(y) * f[0])) / (f[0] * f[0]); };

  // From the front to y = 1/2 in s = (1 - y)^(1/3), in which phi ~ (3 c)^(1/3) s is smooth.
  Shape f = {std::cbrt(3 * c) * kStart, 0};
  f[1] = 0.75 * f[0] * kStart * kStart * kStart;
  y_ = {1, 1 - kStart * kStart * kStart};
  phi_ = {0, f[0]};
  beyond_ = {0, f[1]};
  const Real s_end = std::cbrt(0.5), ds = (s_end - kStart) / kStepsOuter;
  const auto outer = [&](Real s, const Shape& v) {
    const Real y = 1 - s * s * s, dy_ds = -3 * s * s;
    return Shape{slope(y, v) * dy_ds, -ring(y) * v[0] * dy_ds};
  };
  for (int i = 0; i < kStepsOuter; ++i) {
    runge_kutta_step(outer, kStart + i * ds, ds, f);
    const Real s = kStart + (i + 1) * ds;
    y_.push_back(1 - s * s * s);
    phi_.push_back(f[0]);
    beyond_.push_back(f[1]);
  }
  // From there to the source in ln y: a point source's depth has a logarithm in it.
  const Real l_begin = std::log(0.5), dl = (std::log(kInnermost) - l_begin) / kStepsInner;
  const auto inner = [&](Real l, const Shape& v) {
    const Real y = std::exp(l);
    return Shape{slope(y, v) * y, -ring(y) * v[0] * y};
  };
  for (int i = 0; i < kStepsInner; ++i) {
    runge_kutta_step(inner, l_begin + i * dl, dl, f);
    y_.push_back(std::exp(l_begin + (i + 1) * dl));
    phi_.push_back(f[0]);
    beyond_.push_back(f[1]);
  }
  const Real volume = f[1] + phi_.back() * kInnermost * (round ? kInnermost / 2 : 1);
  for (Real& share : beyond_) share /= volume;
  eta_ = round ? power(2 * kPi * volume, -3.0 / 8) : power(volume, -3.0 / 5);
}

Real GravityCurrent::prefactor() const {
  return eta_ * power(k_ * q_ * q_ * q_, spread_ == Spread::kAxisymmetric ? 1.0 / 8 : 1.0 / 5);
}

Real GravityCurrent::front(Real t) const {
  CHECK_GE(t, 0);
  return prefactor() * power(t, exponent_);
}

Real GravityCurrent::depth(Real x, Real t) const {
  CHECK_GT(t, 0);
  CHECK_GE(x, 0);
  const Real y = std::max(x / front(t), y_.back());
  if (y >= 1) return 0;
  // y_ falls: the first entry not above y.
  const auto below = std::lower_bound(y_.begin(), y_.end(), y, [](Real a, Real b) { return a > b; });
  const auto i = static_cast<std::size_t>(below - y_.begin());
  // phi^3 is close to linear between the entries, at the front too.
  const Real a = power(phi_[i - 1], 3), b = power(phi_[i], 3), w = (y_[i - 1] - y) / (y_[i - 1] - y_[i]);
  const Real phi = std::cbrt(a + w * (b - a));
  const Real scale = spread_ == Spread::kAxisymmetric ? power(q_ / k_, 0.25) * power(t, (alpha_ - 1) / 4)
                                                      : power(q_ * q_ / k_, 0.2) * power(t, (2 * alpha_ - 1) / 5);
  return power(eta_, 2.0 / 3) * scale * phi;
}

Real GravityCurrent::volume(Real t) const { return q_ * power(t, alpha_); }

Real GravityCurrent::place(Real share) const {
  CHECK_GE(share, 0);
  CHECK_LE(share, 1);
  const Real beyond = 1 - share;
  const auto above = std::upper_bound(beyond_.begin(), beyond_.end(), beyond);
  if (above == beyond_.end()) return 0;
  const auto i = static_cast<std::size_t>(above - beyond_.begin());
  return y_[i - 1] + (y_[i] - y_[i - 1]) * (beyond - beyond_[i - 1]) / (beyond_[i] - beyond_[i - 1]);
}

Real PlanarSlopeCurrent::front(Real t) const {
  CHECK_GT(nu, 0);
  CHECK_GE(t, 0);
  return std::cbrt(9 * kGravity * std::sin(slope) * area * area / (4 * nu) * t);
}

Real PlanarSlopeCurrent::depth(Real x, Real t) const {
  CHECK_GT(t, 0);
  if (x < 0 || x > front(t)) return 0;
  return std::sqrt(nu * x / (kGravity * std::sin(slope) * t));
}

Real LineSourceOnSlope::front(Real t) const {
  CHECK_GT(nu, 0);
  return std::cbrt(flux * flux * kGravity * std::sin(slope) / (3 * nu)) * t;
}

Real LineSourceOnSlope::depth() const {
  CHECK_GT(slope, 0);
  return std::cbrt(3 * nu * flux / (kGravity * std::sin(slope)));
}

Real PointSourceOnSlope::front(Real t) const {
  CHECK_GT(nu, 0);
  CHECK_GT(flux, 0);
  const Real a = kGravity * std::sin(slope) / (3 * nu), b = kGravity * std::cos(slope) / (3 * nu);
  return 0.817 * power(power(flux, 4) * power(a, 5) / (b * b), 1.0 / 9) * power(t, 7.0 / 9);
}

Real PointSourceOnSlope::half_width(Real t) const {
  CHECK_GT(slope, 0);
  return 0.99 * std::cbrt(flux * t / std::tan(slope));
}

Real early_dam_break_front(Real length, Real depth, Real nu, Real t) {
  CHECK_GT(nu, 0);
  return length + 0.49242 * std::sqrt(kGravity / (3 * nu) * depth * depth * depth * t);
}

}  // namespace effuse::flow::reference
