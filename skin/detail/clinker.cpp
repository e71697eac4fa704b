#include "skin/detail/clinker.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/random.h"
#include "skin/detail/triangle_noise.h"

namespace effuse::skin {

ClinkerGrowth clinker_growth(Real cold) {
  const Real c = std::clamp(cold, Real{0}, Real{1});
  return {c * std::sqrt(c), 0.9 + 0.15 * c, 0.45 * c};
}

Real clinker_dome(Real inside, Real size) {
  const Real t = std::min(size * inside * std::sqrt(std::sqrt(inside)), Real{1});
  return t * (2 - t);
}

Real clinker(const Regions::Place& place, std::uint64_t id, const Vec2& uv, const ClinkerGrowth& growth, std::uint64_t seed) {
  if (place.particle == Regions::kNone || place.inside <= 0) return 0;
  const auto draw = [&](std::uint64_t which) { return random_uniform(seed, id, which); };
  const Real dome = clinker_dome(place.inside, growth.size);
  const Real share = 0.55 + 0.55 * draw(0), angle = 2 * kPi * draw(1), tilt = 0.7 * draw(2);
  const Real lean = tilt * (std::cos(angle) * uv.x() + std::sin(angle) * uv.y());
  const Vec2 part(1000 * draw(3), 1000 * draw(4));
  const Real rough = growth.roughness > 0 ? triangle_octaves(uv / 0.6 + part, seed, 3, 0.5).value : 0;
  return dome * (share * (1 + lean) + growth.roughness * rough);
}

Real mean_clinker(Real size) { return 0.217 + 0.112 * (size - 0.9); }

}  // namespace effuse::skin
