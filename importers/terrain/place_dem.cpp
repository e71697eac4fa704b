#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/zones.h"
#include "importers/terrain/fill_holes.h"
#include "importers/terrain/import_dem.h"
#include "importers/terrain/mosaic.h"
#include "importers/terrain/pits.h"
#include "importers/terrain/resample.h"
#include "importers/terrain/trim.h"

namespace effuse::importers {

namespace fs = std::filesystem;

namespace {

constexpr Real kOnPost = 1e-6;  // [spacings]: a crop that ends on a post holds it

/// West, south, east, north.
struct Area {
  Vec2 low = Vec2::Constant(std::numeric_limits<Real>::infinity()), high = -low;
  void add(const Vec2& p) {
    if (!p.allFinite()) return;
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  void add(const Area& other) { add(other.low), add(other.high); }
  bool empty() const { return !(low.x() <= high.x() && low.y() <= high.y()); }
  Area cut(const Area& other) const {
    Area both;
    both.low = low.cwiseMax(other.low);
    both.high = high.cwiseMin(other.high);
    return both;
  }
};

std::string to_string(const Area& a) { return fmt::format("x {:.10g} to {:.10g}, y {:.10g} to {:.10g}", a.low.x(), a.high.x(), a.low.y(), a.high.y()); }

Area area_of(const RasterFrame& frame) {
  Area area;
  for (const int c : {0, frame.columns - 1})
    for (const int r : {0, frame.rows - 1}) area.add(frame.at(c, r));
  return area;
}

/// What a border of straight lines covers in another system, where they are curves.
template <class At>
Area area_through(const CrsTransform& transform, const At& border) {
  constexpr int kPieces = 64;
  std::vector<Vec2> points;
  for (int k = 0; k <= kPieces; ++k)
    for (const Vec2& p : border(static_cast<Real>(k) / kPieces)) points.push_back(p);
  transform(points);
  Area area;
  for (const Vec2& p : points) area.add(p);
  return area;
}

Area area_through(const CrsTransform& transform, const RasterFrame& frame) {
  return area_through(transform, [&](Real t) {
    const Real c = t * (frame.columns - 1), r = t * (frame.rows - 1);
    return std::vector<Vec2>{frame.at(c, 0), frame.at(c, frame.rows - 1), frame.at(0, r), frame.at(frame.columns - 1, r), frame.at(c, r)};
  });
}

Area area_through(const CrsTransform& transform, const Area& a) {
  return area_through(transform, [&](Real t) {
    const Vec2 p = a.low + t * (a.high - a.low);
    return std::vector<Vec2>{{p.x(), a.low.y()}, {p.x(), a.high.y()}, {a.low.x(), p.y()}, {a.high.x(), p.y()}};
  });
}

bool same_system(const Crs& a, const Crs& b) { return a.epsg > 0 && b.epsg > 0 ? a.epsg == b.epsg : a.wkt == b.wkt; }

void check_options(const DemOptions& o) {
  const auto refuse = [](const char* key, const std::string& message) { throw InputError({key}, message); };
  const auto finite = [](const std::vector<Real>& v) { return std::all_of(v.begin(), v.end(), [](Real x) { return std::isfinite(x); }); };
  if (!o.crop.empty() && (o.crop.size() != 4 || !finite(o.crop) || !(o.crop[0] < o.crop[2] && o.crop[1] < o.crop[3])))
    refuse("crop", "wanted four numbers: west, south, east, north, with west < east and south < north");
  if (!(o.spacing >= 0) || !std::isfinite(o.spacing)) refuse("spacing", fmt::format("is {}, wanted metres above 0", o.spacing));
  if (!o.size.empty() && (o.size.size() != 2 || !finite(o.size) || !(o.size[0] > 0 && o.size[1] > 0))) refuse("size", "wanted two lengths above 0: east-west and north-south");
  if (!o.range.empty() && (o.range.size() != 2 || !finite(o.range) || o.range[0] == o.range[1])) refuse("range", "wanted two different heights: of the darkest and the brightest value");
  if (!(o.pit_depth >= 0)) refuse("pit_depth", fmt::format("is {}, wanted metres", o.pit_depth));
}

/// The work, from opened files to one grid.
class Placement {
 public:
  Placement(const std::vector<fs::path>& files, const DemOptions& options, const ReadText& read_text) : options_(options), name_(files.front().string()) {
    sources_.reserve(files.size());
    for (const fs::path& file : files) {
      sources_.emplace_back(file, options, read_text);
      const std::string of = files.size() > 1 ? file.filename().string() + ": " : "";
      const RasterFacts& facts = sources_.back().facts();
      if (grid_.format.empty()) grid_.format = fmt::format("{}, {}", facts.format, facts.type);
      if (facts.type != "text") note(fmt::format("{}{}, {}, {} x {} cells", of, facts.format, facts.type, facts.frame.columns, facts.frame.rows));
      for (const std::string& text : facts.notes) note(of + text);
    }
    std::vector<std::size_t> left(sources_.size());
    for (std::size_t k = 0; k < left.size(); ++k) left[k] = k;
    while (!left.empty()) mosaics_.emplace_back(sources_, left);
    for (const Mosaic& mosaic : mosaics_)
      for (const std::string& tile : mosaic.missing_tiles()) note("a tile is missing: no file covers " + tile);
  }

