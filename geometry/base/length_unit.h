#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "geometry/base/types.h"

/// Units of length as files and people name them.
namespace effuse {

/// Metres in a unit: "m", "metre", "ft", "foot", "US survey foot", "us-ft", "in", "cm", ...; blanks, dots, dashes and case do not count;
/// nullopt: not one.
std::optional<Real> length_unit(std::string_view name);

/// The same, or a number of metres ("0.01"). Throws std::invalid_argument that says what would do, and the nearest name.
Real parse_length_unit(const std::string& text);

}  // namespace effuse
