#include "importers/terrain/projection.h"

#include <fmt/format.h>

#include <cmath>
#include <string_view>

#include "geometry/base/error.h"
#include "importers/input_file.h"

namespace effuse::importers {

namespace fs = std::filesystem;

namespace {

std::string_view trimmed(std::string_view text) {
  const char* blanks = " \t\r\n\v\f";
  const std::size_t first = text.find_first_not_of(blanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(blanks) - first + 1);
}

/// Where one of keywords begins outside quotes, followed by a bracket; npos when none does.
std::size_t find_keyword(std::string_view wkt, const std::vector<std::string>& keywords) {
  bool in_quotes = false;
  for (std::size_t i = 0; i < wkt.size(); ++i) {
    if (wkt[i] == '"') in_quotes = !in_quotes;
    if (in_quotes || (i > 0 && wkt[i - 1] != ',' && wkt[i - 1] != '[' && wkt[i - 1] != '(' && wkt[i - 1] != ' ' && wkt[i - 1] != '\n'))
      continue;
    for (const std::string& keyword : keywords)
      if (lower(wkt.substr(i, keyword.size())) == keyword && wkt.substr(i + keyword.size()).find_first_of("[(") == 0) return i;
  }
  return std::string_view::npos;
}

/// The factor to metres of the unit that stands directly in the projected system; 1 when none does.
double linear_unit(std::string_view projected) {
  int depth = 0;
  bool in_quotes = false;
  for (std::size_t i = 0; i < projected.size(); ++i) {
    const char c = projected[i];
    if (c == '"') in_quotes = !in_quotes;
    if (in_quotes) continue;
    if (c == '[' || c == '(') ++depth;
    if ((c == ']' || c == ')') && --depth == 0) return 1;
    const bool unit = depth == 1 && (lower(projected.substr(i, 5)) == "unit[" || lower(projected.substr(i, 11)) == "lengthunit[");
    if (!unit) continue;
    const std::size_t comma = projected.find(',', i), end = projected.find_first_of(",])", comma == std::string_view::npos ? i : comma + 1);
    double factor = 1;
    if (comma != std::string_view::npos && end != std::string_view::npos &&
        parse_number(trimmed(projected.substr(comma + 1, end - comma - 1)), factor))
      return factor;
    return 1;
  }
  return 1;
}

}  // namespace

std::string projection_title(const std::string& crs) {
  const std::size_t open = crs.find('"'), close = open == std::string::npos ? open : crs.find('"', open + 1);
  return close == std::string::npos ? printable(crs, 80) : printable(std::string_view(crs).substr(open + 1, close - open - 1), 80);
}

std::string check_projection(const std::string& wkt, const std::string& name, std::vector<std::string>& notes) {
  const std::string text = utf8(trimmed(wkt));
  const std::size_t projected = find_keyword(text, {"projcs", "projcrs", "projectedcrs"});
  if (projected == std::string::npos) {
    if (find_keyword(text, {"geogcs", "geogcrs", "geographiccrs", "geodcrs", "geodeticcrs"}) != std::string::npos)
      throw InputError(
          {name}, fmt::format("'{}' has coordinates in degrees, a terrain wants metres: reproject it (for example with gdalwarp -t_srs)",
                              projection_title(text)));
    notes.push_back(fmt::format("{}: not a projected coordinate system in WKT, ignored", name));
    return "";
  }
  const double unit = linear_unit(std::string_view(text).substr(projected));
  if (std::abs(unit - 1) > 1e-9)
    throw InputError(
        {name},
        fmt::format("'{}' has coordinates in units of {} m, a terrain wants metres: reproject it (for example with gdalwarp -t_srs)",
                    projection_title(text), unit));
  const std::string low = lower(text);
  const bool new_zealand_map_grid =
      low.find("projection[\"new_zealand_map_grid\"") != std::string::npos &&
      (low.find("new_zealand_1949") != std::string::npos || low.find("new_zealand_geodetic_datum_1949") != std::string::npos);
  notes.push_back(
      fmt::format("coordinate system: {}{}", projection_title(text.substr(projected)), new_zealand_map_grid ? " (EPSG:27200)" : ""));
  return text;
}

std::string read_projection(const fs::path& grid_file, std::vector<std::string>& notes) {
  for (const char* extension : {".prj", ".PRJ"}) {
    fs::path file = grid_file;
    file.replace_extension(extension);
    std::error_code error;
    if (!fs::is_regular_file(file, error) || fs::file_size(file, error) == 0 || error) continue;
    return check_projection(read_input(file, 1u << 20, "a coordinate system"), file.string(), notes);
  }
  return "";
}

}  // namespace effuse::importers
