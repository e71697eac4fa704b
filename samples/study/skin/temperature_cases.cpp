#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/random.h"
#include "samples/study/measure.h"
#include "samples/study/skin/cases.h"
#include "samples/study/skin/fill.h"
#include "skin/color/lava_color.h"
#include "skin/detail/relief.h"

/// Height, roughness and glow of each kind of skin against temperature.
namespace effuse::study {

namespace {

using skin::SkinKind;

constexpr SkinKind kKinds[] = {SkinKind::kAa, SkinKind::kPahoehoe, SkinKind::kBlock, SkinKind::kObsidian};
constexpr Real kDraper = 798;                      // [K] Draper 1847: rock begins to glow
constexpr Real kCoolest = 900, kHottest = 1450;    // [K]
constexpr std::size_t kSteps = 23, kPoints = 2000;
constexpr Real kMolten = 0.6;                      // share of the height that molten lava may have
constexpr Real kAcross = 18, kTop = 3;             // of the slab [spacings]

/// A slab of lava, three layers deep, squeezed along x so that what folds does.
struct Slab {
  std::vector<Vec3> x, velocity;
  std::vector<Real> radius, temperature, crust;
  std::vector<std::uint64_t> id;
  Slab() {
    const Box3 box(Vec3(0, 0, 0), Vec3(kAcross, kAcross, kTop));
    x = fill(box, [&](const Vec3& p) { return (box.min() - p).cwiseMax(p - box.max()).maxCoeff(); }, 0, Filling::kDisorder, 5);
    for (std::size_t i = 0; i < x.size(); ++i) {
      velocity.emplace_back(-0.05 * x[i].x(), 0, 0.05 * x[i].z());
      radius.push_back(0.5);
      id.push_back(i);
    }
  }
  /// All of it at one temperature under one crust.
  geometry::Points points(Real T, Real solid) {
    temperature.assign(x.size(), T);
    crust.assign(x.size(), solid);
    geometry::Points p;
    p.position = x;
    p.rest = x;
    p.velocity = velocity;
    p.radius = radius;
    p.temperature = temperature;
    p.crust = crust;
    p.id = id;
    return p;
  }
};

/// Of one kind at one temperature.
struct Look {
  Real roughness = 0;  ///< rms of the height round its mean [spacings]
  Real height = 0;     ///< from the lowest to the highest 2 % [spacings]
  Real glow = 0;       ///< emission, all channels, mean over the surface
};
Look look_of(Slab& slab, SkinKind kind, Real T, Real crust) {
  skin::DisplaceOptions options;
  options.spacing = 1;
  options.kind = kind;
  const skin::Relief relief(slab.points(T, crust), options);
  geometry::TriMesh patch;
  geometry::VertexAttribute temperature{1, {}}, solid{1, {}}, detail{1, {}};
  std::vector<Real> h;
  for (std::uint64_t i = 0; i < kPoints; ++i) {
    const Vec3 p(3 + (kAcross - 6) * random_uniform(5, 0, i), 3 + (kAcross - 6) * random_uniform(5, 1, i), kTop);
    const skin::Relief::Sample s = relief.at(p, 0.05);
    h.push_back(s.height);
    patch.positions.push_back(p);
    temperature.values.push_back(static_cast<float>(T));
    solid.values.push_back(static_cast<float>(crust));
    detail.values.push_back(static_cast<float>(s.detail));
  }
  patch.attributes = {{"temperature", temperature}, {"crust", solid}, {"detail", detail}};
  skin::color_lava(patch);

  Look look;
  Real sum = 0, squares = 0, glow = 0;
  for (const Real v : h) sum += v;
  for (const Real v : h) squares += (v - sum / kPoints) * (v - sum / kPoints);
  for (const float e : patch.attributes.at("glow").values) glow += e;
  std::sort(h.begin(), h.end());
  look.roughness = std::sqrt(squares / kPoints);
  look.height = h[h.size() * 98 / 100] - h[h.size() * 2 / 100];
  look.glow = glow / kPoints;
  return look;
}

/// The largest step the wrong way, as a share of the largest value. rising: with x.
Real against(const std::vector<Real>& y, bool rising) {
  Real worst = 0, most = 0;
  for (const Real v : y) most = std::max(most, std::abs(v));
  for (std::size_t k = 1; k < y.size(); ++k) worst = std::max(worst, (rising ? y[k - 1] - y[k] : y[k] - y[k - 1]));
  return most > 0 ? worst / most : 0;
}

CaseResult temperatures() {
  CaseResult result;
  Slab slab;
  Plot height{"skin_height", "Height of the relief, lowest to highest 2 %", "temperature [K]", "height [spacings]", false, false, {}};
  Plot rough{"skin_roughness", "Roughness: rms round the mean", "temperature [K]", "roughness [spacings]", false, false, {}};
  Plot glow{"skin_glow", "Glow: emission of all channels, mean over the surface, no crust", "temperature [K]", "emission [white paper in the sun is 1 a channel]", false, true, {}};
  Plot thick{"skin_crust", "Height of the relief of molten lava under a growing crust", "crust", "height [spacings]", false, false, {}};
  const std::vector<Real> T = spaced(kCoolest, kHottest, kSteps), C = spaced(0, 1, 11);
  for (const SkinKind kind : kKinds) {
    const std::string name(skin::kSkinKindNames[static_cast<std::size_t>(kind)]);
    std::vector<Real> heights, roughness, light, by_crust;
    for (const Real t : T) {
      const Look look = look_of(slab, kind, t, 0);
      heights.push_back(look.height);
      roughness.push_back(look.roughness);
      light.push_back(look.glow);
    }
    for (const Real c : C) by_crust.push_back(look_of(slab, kind, kHottest, c).height);
    // Rounding: heights are sums of some ten terms.
    constexpr Real kRounding = 1e-12;
    const auto add = [&](const std::string& what, const std::vector<Real>& y, bool rising) {
      const Real wrong = against(y, rising);
      result.measures.push_back({name + ": " + what + ", largest step the wrong way", "", wrong, 0, wrong, kRounding, ""});
    };
    add("height falls with temperature", heights, false);
    add("roughness falls with temperature", roughness, false);
    add("height grows with crust", by_crust, true);
    add("glow rises with temperature", light, true);
    const Real gain = heights.back() / heights.front();
    result.measures.push_back({name + ": height at 1450 K over that at 900 K", "", gain, 0, gain, kMolten, "times"});
    Real dark = 0;
    for (const Real crust : {0.0, 0.5, 1.0})
      for (const Real t : {300.0, 600.0, 750.0, kDraper}) dark = std::max(dark, look_of(slab, kind, t, crust).glow);
    result.measures.push_back({name + ": glow at 300 K to 798 K", "", dark, 0, dark, 0, ""});
    height.curves.push_back({name, T, heights, false, false});
    rough.curves.push_back({name, T, roughness, false, false});
    thick.curves.push_back({name, C, by_crust, false, false});
    glow.curves.push_back({name, T, light, false, false});
  }
  result.plots = {std::move(height), std::move(rough), std::move(glow), std::move(thick)};
  result.note = fmt::format("{} points on the top of a slab of {:.0f} particles a spacing apart, all at one temperature, with default settings. Glow is the linear emission that files "
                            "carry, before any tone mapping.",
                            kPoints, kAcross * kAcross * kTop);
  return result;
}

}  // namespace

void add_temperature_cases(std::vector<Case>& cases) {
  cases.push_back({"temperature", "Relief grows as lava cools, glow fades", "monotone; no glow below the Draper point, 798 K", true, temperatures});
}

}  // namespace effuse::study
