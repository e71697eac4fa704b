#pragma once

#include "flow/scene/effect.h"

namespace effuse::flow {

/// The table [lava]: the classic lava of flow/sph over the scene's terrain.
EffectPlan read_lava(Parameters& parameters, Real duration);

}  // namespace effuse::flow
