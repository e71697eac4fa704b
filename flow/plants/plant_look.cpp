#include "flow/plants/plant_look.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/base/random.h"
#include "geometry/mesh/measure.h"

namespace effuse::flow::plants {

using geometry::Leaf;
using geometry::Limb;
using geometry::Plant;
using geometry::TriMesh;

namespace {

constexpr std::uint64_t kLeafStream = 0x1eaf, kLimbStream = 0x11b, kTongueStream = 0xf1a;
constexpr Real kKeptTwigs = 0.2;     // of the stem's thickness: thicker limbs stand when all has burnt
constexpr Real kShrunk = 0.75;       // thickness of a charred limb
constexpr Real kDry = 60;            // [K] above air: it begins to wilt
using Light = std::array<Real, 3>;
constexpr Light kBrown = {0.16, 0.085, 0.025}, kChar = {0.012, 0.011, 0.010}, kEmber = {1.5, 0.28, 0.025}, kFlameLow = {2.0, 0.72, 0.10}, kFlameHigh = {1.2, 0.24, 0.015};

Light mix(const Light& a, const Light& b, Real share) { return {a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])}; }

int band_of(Real z, Real height) { return std::clamp(static_cast<int>(z / height * PlantFire::kBands), 0, PlantFire::kBands - 1); }

}  // namespace

TriMesh look_of(const Plant& grown, const Standing& standing, const geometry::Sway& sway, int sides, const PlantFire& fire, std::size_t p, Real t, Real air, Real ignition) {
  geometry::Sway own = sway;
  // It is the wind that stands still, not the plant: turned back by what turns the plant. Its own time, too, so that plants do not sway as one.
  const Real c = std::cos(standing.turn), s = std::sin(standing.turn);
  own.wind = Vec2(c * sway.wind.x() + s * sway.wind.y(), -s * sway.wind.x() + c * sway.wind.y());
  const Plant bent = geometry::swayed(grown, own, t + sway.period * random_uniform(1, kLimbStream, p));
  const Real height = grown.height(), stem = grown.limbs.empty() ? 1 : grown.limbs.front().thick_from;

  // What is left of it. The band goes by where a part stands without wind.
  Plant left;
  std::vector<Index> number(bent.limbs.size(), Plant::kNone);
  std::vector<int> limb_band;
  for (std::size_t k = 0; k < bent.limbs.size(); ++k) {
    const int band = band_of((grown.limbs[k].from.z() + grown.limbs[k].to.z()) / 2, height);
    const Real b = fire.burnt(p, band), thin = grown.limbs[k].thick_from / stem, u = random_uniform(p, kLimbStream, k);
    Limb limb = bent.limbs[k];
    const bool orphan = limb.parent != Plant::kNone && number[limb.parent] == Plant::kNone;
    if (orphan || (thin < kKeptTwigs && b > 0.35 + 0.6 * thin / kKeptTwigs * (0.5 + 0.5 * u))) continue;
    const Real shrunk = 1 - (1 - kShrunk) * b;
    limb.thick_from *= shrunk;
    limb.thick_to *= shrunk;
    limb.parent = limb.parent == Plant::kNone ? Plant::kNone : number[limb.parent];
    number[k] = static_cast<Index>(left.limbs.size());
    left.limbs.push_back(limb);
    limb_band.push_back(band);
  }
  std::vector<int> leaf_band;
  std::vector<Real> leaf_chance;
  for (std::size_t k = 0; k < bent.leaves.size(); ++k) {
    Leaf leaf = bent.leaves[k];
    const int band = band_of(grown.leaves[k].at.z(), height);
    const Real b = fire.burnt(p, band), u = random_uniform(p, kLeafStream, k);
    if (leaf.limb != Plant::kNone && number[leaf.limb] == Plant::kNone) continue;
    const Real gone = 0.12 + 0.4 * u;
    if (b > gone) continue;
    leaf.size *= 1 - 0.6 * b / gone;
    leaf.limb = leaf.limb == Plant::kNone ? Plant::kNone : number[leaf.limb];
    left.leaves.push_back(leaf);
    leaf_band.push_back(band);
    leaf_chance.push_back(u);
  }

  TriMesh mesh = geometry::plant_mesh(left, sides);
  const std::vector<float> part = std::move(mesh.attributes.at("part").values);
  const geometry::VertexAttribute of_limb = std::move(mesh.attributes.at("limb"));
  geometry::VertexAttribute color = std::move(mesh.attributes.at("color")), glow{3, std::vector<float>(color.values.size(), 0)};
  std::size_t leaf_vertex = 0;
  for (std::size_t q = 0; q < mesh.positions.size(); ++q) {
    const bool leaf = part[q] > 0;
    // Leaves come last, four vertices each.
    const std::size_t n = leaf ? leaf_vertex++ / 4 : static_cast<std::size_t>(of_limb.values[q]);
    const int band = leaf ? leaf_band[n] : limb_band[n];
    const Real u = leaf ? leaf_chance[n] : random_uniform(p, kTongueStream, n);
    const Real b = fire.burnt(p, band), dry = std::clamp((fire.temperature(p, band) - air - kDry) / (ignition - air - kDry), 0.0, 1.0);
    Light light = {color.values[3 * q], color.values[3 * q + 1], color.values[3 * q + 2]};
    // Leaves are not all of one green, and more brown the drier.
    const Real shade = leaf ? 0.75 + 0.5 * u : 1;
    for (Real& each : light) each *= shade;
    if (leaf) light = mix(light, kBrown, dry);
    light = mix(light, kChar, std::clamp(b / 0.25, 0.0, 1.0));
    const Real ember = fire.flame(p, band) * (leaf ? 1 : 0.25 + 0.75 * u) * (leaf ? 0.8 : 0.5);
    for (std::size_t a = 0; a < 3; ++a) {
      color.values[3 * q + a] = static_cast<float>(light[a]);
      glow.values[3 * q + a] = static_cast<float>(ember * kEmber[a]);
    }
  }
  mesh.attributes.clear();
  mesh.attributes["color"] = std::move(color);
  mesh.attributes["glow"] = std::move(glow);
  const auto turned = [&](const Vec3& v) { return Vec3(c * v.x() - s * v.y(), s * v.x() + c * v.y(), v.z()); };
  for (Vec3& x : mesh.positions) x = standing.foot + standing.scale * turned(x);
  for (Vec3& n : mesh.normals) n = turned(n);
  return mesh;
}

