#pragma once

#include "flow/scene/effect.h"

namespace effuse::flow {

/// A table [[springs]]: a jello cube, a cloth or a soft solid of mass points and springs (flow/springs), which meets walls of its own, the
/// terrain and the scene's obstacles by penalty springs. It feels them; they do not feel it. Modern lava and it push each other: the lava then
/// steps it with itself (SolidWorld), in one solve for both (sph::Pressed).
EffectPlan read_springs(Parameters& parameters, Real duration);

}  // namespace effuse::flow
