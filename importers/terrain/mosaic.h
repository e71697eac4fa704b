#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "importers/terrain/raster_source.h"

namespace effuse::importers {

/// Rasters whose cells lie on one lattice, in one coordinate system: read as if they were one.
class Mosaic {
 public:
  /// The first raster that is not yet in a mosaic, and all others that share its lattice (to a twentieth of a cell over
  /// the whole mosaic) and its system. Takes them out of left, which holds indices into sources and is not empty.
  Mosaic(const std::vector<RasterSource>& sources, std::vector<std::size_t>& left);

  const RasterFrame& frame() const { return frame_; }  ///< of the whole
  const Crs& crs() const { return sources_.front().source->crs(); }
  std::size_t files() const { return sources_.size(); }

  struct Piece {
    RasterCells cells;
    std::size_t uncovered = 0;  ///< cells that no file has
    std::size_t shared = 0;     ///< cells that several have a height for: the first file's counts
    Real largest_step = 0;      ///< between two files' heights of one cell [m]
  };
  Piece read(const CellWindow& window) const;

  /// Places of a regular array of tiles where no file lies: "x 400000 to 410000, y 5000000 to 5010000".
  std::vector<std::string> missing_tiles() const;

 private:
  struct Placed {
    const RasterSource* source;
    int column, row;  // of its first cell in the whole
  };
  std::vector<Placed> sources_;
  RasterFrame frame_;
};

}  // namespace effuse::importers
