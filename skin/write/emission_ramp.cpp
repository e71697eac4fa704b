#include "skin/write/emission_ramp.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/base/check.h"
#include "skin/color/srgb.h"

namespace effuse::skin {

namespace {
constexpr std::size_t kTexels = 256;

Vec3 emission_at(const geometry::VertexAttribute& glow, std::size_t i) {
  return Vec3(glow.values[3 * i], glow.values[3 * i + 1], glow.values[3 * i + 2]).cwiseMax(0);
}
}  // namespace

EmissionRamp make_emission_ramp(const geometry::VertexAttribute& glow) {
  CHECK_EQ(glow.width, 3);
  const std::size_t n = glow.values.size() / 3;
  EmissionRamp ramp;
  for (std::size_t i = 0; i < n; ++i) ramp.strength = std::max(ramp.strength, static_cast<float>(emission_at(glow, i).maxCoeff()));
  ramp.coordinate.assign(n, 0.5f / kTexels);
  ramp.image = {static_cast<int>(kTexels), 1, std::vector<std::uint8_t>(3 * kTexels)};
  if (!(ramp.strength > 0)) return ramp;

  // Square root: more texels for the dark end, where hue changes fastest.
  std::array<Vec3, kTexels> hue;
  std::array<std::size_t, kTexels> count{};
  hue.fill(Vec3::Zero());
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3 emission = emission_at(glow, i);
    const Real brightness = emission.maxCoeff();
    if (!(brightness > 0)) continue;
    const Real s = std::sqrt(brightness / ramp.strength) * (kTexels - 1);
    const std::size_t texel = std::min(static_cast<std::size_t>(std::lround(s)), kTexels - 1);
    hue[texel] += emission / brightness;
    ++count[texel];
    ramp.coordinate[i] = static_cast<float>((s + 0.5) / kTexels);
  }

  // Texels nobody uses lie between two that are: hue on the line between them, so that filtering stays on the curve.
  std::size_t before = kTexels;
  for (std::size_t k = 0; k < kTexels; ++k) {
    if (count[k] == 0) continue;
    hue[k] /= static_cast<Real>(count[k]);
    for (std::size_t gap = before == kTexels ? 0 : before + 1; gap < k; ++gap) {
      const Real t = before == kTexels ? 1 : static_cast<Real>(gap - before) / static_cast<Real>(k - before);
      hue[gap] = before == kTexels ? hue[k] : Vec3((1 - t) * hue[before] + t * hue[k]);
    }
    before = k;
  }
  const SrgbEncoder srgb;
  for (std::size_t k = 0; k < kTexels; ++k) {
    const Real s = static_cast<Real>(k) / (kTexels - 1);
    for (std::size_t c = 0; c < 3; ++c) ramp.image.rgb[3 * k + c] = srgb(static_cast<float>(s * s * hue[k][static_cast<Eigen::Index>(c)]));
  }
  return ramp;
}

}  // namespace effuse::skin
