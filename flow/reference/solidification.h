#pragma once

#include <span>
#include <vector>

#include "geometry/base/types.h"

/// Heat by conduction, freezing and radiation: exact solutions, and one converged numerical one.
namespace effuse::flow::reference {

/// Two half-spaces brought together at t = 0, left (x < 0) at T_left, right at T_right. With the effusivities
/// b = sqrt(k rho c) [J/(m^2 K s^0.5)] the interface stands at (b_l T_l + b_r T_r) / (b_l + b_r) from then on, and on
/// either side T runs to its old value as erf(|x| / (2 sqrt(kappa t))).
/// Source: Carslaw & Jaeger, Conduction of Heat in Solids, 1959, section 2.15.
struct ContactOfHalfSpaces {
  Real T_left = 0, T_right = 0;          ///< [K]
  Real b_left = 1, b_right = 1;          ///< effusivities; only their ratio counts
  Real kappa_left = 1, kappa_right = 1;  ///< diffusivities [m^2/s]

  Real interface_temperature() const { return (b_left * T_left + b_right * T_right) / (b_left + b_right); }
  /// [K] at x [m], t > 0 [s].
  Real temperature(Real x, Real t) const;
  /// Through the interface, from right to left [W/m^2].
  Real flux(Real t) const;
};

/// A melt at T_melt or above fills x > 0 and freezes from x = 0 on, held at T_wall < T_melt: the front stands at
/// s = 2 lambda sqrt(kappa t). Solid and melt have the same properties; latent heat L at the one temperature T_melt.
///   exp(-l^2)/erf(l) - (T_far - T_melt)/(T_melt - T_wall) exp(-l^2)/erfc(l) = l sqrt(pi) / St,  St = c (T_melt - T_wall) / L
/// (Neumann; T_far = T_melt: Stefan's one-phase problem, l exp(l^2) erf(l) = St / sqrt(pi)).
/// Source: Carslaw & Jaeger 1959, section 11.2.
class FreezingFront {
 public:
  /// T_wall < T_melt <= T_far [K], latent_heat > 0 [J/kg], heat_capacity > 0 [J/(kg K)], kappa > 0 [m^2/s] (all checked).
  FreezingFront(Real T_wall, Real T_melt, Real T_far, Real latent_heat, Real heat_capacity, Real kappa);
  Real lambda() const { return lambda_; }
  Real front(Real t) const;                ///< [m]
  Real temperature(Real x, Real t) const;  ///< [K]; x >= 0, t > 0

 private:
  Real T_wall_, T_melt_, T_far_, kappa_, lambda_;
};

/// A body of one temperature that radiates to nothing:  T = T0 (1 + 3 eps sigma T0^3 t / (rho c d))^(-1/3),
/// d [m] its volume over its radiating area.
Real radiative_cooling(Real T0, Real emissivity, Real density, Real heat_capacity, Real d, Real t);

/// A half-space of lava, uniformly hot at t = 0, that radiates and convects from its face and freezes over a range of
/// temperatures. Enthalpy differences on a graded grid, implicit and second order in time, with steps and cells that
/// grow: halving both moves the face by less than 0.5 K and the 1070 degC isotherm by less than 1 % from 10 s on.
/// The far end (3 m deep by default, insulated) must not feel it: good for a day of lava.
struct CoolingHalfSpace {
  Real T0 = 1150 + kZeroCelsius;       ///< [K]
  Real emissivity = 0.95;
  Real convection = 50;                ///< [W/(m^2 K)]
  Real air_temperature = 30 + kZeroCelsius;  ///< [K]
  Real latent_heat = 350e3;            ///< [J/kg], evenly between solidus and liquidus
  Real solidus = 1000 + kZeroCelsius, liquidus = 1150 + kZeroCelsius;  ///< [K], solidus < liquidus
  Real heat_capacity = 1150;           ///< [J/(kg K)]
  Real conductivity = 1.709;           ///< [W/(m K)]
  Real density = 1560;                 ///< [kg/m^3]
  Real depth = 3;                      ///< [m]
  Real refinement = 1;                 ///< 2: half the cells' size, half the steps
};

struct CoolingMoment {
  Real t = 0;                  ///< [s]
  Real surface_temperature = 0;  ///< [K]
  Real flux = 0;               ///< out of the face [W/m^2]
  Real lost = 0;               ///< J/m^2 since t = 0
  Real crust = 0;              ///< depth of the isotherm [m]
};

/// The state at `times` [s], rising, > 0.
std::vector<CoolingMoment> cool(const CoolingHalfSpace& lava, std::span<const Real> times, Real isotherm = 1070 + kZeroCelsius);

}  // namespace effuse::flow::reference
