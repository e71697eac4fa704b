#pragma once

#include "geometry/base/types.h"

/// Exact flows between plates and down slopes: functions of place and time, laminar, of a fluid of constant density.
///
/// y is the distance from the (lower) wall [m], nu = mu / rho the kinematic viscosity [m^2/s]; a force is one per mass [m/s^2]. Series are
/// summed until their terms fall below rounding, so any t >= 0 will do. Positive widths, depths and viscosities (checked); y outside the
/// fluid gives the formula's value, which means nothing.
/// Source: standard results of the Navier-Stokes equations, as in Batchelor 1967, An Introduction to Fluid Dynamics, section 4.2-4.3.
namespace effuse::flow::reference {

/// Two resting plates, a force along them, from rest at t = 0.
struct PlanePoiseuille {
  Real force = 0;  ///< F [m/s^2]
  Real width = 1;  ///< W of the gap [m]
  Real nu = 1;     ///< [m^2/s]

  Real velocity(Real y) const;          ///< u = F / (2 nu) y (W - y), reached as t -> infinity [m/s]
  Real velocity(Real y, Real t) const;  ///< u - sum_n 4 F W^2 / (nu pi^3 k^3) sin(pi k y / W) exp(-k^2 pi^2 nu t / W^2), k = 2 n + 1
  Real peak() const;                    ///< F W^2 / (8 nu) [m/s]
  Real flux() const;                    ///< F W^3 / (12 nu), per width [m^2/s]
  Real flux(Real t) const;              ///< the integral of velocity(y, t) over the gap [m^2/s]
};

/// A resting plate at y = 0, one at y = W that slides at speed U from t = 0 on.
struct Couette {
  Real speed = 0;  ///< U [m/s]
  Real width = 1;  ///< W of the gap [m]
  Real nu = 1;     ///< [m^2/s]

  Real velocity(Real y) const;          ///< U y / W [m/s]
  Real velocity(Real y, Real t) const;  ///< U y / W + sum_n 2 U / (n pi) (-1)^n sin(n pi y / W) exp(-n^2 pi^2 nu t / W^2)
  Real flux() const;                    ///< U W / 2, per width [m^2/s]
};

/// A film of even depth on a slope, its surface free of stress: Nusselt 1916.
struct NusseltFilm {
  Real depth = 1;  ///< H, at right angles to the slope [m]
  Real slope = 0;  ///< theta [rad]
  Real nu = 1;     ///< [m^2/s]

  Real velocity(Real y) const;          ///< g sin(theta) / nu (H y - y^2 / 2) [m/s]
  Real velocity(Real y, Real t) const;  ///< from rest at t = 0: half of a Poiseuille flow of twice the width
  Real surface_speed() const;           ///< g sin(theta) H^2 / (2 nu) [m/s]
  Real mean_speed() const;              ///< g sin(theta) H^2 / (3 nu) [m/s]
  Real flux() const;                    ///< g sin(theta) H^3 / (3 nu), per width [m^2/s]
};

/// The same film with a yield strength: sheared below, a plug on top.
///
///   Y = H - tau_y / (rho g sin(theta))     depth that is sheared; 0 where the yield strength holds the film
///   U = rho g sin(theta) Y^2 / (2 mu)      speed of the plug
///   u = U (1 - ((y - Y) / Y)^2)  below Y,  U above
struct BinghamFilm {
  Real depth = 1;    ///< H [m]
  Real slope = 0;    ///< theta [rad]
  Real density = 1;  ///< rho [kg/m^3]
  Real mu = 1;       ///< plastic viscosity [Pa s]
  Real yield = 0;    ///< tau_y [Pa]

  Real wall_stress() const;      ///< rho g H sin(theta) [Pa]
  Real strength_ratio() const;   ///< r = tau_y / wall_stress; from 1 on nothing flows
  Real sheared_depth() const;    ///< Y [m]
  Real velocity(Real y) const;   ///< [m/s]
  Real plug_speed() const;       ///< U [m/s]
  Real flux() const;             ///< U (H - Y / 3), per width [m^2/s]
  /// Jeffreys' mean speed with Bingham's strength: rho g H^2 sin(theta) / (n mu) (1 - 3/2 r + 1/2 r^3), 0 from r = 1 on [m/s]. n: 3 for a
  /// wide flow (then flux = H mean), 3 (1 + H / w) for a channel of width w. Source: Chevrel et al. 2018, eq. 7.
  Real jeffreys_mean(Real n = 3) const;
};

}  // namespace effuse::flow::reference
