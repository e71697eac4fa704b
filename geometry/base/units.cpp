#include "geometry/base/units.h"

#include <fmt/format.h>

#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "geometry/base/error.h"

namespace effuse {

namespace {

/// Powers of metre, kilogram, second, kelvin, radian.
using Dimension = std::array<int, 5>;

/// factor * 10^exponent in SI. The exponent is apart so that "5 mm" is 5 / 1000, rounded once.
struct Unit {
  Real factor = 1;
  int exponent = 0;
  Dimension dimension{};
};

struct NamedUnit {
  std::string_view name;
  Unit unit;
  bool takes_prefix;
};

constexpr NamedUnit kUnits[] = {
    {"m", {1, 0, {1, 0, 0, 0, 0}}, true},       {"g", {1, -3, {0, 1, 0, 0, 0}}, true},
    {"t", {1, 3, {0, 1, 0, 0, 0}}, false},      {"s", {1, 0, {0, 0, 1, 0, 0}}, true},
    {"min", {60, 0, {0, 0, 1, 0, 0}}, false},   {"h", {3600, 0, {0, 0, 1, 0, 0}}, false},
    {"day", {86400, 0, {0, 0, 1, 0, 0}}, false}, {"K", {1, 0, {0, 0, 0, 1, 0}}, true},
    {"rad", {1, 0, {0, 0, 0, 0, 1}}, true},     {"deg", {kPi / 180, 0, {0, 0, 0, 0, 1}}, false},
    {"N", {1, 0, {1, 1, -2, 0, 0}}, true},      {"Pa", {1, 0, {-1, 1, -2, 0, 0}}, true},
    {"J", {1, 0, {2, 1, -2, 0, 0}}, true},      {"W", {1, 0, {2, 1, -3, 0, 0}}, true},
    {"Hz", {1, 0, {0, 0, -1, 0, 0}}, true},     {"l", {1, -3, {3, 0, 0, 0, 0}}, true},
    {"ft", {3048, -4, {1, 0, 0, 0, 0}}, false}, {"in", {254, -4, {1, 0, 0, 0, 0}}, false},
    {"%", {1, -2, {0, 0, 0, 0, 0}}, false},
};

struct Prefix {
  std::string_view name;
  int exponent;
};
constexpr Prefix kPrefixes[] = {{"T", 12}, {"G", 9},  {"M", 6},  {"k", 3},  {"h", 2},   {"da", 1},
                                {"d", -1}, {"c", -2}, {"m", -3}, {"u", -6}, {"n", -9}};

/// Dimensions with a name of their own, and how they are written in SI.
struct NamedDimension {
  Dimension dimension;
  std::string_view name, unit;
};
constexpr NamedDimension kDimensions[] = {
    {{0, 0, 0, 0, 0}, "a plain number", "1"},
    {{1, 0, 0, 0, 0}, "a length", "m"},
    {{2, 0, 0, 0, 0}, "an area", "m2"},
    {{3, 0, 0, 0, 0}, "a volume", "m3"},
    {{0, 0, 1, 0, 0}, "a time", "s"},
    {{0, 1, 0, 0, 0}, "a mass", "kg"},
    {{0, 0, 0, 1, 0}, "a temperature", "K"},
    {{0, 0, 0, 0, 1}, "an angle", "rad"},
    {{1, 0, -1, 0, 0}, "a speed", "m/s"},
    {{1, 0, -2, 0, 0}, "an acceleration", "m/s2"},
    {{3, 0, -1, 0, 0}, "a volume rate", "m3/s"},
    {{0, 1, -1, 0, 0}, "a mass rate", "kg/s"},
    {{-3, 1, 0, 0, 0}, "a density", "kg/m3"},
    {{1, 1, -2, 0, 0}, "a force", "N"},
    {{-1, 1, -2, 0, 0}, "a pressure", "Pa"},
    {{2, 1, -2, 0, 0}, "an energy", "J"},
    {{2, 1, -3, 0, 0}, "a power", "W"},
    {{0, 0, -1, 0, 0}, "a frequency", "Hz"},
    {{0, 0, -1, 0, 1}, "an angular speed", "rad/s"},
    {{-1, 1, -1, 0, 0}, "a dynamic viscosity", "Pa s"},
    {{2, 0, -1, 0, 0}, "a kinematic viscosity or diffusivity", "m2/s"},
    {{2, 0, -2, -1, 0}, "a specific heat", "J/(kg K)"},
    {{2, 0, -2, 0, 0}, "a specific energy", "J/kg"},
    {{1, 1, -3, -1, 0}, "a heat conductivity", "W/(m K)"},
    {{0, 1, -3, -1, 0}, "a heat transfer coefficient", "W/(m2 K)"},
    {{0, 1, -3, 0, 0}, "a heat flux", "W/m2"},
    {{0, 1, -2, 0, 0}, "a stiffness or surface tension", "N/m"},
    {{0, 0, 0, -1, 0}, "a rate per kelvin", "1/K"},
};

/// "a volume [m3]"; dimensions without a name are spelt in base units.
std::string describe(const Dimension& dimension) {
  for (const NamedDimension& known : kDimensions)
    if (known.dimension == dimension) return known.unit == "1" ? std::string(known.name) : fmt::format("{} [{}]", known.name, known.unit);
  static constexpr std::string_view kBase[] = {"m", "kg", "s", "K", "rad"};
  std::string text;
  for (std::size_t k = 0; k < dimension.size(); ++k) {
    if (dimension[k] == 0) continue;
    text += fmt::format("{}{}", text.empty() ? "" : " ", kBase[k]);
    if (dimension[k] != 1) text += std::to_string(dimension[k]);
  }
  return fmt::format("a quantity in [{}]", text);
}

[[noreturn]] void fail(const std::string& message) { throw std::invalid_argument(message); }

Unit product(const Unit& a, const Unit& b, int sign) {
  Unit c = a;
  c.factor = sign > 0 ? a.factor * b.factor : a.factor / b.factor;
  c.exponent += sign * b.exponent;
  for (std::size_t k = 0; k < c.dimension.size(); ++k) c.dimension[k] += sign * b.dimension[k];
  return c;
}

Unit lookup(std::string_view name, std::string_view whole) {
  for (const NamedUnit& known : kUnits)
    if (known.name == name) return known.unit;
  for (const Prefix& prefix : kPrefixes) {
    if (!name.starts_with(prefix.name)) continue;
    for (const NamedUnit& known : kUnits) {
      if (!known.takes_prefix || known.name != name.substr(prefix.name.size())) continue;
      Unit unit = known.unit;
      unit.exponent += prefix.exponent;
      return unit;
    }
  }
  if (name == "degC" || name == "degF")
    fail(fmt::format("'{}' has {} inside a product; it is a point on a scale and stands alone: write K", whole, name));
  std::vector<std::string> names{"degC", "degF", "kg", "km", "cm", "mm", "ms", "kPa", "MPa", "GPa", "kW", "kJ"};
  for (const NamedUnit& known : kUnits) names.emplace_back(known.name);
  const std::string nearest = name.size() > 1 ? nearest_name(std::string(name), names) : "";
  fail(nearest.empty() ? fmt::format("'{}' has the unknown unit '{}'; known are m g kg t s min h day K degC degF rad deg N Pa J W Hz ft in l %", whole, name)
                       : fmt::format("'{}' has the unknown unit '{}'; is '{}' meant?", whole, name, nearest));
}

/// Recursive descent over  product := factor { ('/' | '*' | '.' | blank) factor },
/// factor := ('1' | name | '(' product ')') [['^'] ['-'] digits].
class UnitParser {
 public:
  UnitParser(std::string_view text, std::string_view whole) : text_(text), whole_(whole) {}

