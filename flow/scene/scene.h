#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "flow/scene/effect.h"
#include "flow/scene/joints.h"
#include "flow/scene/parameters.h"

namespace effuse::flow {

/// Flat ground, the table [terrain.plane]: geometry::make_plane.
struct PlannedPlane {
  Vec2 size = Vec2::Zero();  ///< [m]
  Real slope = 0, downhill = 0;  ///< [rad]
};

/// What a scene says, but for the tables that the skin and the writers read. A value.
struct Scene {
  std::string name;
  std::uint64_t seed = 1;
  int frames = 0;
  Real fps = 24;
  Real time_scale = 1;          ///< simulated seconds a second of film
  std::string terrain_file;     ///< as written; relative to the scene file. "": plane
  std::optional<PlannedPlane> plane;
  Place terrain_place;
  std::string terrain_crs;      ///< "": as the file says
  Real ground_temperature = 0;  ///< [K]
  std::vector<PlannedObstacle> obstacles;
  std::vector<PlannedBody> bodies;
  std::vector<PlannedJoint> joints;
  BodySettings body_settings;
  std::vector<EffectPlan> effects;

  /// Frame n = 1, 2, ... shows this moment [s].
  Real frame_time(int n) const { return n * time_scale / fps; }
};

/// Reads the tables [film], [terrain], [[obstacle]], [[body]], [[joint]], [bodies] and one for each effect of kinds that the scene names.
/// Where it names none, the kind of_solids steps its bodies and obstacles. Faults stay in root: the caller reads on and calls root.finish().
Scene read_scene(Parameters& root, std::span<const EffectKind> kinds);

}  // namespace effuse::flow
