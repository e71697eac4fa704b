#pragma once

#include <span>

#include "flow/scene/effect.h"

namespace effuse::flow {

/// The effects there are.
std::span<const EffectKind> effect_kinds();

}  // namespace effuse::flow