TriMesh flames_of(const Plant& grown, const Standing& standing, const PlantFire& fire, std::size_t p, Real t) {
  constexpr int kTongues = 60, kPlaces = 600, kRound = 6, kUp = 5;
  TriMesh mesh;
  geometry::VertexAttribute color, glow;
  color.width = glow.width = 3;
  const Real height = grown.height(), c = std::cos(standing.turn), s = std::sin(standing.turn);
  int burning = 0;
  for (std::uint64_t k = 0; k < kPlaces && burning < kTongues && fire.any_flame(p); ++k) {
    const std::uint64_t id = p * kPlaces + k;
    const auto u = [&](std::uint64_t n) { return random_uniform(7, kTongueStream + n, id); };
    // On a leaf or in the middle of a limb: where there is much to burn there are many.
    const std::size_t at = static_cast<std::size_t>(u(0) * static_cast<Real>(grown.leaves.size() + grown.limbs.size()));
    Vec3 foot;
    if (at < grown.leaves.size()) foot = grown.leaves[at].at;
    else foot = (grown.limbs[at - grown.leaves.size()].from + grown.limbs[at - grown.leaves.size()].to) / 2;
    const Real f = fire.flame(p, band_of(foot.z(), height));
    if (f <= 0) continue;
    ++burning;
    foot = standing.foot + standing.scale * Vec3(c * foot.x() - s * foot.y(), s * foot.x() + c * foot.y(), foot.z());
    // Each rises, tears off and starts anew, at its own pace.
    const Real phase = t * (1.1 + 0.7 * u(1)) + u(2), life = phase - std::floor(phase), size = f * std::sin(kPi * std::pow(life, 0.6)) * (0.5 + 0.8 * u(3));
    if (size < 0.08) continue;
    const Real tall = 0.2 * fire.height(p) * size, wide = 0.2 * tall;
    const auto first = static_cast<Index>(mesh.positions.size());
    for (int j = 0; j <= kUp; ++j) {
      const Real h = static_cast<Real>(j) / kUp, w = wide * 2.4 * std::sqrt(h + 0.05) * (1.03 - h);
      // It licks to and fro, the more the higher.
      const Vec3 lean = 1.2 * wide * h * Vec3(std::sin(7 * t + 4 * h + 9 * u(4)), std::cos(6 * t + 3 * h + 9 * u(5)), 0);
      const Light light = mix(kFlameLow, kFlameHigh, h);
      for (int q = 0; q < kRound; ++q) {
        const Real a = 2 * kPi * (q + 0.5 * (j % 2)) / kRound;
        mesh.positions.push_back(foot + lean + Vec3(w * std::cos(a), w * std::sin(a), tall * (h + 0.3 * life)));
        for (const Real each : light) {
          color.values.push_back(0.02f);
          glow.values.push_back(static_cast<float>(each * (0.35 + 0.65 * f)));
        }
      }
    }
    const auto vertex = [&](int up, int round) { return first + static_cast<Index>(up * kRound + (round % kRound)); };
    for (int j = 0; j < kUp; ++j)
      for (int q = 0; q < kRound; ++q) {
        mesh.triangles.push_back({vertex(j, q), vertex(j, q + 1), vertex(j + 1, q + 1)});
        mesh.triangles.push_back({vertex(j, q), vertex(j + 1, q + 1), vertex(j + 1, q)});
      }
  }
  geometry::compute_normals(mesh);
  mesh.attributes["color"] = std::move(color);
  mesh.attributes["glow"] = std::move(glow);
  return mesh;
}

}  // namespace effuse::flow::plants
