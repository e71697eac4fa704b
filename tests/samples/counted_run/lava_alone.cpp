#include "flow/effects/lava.h"
#include "flow/effects/registry.h"

namespace effuse::flow {

/// Instead of flow/effects/registry.cpp: with it, no other effect is linked. Weak: flow/effects/registry.cpp, linked behind it, counts.
[[gnu::weak]] std::span<const EffectKind> effect_kinds() {
  static const EffectKind kinds[] = {{"lava", "molten rock on smoothed particles, running over the terrain", read_lava}};
  return kinds;
}

}  // namespace effuse::flow
