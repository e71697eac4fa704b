#pragma once

#include <cstddef>
#include <vector>

#include "geometry/terrain/height_field.h"

namespace effuse::importers {

/// A hollow that water, or thin lava, would fill before it runs on: a crater, a pit, noise of the survey.
struct Depression {
  Real floor = 0;              ///< lowest height [m]
  Real spill = 0;              ///< height at which it overflows [m]
  Vec2 lowest = Vec2::Zero();  ///< where its floor is
  std::size_t posts = 0;       ///< below the spill
  Real volume = 0;             ///< below the spill, posts as columns [m^3]
  Real depth() const { return spill - floor; }
};

/// The closed depressions of a height field, deepest first, by flooding from the border inwards (lowest
/// outlet first; Barnes, Lehman & Mulla 2014, Comput. Geosci. 62, 117-127). Neighbours: the eight around.
/// Water leaves over the border and into holes. O(n log n) in the posts.
std::vector<Depression> closed_depressions(const geometry::HeightField& field);

}  // namespace effuse::importers
