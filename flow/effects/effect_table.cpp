#include "flow/effects/effect_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace effuse::flow {

void check_effect_name(Parameters& p, const std::string& name) {
  static constexpr std::array<std::string_view, 4> kTaken = {"skin", "lava", "obstacles", "terrain"};
  if (name.empty() || name.find_first_of("/\\\n") != std::string::npos || name.find('\0') != std::string::npos || name == "." || name == "..")
    p.fault("name", fmt::format("'{}' cannot be part of a file's name", name));
  if (std::find(kTaken.begin(), kTaken.end(), name) != kTaken.end()) p.fault("name", fmt::format("'{}' is the name of files of something else, wanted another", name));
}

std::string read_effect_name(Parameters& p, const std::string& usual) {
  const std::string name = p.text("name", usual, "for files: frames/NAME.####.*");
  check_effect_name(p, name);
  return name;
}

Vec3 read_vector(Parameters& p, const char* key, const char* unit, const Vec3& usual, const char* what) {
  const std::vector<Real> v = p.numbers(key, unit, 3, false, what);
  return v.size() == 3 ? Vec3(v[0], v[1], v[2]) : usual;
}

Vec3 read_color(Parameters& p, const Vec3& usual, const char* what) {
  const Vec3 srgb = read_vector(p, "color", "", usual, what);
  if (!(srgb.minCoeff() >= 0 && srgb.maxCoeff() <= 1)) p.fault("color", "has a number that is not from 0 to 1");
  // The transfer function of IEC 61966-2-1.
  return srgb.cwiseMax(0).unaryExpr([](Real s) { return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4); });
}

}  // namespace effuse::flow
