#include <algorithm>
#include <cmath>
#include <deque>
#include <unordered_map>

#include "geometry/mesh/measure.h"
#include "geometry/repair/repair_internal.h"

namespace effuse::geometry {

namespace {

void drop(TriMesh& mesh, const std::vector<char>& gone) {
  std::size_t kept = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if (!gone[t]) mesh.triangles[kept++] = mesh.triangles[t];
  mesh.triangles.resize(kept);
}

/// The corner opposite the longest side when it lies on that side; 3 when the triangle has an area.
std::size_t flat_corner(const TriMesh& mesh, const Triangle& t) {
  const Vec3 &a = mesh.positions[t[0]], &b = mesh.positions[t[1]], &c = mesh.positions[t[2]];
  const Real side[3] = {(c - b).squaredNorm(), (a - c).squaredNorm(), (b - a).squaredNorm()};
  const std::size_t corner = static_cast<std::size_t>(std::max_element(side, side + 3) - side);
  // Flatter than the rounding of its own coordinates' differences: what validate() calls no area, and what a step more would.
  constexpr Real kFlat = 1e-14;
  return (b - a).cross(c - a).norm() <= kFlat * side[corner] ? corner : 3;
}

}  // namespace

void stitch_borders(TriMesh& mesh, Real reach, RepairReport& report) {
  // Cells are counted in whole numbers; what is nearer than a millionth of a millionth has been welded.
  const Box3 box = bounds(mesh);
  if (!(reach > 1e-12 * box.sizes().norm())) return;
  const EdgeList edges = edges_of(mesh);
  std::vector<Index> border;
  for (std::size_t e = 0; e < edges.size(); ++e)
    if (edges.of(e).size() == 1)
      for (const Index v : {from_of(mesh, edges.of(e)[0]), to_of(mesh, edges.of(e)[0])}) border.push_back(v);
  std::sort(border.begin(), border.end());
  border.erase(std::unique(border.begin(), border.end()), border.end());

  // In the order of x, each goes to the first not farther than reach that did not go anywhere itself.
  std::vector<Index> by_x = border;
  std::sort(by_x.begin(), by_x.end(), [&](Index p, Index q) {
    const Real px = mesh.positions[p].x(), qx = mesh.positions[q].x();
    return px != qx ? px < qx : p < q;
  });
  std::unordered_map<std::uint64_t, std::vector<Index>> cells;
  const auto cell = [&](const Vec3& p, int dx, int dy, int dz) {
    const auto at = [&](int k, int d) { return static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor((p[k] - box.min()[k]) / reach)) + d); };
    return at(0, dx) * 73856093 ^ at(1, dy) * 19349663 ^ at(2, dz) * 83492791;
  };
  std::vector<Index> target(mesh.positions.size());
  for (Index v = 0; v < target.size(); ++v) target[v] = v;
  for (const Index v : by_x) {
    const Vec3& p = mesh.positions[v];
    Index found = v;
    for (int k = 0; k < 27 && found == v; ++k) {
      const auto at = cells.find(cell(p, k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1));
      if (at == cells.end()) continue;
      for (const Index other : at->second)
        if ((mesh.positions[other] - p).norm() <= reach) {
          found = other;
          break;
        }
    }
    if (found == v) cells[cell(p, 0, 0, 0)].push_back(v);
    else target[v] = found, ++report.stitched_vertices;
  }
  if (report.stitched_vertices == 0) return;
  std::vector<char> gone(mesh.triangles.size(), 0);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    Triangle& corners = mesh.triangles[t];
    for (Index& v : corners) v = target[v];
    gone[t] = corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0];
    report.collapsed_triangles += gone[t] != 0;
  }
  drop(mesh, gone);
}

void drop_flat(TriMesh& mesh, RepairReport& report) {
  std::deque<std::size_t> flat;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if (flat_corner(mesh, mesh.triangles[t]) < 3) flat.push_back(t);
  if (flat.empty()) return;

  // Triangles by edge, kept up to date as they are cut.
  std::unordered_map<std::uint64_t, std::vector<std::size_t>> at_edge;
  const auto key = [](Index a, Index b) { return (std::uint64_t{std::min(a, b)} << 32) | std::max(a, b); };
  const auto enter = [&](std::size_t t) {
    const Triangle& c = mesh.triangles[t];
    for (std::size_t k = 0; k < 3; ++k) at_edge[key(c[k], c[(k + 1) % 3])].push_back(t);
  };
  const auto leave = [&](std::size_t t) {
    const Triangle& c = mesh.triangles[t];
    for (std::size_t k = 0; k < 3; ++k) std::erase(at_edge[key(c[k], c[(k + 1) % 3])], t);
  };
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) enter(t);
  std::vector<char> gone(mesh.triangles.size(), 0);

  // A flat triangle's middle corner lies on its long side: the neighbours across that are cut in two there, so that no crack
  // opens. Each cut shortens an edge; the bound is for meshes that are nothing but lines.
  std::size_t left = 16 * mesh.triangles.size() + 1000;
  while (!flat.empty() && left-- > 0) {
    const std::size_t t = flat.front();
    flat.pop_front();
    if (gone[t]) continue;
    const Triangle corners = mesh.triangles[t];
    const std::size_t middle = flat_corner(mesh, corners);
    if (middle == 3) continue;
    leave(t);
    gone[t] = 1;
    ++report.flat_triangles;
    const Index m = corners[middle], a = corners[(middle + 1) % 3], b = corners[(middle + 2) % 3];
    const std::vector<std::size_t> neighbours = at_edge[key(a, b)];
    for (const std::size_t n : neighbours) {
      Triangle& cut = mesh.triangles[n];
      leave(n);
      const std::size_t k = static_cast<std::size_t>(std::find_if(cut.begin(), cut.end(), [&](Index v) { return v != a && v != b; }) - cut.begin());
      if (cut[k] == m) {  // the same three corners: flat, too
        gone[n] = 1;
        ++report.flat_triangles;
        continue;
      }
      const Index apex = cut[k], from = cut[(k + 1) % 3], to = cut[(k + 2) % 3];
      cut = {from, m, apex};
      mesh.triangles.push_back({m, to, apex});
      gone.push_back(0);
      for (const std::size_t made : {n, mesh.triangles.size() - 1}) {
        enter(made);
        if (flat_corner(mesh, mesh.triangles[made]) < 3) flat.push_back(made);
      }
    }
  }
  for (const std::size_t t : flat)
    if (!gone[t] && flat_corner(mesh, mesh.triangles[t]) < 3) gone[t] = 1, ++report.flat_triangles;
  drop(mesh, gone);
}

