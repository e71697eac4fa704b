#pragma once

#include "flow/scene/effect.h"

namespace effuse::flow {

/// A table [[waves]]: water over a region of the terrain up to a level, its surface by the wave equation (flow/waves), c^2 = g depth.
/// The terrain is its shore. Lava that runs under its surface lifts it by the volume that goes under, which makes waves; and where it
/// boils (boiling > 0) lava of the modern model is quenched.
///
/// scheme = "auto" is explicit, in steps of 0.9 of the longest stable one, unless `step` asks for longer ones: then it is implicit.
/// "explicit" with a step beyond Courant number 1 is refused. Figures: cells water_cells steps implicit volume_m3 (above rest)
/// displaced_m3 (by lava) highest_m energy_m4_s2.
EffectPlan read_waves(Parameters& parameters, Real duration);

}  // namespace effuse::flow
