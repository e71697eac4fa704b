#pragma once

#include <algorithm>
#include <array>
#include <numeric>
#include <span>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/mesh/tri_mesh.h"
#include "skin/surface/key_table.h"

/// Half-edge h = 3 t + k runs from corner k of triangle t to the next.
namespace effuse::skin {

/// In the same triangle, `by` corners on.
inline Index turn(Index h, Index by) { return h / 3 * 3 + (h % 3 + by) % 3; }

/// Some edges of a mesh, numbered.
struct Edges {
  std::vector<Index> of;                     ///< of each half-edge; kNone: not wanted
  std::vector<std::array<Index, 2>> halves;  ///< of each edge, the smaller first

  Index mate(Index h) const { return halves[of[h]][0] ^ halves[of[h]][1] ^ h; }
};

/// The edges of the half-edges h with wanted(h), in the order of their first ones.
/// Both halves must be wanted and run in opposite directions, no others share the edge (checked): a closed, oriented manifold.
template <class F>
Edges number_edges(std::span<const geometry::Triangle> triangles, std::size_t vertices, F&& wanted) {
  const auto n = static_cast<Index>(3 * triangles.size());
  const auto start = [&](Index h) { return triangles[h / 3][h % 3]; };
  // A half-edge waits with its smaller end for the other; few wait there at a time.
  Edges edges;
  edges.of.assign(n, kNone);
  std::vector<Index> waiting(vertices, kNone), next;  // edges, by number; next: behind them
  for (Index h = 0; h < n; ++h) {
    if (!wanted(h)) continue;
    const Index a = start(h), b = start(turn(h, 1));
    Index* link = &waiting[std::min(a, b)];
    while (*link != kNone) {
      const Index first = edges.halves[*link][0];
      if (start(first) == b && start(turn(first, 1)) == a) break;
      link = &next[*link];
    }
    if (*link != kNone) {
      const Index e = *link;
      *link = next[e];
      edges.halves[e][1] = h;
      edges.of[h] = e;
    } else {
      edges.of[h] = *link = static_cast<Index>(edges.halves.size());
      edges.halves.push_back({h, kNone});
      next.push_back(kNone);
    }
  }
  for (const auto& halves : edges.halves) CHECK_NE(halves[1], kNone);
  return edges;
}

}  // namespace effuse::skin
