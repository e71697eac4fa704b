#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "flow/effects/lava_vents.h"
#include "flow/scene/effect.h"

namespace effuse::flow {

/// Equations of lava as a scene has chosen them, not yet built: what read_lava() makes an EffectPlan of.
struct LavaModel {
  Real spacing = 0;                 ///< of particles [m]; 0 after a fault
  Real vent_temperature = 1473.15;  ///< [K] of vents that do not say
  std::string sets_the_step;        ///< parameters that make steps short: for a fault
  std::function<Estimate(const std::vector<PlannedVent>& vents, Real duration)> estimate;
  bool obstacles = true;            ///< whether it flows around any
  std::function<std::unique_ptr<Effect>(const std::vector<sph::Vent>& vents, const World& world)> make;
};

}  // namespace effuse::flow
