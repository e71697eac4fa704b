#include "flow/effects/registry.h"

#include "flow/effects/bodies_effect.h"
#include "flow/effects/elastic_effect.h"
#include "flow/effects/lava.h"
#include "flow/effects/ocean_effect.h"
#include "flow/effects/particles_effect.h"
#include "flow/effects/plants_effect.h"
#include "flow/effects/smoke_effect.h"
#include "flow/effects/springs_effect.h"
#include "flow/effects/waves_effect.h"

namespace effuse::flow {

std::span<const EffectKind> effect_kinds() {
  static const EffectKind kinds[] = {
      {"lava", "molten rock on smoothed particles, running over the terrain", read_lava},
      {"springs", "mass points and springs: jello, cloth, soft solids", read_springs, false, true},
      {"elastic", "finite elements: soft, stiff or brittle solids", read_elastic, false, true},
      {"plants", "trees, bushes and grass by L-systems: they sway, catch fire beside lava and burn down", read_plants, false, true},
      {"waves", "water up to a level, its surface by the wave equation; lava makes waves in it and is quenched", read_waves, false, true},
      {"ocean", "a sea as a sum of waves; lava is quenched in it", read_ocean},
      {"smoke", "smoke on a grid: buoyant, swirling, incompressible", read_smoke, false, true},
      {"particles", "snow, dust, sand, sparks, fire, smoke, steam: particles that do not know of one another", read_particles, false, true},
      {"bodies", "rigid bodies, joints and moving obstacles, by themselves where there is no lava", read_bodies_effect, true},
  };
  return kinds;
}

}  // namespace effuse::flow
