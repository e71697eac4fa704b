#include "importers/terrain/esri_ascii.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "geometry/base/error.h"
#include "importers/input_file.h"

namespace effuse::importers {

namespace {

constexpr Real kHighest = 1e5;  // [m]; nothing on a planet is higher or deeper
constexpr Real kFill = 1e30;    // what writers fill floats with lies beyond (-3.4e38, 1e31, ...)

const std::vector<std::string> kKeys = {"ncols", "nrows",    "xllcorner", "yllcorner",    "xllcenter", "yllcenter",
                                        "dx",    "cellsize", "dy",        "nodata_value", "nodata"};

bool blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == '\v' || c == '\f'; }

/// Words of a text, one after the other, each with its place.
class Words {
 public:
  Words(std::string_view text, std::string name) : text_(text), place_{std::move(name), 1, 1} {
    if (text_.starts_with("\xEF\xBB\xBF")) at_ = line_start_ = 3;
  }

  /// The next word, "" at the end of the text.
  std::string_view next() {
    while (at_ < text_.size() && blank(text_[at_])) {
      const bool lone_return = text_[at_] == '\r' && (at_ + 1 == text_.size() || text_[at_ + 1] != '\n');
      if (text_[at_] == '\n' || lone_return) {
        ++line_;
        line_start_ = at_ + 1;
      }
      ++at_;
    }
    const std::size_t start = at_;
    while (at_ < text_.size() && !blank(text_[at_])) ++at_;
    place_.line = line_;
    place_.column = static_cast<int>(std::min<std::size_t>(start - line_start_ + 1, std::numeric_limits<int>::max()));
    return text_.substr(start, at_ - start);
  }
  const Place& place() const { return place_; }  ///< of the last word
  std::size_t left() const { return text_.size() - at_; }

 private:
  std::string_view text_;
  Place place_;
  std::size_t at_ = 0, line_start_ = 0;
  int line_ = 1;
};

/// Numbers of one file: with decimal points, or all with decimal commas, as some countries' programs write them.
class Numbers {
 public:
  double read(std::string_view word, const Place& place, std::string_view what) {
    double value = 0;
    const bool has_comma = word.find(',') != std::string_view::npos;
    if (!has_comma && parse_number(word, value)) {
      points_ |= word.find('.') != std::string_view::npos;
      if (!points_ || !commas_) return value;
    } else if (has_comma && word.find('.') == std::string_view::npos) {
      std::string point(word);
      point[point.find(',')] = '.';
      commas_ |= parse_number(point, value);
      if (commas_ && !points_ && parse_number(point, value)) return value;
    }
    if (word.empty()) throw InputError(place, fmt::format("the file ends where {} should stand", what));
    std::string advice;
    if (commas_ && points_) advice = "; the file has decimals with points and with commas, which may be thousands";
    else if (has_comma) advice = "; at most one comma, as decimal point";
    throw InputError(place, fmt::format("found {}, wanted {}: a number{}", quote(word), what, advice));
  }
  bool commas() const { return commas_; }

 private:
  bool points_ = false, commas_ = false;
};

struct Header {
  std::map<std::string, double> values;
  std::map<std::string, Place> places;

