#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "flow/scene/accuracy.h"
#include "flow/scene/effect.h"
#include "flow/scene/figures.h"
#include "flow/scene/joints.h"
#include "flow/scene/parameters.h"
#include "flow/scene/terrain_settings.h"

namespace effuse::flow {

/// What a scene says, but for the tables that the skin and the writers read. A value.
struct Scene {
  std::string name;
  std::uint64_t seed = 1;
  int frames = 0;
  Real fps = 24;
  Real time_scale = 1;          ///< simulated seconds a second of film
  std::optional<AccuracyWish> accuracy;
  TerrainSettings terrain;
  std::vector<PlannedObstacle> obstacles;
  std::vector<PlannedFigure> figures;
  std::vector<PlannedBody> bodies;
  std::vector<PlannedJoint> joints;
  BodySettings body_settings;
  std::vector<EffectPlan> effects;

  /// Frame n = 1, 2, ... shows this moment [s].
  Real frame_time(int n) const { return n * time_scale / fps; }
};

/// Reads the tables [film], [accuracy], [terrain], [[obstacle]], [[figure]], [[body]], [[joint]], [bodies] and one for each effect of kinds that the scene names.
/// Where it has bodies and no lava, or nothing but solids, the kind of_solids steps them, before all other effects. Faults stay in root: the
/// caller reads on and calls root.finish().
Scene read_scene(Parameters& root, std::span<const EffectKind> kinds);

}  // namespace effuse::flow
