#include "flow/effects/registry.h"

#include "flow/effects/bodies_effect.h"
#include "flow/effects/lava.h"

namespace effuse::flow {

std::span<const EffectKind> effect_kinds() {
  static const EffectKind kinds[] = {
      {"lava", "molten rock on smoothed particles, running over the terrain", read_lava},
      {"bodies", "rigid bodies, joints and moving obstacles, by themselves where there is no lava", read_bodies_effect, true},
  };
  return kinds;
}

}  // namespace effuse::flow
