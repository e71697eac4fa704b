#pragma once

#include <array>

#include "flow/sph/enthalpy.h"
#include "geometry/base/types.h"

namespace effuse::flow::sph {

/// What a face at T [K] gives to the air and the sky [W/m^2]:  eps(T) sigma (T^4 - T_air^4) + h (T - T_air).
struct SurfaceLaw {
  Real emissivity = 0.95;       ///< eps, 0 to 1
  bool thompson_ramsey = false; ///< eps = 1.0463 - 1.48144e-4 T instead, held within 0 to 1 (Thompson & Ramsey 2021)
  Real convection = 50;         ///< h [W/(m^2 K)]; values in use range from 9 to 75
  Real air_temperature = 300;   ///< [K]

  Real radiated(Real T) const {
    const Real a = air_temperature;
    return emissivity_at(T) * kStefanBoltzmann * (T * T + a * a) * (T + a) * (T - a);
  }
  Real convected(Real T) const { return convection * (T - air_temperature); }
  Real flux(Real T) const { return radiated(T) + convected(T); }
  /// d flux / dT, > 0
  Real slope(Real T) const;
  Real emissivity_at(Real T) const;

  /// The temperature of a face that conduction through G [W/(m^2 K)] from a point at T feeds:
  ///   G (T - Ts) = share flux(Ts),  share in [0, 1].   Between T and the air's, always.
  Real face_temperature(Real T, Real G, Real share) const;
};

inline constexpr int kColumnCells = 16;  ///< at most

/// Shares of a column's depth, from the surface down: a geometric series that begins with `finest`, at most 1 / cells, and sums to 1.
struct ColumnShape {
  /// finest in (0, 1], cells from 2 to kColumnCells (checked).
  explicit ColumnShape(Real finest = 1.0 / 200, int cells = kColumnCells);
  int cells;
  std::array<Real, kColumnCells> share;   ///< 0 beyond cells
  std::array<Real, kColumnCells> centre;  ///< depth of a cell's middle, share of the whole
};

/// Heat of one exposed particle, by depth.
struct CrustColumn {
  std::array<Real, kColumnCells> H;  ///< enthalpies [J/kg], from the surface down; those beyond the shape's cells are not used
  Real surface_temperature = 0;      ///< [K]
  Real depth = 0;                    ///< [m]
  Real age = 0;                      ///< exposed for so long [s]
  Real buried = 0;                   ///< for so long [s]; 0: exposed
  Real pending = 0;                  ///< time not yet stepped [s]
  Real pending_sky = 0;              ///< its integral of exposed area [m^2 s]
  Real pending_ground = 0;           ///< of conductance to the ground [J/K]
  Real ground_temperature = 0;       ///< [K]
};

/// What a column's ends meet, per square metre of its cross-section.
struct ColumnEnds {
  Real sky_share = 1;            ///< share of the top that is exposed
  Real ground_conductance = 0;   ///< from the last cell's middle to ground_temperature [W/(m^2 K)]
  Real ground_temperature = 0;   ///< [K]
};

/// J/m^2 of cross-section that left.
struct ColumnLoss {
  Real radiated = 0, convected = 0, ground = 0;
};

/// One implicit Euler step of  rho dH/dt = d/dz (k dT/dz),  T = T(H), with the flux at the top implicit in the surface
/// temperature (SurfaceLaw::face_temperature) and at the bottom in the last cell's:
/// no temperature leaves the range of what it began with, air and ground, for any dt [s] > 0. Newton's method, along H
/// first, then (a narrow melting range may send it in circles) along T with a line search on the convex function whose
/// slope the equations are. Energy is kept to rounding:  rho depth sum(share dH) = -loss.
///
///   H        enthalpies [J/kg], in and out
///   curve    its solidus below its liquidus
///   depth    of the whole column [m]
///   k_melt, k_solid  conductivities [W/(m K)], by solid fraction before the step
///   surface_temperature   out [K]
/// First order in dt. Source: the scheme is the textbook's (finite volumes, enthalpy form).
ColumnLoss step_column(std::array<Real, kColumnCells>& H, Real dt, Real depth, Real density, const ColumnShape& shape,
                       const EnthalpyCurve& curve, Real k_melt, Real k_solid, const SurfaceLaw& air, const ColumnEnds& ends,
                       Real& surface_temperature);

/// Depth [m] where the profile surface, cells first reaches `isotherm` [K], linear between the cells' centres; depth if nowhere.
Real crust_depth(const CrustColumn& column, const ColumnShape& shape, const EnthalpyCurve& curve, Real isotherm);

}  // namespace effuse::flow::sph
