#include "samples/study/validation/mountain.h"

#include <filesystem>

#include "flow/effects/registry.h"
#include "geometry/base/error.h"
#include "importers/scene/scene_file.h"
#include "importers/terrain/import_terrain.h"
#include "samples/effuse/terrain_options.h"

namespace effuse::study {

namespace fs = std::filesystem;

std::unique_ptr<LoadedScene> load_scene(const std::string& file, const std::vector<std::string>& overrides, const std::optional<geometry::Terrain>& instead) {
  const fs::path folder = fs::path(__FILE__).parent_path().parent_path().parent_path() / "scenes";
  auto loaded = std::make_unique<LoadedScene>();
  loaded->root = importers::read_scene_file(folder / file);
  for (const std::string& assignment : overrides) importers::apply_override(loaded->root, assignment);
  flow::Parameters root(loaded->root);
  loaded->scene = flow::read_scene(root, flow::effect_kinds());
  if (!root.faults().empty()) throw InputError(root.faults());
  const flow::Scene& scene = loaded->scene;
  loaded->terrain = instead ? *instead : importers::import_terrain(folder / scene.terrain.files.at(0), terrain_options(scene.terrain)).terrain;
  loaded->simulation = std::make_unique<flow::Simulation>(scene, flow::World{&*loaded->terrain, scene.seed});
  return loaded;
}

}  // namespace effuse::study
