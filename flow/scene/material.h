#pragma once

#include <cmath>

#include "flow/scene/parameters.h"

namespace effuse::flow {

/// What an obstacle or a body is made of, as heat knows it. Warms up where lava touches it as a half-space does, and as a whole by what
/// it has been given.
struct Material {
  Real conductivity = 0;   ///< k [W/(m K)]; 0: as the ground, and does not warm up as a whole
  Real density = 0;        ///< [kg/m^3]
  Real heat_capacity = 0;  ///< c [J/(kg K)]
  /// sqrt(k rho c) [J/(m^2 K s^0.5)]
  Real effusivity() const { return std::sqrt(conductivity * density * heat_capacity); }
};

/// The keys material, conductivity, density and heat_capacity; own_density: the table's own key
/// `density` [kg/m^3], read already; 0: read here.
Material read_material(Parameters& p, Real own_density = 0);

}  // namespace effuse::flow