  Unit all() {
    const Unit unit = parse_product(0);
    if (at_ < text_.size()) fail(fmt::format("'{}' has '{}' where it should end", whole_, text_.substr(at_)));
    return unit;
  }

 private:
  char peek() const { return at_ < text_.size() ? text_[at_] : '\0'; }
  bool skip_blanks() {
    const std::size_t from = at_;
    while (peek() == ' ' || peek() == '\t') ++at_;
    return at_ > from;
  }

  Unit parse_product(int depth) {
    if (depth > 16) fail(fmt::format("'{:.40}...' has more than 16 parentheses inside one another", whole_));
    skip_blanks();
    Unit unit = parse_factor(depth);
    bool divided = false;
    for (;;) {
      const bool blank = skip_blanks();
      const char c = peek();
      if (c == '\0' || c == ')') return unit;
      if (c == '/') {
        ++at_;
        skip_blanks();
        unit = product(unit, parse_factor(depth), -1);
        divided = true;
        continue;
      }
      if (c == '*' || c == '.') {
        ++at_;
        skip_blanks();
      } else if (!blank) {
        fail(fmt::format("'{}' has '{}' where '/', '*', a blank or the end should be", whole_, text_.substr(at_)));
      }
      if (divided) fail(fmt::format("'{}' can be read two ways after '/': put the divisor in parentheses, as in W/(m2 K)", whole_));
      unit = product(unit, parse_factor(depth), +1);
    }
  }

