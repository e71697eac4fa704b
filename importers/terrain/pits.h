#pragma once

#include <cstddef>
#include <vector>

#include "importers/terrain/dem_options.h"
#include "importers/terrain/depressions.h"

namespace effuse::importers {

struct RemovedPits {
  std::size_t pits = 0;   ///< removed
  std::size_t posts = 0;  ///< whose height changed
  Real volume = 0;        ///< of ground added (fill) or taken away (breach) [m^3], posts as columns
  Real deepest = 0;       ///< of the removed ones [m]
  std::size_t kept = 0;   ///< deeper than asked
};

/// Removes the closed depressions of a grid that are not deeper than deepest [m].
///   kFill    posts below the spill are raised to it: level ground, where a flow still spreads
///   kBreach  from the lowest post along the lowest way out a notch is cut, each post no higher than the one before
///            (Lindsay 2016, Hydrol. Process. 30, 846-857: complete breaching): ground changes along a line only
/// Depressions inside a kept one stay. z: nx * ny heights [m], i fastest; NaN: hole, an outlet like the border.
RemovedPits remove_pits(std::vector<Real>& z, int nx, int ny, const Vec2& spacing, PitPolicy policy, Real deepest);

}  // namespace effuse::importers
