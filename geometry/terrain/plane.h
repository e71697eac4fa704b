#pragma once

#include "geometry/terrain/height_field.h"

namespace effuse::geometry {

/// Flat ground about the origin, level or inclined: z = height - tan(slope) (x cos(downhill) + y sin(downhill)), exact everywhere.
///   size      along x and y [m], each > 0
///   slope     [rad], 0 <= slope < pi/2
///   downhill  the way it falls, counter-clockwise from +x [rad]
///   height    at the origin [m]
///   cells     along the longer side, >= 1; square but for rounding: what draws it or maps a flow on it has that many
/// All checked.
HeightField make_plane(const Vec2& size, Real slope = 0, Real downhill = 0, int cells = 32, Real height = 0);

}  // namespace effuse::geometry
