#pragma once

#include "flow/scene/effect.h"

namespace effuse::flow {

/// The table [ocean]: a sea as a sum of waves (geometry/procedural/ocean), a function of time: nothing is stepped. Waves of the table's own
/// ([[ocean.wave]]), or those that the wind raises. Lava of the modern model that runs under it is quenched (boiling > 0).
///
/// horizon = true: beyond the region its mesh goes on in ever wider quads to thirty times the region, where waves shorter
/// than four quads are left out. Figures: waves highest_m (crest over its level, now) triangles.
EffectPlan read_ocean(Parameters& parameters, Real duration);

}  // namespace effuse::flow
