#pragma once

#include <memory>
#include <string>
#include <vector>

#include "flow/effects/registry.h"
#include "flow/scene/simulation.h"
#include "geometry/base/error.h"
#include "geometry/terrain/plane.h"
#include "importers/scene/scene_file.h"

/// Scenes of one effect, for its tests.
namespace effuse::flow {

/// A scene of the text over level ground at the map's origin, 24 frames a second.
struct SmallScene {
  Node node;
  Scene scene;
  geometry::Terrain terrain;
  std::vector<PlacedObstacle> obstacles;
  std::unique_ptr<Simulation> simulation;

  explicit SmallScene(const std::string& text, const Vec3& origin = Vec3::Zero())
      : node(importers::read_scene_text("[film]\nframes = 9999\n[terrain]\nplane = { size = [100, 100] }\n" + text, "test.toml")),
        terrain(geometry::Terrain::from_height_field(geometry::make_plane(Vec2(100, 100)), {origin, ""})) {
    Parameters root(node);
    scene = read_scene(root, effect_kinds());
    root.finish();
    std::vector<Fault> faults;
    for (const PlannedObstacle& plan : scene.obstacles) place_obstacle(plan, mesh_of(plan), terrain, obstacles, faults);
    World world{&terrain, 1, &obstacles};
    world.mesh = [](const PlannedForm&) { return geometry::TriMesh(); };
    simulation = std::make_unique<Simulation>(scene, world);
  }
  void frames(int n) {
    for (int k = 0; k < n; ++k) simulation->advance([] { return true; });
  }
  geometry::TriMesh mesh() const { return simulation->effects()[0]->meshes().at(0).mesh; }
  double figure(const std::string& name) const {
    for (const auto& [key, value] : simulation->effects()[0]->figures())
      if (key == name) return value;
    return -1;
  }
};

/// What is wrong with it; "": nothing.
inline std::string fault_of(const std::string& text) {
  try {
    SmallScene scene(text);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

}  // namespace effuse::flow
