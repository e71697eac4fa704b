#pragma once

#include <limits>

#include "geometry/base/types.h"

namespace effuse::geometry {

/// Nothing, or what a point is near: the one currency of boundaries. Terrain and obstacles make
/// contacts; lava, jello, bodies and sparks consume them.
///
///   point     nearest on the surface [m]
///   normal    unit, out of the solid; turns continuously as the query point moves
///   distance  signed [m], negative inside the solid; +infinity: nothing near
struct Contact {
  Vec3 point = Vec3::Zero();
  Vec3 normal = Vec3::UnitZ();
  Real distance = std::numeric_limits<Real>::infinity();
  Vec3 surface_velocity = Vec3::Zero();  ///< [m/s]
  Real surface_temperature = 0;          ///< [K]; 0: the surface has none of its own
  Index surface = 0;                     ///< which: 0 terrain, then obstacles

  bool any() const { return distance < std::numeric_limits<Real>::infinity(); }
};

}  // namespace effuse::geometry
