#include "skin/detail/displace.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "geometry/mesh/measure.h"
#include "geometry/procedural/noise.h"
#include "skin/detail/blend.h"
#include "skin/detail/refine.h"
#include "skin/detail/relief.h"

namespace effuse::skin {

namespace {

using geometry::TriMesh;

constexpr int kMostOctaves = 12;
constexpr Real kDeviation = 0.28;           // of gradient_noise
constexpr Real kCrack = 0.45 * kDeviation;  // width of clinker's valleys in noise: a sixth of the area lies below level 0.36
constexpr Real kMeanPlate = 0.69;           // of 1 - exp(-|n| / kCrack) over the noise's distribution: measured, see the test
constexpr Real kMostDisplaced = 0.35;       // [spacings]
constexpr Real kGroundFade = 0.75;          // [spacings]
constexpr Real kTooCoarse = 1.7;            // times the edge asked for

/// A mesh's attribute of that width, or nothing.
const float* find_attribute(const TriMesh& mesh, const char* name, int width) {
  const auto found = mesh.attributes.find(name);
  if (found == mesh.attributes.end()) return nullptr;
  CHECK_EQ(found->second.width, width);
  CHECK_EQ(found->second.values.size(), mesh.positions.size() * static_cast<std::size_t>(width));
  return found->second.values.data();
}

Vec3 vector_at(const float* values, std::size_t i) { return Vec3(values[3 * i], values[3 * i + 1], values[3 * i + 2]); }

/// Noise in the material: where it is taken, and how much of each octave.
struct MeshMaterial {
  const float* rest;
  const float* rest2;
  Real share[2];  // of rest and rest2, their squares summing to one
  Real weight[kMostOctaves];
  Real swell_scale, clinker_scale;

  MeshMaterial(const TriMesh& mesh, const DisplaceOptions& o) : rest(find_attribute(mesh, "rest", 3)), rest2(find_attribute(mesh, "rest2", 3)) {
    const Real q = rest && rest2 ? o.rest_ratio : rest2 && !rest ? 1 : 0;
    const Real contrast = std::hypot(1 - q, q);
    share[0] = (1 - q) / contrast;
    share[1] = q / contrast;
    Real sum = 0, squares = 0, gain = 1;
    for (int k = 0; k < o.octaves; ++k, gain *= o.gain) {
      // Bumps need two edges to be seen; they come in over the next octave.
      const Real edges = std::ldexp(o.wavelength, -k) / o.edge;
      weight[k] = gain * (k == 0 ? 1 : smoothstep(1.9, 3.8, edges));
      sum += weight[k];
      squares += weight[k] * weight[k];
    }
    swell_scale = 1 / (kDeviation * std::sqrt(squares));
    clinker_scale = 1 / sum;
  }
};

struct NoiseRelief {
  Real swell;    // deviation 1
  Real clinker;  // 0 in cracks .. 1
};

NoiseRelief relief_at(const TriMesh& mesh, const MeshMaterial& m, const DisplaceOptions& o, std::size_t i) {
  const Vec3 at[2] = {m.rest ? vector_at(m.rest, i) : mesh.positions[i], m.rest2 ? vector_at(m.rest2, i) : mesh.positions[i]};
  NoiseRelief relief{0, 0};
  Real frequency = 1 / (o.wavelength * o.spacing);
  for (int k = 0; k < o.octaves; ++k, frequency *= 2) {
    if (m.weight[k] <= 0) continue;
    Real n = 0;
    // An offset of its own for each octave: lattices whose zeros meet would show.
    const Vec3 offset(0.37 * k, 0.71 * k, 0.53 * k);
    for (int s = 0; s < 2; ++s)
      if (m.share[s] > 0) n += m.share[s] * geometry::gradient_noise(frequency * at[s] + offset, o.seed + static_cast<std::uint64_t>(k));
    relief.swell += m.weight[k] * n;
    relief.clinker += m.weight[k] * -std::expm1(-std::abs(n) / kCrack);
  }
  relief.swell *= m.swell_scale;
  relief.clinker *= m.clinker_scale;
  return relief;
}

/// Halves the displacement at triangles that it would turn over, until none does; what still does stays where it was.
std::size_t hold_back(const TriMesh& mesh, std::vector<Real>& height) {
  std::vector<std::uint8_t> held(mesh.positions.size(), 0), turned(mesh.triangles.size());
  for (int round = 0; round < 6; ++round) {
    parallel_for(mesh.triangles.size(), [&](std::size_t t) {
      const auto& [a, b, c] = mesh.triangles[t];
      const auto moved = [&](Index v) -> Vec3 { return mesh.positions[v] + height[v] * mesh.normals[v]; };
      const Vec3 before = (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]);
      const Vec3 after = (moved(b) - moved(a)).cross(moved(c) - moved(a));
      turned[t] = before.dot(after) <= 0.05 * before.norm() * after.norm();
    });
    bool any = false;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      if (!turned[t]) continue;
      for (const Index v : mesh.triangles[t]) {
        if (height[v] == 0) continue;
        any = true;
        held[v] = 1;
        height[v] = round < 4 ? height[v] / 2 : 0;
      }
    }
    if (!any) break;
  }
  return static_cast<std::size_t>(std::count(held.begin(), held.end(), std::uint8_t{1}));
}

