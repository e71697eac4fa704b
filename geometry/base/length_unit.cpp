#include "geometry/base/length_unit.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include "geometry/base/error.h"

namespace effuse {

std::optional<Real> length_unit(std::string_view name) {
  std::string word;
  for (const char c : name)
    if (std::string_view(" _-.").find(c) == std::string_view::npos) word += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  static const std::pair<Real, std::vector<std::string_view>> kUnits[] = {
      {1, {"m", "metre", "meter", "metres", "meters"}},
      {0.3048, {"ft", "foot", "feet", "internationalfoot", "footintl", "intlfoot"}},
      {1200.0 / 3937, {"usft", "ftus", "ussurveyfoot", "ussurveyfeet", "surveyfoot", "surveyfeet", "usfoot", "usfeet", "footus"}},
      {0.1, {"dm", "decimetre", "decimeter", "decimetres", "decimeters"}},
      {0.01, {"cm", "centimetre", "centimeter", "centimetres", "centimeters"}},
      {0.001, {"mm", "millimetre", "millimeter", "millimetres", "millimeters"}},
      {1000, {"km", "kilometre", "kilometer", "kilometres", "kilometers"}},
      {0.0254, {"in", "inch", "inches"}},
      {0.9144, {"yd", "yard", "yards"}},
      {1.8288, {"fathom", "fathoms"}}};
  for (const auto& [metres, names] : kUnits)
    if (std::find(names.begin(), names.end(), word) != names.end()) return metres;
  return std::nullopt;
}

Real parse_length_unit(const std::string& text) {
  if (const auto metres = length_unit(text)) return *metres;
  Real number = 0;
  const char* end = text.data() + text.size();
  if (const auto [at, error] = std::from_chars(text.data(), end, number); error == std::errc() && at == end && std::isfinite(number) && number > 0) return number;
  const std::string nearest = nearest_name(text, {"mm", "cm", "dm", "m", "km", "in", "ft", "us-ft", "metre", "foot", "inch"});
  const std::string shown = text.size() > 40 ? text.substr(0, 37) + "..." : text;
  throw std::invalid_argument(fmt::format("no unit of length '{}', {}", shown, nearest.empty() ? "wanted mm, cm, m, km, in, ft, us-ft or a number of metres" : "did you mean '" + nearest + "'?"));
}

}  // namespace effuse
