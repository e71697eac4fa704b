#pragma once

#include "flow/scene/effect.h"

namespace effuse::flow {

/// A table [[particles]]: snow, dust, sand, sparks, fire, smoke, steam and what else flies (flow/particles), from emitters of its
/// own, or off the scene's lava, its vents and the water that it meets. They meet the terrain and the scene's obstacles.
///
/// Lava and water are seen as they stand at the end of each frame. Figures: particles born aged left fallen steps.
EffectPlan read_particles(Parameters& parameters, Real duration);

}  // namespace effuse::flow
