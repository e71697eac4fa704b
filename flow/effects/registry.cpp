#include "flow/effects/registry.h"

#include "flow/effects/lava.h"

namespace effuse::flow {

std::span<const EffectKind> effect_kinds() {
  static const EffectKind kinds[] = {
      {"lava", "molten rock on smoothed particles, running over the terrain", read_lava},
  };
  return kinds;
}

}  // namespace effuse::flow
