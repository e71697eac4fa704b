#include "skin/surface/manifold.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <span>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::skin {

namespace {

using geometry::Triangle;
using geometry::TriMesh;

constexpr Index kNobody = ~Index{0};

/// Half-edge h = 3 t + c runs from corner c of triangle t to corner c + 1.
Index next_in_triangle(Index h) { return h / 3 * 3 + (h % 3 + 1) % 3; }
Index previous_in_triangle(Index h) { return h / 3 * 3 + (h % 3 + 2) % 3; }
Index start(const TriMesh& mesh, Index h) { return mesh.triangles[h / 3][h % 3]; }
Index end(const TriMesh& mesh, Index h) { return start(mesh, next_in_triangle(h)); }

struct HalfEdge {
  Index high, id;  // the larger of its two vertices, and which
  bool forward;    // runs from the smaller to the larger
};

/// All half-edges by their smaller vertex (begin[v] .. begin[v + 1]), then by the larger, then by number.
struct EdgeTable {
  std::vector<Index> begin;
  std::vector<HalfEdge> edges;

  explicit EdgeTable(const TriMesh& mesh) : begin(mesh.positions.size() + 1, 0), edges(3 * mesh.triangles.size()) {
    const Index n = static_cast<Index>(edges.size());
    for (Index h = 0; h < n; ++h) ++begin[std::min(start(mesh, h), end(mesh, h)) + 1];
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    std::vector<Index> filled(begin.begin(), begin.end() - 1);
    for (Index h = 0; h < n; ++h) {
      const Index a = start(mesh, h), b = end(mesh, h);
      edges[filled[std::min(a, b)]++] = {std::max(a, b), h, a < b};
    }
    parallel_for(mesh.positions.size(), [&](std::size_t v) {
      std::stable_sort(edges.begin() + begin[v], edges.begin() + begin[v + 1],
                       [](const HalfEdge& x, const HalfEdge& y) { return x.high < y.high; });
    });
  }

  /// f(half-edges of one edge) for each edge at smaller vertex v.
  template <class F>
  void each_edge(std::size_t v, F&& f) const {
    for (Index from = begin[v]; from < begin[v + 1];) {
      Index to = from;
      while (to < begin[v + 1] && edges[to].high == edges[from].high) ++to;
      f(std::span(edges).subspan(from, to - from));
      from = to;
    }
  }
};

/// For each half-edge the one it is joined to.
using Mates = std::vector<Index>;

/// Pairs the half-edges of one edge by the angle at which their triangles stand around it: going around low -> high
/// counter-clockwise, the solid lies between a backward triangle (its outside faces where we come from)
/// and the next forward one.
void pair_around(const TriMesh& mesh, std::span<const HalfEdge> edge, Mates& mates) {
  const auto join = [&](Index a, Index b) {
    mates[a] = b;
    mates[b] = a;
  };
  if (edge.size() == 2) return join(edge[0].id, edge[1].id);

  const Index first = edge[0].id;
  const Vec3& low = mesh.positions[edge[0].forward ? start(mesh, first) : end(mesh, first)];
  const Vec3 axis = (mesh.positions[edge[0].high] - low).normalized();
  const Vec3 side = (std::abs(axis.x()) < 0.6 ? axis.cross(Vec3::UnitX()) : axis.cross(Vec3::UnitY())).normalized(), up = axis.cross(side);
  struct Standing {
    Real angle;
    const HalfEdge* edge;
  };
  std::vector<Standing> around;
  for (const HalfEdge& e : edge) {
    const Vec3 out = mesh.positions[start(mesh, previous_in_triangle(e.id))] - low;
    around.push_back({std::atan2(out.dot(up), out.dot(side)), &e});
  }
  std::stable_sort(around.begin(), around.end(), [](const Standing& a, const Standing& b) { return a.angle < b.angle; });

  // Matched like brackets, twice round: a backward triangle opens, a forward one closes. Coplanar ones may stand in the
  // wrong order; the stack settles them.
  std::vector<const HalfEdge*> open;
  for (int round = 0; round < 2; ++round)
    for (const Standing& s : around) {
      if (mates[s.edge->id] != kNobody) continue;
      if (!s.edge->forward) {
        if (round == 0) open.push_back(s.edge);
      } else if (!open.empty()) {
        join(open.back()->id, s.edge->id);
        open.pop_back();
      }
    }
}

/// Gives every fan of triangles round a vertex a vertex of its own; the fan of its first corner keeps it.
std::size_t split_fans(TriMesh& mesh, const Mates& mates) {
  const Index n = static_cast<Index>(mates.size());
  // The next half-edge that starts at the same vertex, over the triangles' shared edges.
  const auto around = [&](Index h) { return mates[previous_in_triangle(h)]; };
  std::vector<Index> first(mesh.positions.size(), kNobody), valence(mesh.positions.size(), 0);
  for (Index h = 0; h < n; ++h) {
    const Index v = start(mesh, h);
    if (valence[v]++ == 0) first[v] = h;
  }
  std::vector<std::uint8_t> whole(mesh.positions.size(), 1);
  parallel_for(mesh.positions.size(), [&](std::size_t v) {
    if (valence[v] == 0) return;
    Index count = 1;
    for (Index h = around(first[v]); h != first[v]; h = around(h)) ++count;
    whole[v] = count == valence[v];
  });

  std::size_t copies = 0;
  std::vector<std::uint8_t> done(n, 0);
  for (Index h = 0; h < n; ++h) {
    const Index v = start(mesh, h);
    if (v >= whole.size() || whole[v] || done[h]) continue;
    const Index vertex = h == first[v] ? v : static_cast<Index>(mesh.positions.size());
    if (vertex != v) {
      mesh.positions.push_back(Vec3(mesh.positions[v]));
      ++copies;
    }
    Index g = h;
    do {
      mesh.triangles[g / 3][g % 3] = vertex;
      done[g] = 1;
      g = around(g);
    } while (g != h);
  }
  return copies;
}

}  // namespace

