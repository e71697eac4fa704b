#pragma once

#include <string>
#include <string_view>

#include "flow/scene/parameters.h"
#include "geometry/base/types.h"

/// What tables of many effects have in common.
namespace effuse::flow {

/// A fault where a name that files are called by cannot be part of one, or is that of files of other things.
void check_effect_name(Parameters& p, const std::string& name);

/// The key name, checked.
std::string read_effect_name(Parameters& p, const std::string& usual);

/// Three numbers, or the usual ones.
Vec3 read_vector(Parameters& p, const char* key, const char* unit, const Vec3& usual, const char* what);

/// The key color, sRGB 0 to 1; returned as linear light. usual: sRGB, too.
Vec3 read_color(Parameters& p, const Vec3& usual, const char* what = "red, green and blue, 0 to 1 (sRGB)");

}  // namespace effuse::flow
