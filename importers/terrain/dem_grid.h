#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "geometry/base/types.h"

namespace effuse::importers {

/// A raster of heights as every raster format hands it over, in the coordinates of its own system.
/// Cells have become posts at the cells' centres: post (i, j) stands at corner + (i * spacing.x, j * spacing.y).
struct DemGrid {
  Vec2 corner = Vec2::Zero();      ///< south-west post [m]
  Vec2 spacing = Vec2::Ones();     ///< [m], > 0
  int nx = 0, ny = 0;              ///< >= 2
  std::vector<Real> z;             ///< nx * ny heights [m], i fastest, south row first; NaN: a hole
  std::size_t nodata = 0;          ///< how many are holes
  std::string format;              ///< of the first file: "GeoTIFF, Int16"
  std::string crs;                 ///< WKT or an authority's code; empty: unknown
  std::vector<std::string> notes;  ///< for people: what was found, assumed and changed
};

}  // namespace effuse::importers