void check(const DisplaceOptions& o) {
  CHECK_GT(o.spacing, 0.0);
  CHECK_GE(o.amplitude, 0.0);
  CHECK_GT(o.wavelength, 0.0);
  CHECK(o.octaves >= 1 && o.octaves <= kMostOctaves);
  CHECK_GT(o.gain, 0.0);
  CHECK_GT(o.molten, o.solid);
  CHECK_GE(o.fold_wavelength, 0.0);
  CHECK_GE(o.fold_time, 0.0);
  CHECK_GT(o.edge, 0.0);
  CHECK_GE(o.oversample, 1.0);
  CHECK(o.rest_ratio >= 0 && o.rest_ratio <= 1);
}

/// Less near the ground: 0 on it, 1 from kGroundFade on.
Real ground_share(const geometry::Terrain* terrain, const Vec3& x, Real spacing) {
  if (!terrain) return 1;
  const geometry::Contact contact = terrain->contact(x, 2 * kGroundFade * spacing);
  return contact.any() ? smoothstep(0, kGroundFade * spacing, contact.distance) : 1;
}

void move_along_normals(TriMesh& mesh, std::vector<Real>& height, std::vector<float> detail, DisplaceReport& report) {
  const std::size_t n = mesh.positions.size();
  report.held_back = hold_back(mesh, height);
  parallel_for(n, [&](std::size_t i) { mesh.positions[i] += height[i] * mesh.normals[i]; });
  report.largest = parallel_max(n, 0, [&](std::size_t i) { return std::abs(height[i]); });
  geometry::compute_normals(mesh);
  mesh.attributes["detail"] = {1, std::move(detail)};
}

/// Noise from the mesh's own attributes.
DisplaceReport displace_by_noise(TriMesh& mesh, const geometry::Terrain* terrain, const DisplaceOptions& o) {
  DisplaceReport report;
  const std::size_t n = mesh.positions.size();
  const MeshMaterial material(mesh, o);
  const float* temperature = find_attribute(mesh, "temperature", 1);
  const float* crust = find_attribute(mesh, "crust", 1);
  std::vector<float> detail(n);
  std::vector<Real> height(n);
  parallel_for(n, [&](std::size_t i) {
    const NoiseRelief relief = relief_at(mesh, material, o, i);
    const Real chilled = temperature ? 1 - smoothstep(o.solid, o.molten, static_cast<Real>(temperature[i])) : 1;
    const Real cold = crust ? std::max(chilled, std::clamp(static_cast<Real>(crust[i]), Real{0}, Real{1})) : chilled;
    const Real clinker = o.roughness * cold;
    const Real swell = std::clamp(0.4 * relief.swell, Real{-1}, Real{1});
    detail[i] = static_cast<float>(std::clamp((1 - clinker) * swell + clinker * (2 * relief.clinker - 1), Real{-1}, Real{1}));

    const Real shape = (1 - clinker) * swell + clinker * 2 * (relief.clinker - kMeanPlate);
    const Real amount = o.molten_share + (1 - o.molten_share) * cold;
    height[i] = std::clamp(o.amplitude * amount * shape, -kMostDisplaced, kMostDisplaced) * o.spacing * ground_share(terrain, mesh.positions[i], o.spacing);
  });
  move_along_normals(mesh, height, std::move(detail), report);
  return report;
}

