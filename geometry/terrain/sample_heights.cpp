#include "geometry/terrain/sample_heights.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::geometry {

SampledHeights sample_heights(const Terrain& terrain, Real spacing, const Vec2& offset, std::size_t max_posts) {
  ZONE("terrain.sample");
  CHECK(std::isfinite(spacing) && spacing > 0);
  const Box3 box = terrain.bounds();
  // A post on the rim counts: rounding must not lose it.
  const auto first = [&](int k) { return std::ceil((box.min()[k] + offset[k]) / spacing - 1e-6); };
  const auto last = [&](int k) { return std::floor((box.max()[k] + offset[k]) / spacing + 1e-6); };
  const Vec2 count(last(0) - first(0) + 1, last(1) - first(1) + 1);
  if (!(count.minCoeff() >= 2)) throw InputError(Place{}, fmt::format("posts {:g} m apart: the ground has room for {:.0f} x {:.0f}, wanted at least 2 x 2", spacing, count.x(), count.y()));
  if (!(count.prod() <= static_cast<Real>(max_posts))) throw InputError(Place{}, fmt::format("posts {:g} m apart would be {:.4g}, at most {} will do", spacing, count.prod(), max_posts));

  SampledHeights grid;
  grid.nx = static_cast<int>(count.x());
  grid.ny = static_cast<int>(count.y());
  grid.corner = Vec2(first(0), first(1)) * spacing - offset;
  const auto nx = static_cast<std::size_t>(grid.nx), n = nx * static_cast<std::size_t>(grid.ny);
  grid.z.resize(n);
  std::vector<char> roofed(n, 0);
  const Real hair = 1e-9 * (1 + box.diagonal().norm());
  parallel_for(
      n,
      [&](std::size_t k) {
        const auto at = [&](int axis, std::size_t number) {
          return std::clamp(grid.corner[axis] + static_cast<Real>(number) * spacing, box.min()[axis], box.max()[axis]);
        };
        const Real x = at(0, k % nx), y = at(1, k / nx);
        const std::optional<Real> top = terrain.height(x, y);
        grid.z[k] = top ? *top : std::numeric_limits<Real>::quiet_NaN();
        roofed[k] = top && terrain.height_below(x, y, *top - hair).has_value();
      },
      64);
  for (std::size_t k = 0; k < n; ++k) {
    grid.holes += std::isnan(grid.z[k]);
    grid.roofed += roofed[k] != 0;
  }
  return grid;
}

}  // namespace effuse::geometry
