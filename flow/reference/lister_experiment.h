#pragma once

#include <vector>

#include "geometry/base/types.h"

/// Measured outlines of silicone oil that spreads down a glass plate from a hole in it: benchmark BM2's experiment.
///
/// Slope 2.5 degrees, Q = 1.48e-6 m^3/s, nu = 1.13e-3 m^2/s, density 970 kg/m^3; source at (0, 0), x along the plate downwards, y across.
/// Source: Lister 1992, J. Fluid Mech. 242, 631-653, digitised in barbagroup/geoclaw-landspill-paper (repro-pack, silicone-oil-inclined-plane).
namespace effuse::flow::reference {

struct MeasuredOutline {
  Real time = 0;            ///< [s]
  std::vector<Vec2> points; ///< half of it, y >= 0, from the back to the front [m]; the back is missing in later ones
  Real front() const;       ///< farthest x [m]
  Real half_width() const;  ///< largest y [m]
};

/// At 32, 59, 122, 271, 486 and 727 s.
std::vector<MeasuredOutline> lister_outlines();

}  // namespace effuse::flow::reference
