#pragma once

#include <vector>

#include "importers/terrain/raster.h"

namespace effuse::importers {

/// Of a grid whose edges run askew to its raster's, the part without the outer rows and columns that lie partly beside the
/// raster: what is left when, as long as any outer row or column holds marked posts, the one with the largest share of them
/// is taken away. The whole grid when that would take more than most (a share of the posts that are not marked), or leave
/// fewer than 2 x 2.
///
///   beside  nx * ny marks, i fastest
CellWindow trimmed(const std::vector<char>& beside, int nx, int ny, Real most);

}  // namespace effuse::importers
