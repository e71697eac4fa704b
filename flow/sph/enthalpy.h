#pragma once

#include <algorithm>

#include "geometry/base/types.h"

namespace effuse::flow::sph {

/// Enthalpy [J/kg] against temperature [K], latent heat released evenly between solidus and liquidus:
///   H = c T + L f,   f = melt fraction = (T - solidus) / (liquidus - solidus), clamped to [0, 1]
/// H is the state, T follows from it: a step may cross the melting range, narrow or of no width at all,
/// and no latent heat is lost. H = 0 at 0 K.
/// Defaults: basalt.
struct EnthalpyCurve {
  Real heat_capacity = 1150;    ///< c [J/(kg K)] > 0
  Real latent_heat = 350e3;     ///< L [J/kg] >= 0
  Real solidus = 1000 + kZeroCelsius;   ///< [K]
  Real liquidus = 1150 + kZeroCelsius;  ///< [K] >= solidus; equal: melts at one temperature

  /// [J/kg]. At a melting point of no width: of the melt.
  Real enthalpy(Real T) const {
    if (T >= liquidus) return liquid_enthalpy() + heat_capacity * (T - liquidus);
    if (T <= solidus) return heat_capacity * T;
    return heat_capacity * T + latent_heat * (T - solidus) / (liquidus - solidus);
  }
  /// [K]
  Real temperature(Real H) const {
    const Real solid = heat_capacity * solidus, liquid = liquid_enthalpy();
    if (H <= solid) return H / heat_capacity;
    if (H >= liquid) return liquidus + (H - liquid) / heat_capacity;
    return solidus + (H - solid) / (liquid - solid) * (liquidus - solidus);
  }
  /// dT/dH [K kg/J]: 1/c outside the melting range, less inside.
  Real slope(Real H) const {
    const Real solid = heat_capacity * solidus, liquid = liquid_enthalpy();
    return H < solid || H >= liquid ? 1 / heat_capacity : (liquidus - solidus) / (liquid - solid);
  }
  /// Share of the mass that is solid, 0 to 1.
  Real solid_fraction(Real H) const {
    const Real solid = heat_capacity * solidus, liquid = liquid_enthalpy();
    if (H >= liquid) return 0;
    return H <= solid ? 1 : (liquid - H) / (liquid - solid);
  }

 private:
  Real liquid_enthalpy() const { return heat_capacity * liquidus + latent_heat; }
};

}  // namespace effuse::flow::sph
