#pragma once

#include <string>

#include "skin/write/png.h"

namespace effuse::study {

/// The bytes of a baseline JPEG file (JFIF 1.01; Y Cb Cr by ITU-R BT.601, colour at half the resolution, the specification's
/// example tables). Pictures in a README are ten times smaller so than as PNG.
///   image    sRGB, both sizes from 1 to 65,535 (checked)
///   quality  1 .. 100 (checked): scales the tables of quantisation as is usual, 50 leaves them as they are
/// Source: ITU-T T.81 (1992), Information technology: digital compression and coding of continuous-tone still images, annexes A, F, K.
std::string encode_jpeg(const skin::Rgb8Image& image, int quality);

}  // namespace effuse::study