ManifoldReport make_manifold(TriMesh& mesh) {
  ZONE("skin.manifold");
  CHECK(mesh.attributes.empty());
  CHECK(mesh.normals.empty());
  ManifoldReport report;
  report.dropped_triangles = std::erase_if(mesh.triangles, [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });

  // Each round parts what can part; edges whose two ends both stay whole get midpoints and part in the next.
  for (int round = 0; round < 3; ++round) {
    const EdgeTable table(mesh);
    Mates mates(table.edges.size(), kNobody);
    for (std::size_t v = 0; v + 1 < table.begin.size(); ++v)
      table.each_edge(v, [&](std::span<const HalfEdge> edge) {
        const auto forward = std::count_if(edge.begin(), edge.end(), [](const HalfEdge& e) { return e.forward; });
        CHECK_EQ(2 * forward, static_cast<std::ptrdiff_t>(edge.size()));
        pair_around(mesh, edge, mates);
        if (edge.size() > 2 && round == 0) ++report.split_edges;
      });
    report.split_vertices += split_fans(mesh, mates);

    // Edges that still have more than two triangles.
    struct Cut {
      Index half_edge, middle;
    };
    std::vector<Cut> cuts;
    if (report.split_edges > 0) {
      const EdgeTable after(mesh);
      for (std::size_t v = 0; v + 1 < after.begin.size(); ++v)
        after.each_edge(v, [&](std::span<const HalfEdge> edge) {
          for (const HalfEdge& e : edge) {
            if (edge.size() <= 2 || !e.forward) continue;
            const Index middle = static_cast<Index>(mesh.positions.size());
            mesh.positions.push_back((mesh.positions[v] + mesh.positions[e.high]) / 2);
            cuts.push_back({e.id, middle});
            cuts.push_back({mates[e.id], middle});
          }
        });
    }
    if (cuts.empty()) return report;
    // A triangle with two edges to cut is cut along the first, the second then cuts the half that holds it.
    for (std::size_t c = 0; c < cuts.size(); ++c) {
      const Index h = cuts[c].half_edge, middle = cuts[c].middle;
      const Index a = start(mesh, h), b = end(mesh, h), far = start(mesh, previous_in_triangle(h));
      const Index half = static_cast<Index>(3 * mesh.triangles.size());
      mesh.triangles[h / 3] = {a, middle, far};
      mesh.triangles.push_back({middle, b, far});
      for (std::size_t later = c + 1; later < cuts.size(); ++later) {
        Index& other = cuts[later].half_edge;
        if (other == next_in_triangle(h))
          other = half + 1;
        else if (other == previous_in_triangle(h))
          other = h / 3 * 3 + 2;
      }
    }
  }
  return report;
}

}  // namespace effuse::skin
