#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "flow/scene/scene.h"
#include "flow/scene/simulation.h"
#include "geometry/terrain/terrain.h"

/// The sample scenes, for studies of the flow alone.
namespace effuse::study {

struct LoadedScene {
  flow::Scene scene;
  std::optional<geometry::Terrain> terrain;
  flow::Node root;
  std::unique_ptr<flow::Simulation> simulation;
};

/// A scene of samples/scenes in the tree this was built from, its skin and output left unread. overrides: "key=value" each. instead: of its
/// terrain, if given.
std::unique_ptr<LoadedScene> load_scene(const std::string& file, const std::vector<std::string>& overrides, const std::optional<geometry::Terrain>& instead = {});

}  // namespace effuse::study
