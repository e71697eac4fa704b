#include "skin/detail/clinker.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/random.h"
#include "skin/detail/triangle_noise.h"

namespace effuse::skin {

namespace {

constexpr Real kDome = 0.9, kBlock = 1.05;  // ClinkerGrowth::size: molten, cold
constexpr int kFaces = 5;
constexpr Real kBroken = 2.2;  // slope of the broken faces
constexpr Real kRound = 0.05;  // [spacings] of their edges
constexpr Real kSteep = 1.5;   // of the dome's sides
constexpr Real kEdge = 6;      // how sharp the rim is between side and top
constexpr Real kLeast = 0.1;   // [spacings] about the lowest top

}  // namespace

ClinkerGrowth clinker_growth(Real cold) {
  const Real c = std::clamp(cold, Real{0}, Real{1});
  return {c * std::sqrt(c), kDome + (kBlock - kDome) * c, 0.3 * c};
}

Real clinker_dome(Real inside, Real size) {
  const Real t = std::min(size * inside * std::sqrt(std::sqrt(inside)), Real{1});
  return t * (2 - t);
}

Real clinker(const Regions::Place& place, std::uint64_t id, const Vec2& uv, const ClinkerGrowth& growth, std::uint64_t seed) {
  if (place.particle == Regions::kNone || place.inside <= 0) return 0;
  const auto draw = [&](std::uint64_t which) { return random_uniform(seed, id, which); };
  const Real dome = clinker_dome(place.inside, growth.size);
  const Real high = draw(0), share = 0.3 + high * (0.2 + 0.8 * high), angle = 2 * kPi * draw(1), tilt = 0.9 * draw(2);
  const Real lean = tilt * (std::cos(angle) * uv.x() + std::sin(angle) * uv.y());
  // Faces broken off, all round: they come as the dome gets a top.
  Real broken = 0;
  const Real sharp = (growth.size - kDome) / (kBlock - kDome);
  if (sharp > 0)
    for (std::uint64_t k = 0; k < kFaces; ++k) {
      const Real a = angle + 2 * kPi * (static_cast<Real>(k) + 0.7 * draw(5 + 2 * k)) / kFaces;
      const Real over = std::cos(a) * uv.x() + std::sin(a) * uv.y() - 0.3 * draw(6 + 2 * k);
      broken += 0.5 * (over + std::sqrt(over * over + kRound * kRound));
    }
  const Vec2 part(1000 * draw(3), 1000 * draw(4));
  const Real rough = growth.roughness > 0 ? triangle_octaves(uv / 0.6 + part, seed, 3, 0.5).value : 0;
  const Real top = share * (1 + lean - sharp * kBroken * broken) + growth.roughness * rough;
  // The less of the two, with a round edge between: where the dome vanishes so does this, and as softly.
  const Real side = kSteep * dome, lid = 0.5 * (top + std::sqrt(top * top + kLeast * kLeast));
  return side > 0 ? side / std::pow(1 + std::pow(side / lid, kEdge), 1 / kEdge) : 0;
}

Real mean_clinker(Real size) { return 0.27 - 0.55 * (size - kDome); }

}  // namespace effuse::skin
