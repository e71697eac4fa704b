#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "geometry/terrain/height_field.h"

namespace effuse::importers {

/// A hollow that water, or thin lava, would fill before it runs on: a crater, a pit, noise of the survey.
struct Depression {
  Real floor = 0;              ///< lowest height [m]
  Real spill = 0;              ///< height at which it overflows [m]
  Vec2 lowest = Vec2::Zero();  ///< where its floor is
  std::size_t lowest_post = 0;
  std::size_t posts = 0;  ///< below the spill
  Real volume = 0;        ///< below the spill, posts as columns [m^3]
  Real depth() const { return spill - floor; }
};

/// A grid of heights under water that stands as high everywhere as on the lowest way out over the border or into a hole,
/// neighbours being the eight around (lowest outlet first; Barnes, Lehman & Mulla 2014, Comput. Geosci. 62, 117-127).
struct Flood {
  static constexpr std::uint32_t kNone = 0xffffffff;
  std::vector<Real> level;               ///< of the water at each post [m]; = z where dry; of holes undefined
  std::vector<std::uint32_t> way_out;    ///< the next post on the lowest way out; kNone at outlets and holes
  std::vector<std::uint32_t> depression; ///< number in depressions; kNone: dry
  std::vector<Depression> depressions;   ///< deepest first
};

/// z: nx * ny heights [m], i fastest, NaN: hole; corner: of post (0, 0). O(n log n). Fewer than 2^32 posts (checked).
Flood flood(const std::vector<Real>& z, int nx, int ny, const Vec2& corner, const Vec2& spacing);

/// The closed depressions of a height field, deepest first.
std::vector<Depression> closed_depressions(const geometry::HeightField& field);

}  // namespace effuse::importers
