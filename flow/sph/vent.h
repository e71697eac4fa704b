#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "geometry/base/types.h"
#include "geometry/motion/curve.h"

namespace effuse::flow::sph {

/// Where lava comes out of the ground, and how much.
///
/// Particles rise from sites on a square lattice, one spacing wide, over the vent's area. A site lets
/// out a particle each time its share of the volume has grown by one particle's, sites staggered; the
/// particle starts at ground level and is carried up by the vent at the speed rate / area until it has
/// risen one spacing; then it is free. So the volume let out by time t is rate * (t - start) to within
/// one particle a site, whatever the steps were.
struct Vent {
  Vec3 from = Vec3::Zero();  ///< [m], centre line of a fissure; from = to: a round crater vent. Sites
  Vec3 to = Vec3::Zero();    ///< are moved up or down onto the ground.
  Real width = 0;            ///< [m], of the fissure, or the crater vent's diameter
  Real rate = 0;             ///< [m^3/s]; the largest where it changes
  std::optional<geometry::Curve<Real>> rates;  ///< [m^3/s] by time [s], >= 0, instead of rate and ramp
  Real temperature = 0;      ///< [K]
  Real start = 0;            ///< [s]
  Real stop = std::numeric_limits<Real>::infinity();  ///< [s]
  Real ramp = 0;             ///< [s], the rate grows from 0 and falls to 0 linearly over this time

  /// Sites of the lattice over the area, at the height of the centre line. At least one; no longer or wider than
  /// a million spacings (checked).
  std::vector<Vec3> lattice(Real spacing) const;
  /// Volume let out by time t [m^3]: the integral of the rate.
  Real volume(Real t) const;
};

}  // namespace effuse::flow::sph
