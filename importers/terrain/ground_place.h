#pragma once

#include "geometry/base/types.h"
#include "geometry/terrain/georeference.h"
#include "geometry/terrain/height_field.h"

namespace effuse::importers {

/// A place on the ground, as a scene and as a map in degrees say it, and how the ground lies there.
struct GroundPlace {
  Vec2 map = Vec2::Zero();      ///< x east, y north in the terrain's coordinate system [m]
  Vec2 degrees = Vec2::Zero();  ///< east, north on WGS 84; NaN where the system is unknown
  Real height = 0;              ///< [m]
  Real slope = 0;               ///< of the ground around [rad]
  Real downhill = 0;            ///< where that falls to, counter-clockwise from east [rad], in (-pi, pi]; 0 where it is level
};

/// The place that two numbers name: map coordinates, or, when they lie outside of the ground and a system is known, degrees east and
/// north on WGS 84. Slope and direction are those of the mean gradient over a square of 5 x 5 posts, so that one bad post does not turn
/// them. Throws InputError where there is no ground, saying from where to where there is some. One thread at a time (PROJ).
GroundPlace ground_place(const geometry::HeightField& field, const geometry::Georeference& georeference, const Vec2& wanted);

/// The highest post of the ground.
GroundPlace highest_place(const geometry::HeightField& field, const geometry::Georeference& georeference);

}  // namespace effuse::importers
