#pragma once

#include <cmath>
#include <string_view>
#include <vector>

#include "geometry/base/types.h"

/// Smoothing kernels in three dimensions: W(r) [1/m^3], radial, integral 1, zero from `support` on.
///
/// second_moment() is  m2 = integral of x^2 W dV  [m^2], per axis. With it the mean-difference sum of
/// Stora et al. becomes a Laplacian in physical units:
///   sum_j V_j (f_j - f_i) W_ij  ->  (m2 / 2) lap f      (Taylor expansion; error of fourth order)
namespace effuse::flow::sph {

enum class KernelKind { kSpiky, kCubicSpline, kWendlandC2 };
inline constexpr std::string_view kKernelNames[] = {"spiky", "cubic_spline", "wendland_c2"};

/// W = 15/(pi s^6) (s - r)^3. Its slope does not vanish at r = 0, so particles that meet still repel.
/// Source: Desbrun & Gascuel 1996, the kernel of Stora et al. 1999.
struct SpikyKernel {
  explicit SpikyKernel(Real s) : support(s), norm_(15 / (kPi * std::pow(s, 6))) {}
  Real support;
  Real W(Real r) const {
    const Real q = support - r;
    return q > 0 ? norm_ * q * q * q : 0;
  }
  Real dW(Real r) const {
    const Real q = support - r;
    return q > 0 ? -3 * norm_ * q * q : 0;
  }
  Real second_moment() const { return support * support / 14; }

 private:
  Real norm_;
};

/// Cubic B-spline, support 2h. Source: Monaghan 1992.
struct CubicSpline {
  explicit CubicSpline(Real s) : support(s), norm_(8 / (kPi * s * s * s)) {}
  Real support;
  Real W(Real r) const {
    const Real q = r / support;
    if (q >= 1) return 0;
    const Real p = 1 - q;
    return norm_ * (q <= 0.5 ? 1 - 6 * q * q * p : 2 * p * p * p);
  }
  Real dW(Real r) const {
    const Real q = r / support;
    if (q >= 1) return 0;
    const Real p = 1 - q;
    return norm_ / support * (q <= 0.5 ? q * (18 * q - 12) : -6 * p * p);
  }
  Real second_moment() const { return 0.075 * support * support; }

 private:
  Real norm_;
};

/// Wendland's C2 function. Source: Wendland 1995; Dehnen & Aly 2012.
struct WendlandC2 {
  explicit WendlandC2(Real s) : support(s), norm_(21 / (2 * kPi * s * s * s)) {}
  Real support;
  Real W(Real r) const {
    const Real q = r / support;
    if (q >= 1) return 0;
    const Real p = (1 - q) * (1 - q);
    return norm_ * p * p * (1 + 4 * q);
  }
  Real dW(Real r) const {
    const Real q = r / support;
    if (q >= 1) return 0;
    const Real p = 1 - q;
    return -20 * norm_ / support * q * p * p * p;
  }
  Real second_moment() const { return support * support / 15; }

 private:
  Real norm_;
};

/// A kernel's integral over the half-space beyond a plane at distance d from the particle's centre:
///   gamma(d) = integral of W dV beyond the plane,  slope(d) = d gamma / d d = -(area integral of W).
/// What solid ground contributes to a particle's sums, for terrain and obstacles alike. Outside
/// [-support, support] gamma is 1 or 0. Tabulated by quadrature, linear between 512 nodes: 1e-5 of 1.
class HalfSpaceTable {
 public:
  template <class Kernel>
  explicit HalfSpaceTable(const Kernel& kernel) : support_(kernel.support), gamma_(kNodes + 1), slope_(kNodes + 1) {
    // area(z) = 2 pi int_z^s W(r) r dr, then gamma = int_d^s area dz; from the far end, Simpson's rule.
    const int fine = 16;
    const Real dz = support_ / (kNodes * fine);
    const auto ring = [&](Real r) { return 2 * kPi * kernel.W(r) * r; };
    Real area = 0, gamma = 0;
    for (int k = kNodes * fine; k-- > 0;) {
      const Real a = k * dz, b = a + dz, m = (a + b) / 2;
      const Real area_b = area, area_m = area + dz / 12 * (ring(m) + 4 * ring((m + b) / 2) + ring(b));
      area += dz / 6 * (ring(a) + 4 * ring(m) + ring(b));
      gamma += dz / 6 * (area + 4 * area_m + area_b);
      if (k % fine == 0) {
        gamma_[k / fine] = gamma;
        slope_[k / fine] = -area;
      }
    }
  }

  Real support() const { return support_; }
  Real gamma(Real d) const { return d < 0 ? 1 - lookup(gamma_, -d) : lookup(gamma_, d); }
  Real slope(Real d) const { return lookup(slope_, std::abs(d)); }

 private:
  static constexpr int kNodes = 512;
  Real lookup(const std::vector<Real>& table, Real d) const {
    const Real s = d / support_ * kNodes;
    if (s >= kNodes) return 0;
    const int k = static_cast<int>(s);
    return table[k] + (s - k) * (table[k + 1] - table[k]);
  }
  Real support_;
  std::vector<Real> gamma_, slope_;
};

}  // namespace effuse::flow::sph
