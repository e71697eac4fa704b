#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <tuple>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/types.h"
#include "skin/surface/key_table.h"

namespace effuse::skin {

/// Throw InputError: particle i is not at a place; particles are spread too far [m] for columns of this side [m].
[[noreturn]] void refuse_place(std::size_t i);
[[noreturn]] void refuse_spread(Real spread, Real side);

/// Things at places, found by place: in upright columns as wide as one usually looks, by height inside each. T has a Vec3 x and
/// an Index place, its number before sorting. Columns keep an order that does not depend on the one things came in (but for
/// two at one place).
template <class T>
class NearGrid {
 public:
  NearGrid() = default;
  /// side [m] of the columns, > 0 (checked). Throws InputError for places that are not finite, or a million columns apart.
  NearGrid(std::vector<T> things, Real side) : side_(side) {
    CHECK(std::isfinite(side) && side > 0);
    const std::size_t n = things.size();
    CHECK_LT(n, std::size_t{kNone});
    for (std::size_t i = 0; i < n; ++i) {
      if (!things[i].x.allFinite()) refuse_place(i);
      box_.extend(things[i].x);
    }
    if (n == 0) return;
    if (box_.sizes().maxCoeff() > kFarthest * side)
      refuse_spread(box_.sizes().maxCoeff(), side);

    // Columns in the order of their first, counted, then filled.
    std::vector<Index> column(n);
    for (std::size_t i = 0; i < n; ++i) {
      const Vec3& x = things[i].x;
      column[i] = table_.number(pack(column_of(x.x(), box_.min().x()), column_of(x.y(), box_.min().y()), 0));
      if (column[i] == columns_.size()) columns_.push_back({0, 0});
      ++columns_[column[i]].end;
    }
    Index sum = 0;
    for (Column& c : columns_) {
      const Index count = c.end;
      c.begin = c.end = sum;
      sum += count;
    }
    sorted_.resize(n);
    for (std::size_t i = 0; i < n; ++i) sorted_[columns_[column[i]].end++] = std::move(things[i]);
    parallel_for(
        columns_.size(),
        [&](std::size_t c) {
          std::sort(sorted_.begin() + columns_[c].begin, sorted_.begin() + columns_[c].end, [](const T& a, const T& b) {
            return std::tuple(a.x.z(), a.x.x(), a.x.y(), a.place) < std::tuple(b.x.z(), b.x.x(), b.x.y(), b.place);
          });
        },
        64);
  }

  /// f(thing) for all within radius [m] of x, and some more.
  template <class F>
  void each_near(const Vec3& x, Real radius, F&& f) const {
    if (sorted_.empty() || !x.allFinite()) return;
    const Vec3 low = (x.array() - radius).max(box_.min().array()), high = (x.array() + radius).min(box_.max().array());
    if ((low.array() > high.array()).any()) return;
    const int x0 = column_of(low.x(), box_.min().x()), x1 = column_of(high.x(), box_.min().x());
    const int y0 = column_of(low.y(), box_.min().y()), y1 = column_of(high.y(), box_.min().y());
    for (int cx = x0; cx <= x1; ++cx)
      for (int cy = y0; cy <= y1; ++cy) {
        const Index number = table_.find(pack(cx, cy, 0));
        if (number == kNone) continue;
        const auto end = sorted_.begin() + columns_[number].end;
        auto p = std::lower_bound(sorted_.begin() + columns_[number].begin, end, low.z(), [](const T& a, Real z) { return a.x.z() < z; });
        for (; p != end && p->x.z() <= high.z(); ++p) f(*p);
      }
  }

  std::span<const T> sorted() const { return sorted_; }

 private:
  static constexpr Real kFarthest = 1e6;  // [sides] from end to end: column numbers fit 21 bits
  struct Column {
    Index begin, end;
  };
  int column_of(Real v, Real origin) const { return static_cast<int>(std::floor((v - origin) / side_)); }

  Real side_ = 1;
  Box3 box_;
  std::vector<T> sorted_;
  std::vector<Column> columns_;
  KeyTable table_;
};

}  // namespace effuse::skin
