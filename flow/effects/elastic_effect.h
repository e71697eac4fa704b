#pragma once

#include "flow/scene/effect.h"

namespace effuse::flow {

/// A table [[elastic]]: a solid of finite elements (flow/fem), from a closed mesh, a box or a ball: soft, stiff, or brittle beyond a stress.
/// It meets the terrain and the scene's obstacles by penalty springs. It feels them; they do not feel it, nor do its own pieces feel one another.
/// Modern lava and it push each other: the lava then steps it with itself (SolidWorld), in one solve for both (sph::Pressed). Classic lava
/// meets nothing but the terrain.
EffectPlan read_elastic(Parameters& parameters, Real duration);

}  // namespace effuse::flow
