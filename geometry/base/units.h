#pragma once

#include <string>
#include <string_view>

#include "geometry/base/types.h"

/// Numbers with units, as people write them in a scene: "1150 degC", "30 m3/s", "12 deg", "2 %".
namespace effuse {

/// The value of text in SI, checked to have the dimension of si_unit.
///
///   text     a number, then optionally a unit: factors joined by '/', '*', '.' or a blank, powers as
///            "m3" or "m^3", SI prefixes (km, mm, kPa, ms, ...), parentheses: "W/(m2 K)".
///            Known: m g kg t s min h day K degC degF rad deg N Pa J W Hz ft in l % and their prefixes.
///            A number alone is SI.
///   si_unit  what is wanted, in the same grammar; "" or "1" for a plain number
///
/// A blank after '/' would be read two ways, so "W/m2 K" is refused: write "W/(m2 K)" or "W/m2/K".
/// Angles have a dimension of their own: "12 deg" is not a plain number, rad/s is not Hz.
/// degC and degF are points on a scale: they stand alone ("20 degC"), and are shifted to kelvin.
/// Throws std::invalid_argument that says what was found and what would do, e.g.
/// "'30 m3' is a volume [m3], wanted a volume rate [m3/s]".
Real parse_quantity(std::string_view text, std::string_view si_unit);

/// "12.5 m3/s": the shortest text that parse_quantity turns back into value, bit for bit.
std::string format_quantity(Real value, std::string_view si_unit);

}  // namespace effuse
