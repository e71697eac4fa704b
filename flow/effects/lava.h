#pragma once

#include "flow/scene/effect.h"

namespace effuse::flow {

/// The table [lava]: lava of flow/sph over the scene's terrain, by the equations its `model` names: "modern"
/// (modern_lava_effect.h) or "classic" (classic_lava_effect.h).
EffectPlan read_lava(Parameters& parameters, Real duration);

}  // namespace effuse::flow