  std::optional<double> get(const std::string& key) const {
    const auto found = values.find(key);
    return found == values.end() ? std::nullopt : std::optional(found->second);
  }
};

/// Reads keys and values up to the first word that is a number; that word is handed out.
Header read_header(Words& words, Numbers& numbers, std::string_view& first_value) {
  Header header;
  for (;;) {
    const std::string_view word = words.next();
    const Place place = words.place();
    double ignored = 0;
    if (word.empty() || parse_number(word.substr(0, word.find(',')), ignored)) {
      first_value = word;
      return header;
    }
    std::string key = lower(word);
    if (std::find(kKeys.begin(), kKeys.end(), key) == kKeys.end()) {
      if (header.values.empty()) {
        throw InputError(place, fmt::format("is not an ESRI ASCII grid: it begins with {}, wanted ncols", quote(word)));
      }
      // A word that begins like a number stands among the heights.
      if (word.find_first_of("0123456789") == 0 || word.find(',') != std::string_view::npos) numbers.read(word, place, "a height");
      const std::string nearest = nearest_name(key, kKeys);
      throw InputError(place, fmt::format("found {}, wanted a key of the header or a height{}", quote(word),
                                          nearest.empty() ? "" : fmt::format("; did you mean '{}'?", nearest)));
    }
    if (key == "nodata") key = "nodata_value";
    if (header.values.count(key)) throw InputError(place, fmt::format("'{}' is given twice", key));
    const std::string_view value = words.next();
    header.values[key] = numbers.read(value, words.place(), key);
    header.places[key] = words.place();
  }
}

int count_of(const Header& header, const std::string& key) {
  const double value = header.values.at(key);
  if (!(value >= 1 && value <= std::numeric_limits<int>::max()) || std::trunc(value) != value)
    throw InputError(header.places.at(key), fmt::format("{} is {}, wanted a whole number of at least 2", key, value));
  return static_cast<int>(value);
}

double positive(const Header& header, const std::string& key) {
  const double value = header.values.at(key);
  if (!(value > 0 && std::isfinite(value)))
    throw InputError(header.places.at(key), fmt::format("{} is {}, wanted metres above 0", key, value));
  return value;
}

/// Where the south-west post stands along one axis: on the centre of its cell.
double first_post(const Header& header, const std::string& corner, const std::string& center, double spacing) {
  for (const std::string& key : {corner, center})
    if (const auto value = header.get(key); value && !std::isfinite(*value))
      throw InputError(header.places.at(key), fmt::format("{} is {}, wanted metres", key, *value));
  if (header.get(corner) && header.get(center))
    throw InputError(header.places.at(center), fmt::format("both {} and {} are given, wanted one", corner, center));
  if (const auto value = header.get(center)) return *value;
  return header.get(corner).value_or(0) + spacing / 2;
}

}  // namespace

bool looks_like_esri_ascii(std::string_view text) {
  Words words(text.substr(0, 512), "");
  const std::string first = lower(words.next());
  return std::find(kKeys.begin(), kKeys.end(), first) != kKeys.end();
}

