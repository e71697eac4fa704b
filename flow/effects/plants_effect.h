#pragma once

#include "flow/scene/effect.h"

namespace effuse::flow {

/// A table [[plants]]: plants grown by L-systems (geometry/procedural), standing on the terrain where the table puts or scatters them, swaying in
/// the wind, which is a function of time. A few are grown, the rest are those again, scaled and turned: what is held is a place, a few numbers and
/// the fire's bands for each, 300 bytes; the mesh is made for a frame and let go. Lava beside them dries them, sets them on fire and burns them down
/// (flow/plants).
EffectPlan read_plants(Parameters& parameters, Real duration);

}  // namespace effuse::flow
