#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace effuse::skin {

/// 8 bit sRGB, red green blue, row by row from the top.
struct Rgb8Image {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;
};

/// The bytes of a PNG file (marked sRGB). image.rgb holds 3 * width * height bytes, both sizes > 0 (checked).
std::string encode_png(const Rgb8Image& image);

/// Any PNG as 8 bit sRGB, transparency over black. place names it in errors. Throws InputError.
Rgb8Image decode_png(std::string_view bytes, const std::string& place);

/// Reads a PNG file. Throws InputError naming it.
Rgb8Image read_png(const std::filesystem::path& file);

}  // namespace effuse::skin
