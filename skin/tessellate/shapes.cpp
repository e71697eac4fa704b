#include "skin/tessellate/shapes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/surface/key_table.h"
#include "skin/tessellate/improve.h"
#include "skin/tessellate/surface_walk.h"

namespace effuse::skin {

using geometry::Triangle;
using geometry::TriMesh;

namespace {
constexpr Real kRound = 0.35;  // least cosine between normals at the ends of a round edge; others are sharp
}

TriangleShapes triangle_shapes(const TriMesh& mesh) {
  CHECK_EQ(mesh.normals.size(), mesh.positions.size());
  constexpr Real kThin = 5;  // [deg]
  struct Sum {
    Real least = 180;
    std::size_t thin = 0, folded = 0;
  };
  const Sum sum = parallel_reduce(
      mesh.triangles.size(), Sum{},
      [&](std::size_t i) {
        const Triangle& t = mesh.triangles[i];
        const Vec3 &a = mesh.positions[t[0]], &b = mesh.positions[t[1]], &c = mesh.positions[t[2]];
        const Vec3 up = (b - a).cross(c - a);
        // The least angle is opposite the shortest side: between the other two.
        const Real ab = (b - a).squaredNorm(), bc = (c - b).squaredNorm(), ca = (a - c).squaredNorm();
        const Real cosine_times = (ab + bc + ca) / 2 - std::min({ab, bc, ca});
        const Real angle = std::atan2(up.norm(), cosine_times) * 180 / kPi;
        return Sum{angle, angle < kThin, up.dot(mesh.normals[t[0]] + mesh.normals[t[1]] + mesh.normals[t[2]]) <= 0};
      },
      [](const Sum& p, const Sum& q) {
        return Sum{std::min(p.least, q.least), p.thin + q.thin, p.folded + q.folded};
      });
  TriangleShapes shapes;
  if (mesh.triangles.empty()) return shapes;
  shapes.thin = static_cast<Real>(sum.thin) / static_cast<Real>(mesh.triangles.size());
  shapes.least_angle = sum.least;
  shapes.folded = sum.folded;
  return shapes;
}

std::size_t widen_thin(TriMesh& mesh, Real min_angle, Real wander) {
  ZONE("skin.widen");
  CHECK_EQ(mesh.normals.size(), mesh.positions.size());
  TriMesh before;  // without attributes, of which few change
  before.positions = mesh.positions;
  before.triangles = mesh.triangles;
  before.normals = mesh.normals;
  const SurfaceWalk walk(before);
  Fans fans;  // no centres: each may move
  fans.spots.assign(mesh.positions.size(), {.triangle = kNone});
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const Index v = mesh.triangles[t][k];
      fans.spots[v] = {mesh.positions[v], Vec3::Unit(static_cast<Eigen::Index>(k)), static_cast<Index>(t)};
    }
  for (const Spot& spot : fans.spots) CHECK_NE(spot.triangle, kNone);
  fans.up = std::move(mesh.normals);
  fans.triangles = std::move(mesh.triangles);
  VoronoiOptions options;
  options.min_angle = min_angle;
  options.wander = 1;
  const std::size_t moved = move_for_angles(fans, walk, wander, options);
  mesh.normals = std::move(fans.up);
  mesh.triangles = std::move(fans.triangles);
  std::vector<Index> others;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    if (fans.spots[v].x != mesh.positions[v]) others.push_back(static_cast<Index>(v));
  for (const Index v : others) mesh.positions[v] = fans.spots[v].x;
  for (auto& [name, attribute] : mesh.attributes) {
    const auto width = static_cast<std::size_t>(attribute.width);
    std::vector<float> fresh;
    for (const Index v : others) {
      const Spot& spot = fans.spots[v];
      const Triangle& t = before.triangles[spot.triangle];
      for (std::size_t k = 0; k < width; ++k) {
        Real sum = 0;
        for (std::size_t c = 0; c < 3; ++c)
          sum += spot.weights[static_cast<Eigen::Index>(c)] * static_cast<Real>(attribute.values[t[c] * width + k]);
        fresh.push_back(static_cast<float>(sum));
      }
    }
    for (std::size_t n = 0; n < others.size(); ++n) std::copy_n(&fresh[n * width], width, &attribute.values[others[n] * width]);
  }
  return moved;
}

void lift_facets(TriMesh& mesh) {
  ZONE("skin.lift_facets");
  const std::size_t n = mesh.positions.size();
  CHECK_EQ(mesh.normals.size(), n);
  std::vector<Real> volume(n, 0), area(n, 0), shortest(n, std::numeric_limits<Real>::infinity());
  for (const Triangle& t : mesh.triangles) {
    Real rise = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = t[k], b = t[(k + 1) % 3];
      const Vec3 along = mesh.positions[b] - mesh.positions[a];
      if (mesh.normals[a].dot(mesh.normals[b]) > kRound) rise += along.dot(mesh.normals[b] - mesh.normals[a]) / 8;
      for (const Index v : {a, b}) shortest[v] = std::min(shortest[v], along.norm());
    }
    const Real size = (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]).norm() / 2;
    for (const Index v : t) {
      volume[v] += size * rise / 3;
      area[v] += size;
    }
  }
  parallel_for(n, [&](std::size_t v) {
    if (area[v] > 0) mesh.positions[v] += std::clamp(volume[v] / area[v], -shortest[v] / 2, shortest[v] / 2) * mesh.normals[v];
  });
}

}  // namespace effuse::skin
