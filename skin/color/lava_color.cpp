#include "skin/color/lava_color.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::skin {

using geometry::TriMesh;
using geometry::VertexAttribute;

namespace {

Real smoothstep(Real from, Real to, Real x) {
  const Real t = std::clamp((x - from) / (to - from), Real{0}, Real{1});
  return t * t * (3 - 2 * t);
}

Real mix(Real a, Real b, Real t) { return a + (b - a) * t; }

/// CIE 1931 2 degree colour matching functions, 380 to 780 nm in steps of 10 nm: x, y, z (CIE 015).
constexpr std::array<std::array<Real, 3>, 41> kMatching = {{
    {.0014, .0000, .0065},  {.0042, .0001, .0201},  {.0143, .0004, .0679},  {.0435, .0012, .2074},  {.1344, .0040, .6456},
    {.2839, .0116, 1.3856}, {.3483, .0230, 1.7471}, {.3362, .0380, 1.7721}, {.2908, .0600, 1.6692}, {.1954, .0910, 1.2876},
    {.0956, .1390, .8130},  {.0320, .2080, .4652},  {.0049, .3230, .2720},  {.0093, .5030, .1582},  {.0633, .7100, .0782},
    {.1655, .8620, .0422},  {.2904, .9540, .0203},  {.4334, .9950, .0087},  {.5945, .9950, .0039},  {.7621, .9520, .0021},
    {.9163, .8700, .0017},  {1.0263, .7570, .0011}, {1.0622, .6310, .0008}, {1.0026, .5030, .0003}, {.8544, .3810, .0002},
    {.6424, .2650, .0000},  {.4479, .1750, .0000},  {.2835, .1070, .0000},  {.1649, .0610, .0000},  {.0874, .0320, .0000},
    {.0468, .0170, .0000},  {.0227, .0082, .0000},  {.0114, .0041, .0000},  {.0058, .0021, .0000},  {.0029, .0010, .0000},
    {.0014, .0005, .0000},  {.0007, .0002, .0000},  {.0003, .0001, .0000},  {.0002, .0001, .0000},  {.0001, .0000, .0000},
    {.0000, .0000, .0000},
}};

/// Tristimulus values of a black body, up to a factor.
Vec3 blackbody_xyz(Real temperature) {
  constexpr Real kC2 = 1.438776877e7;  // second radiation constant [nm K]
  const Real T = std::clamp(temperature, Real{500}, Real{20000});
  Vec3 xyz = Vec3::Zero();
  for (std::size_t k = 0; k < kMatching.size(); ++k) {
    const Real lambda = 380 + 10.0 * static_cast<Real>(k);  // [nm]
    // Relative to 780 nm, so that 500 K does not underflow.
    const Real planck = std::pow(780 / lambda, 5) * std::expm1(kC2 / (780 * T)) / std::expm1(kC2 / (lambda * T));
    xyz += planck * Vec3(kMatching[k][0], kMatching[k][1], kMatching[k][2]);
  }
  return xyz;
}

/// lava_emission for a whole mesh: hues looked up in a table instead of integrated anew.
class EmissionTable {
 public:
  explicit EmissionTable(const LavaColorOptions& options) {
    for (std::size_t k = 0; k < kSize; ++k) values_[k] = lava_emission(temperature(k), options);
  }
  Vec3 operator()(Real T) const {
    const Real at = std::clamp((T - kFrom) / kStep, Real{0}, Real{kSize - 1});
    const std::size_t k = std::min(static_cast<std::size_t>(at), kSize - 2);
    const Real t = at - static_cast<Real>(k);
    return (1 - t) * values_[k] + t * values_[k + 1];
  }

 private:
  static constexpr std::size_t kSize = 300;
  static constexpr Real kFrom = 600, kStep = 5;  // [K]; hotter than 2095 K stays at the last value
  static Real temperature(std::size_t k) { return kFrom + kStep * static_cast<Real>(k); }
  std::array<Vec3, kSize> values_;
};

/// The numbers of an attribute, or null when the mesh has none of that name.
const float* values_of(const TriMesh& mesh, const char* name) {
  const auto found = mesh.attributes.find(name);
  if (found == mesh.attributes.end()) return nullptr;
  CHECK_EQ(found->second.width, 1);
  CHECK_EQ(found->second.values.size(), mesh.positions.size());
  return found->second.values.data();
}

/// How far plates have formed: 0 none, 1 all but the cracks.
Real plating(Real T, Real crust, const LavaColorOptions& options) {
  return std::clamp(std::max(crust, 1 - smoothstep(options.plated, options.molten, T)), Real{0}, Real{1});
}

/// Share of the surface that is open where the detail noise is `level` (0..1).
Real openness(Real level, Real plates, const LavaColorOptions& options) {
  const Real softness = std::max(options.crack_softness, Real{1e-3});
  // Unplated: everything is open, whatever the noise. Plated: only what lies below crack_width.
  const Real border = mix(1 + softness, options.crack_width > 0 ? options.crack_width : -softness, plates);
  return 1 - smoothstep(border - softness, border + softness, level);
}

/// Temperatures of plate and crack for lava at T.
struct Skin {
  Real plate, crack;
};
Skin skin_of(Real T, Real plates, const LavaColorOptions& options) {
  const Real closed = std::min(T, options.plate + 0.12 * std::max(T - options.plate, Real{0}));
  // The first film chills fast: plates are dark long before they close. Even a crack has a chilled film.
  return {mix(T, closed, 1 - (1 - plates) * (1 - plates)), mix(T, closed, 0.1 * plates)};
}

}  // namespace

