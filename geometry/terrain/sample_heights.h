#pragma once

#include <cstddef>

#include "geometry/terrain/terrain.h"

namespace effuse::geometry {

/// A terrain as a grid.
struct SampledHeights {
  Vec2 corner = Vec2::Zero();  ///< south-west post [m]
  int nx = 0, ny = 0;
  std::vector<Real> z;         ///< nx * ny, i fastest, south row first; NaN where there is no ground [m]
  std::size_t holes = 0;       ///< posts without ground
  std::size_t roofed = 0;      ///< posts with ground below the highest: caves, overhangs, sheets over one another
};

/// The highest ground on the verticals of posts `spacing` [m] apart, at whole multiples of it from -offset, over the terrain's box.
/// spacing > 0, at least two posts each way and no more than max_posts, or InputError. What a height field cannot hold is
/// counted as roofed. In parallel, the same bits on any number of threads.
SampledHeights sample_heights(const Terrain& terrain, Real spacing, const Vec2& offset, std::size_t max_posts);

}  // namespace effuse::geometry
