#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "geometry/base/zones.h"
#include "skin/surface/rasterize.h"

namespace effuse::skin {

namespace {

using Levels = std::vector<std::array<int, 2>>;  // from, to: blocks of an upright row

/// Joins neighbouring and overlapping ones; sorted before and after.
void join(Levels& levels) {
  std::size_t kept = 0;
  for (const std::array<int, 2>& next : levels) {
    if (kept > 0 && next[0] <= levels[kept - 1][1] + 1) levels[kept - 1][1] = std::max(levels[kept - 1][1], next[1]);
    else levels[kept++] = next;
  }
  levels.resize(kept);
}

/// Upright rows of blocks by place: a table as wide as all of them where that is no waste, else by hash.
class Rows {
 public:
  /// From (a0, b0) to (a1, b1); `much`: so many are no waste.
  Rows(int a0, int a1, int b0, int b1, std::size_t much) : a0_(a0), b0_(b0), wide_(b1 - b0 + 1) {
    const double area = (static_cast<double>(a1) - a0 + 1) * (static_cast<double>(b1) - b0 + 1);
    if (area <= static_cast<double>(much)) dense_.assign(static_cast<std::size_t>(area), kNone);
  }
  Levels& at(int a, int b) {
    Index row;
    if (dense_.empty()) {
      row = table_.number(pack(a, b, 0));
    } else {
      Index& known = dense_[static_cast<std::size_t>(a - a0_) * static_cast<std::size_t>(wide_) + static_cast<std::size_t>(b - b0_)];
      if (known == kNone) known = static_cast<Index>(places.size());
      row = known;
    }
    if (row == places.size()) {
      places.push_back({a, b});
      levels.emplace_back();
    }
    return levels[row];
  }
  std::vector<std::array<int, 2>> places;
  std::vector<Levels> levels;

 private:
  int a0_, b0_, wide_;
  std::vector<Index> dense_;
  KeyTable table_;
};

}  // namespace

std::optional<Blocks> blocks_around(const ParticleGrid& particles, Real reach, std::size_t most) {
  ZONE("skin.blocks");
  const auto block = [](Real v) { return static_cast<int>(std::floor(v / kSide)); };
  const auto& columns = particles.columns();
  if (columns.empty()) return Blocks();
  // Columns are squares, their particles may fill a part of one only.
  struct Footprint {
    int a0, a1, b0, b1;
  };
  std::vector<Footprint> footprints;
  Footprint all{std::numeric_limits<int>::max(), std::numeric_limits<int>::min(), std::numeric_limits<int>::max(), std::numeric_limits<int>::min()};
  for (const ParticleGrid::Column& column : columns) {
    Box3 box;
    for (Index p = column.begin; p < column.end; ++p) box.extend(particles.x()[p]);
    const Footprint f{block(box.min().x() - reach), block(box.max().x() + reach), block(box.min().y() - reach), block(box.max().y() + reach)};
    footprints.push_back(f);
    all = {std::min(all.a0, f.a0), std::max(all.a1, f.a1), std::min(all.b0, f.b0), std::max(all.b1, f.b1)};
  }

  Rows rows(all.a0, all.a1, all.b0, all.b1, 64 * columns.size() + 4096);
  Levels levels;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    levels.clear();
    for (Index p = columns[k].begin; p < columns[k].end; ++p) {
      const Real z = particles.x()[p].z();  // rises
      const std::array<int, 2> next{block(z - reach), block(z + reach)};
      if (!levels.empty() && next[0] <= levels.back()[1] + 1) levels.back()[1] = std::max(levels.back()[1], next[1]);
      else levels.push_back(next);
    }
    const Footprint& f = footprints[k];
    for (int a = f.a0; a <= f.a1; ++a)
      for (int b = f.b0; b <= f.b1; ++b) {
        Levels& row = rows.at(a, b);
        for (const std::array<int, 2>& next : levels) {
          // Columns beside one another reach much the same blocks.
          if (!row.empty() && next[0] >= row.back()[0] && next[0] <= row.back()[1] + 1) {
            row.back()[1] = std::max(row.back()[1], next[1]);
            continue;
          }
          row.push_back(next);
        }
      }
    if (rows.places.size() > most) return std::nullopt;  // a row has a block at least
  }

  std::vector<BlockCoord> coords;
  for (std::size_t r = 0; r < rows.places.size(); ++r) {
    Levels& row = rows.levels[r];
    std::sort(row.begin(), row.end());
    join(row);
    for (const auto& [from, to] : row)
      for (int c = from; c <= to; ++c) coords.push_back({rows.places[r][0], rows.places[r][1], c});
    if (coords.size() > most) return std::nullopt;
  }
  return Blocks(coords);
}

Blocks blocks_around(const ParticleGrid& particles, Real reach) { return *blocks_around(particles, reach, std::numeric_limits<std::size_t>::max()); }

}  // namespace effuse::skin