Vec2 blackbody_chromaticity(Real temperature) {
  const Vec3 xyz = blackbody_xyz(temperature);
  return xyz.head<2>() / xyz.sum();
}

Vec3 blackbody_hue(Real temperature) {
  // CIE XYZ to linear Rec.709, white D65 (IEC 61966-2-1).
  const Mat3 rgb_from_xyz{{3.2406, -1.5372, -0.4986}, {-0.9689, 1.8758, 0.0415}, {0.0557, -0.2040, 1.0570}};
  const Vec3 rgb = (rgb_from_xyz * blackbody_xyz(temperature)).cwiseMax(0);
  return rgb / rgb.maxCoeff();
}

Vec3 lava_emission(Real temperature, const LavaColorOptions& options) {
  if (!(temperature > options.glow_from)) return Vec3::Zero();
  const Real fade = smoothstep(options.glow_from, options.glow_from + 120, temperature);
  return fade * options.strength * std::pow(temperature / options.reference, options.exponent) * blackbody_hue(temperature);
}

Vec3 lava_albedo(Real temperature, Real crust, Real altitude) {
  const Vec3 fresh(0.020, 0.016, 0.013), chilled(0.038, 0.029, 0.021), old(0.062, 0.050, 0.040);
  const Real c = std::clamp(crust, Real{0}, Real{1});
  const Vec3 solid = chilled + (old - chilled) * (1 - smoothstep(400, 900, temperature));
  const Vec3 flat = fresh + (solid - fresh) * std::max(c, 1 - smoothstep(900, 1250, temperature));
  const Real a = std::clamp(altitude, Real{-1}, Real{1});
  return flat.cwiseProduct(Vec3::Ones() + a * Vec3(0.42, 0.36, 0.30));
}

Real apparent_temperature(Real temperature, Real crust, Real detail, const LavaColorOptions& options) {
  const Real plates = plating(temperature, crust, options);
  const Skin skin = skin_of(temperature, plates, options);
  return mix(skin.plate, skin.crack, openness(0.5 * (detail + 1), plates, options));
}

Vec3 display_emission(const Vec3& emission) {
  return emission.unaryExpr([](Real e) { return -std::expm1(-e); });
}

void color_lava(TriMesh& mesh, const LavaColorOptions& options) {
  ZONE("skin.color");
  const std::size_t n = mesh.positions.size();
  const float* temperature = values_of(mesh, "temperature");
  const float* crust = values_of(mesh, "crust");
  const float* detail = values_of(mesh, "detail");
  const EmissionTable emission(options);
  VertexAttribute color{3, std::vector<float>(3 * n)}, glow{3, std::vector<float>(3 * n)};

  parallel_for(n, [&](std::size_t i) {
    const Real T = temperature ? temperature[i] : kZeroCelsius + 20;
    const Real solid = crust ? crust[i] : 0;
    const Real plates = plating(T, solid, options);
    const Skin skin = skin_of(T, plates, options);

    // Light from plates and cracks; without detail each vertex holds its share of both.
    Vec3 light;
    const Real altitude = detail ? std::clamp(static_cast<Real>(detail[i]), Real{-1}, Real{1}) : 0;
    const Vec3 albedo = lava_albedo(T, std::max(solid, plates), altitude);
    if (detail) {
      const Real level = 0.5 * (altitude + 1);
      light = emission(mix(skin.plate, skin.crack, openness(level, plates, options)));
    } else {
      const Real open = mix(1, 0.5 * options.crack_width, plates);
      light = (1 - open) * emission(skin.plate) + open * emission(skin.crack);
    }
    const Vec3 display = (albedo + display_emission(light)).cwiseMin(1);
    for (std::size_t k = 0; k < 3; ++k) {
      color.values[3 * i + k] = static_cast<float>(display[static_cast<Eigen::Index>(k)]);
      glow.values[3 * i + k] = static_cast<float>(light[static_cast<Eigen::Index>(k)]);
    }
  });
  mesh.attributes["color"] = std::move(color);
  mesh.attributes["glow"] = std::move(glow);
}

}  // namespace effuse::skin
