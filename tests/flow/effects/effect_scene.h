#pragma once

#include <memory>
#include <string>
#include <vector>

#include "flow/effects/registry.h"
#include "flow/scene/placing.h"
#include "flow/scene/simulation.h"
#include "geometry/base/error.h"
#include "geometry/procedural/primitives.h"
#include "geometry/terrain/plane.h"
#include "importers/scene/scene_file.h"

/// A scene of a few lines over a plane, 24 frames a second, for tests of effects. Files hold a level sheet, two metres wide.
namespace effuse::flow {

struct EffectScene {
  Node node;
  Scene scene;
  geometry::Terrain terrain;
  std::vector<PlacedObstacle> obstacles;
  std::vector<PlacedBody> bodies;
  std::unique_ptr<Simulation> simulation;

  explicit EffectScene(const std::string& text, Real slope = 0)
      : node(importers::read_scene_text("[film]\nframes = 9999\n[terrain]\nplane = { size = [40, 40] }\n" + text, "test.toml")),
        terrain(geometry::Terrain::from_height_field(geometry::make_plane(Vec2(40, 40), slope, 0))) {
    Parameters root(node);
    scene = read_scene(root, effect_kinds());
    root.finish();
    std::vector<Fault> faults;
    for (const PlannedObstacle& plan : scene.obstacles) place_obstacle(plan, mesh_of(plan), terrain, obstacles, faults);
    for (const PlannedBody& plan : scene.bodies) place_body(plan, mesh_of(plan), terrain, bodies, faults);
    World world{&terrain, 1, &obstacles, &bodies, nullptr, scene.body_settings};
    world.mesh = [](const PlannedForm&) { return geometry::make_grid(Vec3(-1, -1, 0), Vec2(0.25, 0.25), 8, 8); };
    for (const EffectPlan& plan : scene.effects)
      for (const Fault& fault : plan.misfits ? plan.misfits(world) : std::vector<Fault>()) faults.push_back(fault);
    if (!faults.empty()) throw InputError(faults);
    simulation = std::make_unique<Simulation>(scene, world);
  }
  void frames(int n) {
    for (int k = 0; k < n; ++k) simulation->advance([] { return true; });
  }
  const Effect& effect(const std::string& name) const {
    for (const auto& each : simulation->effects())
      if (each->name() == name) return *each;
    throw std::runtime_error("no effect " + name);
  }
  double figure(const std::string& name, const std::string& key) const {
    for (const auto& [k, value] : effect(name).figures())
      if (k == key) return value;
    throw std::runtime_error("no figure " + key);
  }
};

/// What is said of a scene; "" of a sound one.
inline std::string fault_of(const std::string& text, Real slope = 0) {
  try {
    EffectScene scene(text, slope);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

inline bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// Whether a run that was saved and loaded after `first` frames goes on to the same bits.
inline bool resumes(const std::string& text, int first, int then, Real slope = 0) {
  EffectScene straight(text, slope), again(text, slope);
  straight.frames(first);
  again.simulation->restore(straight.simulation->checkpoint("key"), "key", "checkpoint");
  straight.frames(then);
  again.frames(then);
  return straight.simulation->state_hash() == again.simulation->state_hash();
}

}  // namespace effuse::flow
