#include "geometry/mesh/clip.h"

#include <algorithm>
#include <map>
#include <utility>

#include "geometry/base/check.h"

namespace effuse::geometry {

TriMesh clip(const TriMesh& mesh, const Vec3& point, const Vec3& normal) {
  const std::size_t n = mesh.positions.size();
  std::vector<Real> height(n);
  for (std::size_t v = 0; v < n; ++v) height[v] = normal.dot(mesh.positions[v] - point);

  // Vertices of the result: one of the input, or a point between two.
  struct Source {
    Index a, b;
    Real share;  // of b
  };
  std::vector<Source> sources;
  std::vector<Index> kept(n, 0);
  std::vector<char> used(n, 0);
  for (const Triangle& t : mesh.triangles)
    for (const Index v : t) CHECK_LT(v, n);
  for (const Triangle& t : mesh.triangles) {
    if (height[t[0]] < 0 && height[t[1]] < 0 && height[t[2]] < 0) continue;
    for (const Index v : t) used[v] = used[v] || height[v] >= 0;
  }
  for (std::size_t v = 0; v < n; ++v) {
    if (!used[v]) continue;
    kept[v] = static_cast<Index>(sources.size());
    sources.push_back({static_cast<Index>(v), static_cast<Index>(v), 0});
  }
  std::map<std::pair<Index, Index>, Index> cuts;
  const auto cut = [&](Index inside, Index outside) {
    const auto [at, made] = cuts.try_emplace({std::min(inside, outside), std::max(inside, outside)}, static_cast<Index>(sources.size()));
    // From the smaller number on, so that both triangles at the edge find the same point.
    if (made) {
      const Index a = at->first.first, b = at->first.second;
      sources.push_back({a, b, height[a] / (height[a] - height[b])});
    }
    return at->second;
  };

  TriMesh out;
  for (const Triangle& t : mesh.triangles) {
    std::vector<Index> polygon;
    for (std::size_t k = 0; k < 3; ++k) {
      const Index v = t[k], w = t[(k + 1) % 3];
      if (height[v] >= 0) polygon.push_back(kept[v]);
      // Where an end lies in the plane, it is the cut.
      if ((height[v] > 0 && height[w] < 0) || (height[v] < 0 && height[w] > 0)) polygon.push_back(cut(v, w));
    }
    for (std::size_t k = 1; k + 1 < polygon.size(); ++k) out.triangles.push_back({polygon[0], polygon[k], polygon[k + 1]});
  }
  for (const Source& s : sources) {
    const Vec3 &a = mesh.positions[s.a], &b = mesh.positions[s.b];
    out.positions.push_back(s.a == s.b ? a : Vec3(a + s.share * (b - a)));
    if (mesh.normals.empty()) continue;
    const Vec3 blend = (1 - s.share) * mesh.normals[s.a] + s.share * mesh.normals[s.b];
    out.normals.push_back(blend.norm() > 0 ? Vec3(blend.normalized()) : mesh.normals[s.a]);
  }
  for (const auto& [name, attribute] : mesh.attributes) {
    VertexAttribute& to = out.attributes[name];
    to.width = attribute.width;
    const auto width = static_cast<std::size_t>(attribute.width);
    for (const Source& s : sources)
      for (std::size_t k = 0; k < width; ++k) {
        const float a = attribute.values[s.a * width + k], b = attribute.values[s.b * width + k];
        to.values.push_back(s.a == s.b ? a : static_cast<float>(a + s.share * (b - a)));
      }
  }
  return out;
}

TriMesh crop(TriMesh mesh, const Vec2& low, const Vec2& high) {
  mesh = clip(mesh, Vec3(low.x(), 0, 0), Vec3::UnitX());
  mesh = clip(mesh, Vec3(high.x(), 0, 0), -Vec3::UnitX());
  mesh = clip(mesh, Vec3(0, low.y(), 0), Vec3::UnitY());
  return clip(mesh, Vec3(0, high.y(), 0), -Vec3::UnitY());
}

}  // namespace effuse::geometry
