#pragma once

#include <array>
#include <cstdint>

/// How the surface runs through one cell: which of its crossed edges belong to one patch.
///
/// A cell's corner c = 4 dx + 2 dy + dz, its configuration has bit c set where corner c is inside. Edge e = 4 axis + 2 p + q, where
/// p and q are the corner's offsets along the other two axes, in their order (x: y, z; y: x, z; z: x, y). Face f = 2 axis + side.
namespace effuse::skin {

/// Patches of a cell with this configuration; patch[e]: of crossed edge e, kNoPatch for the others. At most four.
struct DualCell {
  static constexpr std::uint8_t kNoPatch = 255;
  std::array<std::uint8_t, 12> patch;
  std::uint8_t patches;
  std::uint8_t ambiguous;  ///< bit f: face f has two inside corners, on a diagonal
  std::uint8_t pinched;    ///< bit f: and all four of its edges belong to one patch
};

/// Edge e's end outside the corner with offset 0 along its axis.
struct CellEdge {
  std::uint8_t low, high;  ///< corners
};

namespace detail {

constexpr std::array<CellEdge, 12> cell_edges() {
  std::array<CellEdge, 12> edges{};
  constexpr int bit[3] = {4, 2, 1};
  for (int axis = 0; axis < 3; ++axis)
    for (int p = 0; p < 2; ++p)
      for (int q = 0; q < 2; ++q) {
        const int low = p * bit[axis == 0 ? 1 : 0] + q * bit[axis == 2 ? 1 : 2];
        edges[static_cast<std::size_t>(4 * axis + 2 * p + q)] = {static_cast<std::uint8_t>(low), static_cast<std::uint8_t>(low + bit[axis])};
      }
  return edges;
}
inline constexpr std::array<CellEdge, 12> kCellEdges = cell_edges();

/// Edge between two corners that differ along one axis.
constexpr std::size_t edge_between(int a, int b) {
  const int low = a < b ? a : b, high = a < b ? b : a;
  for (std::size_t e = 0; e < 12; ++e)
    if (kCellEdges[e].low == low && kCellEdges[e].high == high) return e;
  return 12;
}

}  // namespace detail

/// On an ambiguous face the inside corners are parted; on the faces of `joined` they are joined instead.
constexpr DualCell dual_cell(unsigned configuration, unsigned joined = 0) {
  constexpr int bit[3] = {4, 2, 1};
  const auto inside = [&](int corner) { return (configuration >> corner) & 1u; };
  // On each face every crossed edge is paired with another one.
  std::array<std::array<std::uint8_t, 6>, 12> pair{};
  for (auto& p : pair) p.fill(12);
  DualCell cell{};
  for (int axis = 0; axis < 3; ++axis)
    for (int side = 0; side < 2; ++side) {
      const std::size_t face = static_cast<std::size_t>(2 * axis + side);
      const int u = bit[(axis + 1) % 3], v = bit[(axis + 2) % 3], base = side * bit[axis];
      const int corner[4] = {base, base + u, base + u + v, base + v};
      std::size_t edge[4] = {};
      for (int k = 0; k < 4; ++k) edge[k] = detail::edge_between(corner[k], corner[(k + 1) % 4]);
      const auto join = [&](std::size_t a, std::size_t b) {
        pair[a][face] = static_cast<std::uint8_t>(b);
        pair[b][face] = static_cast<std::uint8_t>(a);
      };
      std::size_t crossed[4] = {};
      int n = 0;
      for (int k = 0; k < 4; ++k)
        if (inside(corner[k]) != inside(corner[(k + 1) % 4])) crossed[n++] = edge[k];
      if (n == 2) join(crossed[0], crossed[1]);
      if (n < 4) continue;
      cell.ambiguous = static_cast<std::uint8_t>(cell.ambiguous | (1u << face));
      // Edges k - 1 and k meet in corner k.
      const bool about_inside = ((joined >> face) & 1u) == 0;
      const int first = (inside(corner[0]) != 0) == about_inside ? 0 : 1;
      join(edge[(first + 3) % 4], edge[first]);
      join(edge[first + 1], edge[(first + 2) % 4]);
    }

  cell.patch.fill(DualCell::kNoPatch);
  for (std::size_t start = 0; start < 12; ++start) {
    const auto is_crossed = [&] { return inside(detail::kCellEdges[start].low) != inside(detail::kCellEdges[start].high); };
    if (!is_crossed() || cell.patch[start] != DualCell::kNoPatch) continue;
    std::size_t e = start, from_face = 6;
    do {
      cell.patch[e] = cell.patches;
      std::size_t face = 0;
      while (pair[e][face] == 12 || face == from_face) ++face;
      e = pair[e][face];
      from_face = face;
    } while (e != start);
    ++cell.patches;
  }
  for (int axis = 0; axis < 3; ++axis)
    for (int side = 0; side < 2; ++side) {
      const unsigned face = static_cast<unsigned>(2 * axis + side);
      if (((cell.ambiguous >> face) & 1u) == 0) continue;
      bool one = true;
      std::uint8_t patch = DualCell::kNoPatch;
      for (std::size_t e = 0; e < 12; ++e) {
        if (pair[e][face] == 12) continue;
        one = one && (patch == DualCell::kNoPatch || patch == cell.patch[e]);
        patch = cell.patch[e];
      }
      if (one) cell.pinched = static_cast<std::uint8_t>(cell.pinched | (1u << face));
    }
  return cell;
}

/// dual_cell of every configuration, no face joined.
extern const std::array<DualCell, 256> kDualCells;

}  // namespace effuse::skin
