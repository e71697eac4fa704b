#pragma once

#include "geometry/base/types.h"

/// What a warm current that spreads from a steady point source on level ground loses.
namespace effuse::flow::reference {

/// Depth-averaged: fluid let out at time tau moves outwards with the spreading current (GravityCurrent, round, alpha = 1), always with the
/// share (t - tau) / t of the volume within it, and cools through both faces as
///   rho c h dT/dt = -U (T - T_env),   h the current's depth where the fluid is.
/// Viscosity and so the spreading do not depend on temperature. The loss tends to the supply rho c Q (T_vent - T_env), slowly: cold fluid
/// keeps being left behind at the growing rim.
/// Fluid that stays in the middle of its depth all the way, and that nothing mixes, is a simplification: good to a few percent.
/// Source: the energy balance of Garel, Kaminski, Tait & Limare 2012, J. Geophys. Res. 117, B02205; the current of Huppert 1982.
struct CoolingCurrent {
  Real rate = 1;           ///< Q [m^3/s]
  Real nu = 1;             ///< [m^2/s]
  Real density = 1;        ///< rho [kg/m^3]
  Real heat_capacity = 1;  ///< c [J/(kg K)]
  Real excess = 1;         ///< T_vent - T_env [K]
  Real exchange = 1;       ///< U, both faces together [W/(m^2 K)]

  Real supply() const;      ///< rho c Q (T_vent - T_env) [W]
  Real loss(Real t) const;  ///< [W] at t > 0 s; to 1e-3
};

}  // namespace effuse::flow::reference
