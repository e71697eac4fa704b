#include "geometry/terrain/plane.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"

namespace effuse::geometry {

HeightField make_plane(const Vec2& size, Real slope, Real downhill, int cells, Real height) {
  CHECK(size.allFinite() && size.minCoeff() > 0);
  CHECK(slope >= 0 && slope < kPi / 2);
  CHECK(std::isfinite(downhill) && std::isfinite(height));
  CHECK_GE(cells, 1);
  const Real cell = size.maxCoeff() / cells;
  const int nx = 1 + std::max(1, static_cast<int>(std::lround(size.x() / cell))), ny = 1 + std::max(1, static_cast<int>(std::lround(size.y() / cell)));
  const Vec2 spacing(size.x() / (nx - 1), size.y() / (ny - 1)), corner = -size / 2;
  const Vec2 fall = std::tan(slope) * Vec2(std::cos(downhill), std::sin(downhill));
  std::vector<Real> z;
  z.reserve(static_cast<std::size_t>(nx) * static_cast<std::size_t>(ny));
  for (int j = 0; j < ny; ++j)
    for (int i = 0; i < nx; ++i) z.push_back(height - fall.dot(corner + Vec2(i * spacing.x(), j * spacing.y())));
  return HeightField(corner, spacing, nx, ny, std::move(z));
}

}  // namespace effuse::geometry
