#include "flow/sph/vent.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"

namespace effuse::flow::sph {

std::vector<Vec3> Vent::lattice(Real spacing) const {
  const Vec2 line = (to - from).head<2>();
  const Real length = line.norm();
  CHECK_LE(std::max(length, width) / spacing, 1e6);
  std::vector<Vec3> sites;
  const auto half_count = [&](Real extent) { return static_cast<int>(std::floor(extent / 2 / spacing)); };
  if (length < 1e-9) {
    // A disk: the lattice points within it, its centre one of them.
    const int n = half_count(width);
    for (int j = -n; j <= n; ++j)
      for (int i = -n; i <= n; ++i)
        if (4 * spacing * spacing * (static_cast<Real>(i) * i + static_cast<Real>(j) * j) <= width * width) sites.push_back(from + spacing * Vec3(i, j, 0));
    return sites;
  }
  // A strip: whole rows along the line, columns across it, both centred.
  const int along = std::max(1, static_cast<int>(std::lround(length / spacing))), across = std::max(1, static_cast<int>(std::lround(width / spacing)));
  const Vec2 t = line / length, n(-t.y(), t.x());
  for (int i = 0; i < along; ++i) {
    const Real s = (i + 0.5) / along;
    for (int j = 0; j < across; ++j) {
      const Vec2 aside = n * (spacing * (j - (across - 1) / 2.0));
      sites.push_back(from + s * (to - from) + Vec3(aside.x(), aside.y(), 0));
    }
  }
  return sites;
}

Real Vent::volume(Real t) const {
  const Real end = std::min(t, stop);
  if (end <= start) return 0;
  if (rates) return geometry::integral(*rates, start, end);
  if (ramp <= 0) return rate * (end - start);
  // Trapezoid: up over `ramp`, down over `ramp` before stop; both shortened when the vent is brief.
  const Real up = std::min(ramp, (stop - start) / 2);
  const auto rising = [&](Real s) { return rate * s * s / (2 * up); };
  const Real s = end - start;
  if (s <= up) return rising(s);
  const Real falling_from = stop - start - up;
  if (s <= falling_from) return rising(up) + rate * (s - up);
  return rising(up) + rate * (falling_from - up) + rising(up) - rising(stop - start - s);
}

}  // namespace effuse::flow::sph
