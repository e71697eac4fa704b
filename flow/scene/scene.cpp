#include "flow/scene/scene.h"

#include <fmt/format.h>

namespace effuse::flow {

Scene read_scene(Parameters& root, std::span<const EffectKind> kinds) {
  Scene scene;
  root.integer("format", 1, 1, 1, "version of the scene format");
  scene.name = root.text("name", "", "title, for people");
  scene.seed = static_cast<std::uint64_t>(root.integer("seed", 1, 0, std::numeric_limits<std::int64_t>::max(), "same seed, same bits"));

  Parameters film = root.table("film", "how long and how fast");
  scene.frames = static_cast<int>(film.integer("frames", std::nullopt, 1, 9999, "frames to make"));
  scene.fps = film.number("fps", "1/s", 24, Parameters::positive(), "frames a second of film");
  scene.time_scale = film.number("time_scale", "", 1, Parameters::positive(), "simulated seconds a second of film: 30 is a time lapse");

  scene.terrain = read_terrain_settings(root);

  scene.obstacles = read_obstacles(root);
  scene.bodies = read_bodies(root);

  for (const EffectKind& kind : kinds) {
    if (!root.has(kind.name)) continue;
    Parameters table = root.table(kind.name, kind.what);
    scene.effects.push_back(kind.read(table, scene.frame_time(scene.frames)));
  }
  if (scene.effects.empty()) {
    std::string names;
    for (const EffectKind& kind : kinds) names += (names.empty() ? "[" : ", [") + kind.name + "]";
    root.fault("", fmt::format("the scene names no effect, wanted at least one of {}", names));
  }
  return scene;
}

}  // namespace effuse::flow
