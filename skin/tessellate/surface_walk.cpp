#include "skin/tessellate/surface_walk.h"

#include <numeric>
#include <span>

#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "geometry/mesh/measure.h"
#include "geometry/query/closest_point.h"

namespace effuse::skin {

using geometry::Triangle;
using geometry::TrianglePoint;

SurfaceWalk::SurfaceWalk(const geometry::TriMesh& mesh)
    : mesh_(mesh), begin_(mesh.positions.size() + 1, 0), around_(3 * mesh.triangles.size()) {
  for (const Triangle& t : mesh.triangles)
    for (const Index v : t) ++begin_[v + 1];
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  std::vector<Index> filled(begin_.begin(), begin_.end() - 1);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const Index v : mesh.triangles[t]) around_[filled[v]++] = static_cast<Index>(t);
  if (mesh.normals.empty()) {
    geometry::TriMesh bare;
    bare.positions = mesh.positions;
    bare.triangles = mesh.triangles;
    geometry::compute_normals(bare);
    normals_ = std::move(bare.normals);
  }
}

Spot SurfaceWalk::nearest(const Vec3& p, Index start) const {
  Spot best;
  const auto visit = [&](Index t) {
    const Triangle& corner = mesh_.triangles[t];
    return geometry::closest_point_on_triangle(p, mesh_.positions[corner[0]], mesh_.positions[corner[1]], mesh_.positions[corner[2]]);
  };
  TrianglePoint at = visit(start);
  best.triangle = start;
  Real least = (at.point - p).squaredNorm();
  // Each turn comes nearer, so that it ends. A point in a triangle's inside is a foot: nothing around is nearer. One on its
  // rim may be nearer in the triangles that share it.
  for (bool nearer = true; nearer && at.feature != TrianglePoint::Feature::kFace;) {
    nearer = false;
    const Triangle corner = mesh_.triangles[best.triangle];
    const bool edge = at.feature == TrianglePoint::Feature::kEdge;
    const Index from = corner[static_cast<std::size_t>(at.index)], to = corner[static_cast<std::size_t>((at.index + 1) % 3)];
    const Index own = best.triangle;
    for (Index k = begin_[from]; k < begin_[from + 1]; ++k) {
      const Index t = around_[k];
      const Triangle& c = mesh_.triangles[t];
      if (t == own || (edge && c[0] != to && c[1] != to && c[2] != to)) continue;
      const TrianglePoint there = visit(t);
      const Real d = (there.point - p).squaredNorm();
      if (d >= least) continue;
      least = d;
      at = there;
      best.triangle = t;
      nearer = true;
    }
  }
  best.x = at.point;
  best.weights = at.weights;
  return best;
}

Vec3 SurfaceWalk::normal(const Spot& spot) const {
  const std::vector<Vec3>& normals = normals_.empty() ? mesh_.normals : normals_;
  const Triangle& t = mesh_.triangles[spot.triangle];
  const Vec3 n = spot.weights[0] * normals[t[0]] + spot.weights[1] * normals[t[1]] + spot.weights[2] * normals[t[2]];
  const Real length = n.norm();
  return length > 0 ? Vec3(n / length) : normals[t[0]];
}

void carry_over(const geometry::TriMesh& surface, const std::vector<Spot>& spots, geometry::TriMesh& mesh) {
  ZONE("skin.carry");
  const std::size_t n = spots.size();
  for (const auto& [name, from] : surface.attributes) {
    geometry::VertexAttribute& to = mesh.attributes[name];
    const auto width = static_cast<std::size_t>(from.width);
    to.width = from.width;
    to.values.resize(n * width);
    parallel_for(n, [&](std::size_t v) {
      const Triangle& t = surface.triangles[spots[v].triangle];
      const Vec3& w = spots[v].weights;
      for (std::size_t k = 0; k < width; ++k)
        to.values[v * width + k] = static_cast<float>(w[0] * from.values[t[0] * width + k] + w[1] * from.values[t[1] * width + k] +
                                                      w[2] * from.values[t[2] * width + k]);
    });
  }
}

}  // namespace effuse::skin