  Unit parse_factor(int depth) {
    Unit unit;
    if (peek() == '(') {
      ++at_;
      unit = parse_product(depth + 1);
      if (peek() != ')') fail(fmt::format("'{}' lacks a closing parenthesis", whole_));
      ++at_;
    } else if (peek() == '1') {
      ++at_;
      return unit;
    } else {
      const std::size_t from = at_;
      while (std::isalpha(static_cast<unsigned char>(peek())) || peek() == '%' || peek() == '_') ++at_;
      if (at_ == from)
        fail(at_ < text_.size() ? fmt::format("'{}' has '{}' where a unit should be", whole_, text_.substr(at_))
                                : fmt::format("'{}' ends where a unit should be", whole_));
      unit = lookup(text_.substr(from, at_ - from), whole_);
    }
    return power(unit, parse_exponent());
  }

  int parse_exponent() {
    const bool hat = peek() == '^';
    if (hat) ++at_;
    const std::size_t from = at_;
    if (peek() == '-') ++at_;
    int exponent = 1;
    const auto [end, error] = std::from_chars(text_.data() + from, text_.data() + text_.size(), exponent);
    if (error == std::errc::invalid_argument) {
      if (hat || at_ > from) fail(fmt::format("'{}' lacks the exponent after '{}'", whole_, text_.substr(0, at_)));
      return 1;
    }
    if (error != std::errc{} || std::abs(exponent) > 9) fail(fmt::format("'{}' has an exponent beyond 9", whole_));
    at_ = static_cast<std::size_t>(end - text_.data());
    return exponent;
  }

  static Unit power(const Unit& unit, int exponent) {
    Unit result;
    for (int k = 0; k < std::abs(exponent); ++k) result = product(result, unit, exponent > 0 ? 1 : -1);
    return result;
  }

  std::string_view text_, whole_;
  std::size_t at_ = 0;
};

std::string_view trim(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

Unit parse_unit(std::string_view text, std::string_view whole) {
  text = trim(text);
  return text.empty() ? Unit{} : UnitParser(text, whole).all();
}

Real scaled(Real number, const Unit& unit) {
  const Real value = number * unit.factor;
  // 10^n is exact up to n = 22, so that one rounding is made here.
  return unit.exponent < 0 ? value / std::pow(10.0, -unit.exponent) : value * std::pow(10.0, unit.exponent);
}

}  // namespace

Real parse_quantity(std::string_view text, std::string_view si_unit) {
  const Unit wanted = parse_unit(si_unit, si_unit);
  const std::string_view whole = trim(text);
  const auto example = [&] { return trim(si_unit).empty() || si_unit == "1" ? std::string("'1.5'") : fmt::format("'1.5 {}'", si_unit); };

  // The number.
  std::string_view rest = whole;
  if (rest.starts_with('+') && !rest.starts_with("+-")) rest.remove_prefix(1);
  Real number = 0;
  const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), number);
  if (error == std::errc::invalid_argument) fail(fmt::format("'{}' does not begin with a number, wanted {}, like {}", whole, describe(wanted.dimension), example()));
  if (error == std::errc::result_out_of_range || !std::isfinite(number)) fail(fmt::format("'{}' is not a finite number", whole));
  rest.remove_prefix(static_cast<std::size_t>(end - rest.data()));
  rest = trim(rest);
  if (rest.empty()) return number;

  // Points on a temperature scale are shifted, not only scaled.
  const bool celsius = rest == "degC", fahrenheit = rest == "degF";
  const Unit found = celsius || fahrenheit ? Unit{1, 0, {0, 0, 0, 1, 0}} : parse_unit(rest, whole);
  if (found.dimension != wanted.dimension)
    fail(fmt::format("'{}' is {}, wanted {}", whole, describe(found.dimension), describe(wanted.dimension)));
  if (celsius) return number + kZeroCelsius;
  if (fahrenheit) return (number + 459.67) * 5 / 9;
  const Real value = scaled(number, found);
  if (!std::isfinite(value)) fail(fmt::format("'{}' is not a finite number in SI", whole));
  return value;
}

std::string format_quantity(Real value, std::string_view si_unit) {
  const std::string_view unit = trim(si_unit);
  return unit.empty() || unit == "1" ? fmt::format("{}", value) : fmt::format("{} {}", value, unit);
}

}  // namespace effuse