DemGrid parse_esri_ascii(std::string_view text, const std::string& name) {
  Words words(text, name);
  std::string_view word;
  Numbers numbers;
  const Header header = read_header(words, numbers, word);

  // What is missing, all at once.
  std::string missing;
  const auto need = [&](bool there, std::string_view what) {
    missing += there ? "" : fmt::format("{}{}", missing.empty() ? "" : ", ", what);
  };
  const bool cellsize = header.get("cellsize").has_value();
  const bool has_x = header.get("xllcorner") || header.get("xllcenter"), has_y = header.get("yllcorner") || header.get("yllcenter");
  need(header.get("ncols").has_value(), "ncols");
  need(header.get("nrows").has_value(), "nrows");
  need(cellsize || (header.get("dx") && header.get("dy")), "cellsize");
  need(has_x || !has_y, "xllcorner");
  need(has_y || !has_x, "yllcorner");
  if (header.values.empty() && word.empty()) throw InputError({name}, "holds nothing but blanks, wanted an ESRI ASCII grid");
  if (!missing.empty()) throw InputError(words.place(), fmt::format("the header of the grid lacks {}", missing));
  if (cellsize && (header.get("dx") || header.get("dy")))
    throw InputError(header.places.at("cellsize"), "both cellsize and dx or dy are given, wanted one");

  DemGrid grid;
  grid.nx = count_of(header, "ncols");
  grid.ny = count_of(header, "nrows");
  grid.spacing = Vec2(positive(header, cellsize ? "cellsize" : "dx"), positive(header, cellsize ? "cellsize" : "dy"));
  grid.corner =
      Vec2(first_post(header, "xllcorner", "xllcenter", grid.spacing.x()), first_post(header, "yllcorner", "yllcenter", grid.spacing.y()));
  if (!has_x) grid.notes.push_back("the header has no xllcorner, yllcorner: the grid's south-west corner is taken as 0, 0");
  if (grid.nx < 2 || grid.ny < 2)
    throw InputError(header.places.at("ncols"),
                     fmt::format("the grid has {} x {} posts: a terrain needs at least 2 x 2", grid.nx, grid.ny));
  const auto extent = [&](int axis) { return grid.corner[axis] + grid.spacing[axis] * ((axis == 0 ? grid.nx : grid.ny) - 1); };
  if (!std::isfinite(extent(0)) || !std::isfinite(extent(1)) || extent(0) <= grid.corner.x() || extent(1) <= grid.corner.y())
    throw InputError(header.places.at(cellsize ? "cellsize" : "dx"),
                     "the posts cannot be told apart: coordinates too large for this cell size");

  // A height takes a digit and a blank: no memory for what cannot stand in the rest of the file.
  const std::uint64_t promised = static_cast<std::uint64_t>(grid.nx) * static_cast<std::uint64_t>(grid.ny);
  const bool possible = promised <= (words.left() + word.size() + 1) / 2;
  if (word.empty()) throw InputError(words.place(), fmt::format("the file ends after its header, {} heights are missing", promised));

  const std::optional<double> nodata = header.get("nodata_value");
  const auto declared = [&](double z) { return nodata && (z == *nodata || static_cast<float>(z) == static_cast<float>(*nodata)); };
  if (possible) grid.z.resize(promised);
  std::map<double, std::size_t> undeclared;
  std::size_t nans = 0;
  for (std::uint64_t n = 0; n < promised; ++n, word = words.next()) {
    if (word.empty())
      throw InputError(words.place(), fmt::format("the file ends after {} of {} heights ({} x {})", n, promised, grid.nx, grid.ny));
    double z = numbers.read(word, words.place(), "a height");
    const bool nan = std::isnan(z);
    if (std::isinf(z)) throw InputError(words.place(), fmt::format("found {}, wanted a height", quote(word)));
    if (nan || declared(z)) {
      nans += nan;
      z = std::numeric_limits<double>::quiet_NaN();
    } else if (z == -9999 || z == -32768 || std::abs(z) >= kFill) {
      ++undeclared[z];
      z = std::numeric_limits<double>::quiet_NaN();
    } else if (std::abs(z) > kHighest) {
      throw InputError(words.place(),
                       fmt::format("found a height of {} m; if it marks missing data, say 'NODATA_value {}' in the header", word, word));
    }
    grid.nodata += std::isnan(z);
    if (!possible) continue;  // only to find where it ends
    // North row first in the file, south row first here.
    const std::uint64_t row = n / static_cast<std::uint64_t>(grid.nx), column = n % static_cast<std::uint64_t>(grid.nx);
    grid.z[(static_cast<std::uint64_t>(grid.ny) - 1 - row) * static_cast<std::uint64_t>(grid.nx) + column] = z;
  }
  // Some writers say at the end what stood for missing data.
  if (!nodata && (lower(word) == "nodata_value" || lower(word) == "nodata")) {
    const std::string_view value = words.next();
    const double mark = numbers.read(value, words.place(), "nodata_value");
    for (Real& z : grid.z)
      if (z == mark || static_cast<float>(z) == static_cast<float>(mark)) {
        z = std::numeric_limits<double>::quiet_NaN();
        ++grid.nodata;
      }
    undeclared.erase(mark);
    grid.notes.push_back(fmt::format("the nodata value {} stands at the end of the file", value));
    word = words.next();
  }
  if (!word.empty())
    throw InputError(words.place(), fmt::format("more than the {} x {} = {} heights promised: {} is one too many", grid.nx, grid.ny,
                                                promised, quote(word)));

  if (grid.nodata == promised) throw InputError({name}, fmt::format("holds no heights: all {} are nodata", promised));
  bool whole_cell = false;
  for (int j = 0; j + 1 < grid.ny && !whole_cell; ++j)
    for (int i = 0; i + 1 < grid.nx && !whole_cell; ++i) {
      const Real* south = &grid.z[static_cast<std::size_t>(j) * static_cast<std::size_t>(grid.nx) + static_cast<std::size_t>(i)];
      whole_cell = !std::isnan(south[0] + south[1] + south[grid.nx] + south[grid.nx + 1]);
    }
  if (!whole_cell) throw InputError({name}, fmt::format("no cell has four heights: {} of {} are nodata", grid.nodata, promised));

  if (grid.nodata > 0) grid.notes.push_back(fmt::format("{} of {} posts have no data", grid.nodata, promised));
  if (nans > 0) grid.notes.push_back(fmt::format("{} of them are written as NaN", nans));
  for (const auto& [value, times] : undeclared)
    grid.notes.push_back(fmt::format("{} posts of {} are taken for missing data, though the header does not say so", times, value));
  if (numbers.commas()) grid.notes.push_back("numbers with decimal commas");
  return grid;
}

}  // namespace effuse::importers
