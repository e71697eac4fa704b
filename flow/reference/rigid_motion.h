#pragma once

#include "geometry/base/types.h"

/// Exact motions of rigid bodies, by elliptic functions.
namespace effuse::flow::reference {

/// sn, cn, dn of u with parameter m = k^2 in [0, 1), by descending Landen steps (arithmetic-geometric mean) to rounding.
/// Source: Abramowitz & Stegun 1964, 16.4.
struct JacobiElliptic {
  Real sn = 0, cn = 1, dn = 1;
};
JacobiElliptic jacobi_elliptic(Real u, Real m);

/// A physical pendulum that swings through +-amplitude about the vertical:  angle'' = -omega0^2 sin(angle),
/// omega0^2 = m g l / I with l from pivot to centre of mass and I about the pivot.
struct Pendulum {
  Real omega0 = 1;      ///< [1/s] of small swings
  Real amplitude = 1;   ///< [rad], in (0, pi)
  /// 4 K(sin^2(amplitude / 2)) / omega0 [s].
  Real period() const;
  /// Angle at time t from rest at +amplitude:  2 asin(k sn(K - omega0 t)).
  Real angle(Real t) const;
};

/// Euler's top: a body nothing turns, with moments I1 <= I2 <= I3, not all equal to the middle one, and the body-frame angular
/// velocity (a cn, -b sn, c dn) or (a dn, -b sn, c cn): Dzhanibekov's turns are those near the separatrix.
/// Source: Landau & Lifshitz, Mechanics, 37.
struct FreeTop {
  Vec3 moments = Vec3(1, 2, 3);       ///< [kg m^2], strictly rising
  Vec3 spin0 = Vec3(0.01, 5, 0.01);   ///< body-frame angular velocity at t = 0 [1/s], any
  /// Body-frame angular velocity at time t.
  Vec3 spin(Real t) const;
  /// Time [s] in which it comes back to itself; a Dzhanibekov body flips twice in it.
  Real period() const;
  Real energy() const;
  Real momentum() const;  ///< |L|
};

}  // namespace effuse::flow::reference
