#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "flow/scene/scene.h"
#include "flow/scene/simulation.h"
#include "geometry/terrain/terrain.h"
#include "importers/read_apart.h"
#include "samples/budget/forecast.h"
#include "samples/effuse/commands.h"
#include "samples/effuse/solid_things.h"
#include "skin/scene/skin_settings.h"

namespace effuse {

/// A scene file, read to the end: its settings, its terrain, and the simulation built from both.
struct LoadedScene {
  flow::Scene scene;
  skin::SkinSettings skin;
  std::string resolved;  ///< TOML, every default filled in
  std::string key;       ///< hash of what the simulation's state depends on: for checkpoints
  std::optional<geometry::Terrain> terrain;
  SolidThings solids;  ///< the simulation refers to them
  std::vector<std::string> notes;  ///< of the imports
  std::optional<budget::Forecast> forecast;  ///< where the scene says how right it is to be: what was chosen for that, and what it will come to
  double rehearsal_seconds = 0, rehearsal_processor_seconds = 0;  ///< that this took
  std::unique_ptr<flow::Simulation> simulation;
};

/// Throws InputError with every fault of the scene, the terrain's file among them; nothing is written. A scene with [accuracy] is rehearsed
/// (budget::forecast), which takes some seconds.
/// overrides: key=value each; frames > 0 replaces film.frames.
/// limits: of its terrain's and meshes' files.
std::unique_ptr<LoadedScene> load_scene(const std::filesystem::path& file, const std::vector<std::string>& overrides, int frames, const importers::ReadLimits& limits = {true, 0, 0});

/// As --read-limit says; files are read in processes of their own.
importers::ReadLimits read_limits(const CommonOptions& common);

}  // namespace effuse
