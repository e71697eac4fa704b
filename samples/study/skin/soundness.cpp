#include "samples/study/skin/soundness.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/mesh/validate.h"
#include "skin/tessellate/regions.h"

namespace effuse::study {

using geometry::TriMesh;

namespace {

constexpr Real kThin = 5 * kPi / 180;

Real share_of_thin(const TriMesh& mesh) {
  std::size_t thin = 0;
  for (const geometry::Triangle& t : mesh.triangles) {
    Real least = kPi;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 a = mesh.positions[t[(k + 1) % 3]] - mesh.positions[t[k]], b = mesh.positions[t[(k + 2) % 3]] - mesh.positions[t[k]];
      least = std::min(least, std::atan2(a.cross(b).norm(), a.dot(b)));
    }
    thin += least < kThin;
  }
  return mesh.triangles.empty() ? 0 : static_cast<Real>(thin) / static_cast<Real>(mesh.triangles.size());
}

/// The particle nearest to each vertex, each once. Particles sorted along x: those within a slab are looked at.
std::set<Index> nearest_to_vertices(const TriMesh& mesh, const geometry::Points& points) {
  std::vector<Index> order(points.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<Index>(i);
  std::sort(order.begin(), order.end(), [&](Index i, Index j) { return points.position[i].x() < points.position[j].x(); });
  std::vector<Index> nearest(mesh.positions.size());
  parallel_for(
      nearest.size(),
      [&](std::size_t v) {
        const Vec3& p = mesh.positions[v];
        const auto from = std::lower_bound(order.begin(), order.end(), p.x(), [&](Index i, Real x) { return points.position[i].x() < x; });
        Real least = std::numeric_limits<Real>::infinity();
        const auto look = [&](Index i) {
          const Real d = (points.position[i] - p).squaredNorm();
          if (d < least || (d == least && i < nearest[v])) least = d, nearest[v] = i;
          const Real aside = points.position[i].x() - p.x();
          return aside * aside <= least;
        };
        for (auto i = from; i != order.end() && look(*i); ++i) {}
        for (auto i = from; i != order.begin() && look(*(i - 1)); --i) {}
      },
      64);
  return {nearest.begin(), nearest.end()};
}

}  // namespace

Soundness soundness(const skin::Skin& skin, const geometry::Points& points, const skin::SkinOptions& options) {
  CHECK(options.coarsen == 0);
  const bool voronoi = options.tessellation == skin::TessellationKind::kVoronoi;
  Soundness found;
  found.solid = geometry::validate(skin.mesh).solid();
  found.thin = share_of_thin(skin.mesh);

  TriMesh surface = voronoi ? skin::mesh_level_set(skin.surface) : skin::tessellate_level_set(skin.surface);
  if (!voronoi && options.detail) {
    skin::DisplaceOptions detail = *options.detail;
    detail.spacing = options.level_set.spacing;
    skin::refine_for(surface, detail);
  }
  std::set<Index> on_surface = nearest_to_vertices(surface, points);
  for (const Index p : skin.regions.particle) found.regions_of_others += on_surface.erase(p) == 0;
  found.without_region = on_surface.size();
  std::vector<std::uint8_t> there(skin.regions.size(), 0);
  for (const Index r : voronoi ? skin.regions.of_triangle : skin.regions.of_vertex) there[r] = 1;
  found.nowhere = static_cast<std::size_t>(std::count(there.begin(), there.end(), 0));
  return found;
}

Real volume_above(const TriMesh& mesh, const geometry::Terrain& ground) {
  // Over each triangle the height is averaged over four times four parts: the ground bends little over one.
  constexpr int kParts = 4;
  return parallel_sum(mesh.triangles.size(), Real{0}, [&](std::size_t t) {
    const auto& [i, j, k] = mesh.triangles[t];
    const Vec3 &a = mesh.positions[i], u = mesh.positions[j] - a, v = mesh.positions[k] - a;
    Real height = 0;
    const auto add = [&](Real s, Real r) {
      const Vec3 p = a + s / kParts * u + r / kParts * v;
      if (const auto z = ground.height(p.x(), p.y())) height += std::max(p.z() - *z, 0.0) / (kParts * kParts);
    };
    for (int m = 0; m < kParts; ++m)
      for (int n = 0; m + n < kParts; ++n) {
        add(m + 1 / 3.0, n + 1 / 3.0);
        if (m + n + 1 < kParts) add(m + 2 / 3.0, n + 2 / 3.0);
      }
    return u.cross(v).z() / 2 * height;
  });
}

}  // namespace effuse::study
