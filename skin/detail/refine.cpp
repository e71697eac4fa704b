#include "skin/detail/refine.h"

#include <algorithm>
#include <array>
#include <numeric>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::skin {

namespace {
struct Edge {
  Index high, corner;  // larger end; 3 * triangle + corner it starts at
};
}  // namespace

Real mean_edge(const geometry::TriMesh& mesh) {
  if (mesh.triangles.empty()) return 0;
  const Real sum = parallel_sum(mesh.triangles.size(), Real{0}, [&](std::size_t t) {
    const auto& [a, b, c] = mesh.triangles[t];
    const auto& x = mesh.positions;
    return (x[a] - x[b]).norm() + (x[b] - x[c]).norm() + (x[c] - x[a]).norm();
  });
  return sum / (3 * static_cast<Real>(mesh.triangles.size()));
}

geometry::TriMesh refine(const geometry::TriMesh& mesh) {
  ZONE("skin.refine");
  const std::size_t n = mesh.positions.size(), m = mesh.triangles.size();
  CHECK_LT(n + 3 * m, std::size_t{1} << 32);

  // Edges by their smaller end, then the larger: each run of equals is one new vertex.
  std::vector<Index> begin(n + 1, 0);
  const auto ends = [&](std::size_t corner) {
    const Index a = mesh.triangles[corner / 3][corner % 3], b = mesh.triangles[corner / 3][(corner % 3 + 1) % 3];
    return std::pair{std::min(a, b), std::max(a, b)};
  };
  for (std::size_t c = 0; c < 3 * m; ++c) ++begin[ends(c).first + 1];
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<Edge> edges(3 * m);
  std::vector<Index> filled(begin.begin(), begin.end() - 1);
  for (std::size_t c = 0; c < 3 * m; ++c) {
    const auto [low, high] = ends(c);
    edges[filled[low]++] = {high, static_cast<Index>(c)};
  }
  parallel_for(n, [&](std::size_t v) {
    std::sort(edges.begin() + begin[v], edges.begin() + begin[v + 1],
              [](const Edge& a, const Edge& b) { return std::tie(a.high, a.corner) < std::tie(b.high, b.corner); });
  });
  std::vector<std::array<Index, 2>> middles;
  std::vector<Index> middle(3 * m);
  for (std::size_t v = 0; v < n; ++v)
    for (Index e = begin[v]; e < begin[v + 1]; ++e) {
      if (e == begin[v] || edges[e].high != edges[e - 1].high) middles.push_back({static_cast<Index>(v), edges[e].high});
      middle[edges[e].corner] = static_cast<Index>(n + middles.size() - 1);
    }

  geometry::TriMesh fine;
  fine.positions = mesh.positions;
  fine.positions.resize(n + middles.size());
  parallel_for(middles.size(),
               [&](std::size_t i) { fine.positions[n + i] = (mesh.positions[middles[i][0]] + mesh.positions[middles[i][1]]) / 2; });
  if (!mesh.normals.empty()) {
    fine.normals = mesh.normals;
    fine.normals.resize(n + middles.size());
    parallel_for(middles.size(), [&](std::size_t i) {
      const Vec3 sum = mesh.normals[middles[i][0]] + mesh.normals[middles[i][1]];
      fine.normals[n + i] = sum.norm() > 1e-9 ? Vec3(sum.normalized()) : mesh.normals[middles[i][0]];
    });
  }
  for (const auto& [name, attribute] : mesh.attributes) {
    const std::size_t width = static_cast<std::size_t>(attribute.width);
    geometry::VertexAttribute& to = fine.attributes[name];
    to = attribute;
    to.values.resize((n + middles.size()) * width);
    parallel_for(middles.size(), [&](std::size_t i) {
      for (std::size_t k = 0; k < width; ++k)
        to.values[(n + i) * width + k] = (attribute.values[middles[i][0] * width + k] + attribute.values[middles[i][1] * width + k]) / 2;
    });
  }
  fine.triangles.resize(4 * m);
  parallel_for(m, [&](std::size_t t) {
    const auto& [a, b, c] = mesh.triangles[t];
    const Index ab = middle[3 * t], bc = middle[3 * t + 1], ca = middle[3 * t + 2];
    fine.triangles[4 * t] = {a, ab, ca};
    fine.triangles[4 * t + 1] = {ab, b, bc};
    fine.triangles[4 * t + 2] = {ca, bc, c};
    fine.triangles[4 * t + 3] = {ab, bc, ca};
  });
  return fine;
}

}  // namespace effuse::skin
