#include "geometry/mesh/validate.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "geometry/base/error.h"

namespace effuse::geometry {

namespace {

/// Disjoint sets of 0..n-1; a set's root is its smallest member.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), std::size_t{0}); }
  std::size_t root(std::size_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void unite(std::size_t i, std::size_t j) {
    const std::size_t a = root(i), b = root(j);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::size_t> parent_;
};

/// One side of a triangle: from corner to the corner after it.
struct HalfEdge {
  Index low, high;     // its vertices
  std::size_t corner;  // 3 * triangle + k
  bool rising;         // runs from low to high
  bool same_edge(const HalfEdge& other) const { return low == other.low && high == other.high; }
};

std::size_t next_corner(std::size_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; }

void check_well_formed(const TriMesh& mesh) {
  const std::size_t n = mesh.positions.size();
  std::vector<Fault> faults;
  const auto fault = [&](const std::string& message) { faults.push_back({Place{}, message}); };

  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto bad = std::find_if(mesh.triangles[t].begin(), mesh.triangles[t].end(), [&](Index i) { return i >= n; });
    if (bad == mesh.triangles[t].end()) continue;
    fault(fmt::format("triangle {} names vertex {}, but there are only {} (counted from 0)", t, *bad, n));
    break;
  }
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3& x = mesh.positions[i];
    if (x.allFinite()) continue;
    fault(fmt::format("vertex {} is at ({}, {}, {}), wanted finite numbers", i, x.x(), x.y(), x.z()));
    break;
  }
  if (!mesh.normals.empty() && mesh.normals.size() != n)
    fault(fmt::format("{} normals for {} vertices, wanted as many or none", mesh.normals.size(), n));
  for (const auto& [name, attribute] : mesh.attributes) {
    if (attribute.width < 1)
      fault(fmt::format("attribute '{}' has width {}, wanted 1 or more", name, attribute.width));
    else if (attribute.values.size() != n * static_cast<std::size_t>(attribute.width))
      fault(fmt::format("attribute '{}' holds {} numbers, wanted {} a vertex for {} vertices", name, attribute.values.size(),
                        attribute.width, n));
  }
  if (!faults.empty()) throw InputError(std::move(faults));
}

}  // namespace

MeshReport validate(const TriMesh& mesh) {
  check_well_formed(mesh);
  MeshReport report;
  report.vertices = mesh.positions.size();
  report.triangles = mesh.triangles.size();

  // Sides of the triangles that have three different vertices, sorted so that an edge's sides are neighbours.
  std::vector<HalfEdge> sides;
  sides.reserve(3 * mesh.triangles.size());
  std::vector<char> used(mesh.positions.size(), 0);
  std::size_t whole_triangles = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto [a, b, c] = mesh.triangles[t];
    used[a] = used[b] = used[c] = 1;
    if (a == b || b == c || c == a) {
      ++report.repeated_indices;
      continue;
    }
    ++whole_triangles;
    const Vec3 &A = mesh.positions[a], &B = mesh.positions[b], &C = mesh.positions[c];
    if ((B - A).cross(C - A).squaredNorm() == 0) ++report.zero_area;
    const Index v[4] = {a, b, c, a};
    for (std::size_t k = 0; k < 3; ++k) sides.push_back({std::min(v[k], v[k + 1]), std::max(v[k], v[k + 1]), 3 * t + k, v[k] < v[k + 1]});
  }
  std::sort(sides.begin(), sides.end(), [](const HalfEdge& p, const HalfEdge& q) {
    return p.low != q.low ? p.low < q.low : p.high != q.high ? p.high < q.high : p.corner < q.corner;
  });

  // Edge by edge: how many triangles, in which directions; corners that an edge joins are of one fan.
  DisjointSets fans(3 * mesh.triangles.size()), pieces(mesh.positions.size());
  const auto corner_at = [](const HalfEdge& side, bool low) { return side.rising == low ? side.corner : next_corner(side.corner); };
  for (std::size_t begin = 0, end; begin < sides.size(); begin = end) {
    for (end = begin + 1; end < sides.size() && sides[end].same_edge(sides[begin]); ++end) {
      fans.unite(corner_at(sides[begin], true), corner_at(sides[end], true));
      fans.unite(corner_at(sides[begin], false), corner_at(sides[end], false));
    }
    ++report.edges;
    if (end - begin == 1) ++report.boundary_edges;
    if (end - begin == 2 && sides[begin].rising == sides[begin + 1].rising) ++report.misoriented_edges;
    if (end - begin >= 3) ++report.non_manifold_edges;
    pieces.unite(sides[begin].low, sides[begin].high);
  }

  // Vertex by vertex: how many fans meet.
  std::vector<Index> fan_count(mesh.positions.size(), 0);
  for (const HalfEdge& side : sides)
    if (fans.root(side.corner) == side.corner) ++fan_count[mesh.triangles[side.corner / 3][side.corner % 3]];
  std::size_t used_vertices = 0;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    report.non_manifold_vertices += fan_count[i] > 1;
    used_vertices += used[i] != 0;
    report.components += used[i] && pieces.root(i) == i;
  }
  report.unused_vertices = report.vertices - used_vertices;
  report.euler = static_cast<std::ptrdiff_t>(used_vertices + whole_triangles) - static_cast<std::ptrdiff_t>(report.edges);
  return report;
}

std::string to_string(const MeshReport& r) {
  const auto plural = [](std::size_t n, const char* one, const char* many) { return fmt::format("{} {}", n, n == 1 ? one : many); };
  std::string text = plural(r.vertices, "vertex", "vertices") + ", " + plural(r.triangles, "triangle", "triangles");
  text += r.closed() ? ", closed" : ", " + plural(r.boundary_edges, "border edge", "border edges");
  if (r.manifold())
    text += ", manifold";
  else
    text += ", not manifold at " + plural(r.non_manifold_edges, "edge", "edges") + " and " + plural(r.non_manifold_vertices, "vertex", "vertices");
  text += r.oriented() ? ", oriented" : ", not oriented at " + plural(r.misoriented_edges, "edge", "edges");
  text += ", " + plural(r.components, "component", "components");
  if (r.repeated_indices > 0) text += ", " + plural(r.repeated_indices, "triangle names", "triangles name") + " a vertex twice";
  if (r.zero_area > 0) text += ", " + plural(r.zero_area, "triangle", "triangles") + " of no area";
  if (r.unused_vertices > 0) text += ", " + plural(r.unused_vertices, "unused vertex", "unused vertices");
  return text;
}

}  // namespace effuse::geometry
