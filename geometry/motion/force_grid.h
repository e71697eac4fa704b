#pragma once

#include <algorithm>
#include <vector>

#include "geometry/base/types.h"

namespace effuse::geometry {

/// Vectors on the corners of a regular grid over a cube, trilinear in between.
///
///   low, high   opposite corners of the cube [m]
///   resolution  corners a side, >= 2; or 0: zero everywhere
///   values      resolution^3, value (i, j, k) is number (i resolution + j) resolution + k
struct ForceGrid {
  Vec3 low = Vec3::Constant(-2), high = Vec3::Constant(2);
  int resolution = 0;
  std::vector<Vec3> values;

  /// At p; outside the cube as at its nearest point.
  Vec3 at(const Vec3& p) const {
    if (resolution < 2) return Vec3::Zero();
    const auto n = static_cast<std::size_t>(resolution);
    std::size_t cell[3];
    Real f[3];
    for (int a = 0; a < 3; ++a) {
      const Real u = std::clamp((p[a] - low[a]) / (high[a] - low[a]), 0.0, 1.0) * static_cast<Real>(n - 1);
      cell[a] = std::min(static_cast<std::size_t>(u), n - 2);
      f[a] = u - static_cast<Real>(cell[a]);
    }
    Vec3 sum = Vec3::Zero();
    for (std::size_t c = 0; c < 8; ++c) {
      const std::size_t i = c >> 2, j = (c >> 1) & 1, k = c & 1;
      const Real w = (i ? f[0] : 1 - f[0]) * (j ? f[1] : 1 - f[1]) * (k ? f[2] : 1 - f[2]);
      sum += w * values[((cell[0] + i) * n + cell[1] + j) * n + cell[2] + k];
    }
    return sum;
  }
};

}  // namespace effuse::geometry
