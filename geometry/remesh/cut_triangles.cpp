#include "geometry/remesh/cut_triangles.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <unordered_map>
#include <utility>

#include "geometry/base/check.h"
#include "geometry/base/zones.h"

namespace effuse::geometry {

namespace {

/// Length of an edge; 0 where its numbers are too near for one between them.
Real length(const TriMesh& mesh, Index a, Index b) {
  const Vec3 &p = mesh.positions[a], &q = mesh.positions[b];
  constexpr Real kNear = 8 * std::numeric_limits<Real>::epsilon();
  const bool near = (p - q).cwiseAbs().maxCoeff() <= kNear * std::max(p.cwiseAbs().maxCoeff(), q.cwiseAbs().maxCoeff());
  return near ? 0 : (p - q).norm();
}

Real area(const TriMesh& mesh, const Triangle& t) {
  const Vec3& p = mesh.positions[t[0]];
  return (mesh.positions[t[1]] - p).cross(mesh.positions[t[2]] - p).norm() / 2;
}

std::uint64_t key(Index a, Index b) { return std::uint64_t{std::min(a, b)} << 32 | std::max(a, b); }

/// The corners a b c, ab the longest edge; of equal edges all triangles choose the same.
Triangle longest_first(const TriMesh& mesh, const Triangle& t) {
  std::array<std::pair<Real, std::uint64_t>, 3> edges;
  for (std::size_t k = 0; k < 3; ++k) edges[k] = {length(mesh, t[k], t[(k + 1) % 3]), key(t[k], t[(k + 1) % 3])};
  const auto k = static_cast<std::size_t>(std::max_element(edges.begin(), edges.end()) - edges.begin());
  return {t[k], t[(k + 1) % 3], t[(k + 2) % 3]};
}

}  // namespace

TriMesh cut_triangles(const TriMesh& mesh, Real largest) {
  ZONE("mesh.cut_triangles");
  CHECK(std::isfinite(largest) && largest > 0);
  TriMesh out;
  out.positions = mesh.positions;
  out.triangles = mesh.triangles;
  for (;;) {
    // Edges to cut and their middles: the longest of each large triangle, and of each that has an edge to cut.
    std::unordered_map<std::uint64_t, Index> middles;
    const auto cut_longest = [&](const Triangle& t) {
      const auto [a, b, c] = longest_first(out, t);
      if (length(out, a, b) == 0 || !middles.try_emplace(key(a, b), static_cast<Index>(out.positions.size())).second) return false;
      out.positions.push_back((out.positions[std::min(a, b)] + out.positions[std::max(a, b)]) / 2);
      return true;
    };
    for (const Triangle& t : out.triangles)
      if (area(out, t) > largest) cut_longest(t);
    if (middles.empty()) return out;
    for (bool spreads = true; spreads;) {
      spreads = false;
      for (const Triangle& t : out.triangles)
        if (middles.count(key(t[0], t[1])) + middles.count(key(t[1], t[2])) + middles.count(key(t[2], t[0])) > 0) spreads |= cut_longest(t);
    }
    // In halves, and each half once more where its own side is cut.
    std::vector<Triangle> pieces;
    pieces.reserve(out.triangles.size());
    for (const Triangle& t : out.triangles) {
      const auto [a, b, c] = longest_first(out, t);
      const auto ab = middles.find(key(a, b)), bc = middles.find(key(b, c)), ca = middles.find(key(c, a));
      if (ab == middles.end()) {
        pieces.push_back(t);
        continue;
      }
      if (ca == middles.end()) pieces.push_back({a, ab->second, c});
      else pieces.insert(pieces.end(), {{a, ab->second, ca->second}, {ca->second, ab->second, c}});
      if (bc == middles.end()) pieces.push_back({ab->second, b, c});
      else pieces.insert(pieces.end(), {{ab->second, b, bc->second}, {ab->second, bc->second, c}});
    }
    out.triangles = std::move(pieces);
  }
}

}  // namespace effuse::geometry
