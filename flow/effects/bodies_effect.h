#pragma once

#include "flow/scene/effect.h"

namespace effuse::flow {

/// The effect "bodies": a scene's rigid bodies, joints and obstacles where no lava meets them. Parameters are BodySettings.
EffectPlan read_bodies_effect(Parameters& parameters, Real duration);

}  // namespace effuse::flow
