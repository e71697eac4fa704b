#pragma once

#include <cstddef>
#include <vector>

#include "geometry/base/types.h"

namespace effuse::importers {

struct FilledHoles {
  std::size_t posts = 0;    ///< filled
  std::size_t largest = 0;  ///< posts of the largest hole
};

/// Gives every NaN of a grid a height: a surface as smooth as the rims allow (Laplace's equation, heights of the rims kept,
/// no flux over the grid's border), to about 1e-3 of the heights' range. Holes that reach the border are carried on from
/// the ground beside them. Solved on a pyramid of halved grids: O(n). Serial; throws nothing.
///
///   z  nx * ny heights [m], NaN: hole; at least one is no hole (else nothing is done)
FilledHoles fill_holes(std::vector<Real>& z, int nx, int ny);

}  // namespace effuse::importers
