#pragma once

#include <span>
#include <vector>

#include "geometry/mesh/volume.h"
#include "skin/color/lava_color.h"
#include "skin/preview/light.h"
#include "skin/preview/preview.h"
#include "skin/preview/sky.h"

namespace effuse::skin {

/// Where a picture's pixels look, in the ground's frame: through pixel (x, y) goes forward + u right + v up with u, v in -1..1.
struct AirView {
  Vec3 origin;             ///< [m] of that frame
  Vec3f eye, forward, right, up;
  float pixel_angle;       ///< size of a pixel at a distance of 1
};

/// Draws what is in the air over a picture of what is solid: volumes first, then specks from back to front.
///   depth  distance from the eye to what each pixel shows [m], infinite where it shows sky
/// Volumes: extinction is their density [1/m], lit by the sun and the open sky through themselves, glowing as black bodies do where
/// they are hot. Marched a ray a pixel, a cell a step, at most 512.
/// Light is as after exposure. The same bits on any number of threads.
void draw_air(Image& image, std::span<const float> depth, const AirView& view, const Sky& sky, const PreviewOptions& options, const Air& air);

}  // namespace effuse::skin