  DemGrid run() {
    find_system();
    const Mosaic& first = mosaics_.front();
    const bool stays = mosaics_.size() == 1 && first.frame().axis_aligned() && (unknown_ || same_system(first.crs(), crs_)) && options_.spacing == 0;
    if (stays) keep_posts(first);
    else move_posts();
    finish();
    tell_stretch();
    return std::move(grid_);
  }

 private:
  void note(std::string text) { grid_.notes.push_back(std::move(text)); }
  [[noreturn]] void refuse(const std::string& message) const { throw InputError({name_}, message); }

  /// The system to work in, and the crop in it.
  void find_system() {
    const Crs& own = mosaics_.front().crs();
    for (const Mosaic& mosaic : mosaics_)
      if ((mosaic.crs().kind == Crs::Kind::kUnknown) != (own.kind == Crs::Kind::kUnknown)) refuse("some files say their coordinate system and some do not: file_crs says it for all");
    if (!options_.crs.empty()) {
      const Crs asked = read_crs(options_.crs, "crs");
      if (asked.kind == Crs::Kind::kGeographic) throw InputError({"crs"}, fmt::format("{} counts in degrees, wanted a projection in metres", to_string(asked)));
      crs_ = in_metres(asked);
      if (asked.unit != 1) note(fmt::format("{} counts in {}: worked in metres", to_string(asked), asked.unit_name));
      if (own.kind == Crs::Kind::kUnknown) {
        if (asked.unit != 1) refuse(fmt::format("says no coordinate system, and {} counts in {}: give it as file_crs", to_string(asked), asked.unit_name));
        note(fmt::format("says no coordinate system: taken to be in {}, as asked", to_string(asked)));
        unknown_ = true;
      }
    } else if (own.kind == Crs::Kind::kGeographic) {
      try {
        crs_ = utm_of(middle_in_degrees(), own);
      } catch (const InputError& error) {
        refuse(fmt::format("counts in degrees, and {}", error.faults().front().message));
      }
    } else {
      crs_ = own;
      unknown_ = own.kind == Crs::Kind::kUnknown;
    }
    grid_.crs = crs_.wkt;
    if (!crs_.wkt.empty()) note(fmt::format("coordinate system: {}", to_string(crs_)));
    if (options_.crop.empty()) return;
    crop_.emplace();
    crop_->low = Vec2(options_.crop[0], options_.crop[1]);
    crop_->high = Vec2(options_.crop[2], options_.crop[3]);
    const Area degrees = *crop_;
    if (own.kind == Crs::Kind::kGeographic && degrees.low.cwiseAbs().maxCoeff() <= 360 && degrees.high.cwiseAbs().maxCoeff() <= 360) {
      crop_ = area_through(CrsTransform(own, crs_), degrees);
      note(fmt::format("crop of {} degrees: {} m", to_string(degrees), to_string(*crop_)));
    }
  }

  Vec2 middle_in_degrees() const {
    Area all;
    for (const Mosaic& mosaic : mosaics_) {
      if (mosaic.crs().kind != Crs::Kind::kGeographic) continue;
      all.add(area_of(mosaic.frame()));
    }
    if (options_.crop.size() == 4 && std::max({std::abs(options_.crop[0]), std::abs(options_.crop[1]), std::abs(options_.crop[2]), std::abs(options_.crop[3])}) <= 360) {
      Area crop;
      crop.low = Vec2(options_.crop[0], options_.crop[1]);
      crop.high = Vec2(options_.crop[2], options_.crop[3]);
      if (const Area cut = all.cut(crop); !cut.empty()) all = cut;
    }
    const Crs& own = mosaics_.front().crs();
    return (all.low + all.high) / 2 * own.unit;
  }

