#include "importers/terrain/xyz_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "geometry/base/error.h"
#include "importers/input_file.h"
#include "importers/terrain/raster.h"

namespace effuse::importers {

namespace {

constexpr Real kBeside = 0.02;    // of a cell: places rounded to the digits of a file
constexpr Real kLeastTold = 50;   // places of the grid for each that is told

bool blank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }

/// How numbers are kept apart: found on the first line with numbers.
struct Separators {
  char mark = ' ';             // besides blanks: ' ' none, ',' or ';'
  bool decimal_comma = false;

  static Separators of(std::string_view line) {
    if (line.find(';') != std::string_view::npos) return {';', line.find(',') != std::string_view::npos};
    const std::size_t comma = line.find(',');
    if (comma == std::string_view::npos) return {};
    // "1,5 2,5 3,5": as many numbers as blanks tell, each with one comma.
    std::size_t words = 0, with_comma = 0;
    for (std::size_t at = 0; at < line.size();) {
      while (at < line.size() && blank(line[at])) ++at;
      const std::size_t start = at;
      while (at < line.size() && !blank(line[at])) ++at;
      if (at == start) break;
      ++words;
      const std::string_view word = line.substr(start, at - start);
      with_comma += std::count(word.begin(), word.end(), ',') == 1 && word.back() != ',';
    }
    if (words >= 3 && with_comma > 0) return {' ', true};
    return {',', false};
  }
};

/// The next number of a line; nullopt at its end.
std::optional<std::string_view> next_word(std::string_view line, std::size_t& at, char mark) {
  while (at < line.size() && (blank(line[at]) || line[at] == mark)) ++at;
  const std::size_t start = at;
  while (at < line.size() && !blank(line[at]) && line[at] != mark) ++at;
  if (at == start) return std::nullopt;
  return line.substr(start, at - start);
}

bool number(std::string_view word, bool decimal_comma, double& value) {
  if (!decimal_comma) return parse_number(word, value);
  std::string point(word);
  std::replace(point.begin(), point.end(), ',', '.');
  return parse_number(point, value);
}

/// Lines of a text; comments and blank ones are skipped.
class Lines {
 public:
  explicit Lines(std::string_view text) : text_(text) {
    if (text_.starts_with("\xEF\xBB\xBF")) text_.remove_prefix(3);
  }
  bool next(std::string_view& line) {
    while (at_ < text_.size()) {
      const std::size_t end = std::min(text_.find_first_of("\r\n", at_), text_.size());
      line = text_.substr(at_, end - at_);
      at_ = end + (end + 1 < text_.size() && text_[end] == '\r' && text_[end + 1] == '\n' ? 2 : 1);
      ++number_;
      line = line.substr(0, line.find('#'));
      if (std::any_of(line.begin(), line.end(), [](char c) { return !blank(c); })) return true;
    }
    return false;
  }
  int number() const { return number_; }

 private:
  std::string_view text_;
  std::size_t at_ = 0;
  int number_ = 0;
};

struct Point {
  double x, y, z;
};

/// First place, step and count along one axis of the grid that values lie on.
struct Axis {
  double first = 0, step = 0;
  int count = 1;
  int index(double value) const { return static_cast<int>(std::lround((value - first) / step)); }
};

Axis find_axis(std::vector<double> values, const std::string& name, const char* axis) {
  std::sort(values.begin(), values.end());
  const double range = values.back() - values.front(), noise = 1e-3 * range / static_cast<double>(values.size());
  double smallest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < values.size(); ++i)
    if (const double gap = values[i] - values[i - 1]; gap > noise) smallest = std::min(smallest, gap);
  if (!std::isfinite(smallest)) throw InputError({name}, fmt::format("all places have the same {}: no grid", axis));
  // Rounded places lie unevenly: the mean of what may be one step.
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t i = 1; i < values.size(); ++i)
    if (const double gap = values[i] - values[i - 1]; gap > noise && gap < 1.5 * smallest) sum += gap, ++count;
  const double steps = std::round(range / (sum / static_cast<double>(count)));
  if (!(steps < std::numeric_limits<int>::max() - 1)) throw InputError({name}, fmt::format("the places lie on no grid along {}: {} apart over {}", axis, smallest, range));
  return {values.front(), range / steps, static_cast<int>(steps) + 1};
}

}  // namespace

