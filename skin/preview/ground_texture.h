#pragma once

#include "skin/preview/light.h"

namespace effuse::skin {

/// What the ground's surface is like at one point.
struct GroundLook {
  Vec3f albedo;
  Vec3f normal;  ///< unit, with bumps
};

/// Grass and scrub where it is gentle, scree, rock where it is steep, scoria near the top; patches and bumps of gradient
/// noise from a fifth of the scene down to half a decimetre, each octave fading out before it is finer than a pixel.
///   p          position [m]
///   normal     smooth, unit
///   altitude   0 lowest .. 1 highest
///   footprint  size of a pixel there [m]
///   size       of the scene [m]
GroundLook ground_look(const Vec3f& p, const Vec3f& normal, float altitude, float footprint, float size);

/// Gradient noise in the plane, in about -1..1, wavelength 1, with its derivatives. C1.
struct PlaneNoise {
  float value, dx, dy;
};
PlaneNoise plane_noise(float x, float y, std::uint32_t seed);

}  // namespace effuse::skin
