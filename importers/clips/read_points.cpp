#include "importers/clips/read_points.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <string_view>

#include "geometry/base/error.h"
#include "importers/input_file.h"

namespace effuse::importers {

using geometry::PointClip;

namespace {

constexpr std::uint64_t kLimit = 500'000'000;
constexpr Real kNone = std::numeric_limits<Real>::quiet_NaN();

struct Lines {
  std::vector<std::string_view> all;
  explicit Lines(std::string_view text) {
    while (!text.empty()) {
      const std::size_t end = std::min(text.find('\n'), text.size());
      std::string_view line = text.substr(0, end);
      if (line.ends_with('\r')) line.remove_suffix(1);
      all.push_back(line);
      text.remove_prefix(std::min(end + 1, text.size()));
    }
    while (!all.empty() && all.back().find_first_not_of(" \t,") == std::string_view::npos) all.pop_back();
  }
};

std::vector<std::string_view> fields(std::string_view line, char between) {
  std::vector<std::string_view> out;
  for (;;) {
    const std::size_t end = line.find(between);
    std::string_view one = line.substr(0, end);
    while (one.starts_with(' ')) one.remove_prefix(1);
    while (one.ends_with(' ')) one.remove_suffix(1);
    out.push_back(one);
    if (end == std::string_view::npos) return out;
    line.remove_prefix(end + 1);
  }
}

struct Reader {
  std::string file;
  [[noreturn]] void wrong(std::size_t line, const std::string& message) const { throw InputError(Place{file, static_cast<int>(line) + 1, 1}, message); }
  Real number(std::size_t line, std::string_view text) const {
    double value = 0;
    if (!parse_number(text, value) || !std::isfinite(value)) wrong(line, fmt::format("found {}, wanted a number", quote(text)));
    return value;
  }
  /// A point's three fields; all empty: not seen.
  Vec3 point(std::size_t line, std::span<const std::string_view> f) const {
    if (f[0].empty() && f[1].empty() && f[2].empty()) return Vec3::Constant(kNone);
    return Vec3(number(line, f[0]), number(line, f[1]), number(line, f[2]));
  }
  void check_time(std::size_t line, Real time, std::size_t frame, Real first, Real step) const {
    const Real wanted = first + step * static_cast<Real>(frame);
    if (std::abs(time - wanted) > 0.25 * step) wrong(line, fmt::format("a frame at {:g} s, wanted {:g} s: frames must be of equal distance", time, wanted));
  }
};

PointClip read_trc(const Reader& r, const Lines& lines) {
  if (lines.all.size() < 6) r.wrong(0, "is shorter than a TRC file's header");
  const auto keys = fields(lines.all[1], '\t'), values = fields(lines.all[2], '\t');
  Real rate = 0, unit = 0;
  std::size_t markers = 0;
  for (std::size_t k = 0; k < std::min(keys.size(), values.size()); ++k) {
    if (keys[k] == "DataRate") rate = r.number(2, values[k]);
    if (keys[k] == "NumMarkers") {
      const Real n = r.number(2, values[k]);
      if (!(n >= 1 && n <= 1e5)) r.wrong(2, fmt::format("{:g} markers, wanted from 1 to 100000", n));
      markers = static_cast<std::size_t>(n);
    }
    if (keys[k] == "Units") unit = values[k] == "mm" ? 1e-3 : values[k] == "cm" ? 1e-2 : values[k] == "m" ? 1 : 0;
  }
  if (!(rate > 0) || markers == 0 || unit == 0) r.wrong(2, "does not say DataRate above 0, NumMarkers and Units (mm, cm or m)");
  PointClip clip;
  clip.frame_time = 1 / rate;
  const auto names = fields(lines.all[3], '\t');
  for (std::size_t m = 0; m < markers; ++m) {
    if (2 + 3 * m >= names.size() || names[2 + 3 * m].empty()) r.wrong(3, fmt::format("names {} markers, wanted {}, one in every third field from the third", m, markers));
    clip.names.emplace_back(names[2 + 3 * m]);
  }
  Real first = 0;
  for (std::size_t l = 5; l < lines.all.size(); ++l) {
    if (lines.all[l].find_first_not_of(" \t") == std::string_view::npos) continue;
    auto row = fields(lines.all[l], '\t');
    while (row.size() > 2 + 3 * markers && row.back().empty()) row.pop_back();
    if (row.size() > 2 + 3 * markers || row.size() < 3) r.wrong(l, fmt::format("has {} fields, wanted {}", row.size(), 2 + 3 * markers));
    row.resize(2 + 3 * markers);
    const Real time = r.number(l, row[1]);
    if (clip.frames.empty()) first = time;
    r.check_time(l, time, clip.frames.size(), first, clip.frame_time);
    std::vector<Vec3> points;
    for (std::size_t m = 0; m < markers; ++m) {
      const Vec3 p = r.point(l, std::span(row).subspan(2 + 3 * m, 3));
      points.push_back(p.isZero(0) ? Vec3(Vec3::Constant(kNone)) : Vec3(unit * p.x(), -unit * p.z(), unit * p.y()));
    }
    clip.frames.push_back(std::move(points));
  }
  if (clip.frames.empty()) r.wrong(lines.all.size() - 1, "has no frame, wanted at least one");
  return clip;
}

constexpr std::string_view kFrames = "NO_OF_FRAMES", kSection = "Trajectories";

/// Rows of a key and its values, then three fields a marker.
PointClip read_tracked(const Reader& r, const Lines& lines) {
  PointClip clip;
  Real rate = 0, markers = 0;
  std::size_t before = 0, l = 0, named = 0;  // fields before the first marker's
  for (; l < lines.all.size(); ++l) {
    auto row = fields(lines.all[l], '\t');
    double value = 0;
    if (row[0].empty() || parse_number(row[0], value) || row[0] == "NULL" || row[0] == "NaN") break;
    while (row.size() > 1 && row.back().empty()) row.pop_back();
    if (row[0] == "Frame") before = 2;
    if (row.size() < 2) continue;
    if (row[0] == "FREQUENCY") rate = r.number(l, row[1]);
    if (row[0] == "NO_OF_MARKERS") markers = r.number(l, row[1]);
    if (row[0] == "DATA_INCLUDED" && row[1] != "3D") r.wrong(l, fmt::format("holds {} data, wanted 3D: places of markers", quote(row[1])));
    if (row[0] != "MARKER_NAMES") continue;
    named = l;
    clip.names.assign(row.begin() + 1, row.end());
  }
  if (!(rate > 0) || clip.names.empty()) r.wrong(0, "does not say FREQUENCY above 0 and MARKER_NAMES before its frames");
  if (markers != static_cast<Real>(clip.names.size())) r.wrong(named, fmt::format("names {} markers, wanted {:g} as NO_OF_MARKERS says", clip.names.size(), markers));
  clip.frame_time = 1 / rate;
  const std::size_t width = before + 3 * clip.names.size();
  Real first = 0;
  for (; l < lines.all.size(); ++l) {
    auto row = fields(lines.all[l], '\t');
    while (row.size() > width && row.back().empty()) row.pop_back();
    if (row.size() != width) r.wrong(l, fmt::format("has {} fields, wanted {}", row.size(), width));
    if (before > 0) {
      const Real time = r.number(l, row[1]);
      if (clip.frames.empty()) first = time;
      r.check_time(l, time, clip.frames.size(), first, clip.frame_time);
    }
    std::vector<Vec3> points;
    for (std::size_t k = before; k < width; k += 3) {
      for (std::size_t a = k; a < k + 3; ++a)
        if (row[a] == "NULL" || row[a] == "NaN") row[a] = {};
      const Vec3 p = r.point(l, std::span(row).subspan(k, 3));
      points.push_back(p.isZero(0) ? Vec3(Vec3::Constant(kNone)) : Vec3(1e-3 * p));
    }
    clip.frames.push_back(std::move(points));
  }
  if (clip.frames.empty()) r.wrong(lines.all.size() - 1, "has no frame, wanted at least one");
  return clip;
}

/// The section of trajectories of a table in sections, which empty rows end.
PointClip read_section(const Reader& r, const Lines& lines, std::size_t title, char between) {
  const auto row_at = [&](std::size_t l) {
    if (l >= lines.all.size()) r.wrong(lines.all.size() - 1, "ends in the header of its trajectories");
    return fields(lines.all[l], between);
  };
  PointClip clip;
  const Real rate = r.number(title + 1, row_at(title + 1)[0]);
  if (!(rate > 0)) r.wrong(title + 1, fmt::format("{:g} frames a second, wanted more than 0", rate));
  clip.frame_time = 1 / rate;
  auto names = row_at(title + 2), columns = row_at(title + 3), units = row_at(title + 4);
  while (!columns.empty() && columns.back().empty()) columns.pop_back();
  if (columns.size() < 5 || columns.size() % 3 != 2 || lower(std::string(columns[0])) != "frame" || lower(std::string(columns[1])) != "sub frame")
    r.wrong(title + 3, "wanted Frame, Sub Frame, X, Y, Z, ...");
  names.resize(columns.size());
  units.resize(columns.size());
  const std::string_view unit = units[2];
  const Real metres = unit == "mm" ? 1e-3 : unit == "cm" ? 1e-2 : unit == "m" ? 1 : 0;
  if (metres == 0) r.wrong(title + 4, fmt::format("found the unit {}, wanted mm, cm or m", quote(unit)));
  for (std::size_t k = 2; k < columns.size(); ++k) {
    if (columns[k].size() != 1 || columns[k][0] != "XYZ"[(k - 2) % 3]) r.wrong(title + 3, fmt::format("field {} is {}, wanted {}", k + 1, quote(columns[k]), "XYZ"[(k - 2) % 3]));
    if (units[k] != unit) r.wrong(title + 4, fmt::format("field {} is {}, wanted {} as the first is", k + 1, quote(units[k]), unit));
    if (k % 3 != 2) continue;
    if (names[k].empty()) r.wrong(title + 2, fmt::format("names no marker in field {}, wanted one in every third from the third", k + 1));
    clip.names.emplace_back(names[k]);
  }
  Real first = 0;
  for (std::size_t l = title + 5; l < lines.all.size(); ++l) {
    if (lines.all[l].find_first_not_of(" \t,") == std::string_view::npos) break;
    auto row = row_at(l);
    while (row.size() > columns.size() && row.back().empty()) row.pop_back();
    if (row.size() != columns.size()) r.wrong(l, fmt::format("has {} fields, wanted {}", row.size(), columns.size()));
    const Real frame = r.number(l, row[0]);
    if (clip.frames.empty()) first = frame;
    r.check_time(l, frame / rate, clip.frames.size(), first / rate, clip.frame_time);
    std::vector<Vec3> points;
    for (std::size_t k = 2; k < row.size(); k += 3) points.push_back(metres * r.point(l, std::span(row).subspan(k, 3)));
    clip.frames.push_back(std::move(points));
  }
  if (clip.frames.empty()) r.wrong(title + 4, "is followed by no frame, wanted at least one");
  return clip;
}

PointClip read_csv(const Reader& r, const Lines& lines, char between) {
  if (lines.all.size() < 3) r.wrong(0, "is shorter than a header and two frames");
  const auto header = fields(lines.all[0], between);
  if (lower(std::string(header[0])) != "time" || header.size() < 4 || header.size() % 3 != 1) r.wrong(0, fmt::format("begins with {} and has {} fields, wanted time, name.x, name.y, name.z, ...", quote(header[0]), header.size()));
  PointClip clip;
  for (std::size_t k = 1; k < header.size(); k += 3) {
    const std::string_view name = header[k].substr(0, header[k].rfind('.'));
    for (std::size_t a = 0; a < 3; ++a)
      if (header[k + a] != fmt::format("{}.{}", name, "xyz"[a])) r.wrong(0, fmt::format("field {} is {}, wanted '{}.{}'", k + a + 1, quote(header[k + a]), name, "xyz"[a]));
    clip.names.emplace_back(name);
  }
  Real first = 0;
  for (std::size_t l = 1; l < lines.all.size(); ++l) {
    const auto row = fields(lines.all[l], between);
    if (row.size() != header.size()) r.wrong(l, fmt::format("has {} fields, wanted {} as in the header", row.size(), header.size()));
    const Real time = r.number(l, row[0]);
    if (l == 1) first = time;
    if (l == 2) clip.frame_time = time - first;
    if (l == 2 && !(clip.frame_time > 0)) r.wrong(l, fmt::format("the time {:g} s does not come after {:g} s", time, first));
    if (l > 2) r.check_time(l, time, l - 1, first, clip.frame_time);
    std::vector<Vec3> points;
    for (std::size_t k = 1; k < row.size(); k += 3) points.push_back(r.point(l, std::span(row).subspan(k, 3)));
    clip.frames.push_back(std::move(points));
  }
  return clip;
}

}  // namespace

PointClip read_points(const std::filesystem::path& file) {
  const std::string extension = lower_extension(file), bytes = read_input(file, kLimit, "a clip");
  const Reader reader{file.string()};
  const Lines lines(bytes);
  if (extension == ".trc") return read_trc(reader, lines);
  if (extension != ".csv" && extension != ".tsv" && extension != ".txt") throw InputError(Place{file.string()}, fmt::format("is a {} file, wanted trajectories of markers: .trc, .csv, .tsv or .txt", extension));
  const char between = extension == ".csv" ? ',' : '\t';
  if (!lines.all.empty() && fields(lines.all[0], '\t')[0] == kFrames) return read_tracked(reader, lines);
  for (std::size_t l = 0; l < lines.all.size(); ++l)
    if (fields(lines.all[l], between)[0] == kSection) return read_section(reader, lines, l, between);
  return read_csv(reader, lines, between);
}

}  // namespace effuse::importers
