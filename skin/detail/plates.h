#pragma once

#include <cstdint>

#include "geometry/base/types.h"

namespace effuse::skin {

/// A point of a crust that is broken into plates.
struct PlatePlace {
  std::uint64_t id = 0;       ///< random bits of the plate
  Vec3 from_middle;           ///< from the plate's site
  Real border = 0;            ///< distance from the nearest border, at most 0.5
  Real inside = 0;            ///< 0 on borders .. 1 from `width` inside on; value and slope vanish on borders, C1
};

/// Plates: Voronoi cells of one site in each cell of the unit lattice, jittered by up to 0.3 each way.
///
///   inside = product over sites j of s(b_j / width),   s(t) = t^2 (3 - 2t),   b_j the distance to the plane between site and site j
///
/// as in Regions. Seen on a surface that cuts it: polygons of five or six sides, about 1 across.
///   p      material coordinates, in plates
///   width  of the slope beside a crack, 0 < width <= kWidestPlateSlope (checked): so far all that matter are among the 27 sites round p
PlatePlace plate_at(const Vec3& p, Real width, std::uint64_t seed);

inline constexpr Real kWidestPlateSlope = 0.14;

}  // namespace effuse::skin
