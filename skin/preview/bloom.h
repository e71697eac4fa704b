#pragma once

#include "skin/preview/preview.h"

namespace effuse::skin {

/// Adds the light that bright pixels (above white) spill around them: three blurs of 0.8, 2.5 and 7 % of the picture's
/// height. amount 0 leaves the image as it is. Same bits on any number of threads.
void add_bloom(Image& image, float amount);

/// The filmic curve of write_png, 0.. to 0..1: a toe, a near-straight middle, a shoulder; very bright colours pale.
void tone_map(float (&rgb)[3]);

}  // namespace effuse::skin
