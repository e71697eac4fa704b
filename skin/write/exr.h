#pragma once

#include <filesystem>

#include "skin/preview/preview.h"

namespace effuse::skin {

/// OpenEXR of linear light, half floats R, G, B (Rec. 709 primaries), zip-compressed; what is brighter than a half can hold (65504) is
/// cut there. Whole or absent.
void write_exr(const std::filesystem::path& file, const Image& image);

}  // namespace effuse::skin