void drop_duplicates(TriMesh& mesh, RepairReport& report) {
  const auto sorted = [](Triangle t) {
    std::sort(t.begin(), t.end());
    return t;
  };
  // Even permutations of the sorted corners are wound one way, odd ones the other.
  const auto even = [&](const Triangle& t) { return (t[0] < t[1]) ^ (t[1] < t[2]) ^ (t[2] < t[0]); };
  std::vector<std::size_t> order(mesh.triangles.size());
  for (std::size_t t = 0; t < order.size(); ++t) order[t] = t;
  std::sort(order.begin(), order.end(), [&](std::size_t p, std::size_t q) {
    const Triangle a = sorted(mesh.triangles[p]), b = sorted(mesh.triangles[q]);
    return a != b ? a < b : p < q;
  });
  std::vector<char> gone(mesh.triangles.size(), 0), wall(mesh.triangles.size(), 0);
  bool any_wall = false;
  for (std::size_t begin = 0, end; begin < order.size(); begin = end) {
    const Triangle corners = sorted(mesh.triangles[order[begin]]);
    std::size_t other = order.size();
    for (end = begin + 1; end < order.size() && sorted(mesh.triangles[order[end]]) == corners; ++end) {
      const bool same = even(mesh.triangles[order[end]]) == even(mesh.triangles[order[begin]]);
      if (!same && other == order.size()) other = end;
      else gone[order[end]] = 1, ++report.duplicate_triangles;
    }
    if (other < order.size()) wall[order[begin]] = wall[order[other]] = 1, any_wall = true;
  }
  if (any_wall) {
    // Pairs back to back: a wall between two solids when, at each edge of the patch they form, other triangles go on to
    // both sides; else a sheet with two faces, of which one stays.
    const EdgeList edges = edges_of(mesh);
    std::vector<std::size_t> patch(mesh.triangles.size());
    for (std::size_t t = 0; t < patch.size(); ++t) patch[t] = t;
    const auto root = [&](std::size_t t) {
      while (patch[t] != t) t = patch[t] = patch[patch[t]];
      return t;
    };
    for (std::size_t e = 0; e < edges.size(); ++e) {
      std::size_t first = mesh.triangles.size();
      for (const Side s : edges.of(e)) {
        if (!wall[s / 3] || gone[s / 3]) continue;
        if (first == mesh.triangles.size()) first = s / 3;
        else {
          const std::size_t p = root(first), q = root(s / 3);
          patch[std::max(p, q)] = std::min(p, q);
        }
      }
    }
    std::vector<char> stays(mesh.triangles.size(), 0), held(mesh.triangles.size(), 0);
    for (std::size_t e = 0; e < edges.size(); ++e) {
      std::size_t others = 0;
      for (const Side s : edges.of(e)) others += !wall[s / 3] && !gone[s / 3];
      for (const Side s : edges.of(e))
        if (wall[s / 3] && !gone[s / 3]) (others == 1 ? stays : held)[root(s / 3)] |= others > 0;
    }
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      if (!wall[t] || gone[t]) continue;
      const bool inner = held[root(t)] && !stays[root(t)];
      const Triangle corners = sorted(mesh.triangles[t]);
      // The pair's second, found by its corners.
      const auto at = std::lower_bound(order.begin(), order.end(), corners, [&](std::size_t p, const Triangle& c) { return sorted(mesh.triangles[p]) < c; });
      std::size_t second = mesh.triangles.size();
      for (auto k = at; k != order.end() && sorted(mesh.triangles[*k]) == corners; ++k)
        if (*k != t && wall[*k] && !gone[*k]) second = *k;
      if (second == mesh.triangles.size()) continue;
      gone[second] = 1;
      if (inner) gone[t] = 1, ++report.inner_walls;
      else ++report.duplicate_triangles;
    }
  }
  drop(mesh, gone);
}

}  // namespace effuse::geometry
