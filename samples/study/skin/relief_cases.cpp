#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "geometry/base/random.h"
#include "samples/study/skin/cases.h"
#include "samples/study/skin/fill.h"
#include "samples/study/skin/solids.h"
#include "skin/detail/displace.h"
#include "skin/detail/triangle_noise.h"
#include "skin/surface/level_set.h"
#include "skin/tessellate/regions.h"

/// What displacement must not show: the borders of what it is made of, and directions.
namespace effuse::study {

namespace {

using geometry::TriMesh;
using skin::SkinKind;

constexpr SkinKind kKinds[] = {SkinKind::kAa, SkinKind::kPahoehoe, SkinKind::kBlock, SkinKind::kObsidian};
std::string name_of(SkinKind kind) { return std::string(skin::kSkinKindNames[static_cast<std::size_t>(kind)]); }

// ---- Kinks ----

/// Root mean square of the normal's jump over edges between triangles of different label, and over the others.
struct Jumps {
  Real border = 0, inside = 0;
};
Jumps jumps(const TriMesh& mesh, const std::vector<Index>& label) {
  std::vector<Vec3> normal;
  for (const auto& [a, b, c] : mesh.triangles) normal.push_back((mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]).normalized());
  std::map<std::pair<Index, Index>, std::size_t> first;
  Real sum[2] = {0, 0}, n[2] = {0, 0};
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = mesh.triangles[t][k], b = mesh.triangles[t][(k + 1) % 3];
      const auto [at, fresh] = first.try_emplace({std::min(a, b), std::max(a, b)}, t);
      if (fresh) continue;
      const std::size_t which = label[t] != label[at->second];
      sum[which] += (normal[t] - normal[at->second]).squaredNorm();
      ++n[which];
    }
  return {std::sqrt(sum[1] / n[1]), std::sqrt(sum[0] / n[0])};
}

constexpr int kLevels = 3;
constexpr Real kNoKink = 1.1;  // the bar

CaseResult kinks() {
  CaseResult result;
  const Solid& ball = solids().front();
  const std::vector<Vec3> x = fill(ball.box, [](const Vec3& p) { return p.norm() - 4; }, 4.0 / 3 * kPi * 64, Filling::kDisorder);
  std::vector<Real> radius(x.size(), 0.5);
  std::vector<std::uint64_t> id;
  for (std::size_t i = 0; i < x.size(); ++i) id.push_back(i);
  geometry::Points points;
  points.position = x;
  points.radius = radius;
  points.id = id;
  skin::LevelSetOptions set;
  set.spacing = 1;
  const TriMesh coarse = skin::mesh_level_set(skin::build_level_set(points, static_cast<Real>(x.size()), nullptr, set));
  const skin::Regions regions(points, 1);

  Plot plot{"skin_kinks", "Normal's jump over borders, over the jump inside", "edges of the mesh [spacings]", "ratio", true, false, {}};
  plot.curves.push_back({"bar", {}, {}, false, true});
  for (const SkinKind kind : kKinds) {
    Curve patches{name_of(kind) + ", patches", {}, {}, false, false}, owners{name_of(kind) + ", regions", {}, {}, true, false};
    for (int level = 1; level <= kLevels; ++level) {
      TriMesh mesh = coarse;
      skin::RefineOptions edges;
      edges.edge = 1.2 * skin::mean_edge(coarse) / std::exp2(level);
      const std::vector<Index> patch = skin::refine_to(mesh, edges).parent;
      std::vector<Index> owner;
      for (const auto& [a, b, c] : mesh.triangles) owner.push_back(regions.nearest((mesh.positions[a] + mesh.positions[b] + mesh.positions[c]) / 3));
      skin::DisplaceOptions options;
      options.spacing = 1;
      options.kind = kind;
      options.edge = 10;    // the mesh stays as it is
      options.octaves = 1;  // no bumps shorter than its edges
      const Real edge = skin::mean_edge(mesh);
      skin::displace(mesh, points, nullptr, options);
      for (auto* curve : {&patches, &owners}) {
        const Jumps j = jumps(mesh, curve == &patches ? patch : owner);
        const Real ratio = j.border / j.inside;
        result.measures.push_back({fmt::format("{}, level {}: jump across {}, over that inside", name_of(kind), level, curve == &patches ? "patches" : "regions"), "", ratio, 1, ratio, kNoKink, "times"});
        curve->x.push_back(edge);
        curve->y.push_back(ratio);
      }
      if (kind == kKinds[0]) {
        plot.curves[0].x.push_back(edge);
        plot.curves[0].y.push_back(kNoKink);
      }
    }
    plot.curves.push_back(std::move(patches));
    plot.curves.push_back(std::move(owners));
  }
  result.plots.push_back(std::move(plot));
  result.note = fmt::format("A ball of {} particles, refined to {} levels, displaced by each kind. Patches are the triangles of the level set's mesh, regions those of the "
                            "particles. Root mean squares of the difference of unit normals over edges; a surface with kinks shows more the finer the mesh.",
                            x.size(), kLevels);
  return result;
}

