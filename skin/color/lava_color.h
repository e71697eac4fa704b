#pragma once

#include "geometry/mesh/tri_mesh.h"

namespace effuse::skin {

/// CIE 1931 chromaticity (x, y) of a black body at T [K], 500 <= T <= 20000 (clamped).
///
/// Planck's law summed from 380 to 780 nm in steps of 10 nm against the tabulated CIE 1931 matching functions; within
/// 0.001 of the published locus from 1000 K to 10000 K. (The closed-form fits of the matching functions are not good
/// enough here: they miss the red tail, which is all there is at 1200 K, by 0.007.)
Vec2 blackbody_chromaticity(Real temperature);

/// Linear Rec.709 colour of a black body at T [K], hue only, brightest channel 1. Below the Draper point (798 K) still
/// defined (deep red). Planck's law against CIE 1931 matching functions; clipped into gamut (below about 1900 K the
/// true colour asks for negative blue).
Vec3 blackbody_hue(Real temperature);

/// Every number that decides how hot rock looks. Emission is a picture's emission, not a radiometer's: the visible
/// radiance of a real black body falls like T^17 at lava temperatures, and no screen shows that range.
struct LavaColorOptions {
  Real glow_from = 800;       ///< [K] no light below (Draper point)
  Real reference = 1473.15;   ///< [K] where emission is `strength`
  Real strength = 6;          ///< linear radiance at the reference temperature, in units of white paper in sun
  Real exponent = 9;          ///< emission ~ T^exponent: 4 is flat, 17 is physical
  Real molten = 1440;         ///< [K] hotter than this the surface has no plates yet
  Real plated = 1190;         ///< [K] cooler than this it is all plates and cracks
  Real plate = 760;           ///< [K] apparent temperature of a closed plate over hot lava
  Real crack_width = 0.36;    ///< where plated, cracks are where (detail + 1) / 2 is below this; 0: no cracks
  Real crack_softness = 0.2;  ///< half the width of the crack's rim, where it darkens from core to plate; same unit
};

/// Emitted light at T: hue times strength * (T / reference)^exponent, faded in over the 120 K above glow_from and 0
/// below; linear, may exceed 1.
Vec3 lava_emission(Real temperature, const LavaColorOptions& options = {});

/// Reflected colour of lava rock by temperature, crust (0 molten .. 1 solid) and altitude within the clinker (-1 valley .. 1
/// crest: "detail"), linear: black-brown crust, darker when fresh; crests lighter and browner (dust, rust, and they see all of the
/// sky), valleys darker and bluer. Rises with altitude in every channel, falls with temperature.
Vec3 lava_albedo(Real temperature, Real crust, Real altitude = 0);

/// What the eye sees of a surface whose lava is at T [K]: plates are chilled to `plate`, the cracks between them show
/// nearly T. The share of plates grows from none (crust 0 and hotter than `molten`) to all but the cracks (crust 1, or
/// cooler than `plated`). Never above T, never below min(T, plate).
///   detail  -1 .. 1, the surface's own noise (skin/detail): low is a valley, valleys crack open first
Real apparent_temperature(Real temperature, Real crust, Real detail, const LavaColorOptions& options = {});

/// Emission squeezed into 0..1 for a vertex colour: 1 - exp(-x) a channel. What color_lava adds to "color"; a renderer
/// that has "glow" too takes it off again to find what is reflected.
Vec3 display_emission(const Vec3& emission);

/// Fills "color" (linear, display: albedo plus emission mapped into 0..1) and "glow" (emission, linear) of a mesh
/// from its "temperature" and "crust", with cracks where it has "detail" (-1..1). Without "crust" the temperature
/// alone decides; without "detail" plates and cracks blur into their mean. A mesh without "temperature" is cold rock.
/// The attributes that are there must fit the mesh (checked). Same bits on any number of threads. About 40 ns a vertex.
void color_lava(geometry::TriMesh& mesh, const LavaColorOptions& options = {});

}  // namespace effuse::skin
