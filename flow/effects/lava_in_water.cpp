#include "flow/effects/lava_in_water.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/zones.h"

namespace effuse::flow {

std::vector<Real> lava_under(const FlowView& lava, const PlanCells& cells, const std::vector<Real>& level) {
  ZONE("waves.lava");
  std::vector<Real> volume(level.size(), 0);
  const Real whole = std::pow(lava.spacing, 3), deviation = std::max(cells.cell, lava.spacing), reach = 2 * deviation;
  const int wide = static_cast<int>(std::ceil(reach / cells.cell));
  std::vector<std::pair<std::size_t, Real>> shares;
  for (const Vec3& x : lava.x) {
    const Real u = (x.x() - cells.corner.x()) / cells.cell, v = (x.y() - cells.corner.y()) / cells.cell;
    const int i = static_cast<int>(std::floor(u)), j = static_cast<int>(std::floor(v));
    if (!(u >= 0 && v >= 0 && i < cells.nx && j < cells.ny)) continue;
    const Real top = level[static_cast<std::size_t>(j) * static_cast<std::size_t>(cells.nx) + static_cast<std::size_t>(i)];
    if (!std::isfinite(top)) continue;
    const Real under = std::clamp((top - x.z()) / lava.spacing + 0.5, 0.0, 1.0);
    if (under <= 0) continue;
    shares.clear();
    Real sum = 0;
    for (int b = std::max(0, j - wide); b <= std::min(cells.ny - 1, j + wide); ++b)
      for (int a = std::max(0, i - wide); a <= std::min(cells.nx - 1, i + wide); ++a) {
        const std::size_t cell = static_cast<std::size_t>(b) * static_cast<std::size_t>(cells.nx) + static_cast<std::size_t>(a);
        if (!std::isfinite(level[cell])) continue;
        const Real d2 = (std::pow(a + 0.5 - u, 2) + std::pow(b + 0.5 - v, 2)) * cells.cell * cells.cell;
        if (d2 > reach * reach) continue;
        shares.emplace_back(cell, std::exp(-d2 / (2 * deviation * deviation)));
        sum += shares.back().second;
      }
    for (const auto& [cell, share] : shares) volume[cell] += under * whole * share / sum;
  }
  return volume;
}

}  // namespace effuse::flow
