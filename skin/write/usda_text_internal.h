#pragma once

#include <string>

#include "skin/write/write_usda.h"

/// What the files of a frame and of a stage have in common.
namespace effuse::skin {

/// Letters, digits and _, no digit first.
std::string usda_identifier(const std::string& name);
/// In double quotes.
std::string usda_string(const std::string& text);
/// "#usda 1.0" and the layer's metadata; fps 0: of what stands still.
std::string usda_header(const std::string& default_prim, Real fps, int first_frame, int last_frame, const Metadata& metadata);
/// " (interpolation = ...)" or nothing. On one line: three.js loses count of parentheses that close on another.
std::string usda_interpolation(const UsdaAttribute& attribute);
/// A line that declares it without a value.
std::string usda_declaration(const UsdaAttribute& attribute);

}  // namespace effuse::skin