  void check_count(double posts, const char* what) const {
    if (posts > static_cast<double>(options_.max_posts))
      refuse(fmt::format("has {:.0f} {}, more than {} (max_posts): take a part (crop) or wider posts (spacing)", posts, what, options_.max_posts));
  }

  /// Posts and heights as the file has them.
  void keep_posts(const Mosaic& mosaic) {
    const RasterFrame& frame = mosaic.frame();
    CellWindow window{0, 0, frame.columns, frame.rows};
    const Area all = area_of(frame);
    if (crop_) {
      if (crop_->cut(all).empty()) refuse(fmt::format("nothing of it lies in the crop {}: it covers {}", to_string(*crop_), to_string(all)));
      const auto cut = [&](int axis, int n, Real step) {
        const Real a = (crop_->low[axis] - frame.first[axis]) / step, b = (crop_->high[axis] - frame.first[axis]) / step;
        const int from = static_cast<int>(std::clamp(std::ceil(std::min(a, b) - kOnPost), Real{0}, Real(n - 1)));
        const int to = static_cast<int>(std::clamp(std::floor(std::max(a, b) + kOnPost), Real{0}, Real(n - 1)));
        return std::pair(from, to - from + 1);
      };
      std::tie(window.column, window.columns) = cut(0, frame.columns, frame.along_columns.x());
      std::tie(window.row, window.rows) = cut(1, frame.rows, frame.along_rows.y());
      if (window.columns < 2 || window.rows < 2) refuse(fmt::format("the crop {} holds fewer than 2 x 2 posts", to_string(*crop_)));
      const Vec2 a = all.low - crop_->low, b = crop_->high - all.high;
      if (std::max({a.x() / std::abs(frame.along_columns.x()), a.y() / std::abs(frame.along_rows.y()), b.x() / std::abs(frame.along_columns.x()), b.y() / std::abs(frame.along_rows.y())}) > 1)
        note(fmt::format("the crop reaches beyond the file, which covers {}", to_string(all)));
    }
    check_count(static_cast<double>(window.columns) * window.rows, "posts");
    Mosaic::Piece piece = mosaic.read(window);
    tell_overlap(piece);
    add_missing(piece.cells.missing, piece.uncovered);
    const bool east = frame.along_columns.x() > 0, north = frame.along_rows.y() > 0;
    grid_.nx = window.columns;
    grid_.ny = window.rows;
    grid_.spacing = {std::abs(frame.along_columns.x()), std::abs(frame.along_rows.y())};
    grid_.corner = frame.at(east ? window.column : window.column + window.columns - 1, north ? window.row : window.row + window.rows - 1);
    grid_.z = std::move(piece.cells.values);
    const auto row = [&](int j) { return grid_.z.begin() + static_cast<std::ptrdiff_t>(j) * grid_.nx; };
    if (!north)
      for (int j = 0; j < grid_.ny / 2; ++j) std::swap_ranges(row(j), row(j) + grid_.nx, row(grid_.ny - 1 - j));
    if (!east)
      for (int j = 0; j < grid_.ny; ++j) std::reverse(row(j), row(j) + grid_.nx);
    if (window.columns != frame.columns || window.rows != frame.rows) note(fmt::format("cropped to {} x {} of {} x {} posts", window.columns, window.rows, frame.columns, frame.rows));
  }

  struct Way {
    const Mosaic* mosaic;
    std::optional<CrsTransform> to, back;
    Area area;   // in the system worked in
    Real cell;   // of its cells there [m]
    Vec2 phase;  // a post of its, where its posts are along the axes there
    bool along_axes;
  };

  Way way_of(const Mosaic& mosaic) const {
    Way way{&mosaic, {}, {}, {}, 0, Vec2::Zero(), false};
    const RasterFrame& frame = mosaic.frame();
    const Vec2 middle = frame.at((frame.columns - 1) / 2.0, (frame.rows - 1) / 2.0);
    if (unknown_ || same_system(mosaic.crs(), crs_)) {
      way.area = area_of(frame);
      way.cell = std::sqrt(frame.along_columns.norm() * frame.along_rows.norm());
      way.phase = frame.first;
      way.along_axes = frame.axis_aligned() && std::abs(std::abs(frame.along_columns.x()) - std::abs(frame.along_rows.y())) < 1e-9 * way.cell;
      return way;
    }
    way.to.emplace(mosaic.crs(), crs_);
    way.back.emplace(crs_, mosaic.crs());
    way.area = area_through(*way.to, frame);
    const Vec2 here = (*way.to)(middle), column = (*way.to)(middle + frame.along_columns), row = (*way.to)(middle + frame.along_rows);
    way.cell = std::sqrt((column - here).norm() * (row - here).norm());
    if (way.area.empty() || !(way.cell > 0) || !std::isfinite(way.cell)) refuse(fmt::format("lies outside of what {} can show", to_string(crs_)));
    return way;
  }

