#include "skin/tessellate/keep_volume.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::skin {

namespace {

using geometry::TriMesh;

/// Heights over the ground; empty: some are not known.
std::vector<Real> heights_over(const TriMesh& mesh, const geometry::Terrain& terrain) {
  std::vector<Real> height(mesh.positions.size());
  const Real unknown = parallel_max(height.size(), 0, [&](std::size_t v) {
    const Vec3& p = mesh.positions[v];
    const std::optional<Real> ground = terrain.height(p.x(), p.y());
    height[v] = ground ? p.z() - *ground : 0;
    return ground ? 0.0 : 1.0;
  });
  if (unknown > 0) height.clear();
  return height;
}

/// Means over a triangle of max(0, h) and of whether h > 0, h linear with these values at the corners.
struct Over {
  Real height, share;
};
Over over_ground(std::array<Real, 3> h) {
  std::sort(h.begin(), h.end());
  const Real mean = (h[0] + h[1] + h[2]) / 3;
  if (h[0] >= 0) return {mean, 1};
  if (h[2] <= 0) return {0, 0};
  if (h[1] <= 0) {
    const Real share = h[2] / (h[2] - h[0]) * (h[2] / (h[2] - h[1]));  // of the corner that is above
    return {share * h[2] / 3, share};
  }
  const Real below = h[0] / (h[0] - h[1]) * (h[0] / (h[0] - h[2]));
  return {mean - below * h[0] / 3, 1 - below};
}

/// How far a vertex goes of the way that all go: the part under the ground stays where the cut put it.
Real share_of(const std::vector<Real>& height, std::size_t v, Real fade) { return height.empty() ? 1 : std::clamp(1 + height[v] / fade, 0.0, 1.0); }

struct Enclosed {
  Real volume = 0, slope = 0;  // slope: by how much the volume grows as all vertices move a metre
};

/// height: empty without ground. ways: scaled by their vertices' shares.
Enclosed enclosed(const TriMesh& mesh, std::span<const Vec3> ways, const std::vector<Real>& height, Real fade = 1) {
  // From the mesh's own middle: far from the origin the products would lose what is wanted.
  const Vec3 middle = mesh.positions.empty() ? Vec3(Vec3::Zero()) : mesh.positions.front();
  return parallel_reduce(
      mesh.triangles.size(), Enclosed{},
      [&](std::size_t t) {
        const auto& [i, j, k] = mesh.triangles[t];
        const Vec3 a = mesh.positions[i] - middle, b = mesh.positions[j] - middle, c = mesh.positions[k] - middle;
        const Vec3 area = (b - a).cross(c - a) / 2;
        const auto way = [&](Index v) -> Vec3 { return share_of(height, v, fade) * ways[v]; };
        const Real growth = ways.empty() ? 0 : area.dot(way(i) + way(j) + way(k)) / 3;
        if (height.empty()) return Enclosed{area.dot(a) / 3, growth};
        const Over over = over_ground({height[i], height[j], height[k]});
        return Enclosed{area.z() * over.height, growth * over.share};
      },
      [](const Enclosed& p, const Enclosed& q) {
        return Enclosed{p.volume + q.volume, p.slope + q.slope};
      });
}

}  // namespace

std::optional<Real> volume_above(const TriMesh& mesh, const geometry::Terrain* terrain) {
  std::vector<Real> height;
  if (terrain) height = heights_over(mesh, *terrain);
  if (terrain && height.empty() && !mesh.positions.empty()) return std::nullopt;
  return enclosed(mesh, {}, height).volume;
}

VolumeKept keep_volume(TriMesh& mesh, std::span<const Vec3> ways, Real target, const geometry::Terrain* terrain, Real most) {
  ZONE("skin.keep_volume");
  CHECK_EQ(ways.size(), mesh.positions.size());
  CHECK_GT(most, 0.0);
  VolumeKept kept;
  if (mesh.positions.empty()) return kept;
  constexpr int kSteps = 2;
  for (int step = 0; step <= kSteps; ++step) {
    std::vector<Real> height;
    if (terrain) height = heights_over(mesh, *terrain);
    if (terrain && height.empty()) return {};
    const Enclosed now = enclosed(mesh, ways, height, most);
    kept.after = now.volume;
    if (step == 0) kept.before = now.volume;
    if (step == kSteps || !(now.slope > 0)) break;
    const Real offset = std::clamp(kept.offset + (target - now.volume) / now.slope, -most, most), by = offset - kept.offset;
    if (by == 0) break;
    parallel_for(mesh.positions.size(), [&](std::size_t v) { mesh.positions[v] += by * share_of(height, v, most) * ways[v]; });
    kept.offset = offset;
  }
  return kept;
}

}  // namespace effuse::skin
