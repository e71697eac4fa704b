#include "importers/terrain/mosaic.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <set>
#include <utility>

#include "geometry/base/check.h"
#include "geometry/base/error.h"

namespace effuse::importers {

namespace {

bool same_system(const Crs& a, const Crs& b) { return a.epsg > 0 && b.epsg > 0 ? a.epsg == b.epsg : a.wkt == b.wkt; }

}  // namespace

Mosaic::Mosaic(const std::vector<RasterSource>& sources, std::vector<std::size_t>& left) {
  constexpr Real kBeside = 0.05;  // of a cell
  CHECK(!left.empty());
  const RasterSource& first = sources[left.front()];
  const RasterFrame& lattice = first.facts().frame;
  struct Found {
    const RasterSource* source;
    std::int64_t column, row;
  };
  std::vector<Found> found;
  std::vector<std::size_t> others;
  for (const std::size_t index : left) {
    const RasterSource& source = sources[index];
    const RasterFrame& frame = source.facts().frame;
    const Vec2 start = lattice.cell(frame.first), end = lattice.cell(frame.at(frame.columns - 1, frame.rows - 1));
    const Vec2 column = lattice.cell(lattice.first + frame.along_columns), row = lattice.cell(lattice.first + frame.along_rows);
    // Its own cells must stay on the lattice from its first to its last.
    const Real size = std::max(frame.columns, frame.rows);
    const bool parallel = (column - Vec2(1, 0)).norm() * size < kBeside && (row - Vec2(0, 1)).norm() * size < kBeside;
    const auto on = [&](const Vec2& p) { return std::abs(p.x() - std::round(p.x())) < kBeside && std::abs(p.y() - std::round(p.y())) < kBeside; };
    if (&source == &first || (parallel && on(start) && on(end) && start.cwiseAbs().maxCoeff() < 1e9 && same_system(source.crs(), first.crs())))
      found.push_back({&source, std::llround(start.x()), std::llround(start.y())});
    else others.push_back(index);
  }
  left = std::move(others);

  std::int64_t c0 = 0, r0 = 0, c1 = 0, r1 = 0;
  for (const Found& f : found) {
    c0 = std::min(c0, f.column), r0 = std::min(r0, f.row);
    c1 = std::max(c1, f.column + f.source->facts().frame.columns), r1 = std::max(r1, f.row + f.source->facts().frame.rows);
  }
  constexpr std::int64_t kMost = std::numeric_limits<int>::max();
  if (c1 - c0 > kMost || r1 - r0 > kMost) throw InputError({first.file().string()}, "lies too far from the other files for one mosaic");
  frame_ = lattice;
  frame_.columns = static_cast<int>(c1 - c0);
  frame_.rows = static_cast<int>(r1 - r0);
  frame_.first = c0 == 0 && r0 == 0 ? lattice.first : lattice.at(static_cast<Real>(c0), static_cast<Real>(r0));
  for (const Found& f : found) sources_.push_back({f.source, static_cast<int>(f.column - c0), static_cast<int>(f.row - r0)});
}

Mosaic::Piece Mosaic::read(const CellWindow& window) const {
  Piece piece;
  if (sources_.size() == 1) {
    piece.cells = sources_.front().source->read(window);
    return piece;
  }
  constexpr Real kNaN = std::numeric_limits<Real>::quiet_NaN();
  piece.cells.window = window;
  piece.cells.values.assign(static_cast<std::size_t>(window.columns) * static_cast<std::size_t>(window.rows), kNaN);
  std::vector<char> covered(piece.cells.values.size(), 0);
  for (const Placed& placed : sources_) {
    const RasterFrame& frame = placed.source->facts().frame;
    const int c0 = std::max(window.column, placed.column), c1 = std::min(window.column + window.columns, placed.column + frame.columns);
    const int r0 = std::max(window.row, placed.row), r1 = std::min(window.row + window.rows, placed.row + frame.rows);
    if (c0 >= c1 || r0 >= r1) continue;
    const RasterCells part = placed.source->read({c0 - placed.column, r0 - placed.row, c1 - c0, r1 - r0});
    piece.cells.missing.add(part.missing);
    for (int r = r0; r < r1; ++r)
      for (int c = c0; c < c1; ++c) {
        const Real z = part.values[static_cast<std::size_t>(r - r0) * static_cast<std::size_t>(c1 - c0) + static_cast<std::size_t>(c - c0)];
        const std::size_t at = static_cast<std::size_t>(r - window.row) * static_cast<std::size_t>(window.columns) + static_cast<std::size_t>(c - window.column);
        covered[at] = 1;
        if (std::isnan(z)) continue;
        Real& whole = piece.cells.values[at];
        if (std::isnan(whole)) {
          whole = z;
        } else {
          ++piece.shared;
          piece.largest_step = std::max(piece.largest_step, std::abs(whole - z));
        }
      }
  }
  piece.uncovered = static_cast<std::size_t>(std::count(covered.begin(), covered.end(), 0));
  return piece;
}

std::vector<std::string> Mosaic::missing_tiles() const {
  if (sources_.size() < 2) return {};
  // Tiles stand at whole steps from one another: their pitch is what divides all distances.
  int pitch_c = 0, pitch_r = 0;
  for (const Placed& p : sources_) pitch_c = std::gcd(pitch_c, p.column), pitch_r = std::gcd(pitch_r, p.row);
  const RasterFrame& tile = sources_.front().source->facts().frame;
  // Neighbours share a row and column of posts, or lie side by side; else they are no array.
  if (pitch_c == 0) pitch_c = tile.columns;
  if (pitch_r == 0) pitch_r = tile.rows;
  for (const auto& [pitch, size] : {std::pair{pitch_c, tile.columns}, {pitch_r, tile.rows}})
    if (pitch < size * 3 / 4 || pitch > size) return {};
  std::set<std::pair<int, int>> there;
  for (const Placed& p : sources_) there.insert({p.column / pitch_c, p.row / pitch_r});
  std::vector<std::string> missing;
  for (int r = 0; r * pitch_r < frame_.rows - 1; ++r)
    for (int c = 0; c * pitch_c < frame_.columns - 1; ++c) {
      if (there.count({c, r}) || missing.size() > 100) continue;
      const Vec2 a = frame_.at(c * pitch_c, r * pitch_r), b = frame_.at(c * pitch_c + tile.columns - 1, r * pitch_r + tile.rows - 1);
      missing.push_back(fmt::format("x {:.10g} to {:.10g}, y {:.10g} to {:.10g}", std::min(a.x(), b.x()), std::max(a.x(), b.x()), std::min(a.y(), b.y()), std::max(a.y(), b.y())));
    }
  return missing;
}

}  // namespace effuse::importers