  /// Heights at new posts.
  void move_posts() {
    std::vector<Way> ways;
    for (const Mosaic& mosaic : mosaics_) ways.push_back(way_of(mosaic));
    Area all;
    Real finest = std::numeric_limits<Real>::infinity();
    for (const Way& way : ways) all.add(way.area), finest = std::min(finest, way.cell);
    const Real spacing = options_.spacing > 0 ? options_.spacing : three_digits(finest);
    Area area = all;
    if (crop_) {
      area = all.cut(*crop_);
      if (area.empty()) refuse(fmt::format("nothing of it lies in the crop {}: it covers {}", to_string(*crop_), to_string(all)));
    }
    // On the file's own posts where they fit.
    Vec2 phase = Vec2::Zero();
    if (const Way& way = ways.front(); way.along_axes) {
      const Real ratio = spacing / way.cell;
      if (std::abs(ratio - std::round(ratio)) < 1e-6 || std::abs(1 / ratio - std::round(1 / ratio)) < 1e-6) phase = way.phase;
    }
    PostLattice posts;
    posts.spacing = Vec2::Constant(spacing);
    const auto first = [&](int axis) { return std::ceil((area.low[axis] - phase[axis]) / spacing - kOnPost); };
    const auto last = [&](int axis) { return std::floor((area.high[axis] - phase[axis]) / spacing + kOnPost); };
    const double nx = last(0) - first(0) + 1, ny = last(1) - first(1) + 1;
    if (!(nx >= 2 && ny >= 2)) refuse(fmt::format("fewer than 2 x 2 posts {:.6g} m apart lie in {}", spacing, to_string(area)));
    check_count(nx * ny, "posts");
    posts.nx = static_cast<int>(nx);
    posts.ny = static_cast<int>(ny);
    posts.corner = phase + spacing * Vec2(first(0), first(1));

    grid_.nx = posts.nx, grid_.ny = posts.ny;
    grid_.corner = posts.corner;
    grid_.spacing = posts.spacing;
    std::size_t overlap = 0;
    std::vector<char> beside;  // all files
    Real largest_step = 0;
    for (const Way& way : ways) {
      const Real cells_per_post = spacing / way.cell;
      const CellMap map(posts, way.mosaic->frame(), way.back ? &*way.back : nullptr);
      const auto window = map.window(2 + static_cast<int>(std::ceil(cells_per_post / 2)));
      if (!window) continue;
      if (static_cast<double>(window->columns) * window->rows > 4.0 * static_cast<double>(options_.max_posts)) check_count(static_cast<double>(window->columns) * window->rows, "cells");
      const Mosaic::Piece piece = way.mosaic->read(*window);
      tell_overlap(piece);
      add_missing(piece.cells.missing, piece.uncovered);
      const Resampled part = resample(map, piece.cells, options_.resampling, cells_per_post);
      if (ways.size() == 1) tell_between(way, piece.cells, part.z, cells_per_post);
      if (grid_.z.empty()) {
        grid_.z = part.z;
        beside = part.beside;
        continue;
      }
      for (std::size_t k = 0; k < beside.size(); ++k) beside[k] = beside[k] && part.beside[k];
      for (std::size_t k = 0; k < grid_.z.size(); ++k) {
        if (std::isnan(part.z[k])) continue;
        if (std::isnan(grid_.z[k])) {
          grid_.z[k] = part.z[k];
        } else {
          ++overlap;
          largest_step = std::max(largest_step, std::abs(grid_.z[k] - part.z[k]));
        }
      }
    }
    if (grid_.z.empty()) refuse(fmt::format("nothing of it lies in {}", to_string(area)));
    if (overlap > 0) note(fmt::format("{} posts lie in several files: the first one's heights count, others differ by up to {:.3g} m", overlap, largest_step));
    const Crs& own = mosaics_.front().crs();
    if (crop_) note(fmt::format("cropped to {}", to_string(area)));
    static constexpr const char* kMethods[] = {"bilinear", "nearest", "bilinear", "cubic", "average"};
    const bool average = options_.resampling == Resampling::kAuto && spacing > 1.5 * ways.front().cell;
    note(fmt::format("resampled{} to posts {:.6g} m apart ({}); its cells were {:.6g} m wide",
                     ways.front().to ? fmt::format(" from {}{}", to_string(own), own.kind == Crs::Kind::kGeographic ? ", degrees," : "") : std::string(), spacing,
                     average ? "average" : kMethods[static_cast<std::size_t>(options_.resampling)], ways.front().cell));
    if (!between_.empty()) note(between_);
    trim(beside);
  }

