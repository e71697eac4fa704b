#include "importers/terrain/raster_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <utility>

#include "geometry/base/error.h"
#include "geometry/base/length_unit.h"
#include "importers/input_file.h"
#include "importers/terrain/esri_ascii.h"
#include "importers/terrain/gdal_raster.h"
#include "importers/terrain/xyz_grid.h"

namespace effuse::importers {

namespace fs = std::filesystem;

namespace {


/// The first bytes of a file; empty when it cannot be opened.
std::string first_bytes(const fs::path& file, std::size_t count = 4096) {
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return "";
  std::ifstream in(file, std::ios::binary);
  std::string bytes(count, '\0');
  in.read(bytes.data(), static_cast<std::streamsize>(count));
  bytes.resize(static_cast<std::size_t>(std::max<std::streamsize>(in.gcount(), 0)));
  return bytes;
}

bool is_xyz(const fs::path& file, const std::string& bytes) {
  const std::string extension = lower_extension(file);
  return (extension == ".xyz" || extension == ".csv" || extension == ".txt" || extension == ".dat") && looks_like_xyz(bytes);
}

RasterFacts facts_of(const DemGrid& grid, const char* format) {
  RasterFacts facts;
  facts.format = format;
  facts.type = "text";
  facts.frame = {grid.nx, grid.ny, grid.corner, Vec2(grid.spacing.x(), 0), Vec2(0, grid.spacing.y())};
  facts.notes = grid.notes;
  return facts;
}

/// The text of a .prj beside the file.
std::string projection_beside(const fs::path& file, RasterFacts& facts) {
  for (const char* extension : {".prj", ".PRJ"}) {
    const fs::path prj = fs::path(file).replace_extension(extension);
    std::error_code error;
    if (!fs::is_regular_file(prj, error) || fs::file_size(prj, error) == 0 || error) continue;
    const std::string text = read_input(prj, 1u << 20, "a coordinate system");
    facts.crs_place = prj.string();
    if (text.find_first_of("[(") != std::string::npos || text.find("+proj") != std::string::npos) return text;
    facts.notes.push_back(fmt::format("{}: not a coordinate system in WKT, ignored", prj.string()));
  }
  return "";
}

}  // namespace

bool is_dem(const fs::path& file) {
  const std::string extension = lower_extension(file);
  if (extension == ".asc" || gdal_reads(extension)) return true;
  const std::string bytes = first_bytes(file);
  return looks_like_esri_ascii(bytes) || looks_like_tiff(bytes) || is_xyz(file, bytes);
}

RasterSource::RasterSource(fs::path file, const DemOptions& options, const ReadText& read_text) : file_(std::move(file)) {
  const std::string name = file_.string(), extension = lower_extension(file_), start = first_bytes(file_);
  // Surfer's .grd and Arc's own share an ending: bytes come first.
  // The header of a raw grid has the same keys, and no heights.
  if ((looks_like_esri_ascii(start) && extension != ".hdr") || extension == ".asc") {
    const bool begins = start.find_first_not_of(" \t\r\n") < 256;
    if (begins && !looks_like_esri_ascii(start)) parse_esri_ascii(start, name);  // says what is wrong before gigabytes are read
    text_ = parse_esri_ascii(read_text(file_), name);
    facts_ = facts_of(*text_, "ESRI ASCII grid");
  } else if (is_xyz(file_, start)) {
    text_ = parse_xyz(read_text(file_), name);
    facts_ = facts_of(*text_, "XYZ places");
  } else {
    facts_ = read_raster_facts(file_);
  }
  if (facts_.frame.columns < 2 || facts_.frame.rows < 2)
    throw InputError({name}, fmt::format("the grid has {} x {} posts: a terrain needs at least 2 x 2", facts_.frame.columns, facts_.frame.rows));
  place_image(options);
  find_crs(options);
  find_height_unit(options);
  const Vec2 far = facts_.frame.at(facts_.frame.columns - 1, facts_.frame.rows - 1);
  if (!far.allFinite() || !facts_.frame.first.allFinite()) throw InputError({name}, "its place on the map is not made of finite numbers");
  if (crs_.kind == Crs::Kind::kGeographic) return;
  const Real farthest = std::max(far.cwiseAbs().maxCoeff(), facts_.frame.first.cwiseAbs().maxCoeff()), cell = std::min(facts_.frame.along_columns.norm(), facts_.frame.along_rows.norm());
  if (farthest > kFarthest) throw InputError({name}, fmt::format("reaches {:.6g} m from its map's origin, which is no place on a planet: its numbers or their unit are wrong", farthest));
  if (cell < std::max(kFinest, 1e-12 * farthest)) throw InputError({name}, fmt::format("has posts {:.3g} m apart, too near to be told apart at {:.6g} m from its map's origin", cell, farthest));
}

void RasterSource::place_image(const DemOptions& options) {
  const bool whole_numbers = facts_.type == "Byte" || facts_.type == "UInt16" || facts_.type == "Int16";
  const bool image = facts_.format == "Portable Network Graphics";
  RasterFrame& frame = facts_.frame;
  if (!facts_.placed) {
    if (options.size.empty())
      throw InputError({file_.string()}, "says neither where it lies nor how large its cells are: give its size, east-west and north-south in metres (size = [1000, 1000])");
    const Vec2 cell(options.size[0] / (frame.columns - 1), options.size[1] / (frame.rows - 1));
    frame.along_columns = Vec2(cell.x(), 0);
    frame.along_rows = Vec2(0, -cell.y());
    frame.first = Vec2(0, options.size[1]);
    facts_.notes.push_back(fmt::format("placed with its south-west post at 0, 0, {:.6g} x {:.6g} m large, as asked", options.size[0], options.size[1]));
  } else if (!options.size.empty()) {
    throw InputError({file_.string()}, "says where it lies: a size is for images that do not");
  }
  if (options.range.empty()) {
    if (image) throw InputError({file_.string()}, "is an image: give the heights that its darkest and brightest values stand for (range = [0, 500])");
    return;
  }
  if (!whole_numbers && facts_.type != "Float32") throw InputError({file_.string()}, fmt::format("holds {}: a range is for images of 8 or 16 bits", facts_.type));
  const Real low = facts_.type == "Int16" ? -32768 : 0, high = facts_.type == "Byte" ? 255 : facts_.type == "UInt16" ? 65535 : facts_.type == "Int16" ? 32767 : 1;
  z_scale_ = (options.range[1] - options.range[0]) / (high - low);
  z_offset_ = options.range[0] - low * z_scale_;
  facts_.notes.push_back(fmt::format("values {} to {} stand for {:.6g} to {:.6g} m, as asked: steps of {:.3g} m", low, high, options.range[0], options.range[1], whole_numbers ? z_scale_ : 0));
  if (facts_.type == "Byte") facts_.notes.push_back("an image of 8 bits has 256 heights: slopes are stairs");
}

bool RasterSource::looks_like_degrees() const {
  const RasterFrame& frame = facts_.frame;
  for (const auto& [c, r] : {std::pair{0, 0}, {frame.columns - 1, 0}, {0, frame.rows - 1}, {frame.columns - 1, frame.rows - 1}})
    if (const Vec2 p = frame.at(c, r); std::abs(p.x()) > 360 || std::abs(p.y()) > 90) return false;
  const Real cell = std::max(frame.along_columns.norm(), frame.along_rows.norm());
  constexpr Real kMetres = 111e3;  // of a degree
  if (cell > 0.5 || cell * kMetres < kFinest) return false;
  // In metres it would be higher than it is wide, in degrees it is not.
  const CellWindow middle{std::max(0, frame.columns / 2 - 32), std::max(0, frame.rows / 2 - 32), std::min(frame.columns, 64), std::min(frame.rows, 64)};
  const RasterCells cells = read(middle);
  Real low = std::numeric_limits<Real>::infinity(), high = -low;
  for (const Real z : cells.values)
    if (!std::isnan(z)) low = std::min(low, z), high = std::max(high, z);
  const Real width = cell * std::max(middle.columns, middle.rows);
  return high - low > 3 * width && high - low < 3 * kMetres * width;
}

void RasterSource::find_crs(const DemOptions& options) {
  if (!options.file_crs.empty()) {
    crs_ = read_crs(options.file_crs, "file_crs");
    facts_.notes.push_back(fmt::format("its coordinates are taken to be in {}, as asked", to_string(crs_)));
  } else {
    const bool beside = facts_.crs.empty();
    if (beside) facts_.crs = projection_beside(file_, facts_);
    try {
      crs_ = read_crs(facts_.crs, facts_.crs_place.empty() ? file_.string() : facts_.crs_place);
    } catch (const InputError& error) {
      if (!beside) throw;
      facts_.notes.push_back(fmt::format("{}, ignored", error.what()));
    }
  }
  if (crs_.kind == Crs::Kind::kUnknown && facts_.placed && looks_like_degrees()) {
    crs_ = read_crs("EPSG:4326", file_.string());
    facts_.notes.push_back("says no coordinate system; its coordinates look like degrees and are taken for those of WGS 84 (EPSG:4326); file_crs says otherwise");
  }
  if (crs_.kind == Crs::Kind::kGeographic || crs_.unit == 1) return;
  facts_.notes.push_back(fmt::format("horizontal unit: {} of {:.10g} m, turned into metres", crs_.unit_name, crs_.unit));
  facts_.frame.first *= crs_.unit;
  facts_.frame.along_columns *= crs_.unit;
  facts_.frame.along_rows *= crs_.unit;
  crs_ = in_metres(crs_);
}

void RasterSource::find_height_unit(const DemOptions& options) {
  if (!options.range.empty()) return;  // in metres already
  Real unit = 1;
  std::string why;
  if (!options.vertical_unit.empty()) {
    try {
      unit = parse_length_unit(options.vertical_unit);
    } catch (const std::invalid_argument& error) {
      throw InputError({"vertical_unit"}, error.what());
    }
    why = "as asked";
  } else if (const auto told = length_unit(facts_.height_unit)) {
    unit = *told;
    why = "as the file says";
  } else if (!facts_.height_unit.empty()) {
    facts_.notes.push_back(fmt::format("the unit of its heights, {}, is not known: taken for metres (vertical_unit says otherwise)", quote(facts_.height_unit)));
  } else if (crs_.vertical_unit > 0) {
    unit = crs_.vertical_unit;
    why = "as its vertical datum says";
  } else if (std::any_of(facts_.notes.begin(), facts_.notes.end(), [](const std::string& note) { return note.starts_with("horizontal unit"); })) {
    facts_.notes.push_back("does not say the unit of its heights: taken for metres (vertical_unit = \"ft\" or \"us-ft\" says otherwise)");
  }
  z_scale_ *= unit;
  z_offset_ *= unit;
  if (unit != 1) facts_.notes.push_back(fmt::format("heights: of {:.10g} m, {}, turned into metres", unit, why));
}

RasterCells RasterSource::read(const CellWindow& window) const {
  RasterCells cells;
  if (text_) {
    cells.window = window;
    cells.values.reserve(static_cast<std::size_t>(window.columns) * static_cast<std::size_t>(window.rows));
    for (int r = window.row; r < window.row + window.rows; ++r) {
      const auto row = text_->z.begin() + static_cast<std::ptrdiff_t>(r) * text_->nx + window.column;
      cells.values.insert(cells.values.end(), row, row + window.columns);
    }
    for (const Real z : cells.values) cells.missing.declared += std::isnan(z);
  } else {
    cells = read_raster_cells(file_, window);
  }
  for (std::size_t k = 0; k < cells.values.size(); ++k) {
    Real& z = cells.values[k];
    if (z_scale_ != 1 || z_offset_ != 0) z = z * z_scale_ + z_offset_;
    if (std::abs(z) > kHighestGround)
      throw InputError({file_.string()}, fmt::format("has a height of {:.6g} m in column {}, row {}; if it marks missing data, the file should declare it", z,
                                                     window.column + static_cast<int>(k % static_cast<std::size_t>(window.columns)) + 1,
                                                     window.row + static_cast<int>(k / static_cast<std::size_t>(window.columns)) + 1));
  }
  return cells;
}

}  // namespace effuse::importers
