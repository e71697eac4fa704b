#pragma once

#include "flow/scene/effect.h"

namespace effuse::flow {

/// A table [[springs]]: a jello cube, a cloth or a soft solid of mass points and springs (flow/springs), which meets walls of its own, the
/// terrain and the scene's obstacles by penalty springs. It feels them; they do not feel it.
EffectPlan read_springs(Parameters& parameters, Real duration);

}  // namespace effuse::flow
