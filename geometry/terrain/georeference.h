#pragma once

#include <string>

#include "geometry/base/types.h"

namespace effuse::geometry {

/// Puts local coordinates back on the map: crs position = origin + local position (both z up, metres).
struct Georeference {
  Vec3 origin = Vec3::Zero();  ///< in crs [m], exact in double
  std::string crs;             ///< "EPSG:27200" or WKT; empty: unknown
};

}  // namespace effuse::geometry
