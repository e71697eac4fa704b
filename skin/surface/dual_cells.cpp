#include "skin/surface/dual_cells.h"

#include <bit>

namespace effuse::skin {

namespace {

constexpr std::array<DualCell, 256> all_cells() {
  std::array<DualCell, 256> cells{};
  for (unsigned c = 0; c < 256; ++c) cells[c] = dual_cell(c);
  return cells;
}

// A cell pinched at a face has no other ambiguous face, and is not pinched there any more once that face is joined: what
// iso_mesh builds on.
constexpr bool joining_unpinches() {
  for (unsigned c = 0; c < 256; ++c) {
    const DualCell cell = dual_cell(c);
    if (cell.pinched == 0) continue;
    if (std::popcount(cell.ambiguous) != 1 || dual_cell(c, cell.pinched).pinched != 0) return false;
  }
  return true;
}
static_assert(joining_unpinches());

}  // namespace

constexpr std::array<DualCell, 256> kDualCells = all_cells();

}  // namespace effuse::skin