DisplaceReport displace_by_relief(TriMesh& mesh, const geometry::Points& points, const geometry::Terrain* terrain, const DisplaceOptions& o) {
  DisplaceReport report;
  const std::size_t n = mesh.positions.size();
  const Relief relief(points, o);
  std::vector<float> detail(n);
  std::vector<Real> height(n);
  parallel_for(n, [&](std::size_t i) {
    const Vec3& x = mesh.positions[i];
    const Relief::Sample sample = relief.at(x, o.view ? std::max(o.edge * o.spacing, o.view->edge_at(x)) : o.edge * o.spacing);
    detail[i] = static_cast<float>(sample.detail);
    height[i] = sample.height * ground_share(terrain, x, o.spacing);
  });
  move_along_normals(mesh, height, std::move(detail), report);
  return report;
}

}  // namespace

RefineOptions fineness(const DisplaceOptions& o) {
  RefineOptions fine;
  fine.edge = kTooCoarse * o.edge * o.spacing / o.oversample;
  fine.view = o.view;
  if (fine.view) fine.view->pixels /= o.oversample;
  return fine;
}

RefineToReport refine_for(TriMesh& mesh, const DisplaceOptions& o) {
  check(o);
  if (o.kind != SkinKind::kNoise) return refine_to(mesh, fineness(o));
  RefineToReport report;
  report.parent.resize(mesh.triangles.size());
  std::iota(report.parent.begin(), report.parent.end(), Index{0});
  // A dual mesh's mean edge is 1.1 to 1.2 of its voxel: refined only when clearly too coarse, so that frames agree.
  constexpr int kMostRefined = 3;
  for (Real edge = mean_edge(mesh); edge > kTooCoarse * o.edge * o.spacing / o.oversample && report.rounds < kMostRefined; edge /= 2, ++report.rounds) {
    mesh = refine(mesh);
    std::vector<Index> parent(mesh.triangles.size());
    for (std::size_t t = 0; t < parent.size(); ++t) parent[t] = report.parent[t / 4];  // each triangle's four follow one another
    report.parent = std::move(parent);
  }
  return report;
}

DisplaceReport displace_only(TriMesh& mesh, const geometry::Points& points, const geometry::Terrain* terrain, const DisplaceOptions& o) {
  ZONE("skin.displace");
  check(o);
  if (mesh.normals.empty()) geometry::compute_normals(mesh);
  return o.kind == SkinKind::kNoise ? displace_by_noise(mesh, terrain, o) : displace_by_relief(mesh, points, terrain, o);
}

DisplaceReport displace(TriMesh& mesh, const geometry::Terrain* terrain, const DisplaceOptions& options) {
  DisplaceOptions noise = options;
  noise.kind = SkinKind::kNoise;
  return displace(mesh, {}, terrain, noise);
}

DisplaceReport displace(TriMesh& mesh, const geometry::Points& points, const geometry::Terrain* terrain, const DisplaceOptions& o) {
  const int refined = refine_for(mesh, o).rounds;
  DisplaceReport report = displace_only(mesh, points, terrain, o);
  report.refined = refined;
  return report;
}

}  // namespace effuse::skin
