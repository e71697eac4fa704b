#pragma once

#include "skin/preview/preview.h"

namespace effuse::skin {

/// Adds the light that bright pixels (above white) spill around them: three blurs of 0.8, 2.5 and 7 % of the picture's
/// height. amount 0 leaves the image as it is. Same bits on any number of threads.
void add_bloom(Image& image, float amount);

/// What write_png does to light, 0.. to 0..1: a film's curve (a toe, a near-straight middle, a shoulder) on each channel, mixed
/// with a quarter of the same curve on the brightest channel alone, which keeps the hue. Lava with default glow so comes out deep
/// red at 1100 K, orange at 1300 K, yellow at 1450 K, not yellow all over. Greys as by the curve; rises with each grey. Strong yellow pales.
void tone_map(float (&rgb)[3]);

}  // namespace effuse::skin
