#include "flow/particles/density_grid.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::particles {

namespace {
constexpr int kSlab = 4;             // layers that one thread fills
constexpr Real kLeastCells = 0.75;   // radius of a particle that still meets a cell's middle
constexpr Real kMostOpaque = 0.999;  // beyond, its extinction is as for this
}  // namespace

geometry::GridVolume density_grid(std::span<const Vec3> x, std::span<const Real> radius, std::span<const Real> opacity, std::span<const Real> temperature,
                                  const DensityGridOptions& options) {
  ZONE("particles.density");
  CHECK_EQ(radius.size(), x.size());
  CHECK_EQ(opacity.size(), x.size());
  if (!temperature.empty()) CHECK_EQ(temperature.size(), x.size());
  geometry::GridVolume grid;
  const std::size_t n = x.size();
  if (n == 0) return grid;

  Box3 box;
  Real sum = 0;
  for (std::size_t i = 0; i < n; ++i) {
    CHECK_GT(radius[i], 0);
    box.extend(Vec3(x[i].array() - radius[i]));
    box.extend(Vec3(x[i].array() + radius[i]));
    sum += radius[i];
  }
  grid.cell = options.cell > 0 ? options.cell : sum / static_cast<Real>(n) / 2;
  // Whole cells of the world: a cloud that drifts does not shimmer.
  for (;; grid.cell *= 1.26) {
    Real cells = 1;
    for (int a = 0; a < 3; ++a) {
      const Real low = std::floor(box.min()[a] / grid.cell) - 1, high = std::ceil(box.max()[a] / grid.cell) + 1;
      grid.corner[a] = low * grid.cell;
      cells *= high - low;
      grid.n[static_cast<std::size_t>(a)] = static_cast<int>(std::min(high - low, 1e9));
    }
    if (cells <= static_cast<Real>(options.most_cells)) break;
  }
  grid.density.assign(grid.size(), 0);
  if (!temperature.empty()) grid.temperature.assign(grid.size(), 0);

  // A thread owns layers and takes the particles that reach them in their order.
  const Real h = grid.cell;
  const auto reach = [&](std::size_t i) { return std::max(radius[i], kLeastCells * h); };
  const auto layer = [&](Real z) { return static_cast<int>(std::floor((z - grid.corner.z()) / h - 0.5)); };
  const int slabs = (grid.n[2] + kSlab - 1) / kSlab;
  std::vector<std::vector<Index>> of_slab(static_cast<std::size_t>(slabs));
  for (std::size_t i = 0; i < n; ++i) {
    const int from = std::max(0, layer(x[i].z() - reach(i))) / kSlab, to = std::min(grid.n[2] - 1, layer(x[i].z() + reach(i)) + 1) / kSlab;
    for (int s = from; s <= to; ++s) of_slab[static_cast<std::size_t>(s)].push_back(static_cast<Index>(i));
  }
  parallel_for(
      static_cast<std::size_t>(slabs),
      [&](std::size_t s) {
        for (const Index i : of_slab[s]) {
          const Real r = reach(i), thin = radius[i] / r;
          const Real tau = -std::log1p(-std::clamp(opacity[i], 0.0, kMostOpaque)) * thin * thin, scale = 15 * tau / (16 * r);
          int low[3], high[3];
          for (int a = 0; a < 3; ++a) {
            low[a] = std::max(0, static_cast<int>(std::ceil((x[i][a] - r - grid.corner[a]) / h - 0.5)));
            high[a] = std::min(grid.n[static_cast<std::size_t>(a)] - 1, static_cast<int>(std::floor((x[i][a] + r - grid.corner[a]) / h - 0.5)));
          }
          low[2] = std::max(low[2], static_cast<int>(s) * kSlab);
          high[2] = std::min(high[2], static_cast<int>(s) * kSlab + kSlab - 1);
          for (int k = low[2]; k <= high[2]; ++k)
            for (int j = low[1]; j <= high[1]; ++j)
              for (int c = low[0]; c <= high[0]; ++c) {
                const Vec3 at = grid.corner + h * Vec3(c + 0.5, j + 0.5, k + 0.5);
                const Real q = 1 - (at - x[i]).squaredNorm() / (r * r);
                if (q <= 0) continue;
                const std::size_t cell = grid.index(c, j, k);
                grid.density[cell] += static_cast<float>(scale * q * q);
                if (!temperature.empty()) grid.temperature[cell] += static_cast<float>(scale * q * q * temperature[i]);
              }
        }
      },
      1);
  if (!temperature.empty())
    parallel_for(grid.size(), [&](std::size_t c) { grid.temperature[c] = grid.density[c] > 0 ? grid.temperature[c] / grid.density[c] : 0; }, 4096);
  return grid;
}

}  // namespace effuse::flow::particles