  /// Leaves out the thin wedges between the file's edges and the grid's, where that costs little.
  void trim(const std::vector<char>& beside) {
    constexpr Real kMost = 0.05;
    const CellWindow part = trimmed(beside, grid_.nx, grid_.ny, kMost);
    if (part.columns < grid_.nx || part.rows < grid_.ny) {
      std::vector<Real> z;
      z.reserve(static_cast<std::size_t>(part.columns) * static_cast<std::size_t>(part.rows));
      std::size_t lost = 0;
      for (int j = 0; j < grid_.ny; ++j)
        for (int i = 0; i < grid_.nx; ++i) {
          const Real height = grid_.z[static_cast<std::size_t>(j) * static_cast<std::size_t>(grid_.nx) + static_cast<std::size_t>(i)];
          if (i >= part.column && i < part.column + part.columns && j >= part.row && j < part.row + part.rows) z.push_back(height);
          else lost += !std::isnan(height);
        }
      note(fmt::format("{} rows and {} columns were left out ({} heights), since the file's edges run askew to the grid's", grid_.ny - part.rows, grid_.nx - part.columns, lost));
      grid_.z = std::move(z);
      grid_.corner += Vec2(part.column * grid_.spacing.x(), part.row * grid_.spacing.y());
      grid_.nx = part.columns, grid_.ny = part.rows;
      return;
    }
    if (const auto count = std::count(beside.begin(), beside.end(), 1); count > 0)
      note(fmt::format("{} posts of the {} x {} lie {}", count, grid_.nx, grid_.ny, sources_.size() > 1 ? "in none of the files" : "beside the file, whose edges run askew to the grid's"));
  }

  /// How far the new surface lies from the file's in the middle of the new cells, where it is farthest as a rule.
  void tell_between(const Way& way, const RasterCells& cells, const std::vector<Real>& z, Real cells_per_post) {
    PostLattice middles{grid_.corner + grid_.spacing / 2, grid_.spacing, grid_.nx - 1, grid_.ny - 1};
    const CellMap map(middles, way.mosaic->frame(), way.back ? &*way.back : nullptr);
    const std::vector<Real> truth = resample(map, cells, Resampling::kBilinear, cells_per_post).z;
    Real largest = 0, sum = 0;
    std::size_t count = 0;
    for (int j = 0; j + 1 < grid_.ny; ++j)
      for (int i = 0; i + 1 < grid_.nx; ++i) {
        const Real* south = &z[static_cast<std::size_t>(j) * static_cast<std::size_t>(grid_.nx) + static_cast<std::size_t>(i)];
        const Real off = (south[0] + south[1] + south[grid_.nx] + south[grid_.nx + 1]) / 4 - truth[static_cast<std::size_t>(j) * static_cast<std::size_t>(grid_.nx - 1) + static_cast<std::size_t>(i)];
        if (std::isnan(off)) continue;
        largest = std::max(largest, std::abs(off));
        sum += off * off;
        ++count;
      }
    if (count > 0) between_ = fmt::format("between the new posts the surface lies up to {:.3g} m from the file's, {:.3g} m rms", largest, std::sqrt(sum / static_cast<Real>(count)));
  }

  static Real three_digits(Real value) {
    const Real scale = std::pow(10.0, 2 - std::floor(std::log10(value)));
    return std::round(value * scale) / scale;
  }

  void tell_overlap(const Mosaic::Piece& piece) {
    if (piece.shared > 0) note(fmt::format("{} cells lie in several files: the first one's heights count, others differ by up to {:.3g} m", piece.shared, piece.largest_step));
  }

  void add_missing(const MissingData& missing, std::size_t uncovered) {
    missing_.add(missing);
    uncovered_ += uncovered;
  }