bool looks_like_xyz(std::string_view text) {
  Lines lines(text.substr(0, 4096));
  std::string_view line;
  for (int tried = 0; tried < 2 && lines.next(line); ++tried) {
    const Separators separators = Separators::of(line);
    std::size_t at = 0;
    int numbers = 0;
    double value = 0;
    while (const auto word = next_word(line, at, separators.mark)) {
      if (!number(*word, separators.decimal_comma, value)) break;
      ++numbers;
    }
    if (numbers >= 3 && numbers < 16) return true;
  }
  return false;
}

DemGrid parse_xyz(std::string_view text, const std::string& name) {
  DemGrid grid;
  Lines lines(text);
  std::string_view line;
  std::vector<Point> points;
  Separators separators;
  bool separated = false;
  bool first = true;
  while (lines.next(line)) {
    if (!separated) separators = Separators::of(line);
    separated = true;
    std::size_t at = 0;
    std::array<double, 3> numbers{};
    int found = 0;
    for (; found < 3; ++found) {
      const auto word = next_word(line, at, separators.mark);
      const Place place{name, lines.number(), static_cast<int>(at) + 1};
      if (!word) throw InputError(place, fmt::format("the line has {} numbers, wanted x, y and height", found));
      if (!number(*word, separators.decimal_comma, numbers[static_cast<std::size_t>(found)])) {
        if (first && found == 0) break;  // titles
        throw InputError(place, fmt::format("found {}, wanted a number", quote(*word)));
      }
    }
    if (first && found == 0) {
      separated = false;
      first = false;
      continue;
    }
    first = false;
    const Point point{numbers[0], numbers[1], numbers[2]};
    if (!std::isfinite(point.x) || !std::isfinite(point.y) || std::abs(point.x) > 1e12 || std::abs(point.y) > 1e12)
      throw InputError({name, lines.number()}, fmt::format("there is no place at {}, {}", point.x, point.y));
    if (std::isinf(point.z)) throw InputError({name, lines.number()}, "found an infinite height");
    points.push_back(point);
  }
  if (points.size() < 4) throw InputError({name}, fmt::format("holds {} places with heights, wanted at least 2 x 2", points.size()));

  std::vector<double> values(points.size());
  const auto axis = [&](double Point::*coordinate, const char* title) {
    std::transform(points.begin(), points.end(), values.begin(), [&](const Point& p) { return p.*coordinate; });
    return find_axis(values, name, title);
  };
  const Axis x = axis(&Point::x, "x"), y = axis(&Point::y, "y");
  const double posts = static_cast<double>(x.count) * y.count;
  if (posts > kLeastTold * static_cast<double>(points.size()) + 1000)
    throw InputError({name}, fmt::format("{} places are no grid: one of {} x {} posts, {:.6g} x {:.6g} apart, would hold them, and {:.3g} % of it", points.size(), x.count, y.count, x.step, y.step, 100 * static_cast<double>(points.size()) / posts));

  grid.nx = x.count, grid.ny = y.count;
  grid.corner = {x.first, y.first};
  grid.spacing = {x.step, y.step};
  grid.z.assign(static_cast<std::size_t>(x.count) * static_cast<std::size_t>(y.count), std::numeric_limits<Real>::quiet_NaN());
  std::vector<char> told(grid.z.size(), 0);
  std::size_t twice = 0, marked = 0;
  for (const Point& p : points) {
    const int i = x.index(p.x), j = y.index(p.y);
    if (std::abs(p.x - (x.first + i * x.step)) > kBeside * x.step || std::abs(p.y - (y.first + j * y.step)) > kBeside * y.step)
      throw InputError({name}, fmt::format("the place {:.10g}, {:.10g} lies beside the grid of the others ({:.6g} x {:.6g} apart): wanted a grid, not a point cloud", p.x, p.y, x.step, y.step));
    const std::size_t at = static_cast<std::size_t>(j) * static_cast<std::size_t>(x.count) + static_cast<std::size_t>(i);
    const bool missing = marks_missing(p.z);
    twice += told[at];
    marked += missing;
    told[at] = 1;
    grid.z[at] = missing ? std::numeric_limits<Real>::quiet_NaN() : p.z;
  }
  for (const Real z : grid.z) grid.nodata += std::isnan(z);
  grid.notes.push_back(fmt::format("{} places on a grid of {} x {}", points.size(), x.count, y.count));
  if (separators.decimal_comma) grid.notes.push_back("numbers with decimal commas");
  if (twice > 0) grid.notes.push_back(fmt::format("{} places are told more than once: the last height counts", twice));
  if (grid.nodata > 0) grid.notes.push_back(fmt::format("{} of {} posts have no data ({} of them marked so)", grid.nodata, grid.z.size(), marked));
  return grid;
}

}  // namespace effuse::importers
