#pragma once

#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "skin/write/png.h"

namespace effuse::skin {

/// Emission per vertex as a one-dimensional texture and a place on it: for formats whose materials glow by texture only.
struct EmissionRamp {
  float strength = 0;             ///< linear emission of the brightest vertex's brightest channel
  Rgb8Image image;                ///< 256 x 1, sRGB, dark to bright; texel k holds brightness strength * (k / 255)^2
  std::vector<float> coordinate;  ///< one a vertex: u in 0..1, texel centres
};

/// glow: width 3, linear, finite, >= 0 (negative counts as 0). Each texel holds the mean hue of the vertices of its
/// brightness, gaps filled from their neighbours. strength 0: nothing glows.
EmissionRamp make_emission_ramp(const geometry::VertexAttribute& glow);

}  // namespace effuse::skin
