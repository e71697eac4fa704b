#pragma once

#include <vector>

#include "geometry/base/types.h"

/// How far a viscous fluid spreads under its own weight: similarity solutions of the thin-film (lubrication) equation
///
///   h_t + A (h^3)_x = B div(h^3 grad h),    A = g sin(theta) / (3 nu),  B = g cos(theta) / (3 nu)
///
/// h depth at right angles to the ground [m], x down the slope. Valid for flows much longer than deep, without inertia and surface tension.
namespace effuse::flow::reference {

/// On level ground: a line source (planar, half-space x >= 0) or a point source (axisymmetric).
enum class Spread { kPlanar, kAxisymmetric };

/// A current on level ground whose volume is q t^alpha (alpha = 0: released at once; 1: constant flux).
///
///   planar         x_N = eta_N (K q^3)^(1/5) t^((3 alpha + 1) / 5)     q volume per width  [m^2 / s^alpha]
///   axisymmetric   r_N = eta_N (K q^3)^(1/8) t^((3 alpha + 1) / 8)     q volume            [m^3 / s^alpha]
///   K = g / (3 nu);  h = eta_N^(2/3) (q^2 / K)^(1/5) t^((2 alpha - 1) / 5) phi(x / x_N), and in the round
///                    h = eta_N^(2/3) (q / K)^(1/4) t^((alpha - 1) / 4) phi(r / r_N)
///
/// eta_N and phi come from the equation of similarity, integrated once and from the front inwards with Runge-Kutta's fourth order:
///   phi^2 phi' = -(c y + alpha M / (y^n phi)),  M' = -y^n phi,  phi(1) = M(1) = 0,   n = 0 or 1, c the exponent of t,
/// M y the volume between y and the front. Accurate to 1e-8 in eta_N. The round current with alpha > 0 is infinitely deep at r = 0, as
/// (ln 1/r)^(1/4).
/// Source: Huppert 1982, J. Fluid Mech. 121, 43-58.
class GravityCurrent {
 public:
  /// Positive q and nu, alpha >= 0 (checked).
  GravityCurrent(Spread spread, Real alpha, Real q, Real nu);

  Real eta() const { return eta_; }            ///< eta_N, a pure number
  Real exponent() const { return exponent_; }  ///< of time in front()
  Real prefactor() const;                      ///< front(1 s) [m]
  Real front(Real t) const;                    ///< x_N or r_N [m]
  Real depth(Real x, Real t) const;            ///< h at x or r >= 0 [m]; 0 beyond the front
  Real volume(Real t) const;                   ///< q t^alpha [m^2] or [m^3]
  Real place(Real share) const;                ///< x / x_N or r / r_N within which that share (0 to 1) of the volume lies

 private:
  Spread spread_;
  Real alpha_, q_, k_;
  Real eta_ = 0, exponent_ = 0;
  std::vector<Real> y_, phi_, beyond_;  ///< the shape, from the front (y = 1) inwards; share of the volume between y and the front
};

/// A line of fluid released on a slope, long after: depth as the root of the distance behind a sudden front.
///
///   x_N = (9 g sin(theta) A0^2 / (4 nu))^(1/3) t^(1/3),   h = sqrt(nu x / (g sin(theta) t)) for 0 < x < x_N
/// Source: Huppert 1982, Nature 300, 427-429.
struct PlanarSlopeCurrent {
  Real area = 1;   ///< A0, volume per width [m^2]
  Real slope = 0;  ///< theta [rad]
  Real nu = 1;     ///< [m^2/s]

  Real front(Real t) const;          ///< [m]
  Real depth(Real x, Real t) const;  ///< [m]
};

/// A steady source on a slope, long after. Line source: exact. Point source: Lister's scalings, whose constants c_x = 0.817 +- 0.005 and
/// c_y = 0.99 +- 0.01 are fitted to numerical solutions of the long-time equation.
///
///   line source    x_N = (q^2 g sin(theta) / (3 nu))^(1/3) t,   h = (3 nu q / (g sin(theta)))^(1/3)
///   point source   x_N = c_x (Q^4 A^5 / B^2)^(1/9) t^(7/9),     y_N = c_y (Q t cot(theta))^(1/3)
/// Source: Lister 1992, J. Fluid Mech. 242, 631-653.
struct LineSourceOnSlope {
  Real flux = 1;   ///< q, per width [m^2/s]
  Real slope = 0;  ///< theta [rad]
  Real nu = 1;     ///< [m^2/s]

  Real front(Real t) const;  ///< [m]
  Real depth() const;        ///< [m]
};
struct PointSourceOnSlope {
  Real flux = 1;   ///< Q [m^3/s]
  Real slope = 0;  ///< theta [rad]
  Real nu = 1;     ///< [m^2/s]

  Real front(Real t) const;       ///< x_N [m]
  Real half_width(Real t) const;  ///< y_N [m]
};

/// The dam of depth H and length L on level ground (a wall behind it), before and after its far end has noticed.
///
///   early   x_N = L + 0.49242 sqrt(K H^3 t)           similarity solution of an endless reservoir
///   late    GravityCurrent of volume L H
/// Both leave out the time between: ThinFilmDamBreak (thin_film.h) is the reference there.
/// Source of the early law: Balmforth, Craster, Perona, Rust & Sassi 2007, J. Non-Newtonian Fluid Mech. 142, 63-73.
Real early_dam_break_front(Real length, Real depth, Real nu, Real t);

}  // namespace effuse::flow::reference
