#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "importers/terrain/dem_grid.h"
#include "importers/terrain/dem_options.h"
#include "importers/terrain/raster.h"
#include "importers/terrain/spatial_reference.h"

namespace effuse::importers {

/// Hands out the bytes of a text file.
using ReadText = std::function<std::string(const std::filesystem::path&)>;

/// A raster of any format, opened: its facts, and its heights window by window, in metres.
///
/// Texts (ESRI ASCII, XYZ) are parsed as a whole when opened; of all others nothing is held.
class RasterSource {
 public:
  /// Finds the format by the first bytes and the ending; puts an image in its place (options.size, options.range); reads the
  /// coordinate system (options.file_crs, the file's own, a .prj beside it) and units, and turns feet into metres. What was
  /// assumed stands in facts().notes. Throws InputError naming the file.
  RasterSource(std::filesystem::path file, const DemOptions& options, const ReadText& read_text);

  const std::filesystem::path& file() const { return file_; }
  const RasterFacts& facts() const { return facts_; }          ///< the frame in crs()'s units
  const Crs& crs() const { return crs_; }                      ///< in metres, or in degrees
  /// Heights in metres.
  RasterCells read(const CellWindow& window) const;

 private:
  void find_crs(const DemOptions& options);
  void place_image(const DemOptions& options);
  void find_height_unit(const DemOptions& options);
  bool looks_like_degrees() const;

  std::filesystem::path file_;
  RasterFacts facts_;
  Crs crs_;
  std::optional<DemGrid> text_;
  Real z_scale_ = 1, z_offset_ = 0;
};

/// Whether import_dem reads the file: by its ending or its first bytes.
bool is_dem(const std::filesystem::path& file);

}  // namespace effuse::importers
