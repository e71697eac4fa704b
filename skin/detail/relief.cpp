#include "skin/detail/relief.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/random.h"
#include "geometry/procedural/noise.h"
#include "skin/detail/blend.h"
#include "skin/detail/clinker.h"
#include "skin/detail/folds.h"
#include "skin/detail/plates.h"

namespace effuse::skin {

namespace {

constexpr Real kDeviation = 0.28;      // of gradient_noise
constexpr Real kMeanFragment = 0.185;  // of fragments(): measured, see the test of means
constexpr Real kFragment = 1.9;        // [spacings] size of the largest fragments
constexpr Real kFragmentFiner = 0.56, kFragmentGain = 0.65;
constexpr Real kMostDisplaced = 0.35;  // [spacings]
constexpr Real kOnDrop = 0.35;         // of the height, on a lone particle: a fifth of its radius at most
constexpr Real kDrop = 0.9, kBody = 2.2;  // Material's weights there, and at a body's edges

/// n's picture under the linear map A of its tangent plane, unit: the cross product of two mapped tangents; n where A has none.
Vec3 mapped_normal(const Mat3& A, const Vec3& n) {
  const Vec3 a = n.unitOrthogonal(), b = n.cross(a), m = (A * a).cross(A * b);
  const Real length = m.norm();
  return length > 1e-9 ? Vec3(m / length) : n;
}

/// Two axes across n, smooth in n but where it points straight down.
/// Source: Duff, Burgess, Christensen, Hery, Kensler, Liani & Villemin 2017, Building an orthonormal basis, revisited.
Vec2 across(const Vec3& n, const Vec3& d) {
  const Real s = 1 / (1 + std::max(n.z(), Real{-0.999})), q = -n.x() * n.y() * s;
  const Vec3 a(1 - n.x() * n.x() * s, q, -n.x()), b(q, 1 - n.y() * n.y() * s, -n.y());
  return Vec2(a.dot(d), b.dot(d));
}

/// Share of the height that what lies under the surface has room for.
Real permitted(Real weight) { return kOnDrop + (1 - kOnDrop) * smoothstep(kDrop, kBody, weight); }

}  // namespace

struct Relief::Here {
  Vec3 x, normal;
  Material::Sample m;
  Real cold;
  Real share[2];  // of the frames: their blend
  Real contrast;  // its deviation, for noises that know nothing of one another
};

Relief::Relief(const geometry::Points& points, const DisplaceOptions& options)
    : o_(options), material_(points, options.spacing), regions_(points, options.spacing), id_(points.id.begin(), points.id.end()) {
  CHECK(o_.kind != SkinKind::kNoise);
  CHECK(o_.rest_ratio >= 0 && o_.rest_ratio <= 1);
  // Without ids the order has to do.
  if (id_.empty())
    for (std::size_t i = 0; i < points.size(); ++i) id_.push_back(i);
}

/// Noise in the two frames, blended to the contrast of one: a gradient_noise.
Real Relief::blended(const Here& here, Real wave, const Vec3& offset, std::uint64_t seed) const {
  Real n = 0;
  for (int f = 0; f < 2; ++f)
    if (here.share[f] > 0) n += here.share[f] * geometry::gradient_noise(here.m.rest[f] / wave + offset, seed);
  return n / here.contrast;
}

/// Broken rock: each piece (plates.h) a wedge, its crest and its two faces at random; pieces of each octave lie on those of
/// the one before. About 0 in the joints .. 1.
Real Relief::fragments(const Here& here, int octaves, Real edge, std::uint64_t seed) const {
  constexpr Real kRound = 0.05;  // of the crests
  Real sum = 0, total = 0, height = 1, wave = kFragment * o_.spacing;
  for (int k = 0; k < octaves; ++k, height *= kFragmentGain, wave *= kFragmentFiner) {
    total += height;
    const Real seen = k == 0 ? 1 : smoothstep(2.5, 5, wave / edge);
    Real level = 0;
    if (seen > 0)
      for (int f = 0; f < 2; ++f) {
        if (here.share[f] <= 0) continue;
        const PlatePlace at = plate_at(here.m.rest[f] / wave + Vec3(0.37 * k, 0.71 * k, 0.53 * k), kWidestPlateSlope, seed + static_cast<std::uint64_t>(k));
        const auto draw = [&](std::uint64_t which) { return 2 * random_uniform(seed, at.id, which) - 1; };
        const Real across = Vec3(draw(1), draw(2), draw(3)).dot(at.from_middle) + 0.1 * draw(7);
        const Real lean = Vec3(draw(4), draw(5), draw(6)).dot(at.from_middle);
        const Real wedge = 0.65 + 0.4 * draw(0) + 0.9 * lean - 2.2 * (std::sqrt(across * across + kRound * kRound) - kRound);
        level += here.share[f] * (at.inside * wedge - kMeanFragment);
      }
    sum += height * (kMeanFragment + seen * level / here.contrast);
  }
  return sum / total;
}

/// Gradient noise in both frames, deviation 1.
Real Relief::swell(const Here& here, Real wavelength, int octaves, Real gain, Real edge, std::uint64_t seed) const {
  Real sum = 0, squares = 0, height = 1, wave = wavelength * o_.spacing;
  for (int k = 0; k < octaves; ++k, height *= gain, wave /= 2) {
    squares += height * height;
    // Bumps need two edges to be seen; they come in over the next octave.
    const Real seen = k == 0 ? 1 : smoothstep(1.9, 3.8, wave / edge);
    if (seen <= 0) continue;
    // An offset of its own for each octave: lattices whose zeros meet would show.
    const Vec3 offset(0.37 * k, 0.71 * k, 0.53 * k);
    sum += seen * height * blended(here, wave, offset, seed + static_cast<std::uint64_t>(k));
  }
  return sum / (kDeviation * std::sqrt(squares));
}

Relief::Sample Relief::at(const Vec3& x, Real edge) const {
  Here here;
  here.x = x;
  here.m = material_.at(x);
  if (!here.m.any) return {};
  here.normal = here.m.outward.norm() > 0 ? Vec3(here.m.outward.normalized()) : Vec3(Vec3::UnitZ());
  const Real chilled = material_.has_temperature() ? 1 - smoothstep(o_.solid, o_.molten, here.m.temperature) : 1;
  here.cold = material_.has_crust() ? std::max(chilled, std::clamp(here.m.crust, Real{0}, Real{1})) : chilled;
  const bool first = material_.has_rest(0), second = material_.has_rest(1);
  const Real q = first && second ? o_.rest_ratio : second ? 1 : 0;
  here.share[0] = 1 - q;
  here.share[1] = q;
  here.contrast = std::hypot(1 - q, q);

  Sample sample;
  switch (o_.kind) {
    case SkinKind::kAa: sample = aa(here, edge); break;
    case SkinKind::kPahoehoe: sample = pahoehoe(here, edge); break;
    case SkinKind::kBlock: sample = block(here, edge); break;
    case SkinKind::kObsidian: sample = obsidian(here, edge); break;
    case SkinKind::kNoise: break;
  }
  // Soft limits: no kink where they are reached.
  const Real most = kMostDisplaced * o_.spacing;
  sample.height = permitted(here.m.weight) * most * std::tanh(o_.amplitude * o_.spacing * sample.height / most);
  sample.detail = std::clamp(sample.detail, Real{-1}, Real{1});
  sample.cold = here.cold;
  return sample;
}

Relief::Sample Relief::aa(const Here& here, Real edge) const {
  const Real swells = std::clamp(0.4 * swell(here, o_.wavelength, 2, o_.gain, edge, o_.seed), Real{-1}, Real{1});
  const Regions::Place place = regions_.at(here.x);
  ClinkerGrowth growth = clinker_growth(here.cold);
  growth.roughness *= o_.roughness;
  Real z = 0;
  if (place.particle != Regions::kNone) {
    // Offsets from the particle in the two frames differ by what happened between their births only: a plain mean keeps contrast.
    Vec2 uv = Vec2::Zero();
    for (int f = 0; f < 2; ++f)
      if (here.share[f] > 0)
        uv += here.share[f] / o_.spacing *
              across(mapped_normal(here.m.slope[f], here.normal), here.m.rest[f] - material_.rest_of(place.particle, f));
    z = clinker(place, id_[place.particle], uv, growth, o_.seed);
  }
  // What broke off them lies on them and between.
  const Real small = fragments(here, o_.octaves, edge, o_.seed + 100);
  Sample s;
  s.height = (o_.molten_share + (0.5 - o_.molten_share) * here.cold) * swells + growth.height * 1.1 * (z - mean_clinker(growth.size)) +
             here.cold * o_.roughness * 2.5 * (small - kMeanFragment);
  const Real dome = place.particle == Regions::kNone ? 1 : clinker_dome(place.inside, growth.size);
  const Real top = std::clamp(std::cbrt(dome) * (0.7 + 0.3 * z), Real{0}, Real{1});
  // Outlines as broken as the rock.
  s.detail = 2 * (1 - (1 - top) * (1 - std::min(1.35 * small, Real{1})) + 0.45 * (small - kMeanFragment)) - 1;
  return s;
}

Relief::Sample Relief::pahoehoe(const Here& here, Real edge) const {
  const Real swells = std::clamp(0.45 * swell(here, o_.wavelength, 2, 0.35, edge, o_.seed), Real{-1}, Real{1});
  SqueezeOptions how;
  how.time = o_.fold_time;
  const Squeeze squeeze = squeeze_at(here.m, here.share[1], how);
  const Real wave = (o_.fold_wavelength > 0 ? o_.fold_wavelength : 1.1) * o_.spacing;
  Real ropes = 0;
  if (squeeze.amount > 0)
    for (int f = 0; f < 2; ++f) {
      if (here.share[f] <= 0) continue;
      const Vec3 along = here.m.slope[f] * squeeze.direction;
      const FoldSample fold = fold_noise(here.m.rest[f] / wave, along / std::sqrt(along.squaredNorm() + 1e-6), o_.seed + 7);
      ropes += here.share[f] * fold.strength * rope_profile(fold.phase);
    }
  ropes *= squeeze.amount / here.contrast;
  const Real wrinkles = swell(here, 0.5, std::max(o_.octaves - 1, 1), o_.gain, edge, o_.seed + 100);
  Sample s;
  const Real grown = o_.molten_share + (1 - o_.molten_share) * here.cold;
  s.height = grown * (0.6 * swells + 0.75 * ropes + 0.02 * o_.roughness * here.cold * wrinkles);
  s.detail = 0.25 + 0.3 * swells + 0.6 * ropes + 0.05 * wrinkles;
  return s;
}

Relief::Sample Relief::block(const Here& here, Real edge) const {
  const Real swells = std::clamp(0.4 * swell(here, 2 * o_.wavelength, 1, o_.gain, edge, o_.seed), Real{-1}, Real{1});
  const Real plate = 4.0 / 3 * o_.wavelength * o_.spacing;
  Real z = 0, level = 0;
  for (int f = 0; f < 2; ++f) {
    if (here.share[f] <= 0) continue;
    // Plates stay as they are: what the surface grew by lies open between them. Area: rest over now.
    const Vec3 a = here.normal.unitOrthogonal();
    const Real area = (here.m.slope[f] * a).cross(here.m.slope[f] * here.normal.cross(a)).norm();
    const Real gap = 0.008 + 0.25 * std::max(Real{0}, 1 - std::sqrt(std::min(area, Real{1})));
    // Broken edges: the plates' straight ones pushed about by noise.
    const Vec3 p = here.m.rest[f] / plate;
    const Vec3 broken = p + 0.05 * Vec3(geometry::gradient_noise(4 * p, o_.seed + 41), geometry::gradient_noise(4 * p, o_.seed + 42),
                                        geometry::gradient_noise(4 * p, o_.seed + 43));
    Real height = 0, top = 1, rim = 1;
    for (int part = 0; part < 2; ++part) {
      // Plates, and half as wide the facets that they break along without parting.
      const PlatePlace at = plate_at(part == 0 ? broken : Vec3(2.1 * broken + Vec3(0.3, 0.7, 0.1)), kWidestPlateSlope, o_.seed + 31 + static_cast<std::uint64_t>(part));
      const auto draw = [&](std::uint64_t which) { return 2 * random_uniform(o_.seed, at.id, which) - 1; };
      const Real lean = Vec3(draw(1), draw(2), draw(3)).dot(at.from_middle);
      if (part == 0) {
        top = smoothstep(gap, gap + 0.035, at.border);
        rim = smoothstep(gap - 0.012, gap + 0.05, at.border);
        height = 0.8 + 0.25 * draw(0) + 1.1 * lean;
      } else {
        height += at.inside * (0.18 * draw(0) + 0.7 * lean);
      }
    }
    z += here.share[f] * top * height;
    level += here.share[f] * rim;
  }
  const Real fine = swell(here, 1, o_.octaves, o_.gain, edge, o_.seed + 100);
  const Real grown = here.cold * here.cold;  // after the swell: the two may lean against one another
  Sample s;
  s.height = (o_.molten_share + (0.5 - o_.molten_share) * here.cold) * swells + grown * (1.5 * (z - 0.75) + 0.1 * o_.roughness * level * fine);
  s.detail = 2 * std::clamp(level * (0.85 + 0.1 * fine), Real{0}, Real{1}) - 1;
  return s;
}

Relief::Sample Relief::obsidian(const Here& here, Real edge) const {
  const Real swells = std::clamp(0.45 * swell(here, 1.5 * o_.wavelength, 1, o_.gain, edge, o_.seed), Real{-1}, Real{1});
  SqueezeOptions how;
  how.time = o_.fold_time;
  how.slope = 0.4;
  const Squeeze squeeze = squeeze_at(here.m, here.share[1], how);
  const Real wave = (o_.fold_wavelength > 0 ? o_.fold_wavelength : 2.4) * o_.spacing;
  Real folds = 0;
  if (squeeze.amount > 0)
    for (int f = 0; f < 2; ++f) {
      if (here.share[f] <= 0) continue;
      const Vec3 along = here.m.slope[f] * squeeze.direction;
      const FoldSample fold = fold_noise(here.m.rest[f] / wave, along / std::sqrt(along.squaredNorm() + 1e-6), o_.seed + 7);
      folds += here.share[f] * fold.strength * ((1 - here.cold) * std::cos(fold.phase) + here.cold * rope_profile(fold.phase));
    }
  folds *= squeeze.amount / here.contrast;
  Sample s;
  s.height = (o_.molten_share + (1 - o_.molten_share) * here.cold) * (0.5 * swells + 0.9 * folds);
  s.detail = 0.4 + 0.2 * swells + 0.5 * folds;
  return s;
}

}  // namespace effuse::skin
