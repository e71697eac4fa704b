#pragma once

#include <cmath>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "geometry/base/types.h"

namespace effuse::importers {

/// Where the centres of a raster's cells lie in its own coordinates: cell (column, row) at first + column * along_columns +
/// row * along_rows. Rows may run to any side, and askew.
struct RasterFrame {
  int columns = 0, rows = 0;
  Vec2 first = Vec2::Zero();
  Vec2 along_columns = Vec2::UnitX(), along_rows = -Vec2::UnitY();

  Vec2 at(Real column, Real row) const { return first + column * along_columns + row * along_rows; }
  /// Column and row of a place, whole numbers at centres.
  Vec2 cell(const Vec2& p) const {
    const Vec2 d = p - first;
    const Real det = along_columns.x() * along_rows.y() - along_columns.y() * along_rows.x();
    return {(d.x() * along_rows.y() - d.y() * along_rows.x()) / det, (along_columns.x() * d.y() - along_columns.y() * d.x()) / det};
  }
  bool axis_aligned() const { return along_columns.y() == 0 && along_rows.x() == 0; }
};

/// A rectangle of cells.
struct CellWindow {
  int column = 0, row = 0, columns = 0, rows = 0;
};

/// What a raster file says of itself before its heights are read.
struct RasterFacts {
  std::string format;       ///< "GeoTIFF"
  std::string type;         ///< "Int16", "text"
  RasterFrame frame;
  bool placed = true;       ///< false: an image; the frame counts cells
  std::string crs;          ///< as the file has it; empty: says nothing
  std::string crs_place;    ///< the file that says so
  std::string height_unit;  ///< of its heights, as written; empty: says nothing
  std::vector<std::string> notes;
};

/// Cells without data, by what marked them.
struct MissingData {
  std::size_t declared = 0, masked = 0, nans = 0;
  std::map<Real, std::size_t> undeclared;  ///< by mark: -9999, -32768, ...
  std::size_t total() const {
    std::size_t sum = declared + masked + nans;
    for (const auto& [mark, count] : undeclared) sum += count;
    return sum;
  }
  void add(const MissingData& other) {
    declared += other.declared, masked += other.masked, nans += other.nans;
    for (const auto& [mark, count] : other.undeclared) undeclared[mark] += count;
  }
};

/// Heights of a window of cells, row after row as the file has them; NaN: no data.
struct RasterCells {
  CellWindow window;
  std::vector<Real> values;
  MissingData missing;
};

/// Whether a number that no header declares marks missing data: NaN, -9999, -32768, +-1e30 and beyond (-3.4e38).
inline bool marks_missing(Real value) { return std::isnan(value) || value == -9999 || value == -32768 || std::abs(value) >= 1e30; }

/// Heights beyond are no planet's [m].
inline constexpr Real kHighestGround = 1e5;

}  // namespace effuse::importers