// ---- Directions ----

constexpr Real kIsotropic = 0.05;  // the bar
constexpr int kDirections = 24;

/// Mean square of the difference to the point `apart` away, by direction in the plane, over random points of it.
template <class Noise>
std::vector<Real> differences(const Noise& noise, Real apart, std::uint64_t samples) {
  std::vector<Real> sum(kDirections, 0);
  for (std::uint64_t i = 0; i < samples; ++i) {
    const Vec2 p = 1000 * Vec2(random_uniform(21, 0, i), random_uniform(21, 1, i));
    const Real here = noise(p);
    for (int k = 0; k < kDirections; ++k) {
      const Real angle = kPi * k / kDirections;
      const Real d = noise(p + apart * Vec2(std::cos(angle), std::sin(angle))) - here;
      sum[static_cast<std::size_t>(k)] += d * d;
    }
  }
  Real mean = 0;
  for (const Real s : sum) mean += s / kDirections;
  for (Real& s : sum) s /= mean;
  return sum;
}

CaseResult directions() {
  CaseResult result;
  constexpr std::uint64_t kSamples = 60'000;
  Plot plot{"skin_directions", "Noise on triangles: mean square difference by direction", "direction [deg]", "over the mean of all directions", false, false, {}};
  plot.curves.push_back({"isotropic", {0, 180}, {1, 1}, false, true});
  const auto add = [&](const std::string& name, const std::vector<Real>& by_direction) {
    const auto [low, high] = std::minmax_element(by_direction.begin(), by_direction.end());
    result.measures.push_back({name + ": spread over directions", "", *high - *low, 0, *high - *low, kIsotropic, ""});
    Curve curve{name, {}, by_direction, false, false};
    for (int k = 0; k < kDirections; ++k) curve.x.push_back(180.0 * k / kDirections);
    plot.curves.push_back(std::move(curve));
  };
  const auto one = [](const Vec2& p) { return skin::triangle_noise(p, 3); };
  for (const Real apart : {0.01, 0.25, 0.5, 1.0}) add(fmt::format("{} sides apart", apart), differences(one, apart, kSamples));
  add("three octaves, 0.25 sides apart", differences([](const Vec2& p) { return skin::triangle_octaves(p, 3, 3, 0.5).value; }, 0.25, kSamples / 3));
  result.plots.push_back(std::move(plot));
  result.note = fmt::format("{} random points of the plane, {} directions each. 0.01 sides stand for the slope.", kSamples, kDirections);
  return result;
}

}  // namespace

void add_relief_cases(std::vector<Case>& cases) {
  cases.push_back({"kinks", "No kinks: normals across borders of patches and regions, three levels", "the same measure inside patches", false, kinks});
  cases.push_back({"directions", "Noise on equilateral triangles knows no direction", "isotropy", true, directions});
}

}  // namespace effuse::study
