#pragma once

#include <string_view>

#include "skin/write/png.h"

namespace effuse::skin {

/// Writes text into a picture in a font of 5 x 7 blocks, white on a dark band, upper left corner of the band at (x, y);
/// what does not fit is cut off. Letters show as capitals, characters the font does not have as '?'.
///   block  pixels a block is wide and high, > 0
void burn_label(Rgb8Image& image, int x, int y, int block, std::string_view text);

}  // namespace effuse::skin
