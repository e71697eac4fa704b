#include "importers/terrain/trim.h"

#include <algorithm>
#include <array>
#include <cstddef>

#include "geometry/base/check.h"

namespace effuse::importers {

CellWindow trimmed(const std::vector<char>& beside, int nx, int ny, Real most) {
  CHECK_EQ(beside.size(), static_cast<std::size_t>(nx) * static_cast<std::size_t>(ny));
  const CellWindow whole{0, 0, nx, ny};
  CellWindow w = whole;
  const auto marked = [&](int i, int j) { return beside[static_cast<std::size_t>(j) * static_cast<std::size_t>(nx) + static_cast<std::size_t>(i)] != 0; };
  const auto in_row = [&](int j) {
    int count = 0;
    for (int i = w.column; i < w.column + w.columns; ++i) count += marked(i, j);
    return count;
  };
  const auto in_column = [&](int i) {
    int count = 0;
    for (int j = w.row; j < w.row + w.rows; ++j) count += marked(i, j);
    return count;
  };
  const auto good = static_cast<double>(std::count(beside.begin(), beside.end(), 0));
  double lost = 0;
  for (;;) {
    const std::array<int, 4> counts = {in_row(w.row), in_row(w.row + w.rows - 1), in_column(w.column), in_column(w.column + w.columns - 1)};
    const std::array<Real, 4> shares = {Real(counts[0]) / w.columns, Real(counts[1]) / w.columns, Real(counts[2]) / w.rows, Real(counts[3]) / w.rows};
    const auto worst = static_cast<std::size_t>(std::max_element(shares.begin(), shares.end()) - shares.begin());
    if (shares[worst] == 0) return w;
    const int length = worst < 2 ? w.columns : w.rows;
    lost += length - counts[worst];
    if (lost > most * good || w.columns <= 2 || w.rows <= 2) return whole;
    if (worst == 0) ++w.row;
    if (worst == 2) ++w.column;
    if (worst < 2) --w.rows;
    else --w.columns;
  }
}

}  // namespace effuse::importers
