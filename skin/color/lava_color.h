#pragma once

#include <array>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::skin {

/// Linear Rec.709 colour of a black body at T [K], hue only, brightest channel 1. Below the Draper point (798 K) still
/// defined (deep red). Planck's law against CIE 1931 matching functions; clipped into gamut.
Vec3 blackbody_hue(Real temperature);

struct LavaColorOptions {
  Real glow_from = 800;       ///< [K] no light below (Draper point)
  Real reference = 1473.15;   ///< [K] where emission is `strength`
  Real strength = 6;          ///< linear radiance at the reference temperature, in units of white paper in sun
};

/// Emitted light at T: hue times strength * (T / reference)^exponent, 0 below glow_from; linear, may exceed 1.
Vec3 lava_emission(Real temperature, const LavaColorOptions& options = {});

/// Reflected colour of lava rock by temperature and crust, linear: black-brown crust, darker when fresh.
Vec3 lava_albedo(Real temperature, Real crust);

/// Fills "color" (linear, display: albedo plus emission mapped into 0..1) and "glow" (emission, linear) of a mesh
/// from its "temperature" and "crust".
void color_lava(geometry::TriMesh& mesh, const LavaColorOptions& options = {});

}  // namespace effuse::skin
