#pragma once

#include "flow/scene/effect.h"

namespace effuse::flow {

/// A table [[smoke]]: smoke in a box of cells (flow/smoke) over the terrain, which is solid in it, from sources of its own
/// ([[smoke.source]]), over lava's vents, and off lava's hot surface. Lava heats the air above it by lava_convection (T - T_air) and
/// gives off lava_smoke; it does not feel that. Density is extinction [1/m].
///
/// Figures: cells solid_cells steps mass (sum of density cell^3) fastest_m_s divergence_1_s iterations (of the pressure, mean a step).
EffectPlan read_smoke(Parameters& parameters, Real duration);

}  // namespace effuse::flow
