#include "geometry/remesh/surface_distance.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "geometry/mesh/measure.h"
#include "geometry/query/mesh_tree.h"

namespace effuse::geometry {

SurfaceDistance distance_to(const TriMesh& from, const TriMesh& to, Real spacing) {
  ZONE("mesh.distance");
  CHECK_GT(spacing, 0);
  SurfaceDistance result;
  result.spacing = spacing;
  const MeshTree tree(to.positions, to.triangles);
  const auto farther = [](SurfaceDistance a, const SurfaceDistance& b) {
    a.samples += b.samples;
    if (b.largest > a.largest) a.largest = b.largest, a.where = b.where;
    return a;
  };
  const auto distance = [&](const Vec3& p) {
    const auto nearest = tree.nearest(p);
    return nearest ? nearest->distance : std::numeric_limits<Real>::infinity();
  };
  const auto sample = [&](SurfaceDistance& found, const Vec3& p) {
    ++found.samples;
    const Real d = distance(p);
    if (d > found.largest) found.largest = d, found.where = p;
  };
  // Vertices once, then what lies between them.
  std::vector<char> used(from.positions.size(), 0);
  for (const Triangle& t : from.triangles)
    for (const Index v : t) used[v] = 1;
  const SurfaceDistance at_vertices = parallel_reduce(
      from.positions.size(), result,
      [&](std::size_t v) {
        SurfaceDistance one;
        if (used[v]) sample(one, from.positions[v]);
        return one;
      },
      farther, 256);
  const SurfaceDistance between = parallel_reduce(
      from.triangles.size(), result,
      [&](std::size_t t) {
        SurfaceDistance found;
        const Vec3 &a = from.positions[from.triangles[t][0]], &b = from.positions[from.triangles[t][1]], &c = from.positions[from.triangles[t][2]];
        const Real longest = std::sqrt(std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()}));
        const int n = static_cast<int>(std::clamp(std::ceil(longest / spacing), 1.0, 4096.0));
        for (int i = 0; i <= n; ++i)
          for (int j = 0; i + j <= n; ++j) {
            const bool corner = i == n || j == n || i + j == 0;
            if (!corner) sample(found, a + (b - a) * (static_cast<Real>(i) / n) + (c - a) * (static_cast<Real>(j) / n));
          }
        return found;
      },
      farther, 64);
  return farther(farther(result, at_vertices), between);
}

SurfaceDistance hausdorff_distance(const TriMesh& a, const TriMesh& b, Real spacing) {
  if (spacing <= 0) {
    // Ten for each triangle of the finer mesh; a lattice of edge h has a point for every half square of it.
    const Real samples = std::clamp(10.0 * static_cast<Real>(std::max(a.triangles.size(), b.triangles.size())), 5e3, 1e6);
    const Real area = std::max(surface_area(a), surface_area(b));
    spacing = area > 0 ? std::sqrt(2 * area / samples) : 1;
  }
  const SurfaceDistance there = distance_to(a, b, spacing), back = distance_to(b, a, spacing);
  SurfaceDistance both = there.largest >= back.largest ? there : back;
  both.samples = there.samples + back.samples;
  return both;
}

void transfer_attributes(const TriMesh& source, TriMesh& target) {
  target.normals.clear();
  target.attributes.clear();
  if (source.attributes.empty() && source.normals.empty()) return;
  const MeshTree tree(source.positions, source.triangles);
  const std::size_t n = target.positions.size();
  if (tree.size() == 0) return;
  std::vector<MeshTree::Nearest> at(n);
  parallel_for(n, [&](std::size_t v) { at[v] = *tree.nearest(target.positions[v]); });
  const auto corner = [&](std::size_t v, std::size_t k) { return source.triangles[at[v].triangle][k]; };
  for (const auto& [name, values] : source.attributes) {
    const auto width = static_cast<std::size_t>(values.width);
    VertexAttribute& to = target.attributes[name];
    to.width = values.width;
    to.values.resize(n * width);
    parallel_for(n, [&](std::size_t v) {
      for (std::size_t k = 0; k < width; ++k) {
        Real sum = 0;
        for (std::size_t c = 0; c < 3; ++c) sum += at[v].at.weights[static_cast<Eigen::Index>(c)] * values.values[corner(v, c) * width + k];
        to.values[v * width + k] = static_cast<float>(sum);
      }
    });
  }
  if (source.normals.empty()) return;
  target.normals.resize(n);
  parallel_for(n, [&](std::size_t v) {
    Vec3 sum = Vec3::Zero();
    for (std::size_t c = 0; c < 3; ++c) sum += at[v].at.weights[static_cast<Eigen::Index>(c)] * source.normals[corner(v, c)];
    target.normals[v] = sum.norm() > 0 ? Vec3(sum.normalized()) : Vec3(0, 0, 1);
  });
}

}  // namespace effuse::geometry
