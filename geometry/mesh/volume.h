#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "geometry/base/types.h"

namespace effuse::geometry {

/// Fields of one moment on a regular grid of cubic cells: smoke, or what particles make together.
///
///   corner       lowest corner of the grid [m]; cell: side [m]
///   n            cells along x, y, z; cell (i, j, k) is number (k n[1] + j) n[0] + i, its middle half a cell further
///   density      one a cell, 0: none there; what 1 means is the maker's
///   temperature  one a cell [K], or empty
///   velocity     x, y, z a cell [m/s], or empty
/// float: files and pictures hold no more, and nothing is computed from them.
struct GridVolume {
  std::string name;
  Vec3 corner = Vec3::Zero();
  Real cell = 1;
  std::array<int, 3> n = {0, 0, 0};
  std::vector<float> density, temperature, velocity;

  std::size_t size() const { return static_cast<std::size_t>(n[0]) * static_cast<std::size_t>(n[1]) * static_cast<std::size_t>(n[2]); }
  std::size_t index(int i, int j, int k) const {
    return (static_cast<std::size_t>(k) * static_cast<std::size_t>(n[1]) + static_cast<std::size_t>(j)) * static_cast<std::size_t>(n[0]) + static_cast<std::size_t>(i);
  }
};

}  // namespace effuse::geometry