  /// Holes and pits by their policies, and what there is to say of them.
  void finish() {
    for (const Real z : grid_.z) grid_.nodata += std::isnan(z);
    const std::size_t all = grid_.z.size();
    if (grid_.nodata == all) refuse(fmt::format("holds no heights{}: all {} are nodata", crop_ ? " in the crop" : "", all));
    const bool text = sources_.front().facts().type == "text";
    if (!text) {
      if (missing_.declared > 0) note(fmt::format("{} cells hold the nodata value", missing_.declared));
      if (missing_.masked > 0) note(fmt::format("{} cells are masked out", missing_.masked));
      if (missing_.nans > 0) note(fmt::format("{} cells are NaN, which the file does not declare", missing_.nans));
      for (const auto& [mark, count] : missing_.undeclared) note(fmt::format("{} cells of {} are taken for missing data, though the file does not say so", count, mark));
    }
    if (uncovered_ > 0) note(fmt::format("{} cells lie in no file", uncovered_));
    const std::size_t real = missing_.total() + uncovered_;
    if (options_.holes == HolePolicy::kError && real > 0) refuse(fmt::format("{} cells have no height, and holes = \"error\": leave them as holes (\"hole\") or fill them (\"fill\")", real));
    if (grid_.nodata > 0 && options_.holes == HolePolicy::kFill) {
      const FilledHoles filled = fill_holes(grid_.z, grid_.nx, grid_.ny);
      note(fmt::format("{} posts without a height ({:.1f} %) were filled smoothly, as asked; the largest hole had {}", filled.posts, 100.0 * static_cast<double>(filled.posts) / static_cast<double>(all), filled.largest));
      grid_.nodata = 0;
    } else if (grid_.nodata > 0) {
      note(fmt::format("{} of {} posts ({:.1f} %) have no height and are left as holes", grid_.nodata, all, 100.0 * static_cast<double>(grid_.nodata) / static_cast<double>(all)));
    }
    check_ground();
    if (options_.pits != PitPolicy::kKeep) {
      const RemovedPits pits = remove_pits(grid_.z, grid_.nx, grid_.ny, grid_.spacing, options_.pits, options_.pit_depth);
      note(fmt::format("{} closed depressions, up to {:.3g} m deep, were {}, as asked: {} posts changed, {:.4g} m3 {}{}", pits.pits, pits.deepest, options_.pits == PitPolicy::kFill ? "filled" : "breached", pits.posts,
                       pits.volume, options_.pits == PitPolicy::kFill ? "added" : "taken away", pits.kept > 0 ? fmt::format("; {} deeper ones kept", pits.kept) : ""));
    }
  }

  /// Web Mercator and projections made for other places count in metres that are none.
  void tell_stretch() {
    constexpr Real kTrue = 0.01;
    if (crs_.kind != Crs::Kind::kProjected || crs_.wkt.empty()) return;
    const Vec2 middle = grid_.corner + grid_.spacing.cwiseProduct(Vec2(grid_.nx - 1, grid_.ny - 1)) / 2, stretch = stretch_at(crs_, middle);
    if (!stretch.allFinite() || (stretch - Vec2::Ones()).cwiseAbs().maxCoeff() < kTrue) return;
    note(fmt::format("warning: on this map lengths are {:.3g} times (east) and {:.3g} times (north) those on the ground, heights are not: crs = \"EPSG:{}\" has true ones here", stretch.x(), stretch.y(),
                     utm_of(degrees_at(crs_, middle), {}).epsg));
  }

  void check_ground() const {
    for (int j = 0; j + 1 < grid_.ny; ++j)
      for (int i = 0; i + 1 < grid_.nx; ++i) {
        const Real* south = &grid_.z[static_cast<std::size_t>(j) * static_cast<std::size_t>(grid_.nx) + static_cast<std::size_t>(i)];
        if (!std::isnan(south[0] + south[1] + south[grid_.nx] + south[grid_.nx + 1])) return;
      }
    refuse(fmt::format("no cell has four heights: {} of {} are nodata", grid_.nodata, grid_.z.size()));
  }

  const DemOptions& options_;
  std::string name_;
  std::vector<RasterSource> sources_;
  std::vector<Mosaic> mosaics_;
  DemGrid grid_;
  Crs crs_;
  bool unknown_ = false;  // the files' system is not known: their coordinates are used as they are
  std::optional<Area> crop_;
  std::string between_;
  MissingData missing_;
  std::size_t uncovered_ = 0;
};

}  // namespace

DemGrid place_dem(const std::vector<fs::path>& files, const DemOptions& options, const ReadText& read_text) {
  ZONE("import.dem");
  CHECK(!files.empty());
  check_options(options);
  return Placement(files, options, read_text).run();
}

}  // namespace effuse::importers
