#include "geometry/mesh/measure.h"

#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"

namespace effuse::geometry {

Box3 bounds(const TriMesh& mesh) {
  Box3 box;
  for (const Vec3& x : mesh.positions) box.extend(x);
  return box;
}

Real signed_volume(const TriMesh& mesh) {
  if (mesh.positions.empty()) return 0;
  const Vec3 centre = bounds(mesh).center();  // near the mesh: far from the origin the products would cancel
  return parallel_sum(mesh.triangles.size(), Real{0}, [&](std::size_t t) {
    const auto [a, b, c] = mesh.triangles[t];
    return (mesh.positions[a] - centre).dot((mesh.positions[b] - centre).cross(mesh.positions[c] - centre)) / 6;
  });
}

Real surface_area(const TriMesh& mesh) {
  return parallel_sum(mesh.triangles.size(), Real{0}, [&](std::size_t t) {
    const auto [a, b, c] = mesh.triangles[t];
    return (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]).norm() / 2;
  });
}

void compute_normals(TriMesh& mesh) {
  const std::size_t n = mesh.positions.size();

  // Which corners meet at a vertex: corners of vertex i are corner[begin[i]] .. corner[begin[i + 1] - 1], in order.
  std::vector<std::size_t> begin(n + 1, 0);
  for (const Triangle& triangle : mesh.triangles) {
    for (Index i : triangle) {
      CHECK_LT(i, n);
      ++begin[i + 1];
    }
  }
  for (std::size_t i = 0; i < n; ++i) begin[i + 1] += begin[i];
  std::vector<std::size_t> corner(3 * mesh.triangles.size()), filled(begin.begin(), begin.end() - 1);
  for (std::size_t c = 0; c < corner.size(); ++c) corner[filled[mesh.triangles[c / 3][c % 3]]++] = c;

  mesh.normals.resize(n);
  parallel_for(n, [&](std::size_t i) {
    Vec3 sum = Vec3::Zero();
    for (std::size_t at = begin[i]; at < begin[i + 1]; ++at) {
      const Triangle& triangle = mesh.triangles[corner[at] / 3];
      const std::size_t k = corner[at] % 3;
      const Vec3& x = mesh.positions[i];
      const Vec3 u = mesh.positions[triangle[(k + 1) % 3]] - x, v = mesh.positions[triangle[(k + 2) % 3]] - x;
      const Vec3 cross = u.cross(v);
      const Real twice_area = cross.norm();
      if (twice_area > 0) sum += std::atan2(twice_area, u.dot(v)) / twice_area * cross;
    }
    const Real length = sum.norm();
    mesh.normals[i] = length > 0 ? Vec3(sum / length) : Vec3(Vec3::UnitZ());
  });
}

}  // namespace effuse::geometry
