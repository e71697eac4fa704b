#include "geometry/mesh/weld.h"

#include <algorithm>
#include <numeric>

#include "geometry/base/check.h"

namespace effuse::geometry {

std::vector<Index> first_coincident(std::span<const Vec3> positions) {
  const auto before = [&](Index i, Index j) {
    const Vec3 &p = positions[i], &q = positions[j];
    for (int k = 0; k < 3; ++k) {
      // NaNs go last, in a fixed order: a plain < would not be an ordering.
      const bool p_nan = p[k] != p[k], q_nan = q[k] != q[k];
      if (p_nan != q_nan) return q_nan;
      if (!p_nan && p[k] != q[k]) return p[k] < q[k];
    }
    return i < j;
  };
  std::vector<Index> order(positions.size());
  std::iota(order.begin(), order.end(), Index{0});
  std::sort(order.begin(), order.end(), before);

  std::vector<Index> first(positions.size());
  for (std::size_t k = 0; k < order.size(); ++k) {
    const bool same = k > 0 && positions[order[k]] == positions[order[k - 1]];
    first[order[k]] = same ? first[order[k - 1]] : order[k];
  }
  return first;
}

WeldReport weld(TriMesh& mesh) {
  const std::size_t n = mesh.positions.size();
  for (const Triangle& triangle : mesh.triangles)
    for (Index i : triangle) CHECK_LT(i, n);
  for (const auto& [name, attribute] : mesh.attributes) CHECK_EQ(attribute.values.size(), n * static_cast<std::size_t>(attribute.width));

  WeldReport report;
  const std::vector<Index> first = first_coincident(mesh.positions);
  for (std::size_t i = 0; i < n; ++i) report.merged_vertices += first[i] != i;

  // Triangles on the vertices that stay; collapsed ones go.
  std::vector<Triangle> triangles;
  triangles.reserve(mesh.triangles.size());
  std::vector<char> used(n, 0);
  for (const Triangle& t : mesh.triangles) {
    const Triangle merged{first[t[0]], first[t[1]], first[t[2]]};
    if (merged[0] == merged[1] || merged[1] == merged[2] || merged[2] == merged[0]) {
      ++report.dropped_triangles;
      continue;
    }
    triangles.push_back(merged);
    for (Index i : merged) used[i] = 1;
  }

  // Vertices move up into the gaps, attributes and normals with them.
  if (report.merged_vertices > 0) mesh.normals.clear();
  std::vector<Index> target(n, 0);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < n; ++i) {
    if (!used[i]) continue;
    target[i] = static_cast<Index>(kept);
    mesh.positions[kept] = mesh.positions[i];
    if (!mesh.normals.empty()) mesh.normals[kept] = mesh.normals[i];
    for (auto& [name, attribute] : mesh.attributes) {
      const auto width = static_cast<std::size_t>(attribute.width);
      for (std::size_t k = 0; k < width; ++k) attribute.values[kept * width + k] = attribute.values[i * width + k];
    }
    ++kept;
  }
  report.dropped_vertices = n - kept - report.merged_vertices;
  mesh.positions.resize(kept);
  if (!mesh.normals.empty()) mesh.normals.resize(kept);
  for (auto& [name, attribute] : mesh.attributes) attribute.values.resize(kept * static_cast<std::size_t>(attribute.width));
  for (Triangle& triangle : triangles)
    for (Index& i : triangle) i = target[i];
  mesh.triangles = std::move(triangles);
  return report;
}

}  // namespace effuse::geometry
