#include "skin/detail/plates.h"

#include <array>
#include <cmath>
#include <limits>

#include "geometry/base/check.h"
#include "geometry/base/random.h"
#include "skin/detail/blend.h"

namespace effuse::skin {

PlatePlace plate_at(const Vec3& p, Real width, std::uint64_t seed) {
  CHECK(width > 0 && width <= kWidestPlateSlope);
  constexpr Real kJitter = 0.3;
  PlatePlace place;
  if (!(p.cwiseAbs().maxCoeff() < 0x1.0p50)) return place;
  const Vec3 base(std::floor(p.x()), std::floor(p.y()), std::floor(p.z()));
  std::array<Vec3, 27> site;  // from p
  std::array<std::uint64_t, 27> bits;
  std::size_t own = 0, n = 0;
  Real nearest = std::numeric_limits<Real>::infinity();
  for (int i = -1; i <= 1; ++i)
    for (int j = -1; j <= 1; ++j)
      for (int k = -1; k <= 1; ++k, ++n) {
        const Vec3 cell = base + Vec3(i, j, k);
        const std::uint64_t row = static_cast<std::uint64_t>(static_cast<std::int64_t>(cell.y())) * 0x9e3779b97f4a7c15ULL +
                                  static_cast<std::uint64_t>(static_cast<std::int64_t>(cell.z()));
        bits[n] = random_bits(seed, row, static_cast<std::uint64_t>(static_cast<std::int64_t>(cell.x())));
        const auto part = [&](int shift) { return kJitter * (static_cast<Real>(bits[n] >> shift & 0x1fffff) * 0x1.0p-20 - 1); };
        site[n] = cell + Vec3::Constant(0.5) + Vec3(part(0), part(21), part(42)) - p;
        const Real d = site[n].squaredNorm();
        if (d < nearest) {
          nearest = d;
          own = n;
        }
      }
  place.id = random_bits(seed, 1, bits[own]);
  place.from_middle = -site[own];
  place.inside = 1;
  place.border = 0.5;
  for (std::size_t s = 0; s < n; ++s) {
    if (s == own) continue;
    const Real b = (site[s].squaredNorm() - nearest) / (2 * (site[s] - site[own]).norm());
    place.border = std::min(place.border, b);
    place.inside *= smoothstep(0, width, b);
  }
  return place;
}

}  // namespace effuse::skin
