#include "flow/scene/scene.h"

#include <fmt/format.h>

#include <cmath>

namespace effuse::flow {

namespace {
/// Of bodies alone: thousand boulders on a mountain take 10 us a body and step.
Estimate estimate_bodies(const BodySettings& settings, std::size_t bodies, Real duration) {
  Estimate e;
  e.steps = std::ceil(duration / settings.step);
  e.seconds = e.steps * (1e-5 + 1e-5 * static_cast<Real>(bodies) * settings.substeps / 4);
  e.bytes = 5e3 * static_cast<Real>(bodies);
  return e;
}
}  // namespace

Scene read_scene(Parameters& root, std::span<const EffectKind> kinds) {
  Scene scene;
  root.integer("format", 1, 1, 1, "version of the scene format");
  scene.name = root.text("name", "", "title, for people");
  scene.seed = static_cast<std::uint64_t>(root.integer("seed", 1, 0, std::numeric_limits<std::int64_t>::max(), "same seed, same bits"));

  Parameters film = root.table("film", "how long and how fast");
  scene.frames = static_cast<int>(film.integer("frames", std::nullopt, 1, 9999, "frames to make"));
  scene.fps = film.number("fps", "1/s", 24, Parameters::positive(), "frames a second of film");
  scene.time_scale = film.number("time_scale", "", 1, Parameters::positive(), "simulated seconds a second of film: 30 is a time lapse");

  Parameters terrain = root.table("terrain", "the ground");
  Parameters plane = terrain.table("plane", "flat ground about the origin, instead of a file");
  if (terrain.has("plane")) {
    const std::vector<Real> size = plane.numbers("size", "m", 2, true, "along x and y");
    scene.plane.emplace();
    scene.plane->size = Vec2(size[0], size[1]);
    if (plane.has("size") && !(scene.plane->size.minCoeff() >= 1e-2 && scene.plane->size.maxCoeff() <= 1e6)) plane.fault("size", "must be from 0.01 to 1e6 m");
    scene.plane->slope = plane.number("slope", "rad", 0, {0, 1.5}, "of the ground");
    scene.plane->downhill = plane.number("downhill", "rad", 0, {}, "the way it falls, counter-clockwise from east");
    if (terrain.has("file")) {
      terrain.text("file", "", "");
      terrain.fault("file", "found with plane, wanted one or the other");
    }
  }
  if (!scene.plane) scene.terrain_file = terrain.text("file", std::nullopt, "DEM grid or mesh, relative to the scene file; or [terrain.plane]");
  scene.terrain_place = terrain.place("file");
  if (terrain.has("file") && (scene.terrain_file.empty() || scene.terrain_file.find('\0') != std::string::npos)) terrain.fault("file", "is not the name of a file");
  scene.terrain_crs = terrain.text("crs", "", "coordinate system, when the file says none or a wrong one");
  scene.ground_temperature = terrain.number("temperature", "K", 288.15, {0, 5000, true}, "of the ground");

  scene.obstacles = read_obstacles(root);
  scene.bodies = read_bodies(root, scene.seed);
  scene.joints = read_joints(root, scene.obstacles, scene.bodies);
  if (root.has("bodies") || !scene.bodies.empty()) {
    Parameters bodies = root.table("bodies", "how rigid bodies are stepped");
    scene.body_settings = read_body_settings(bodies);
    if (scene.bodies.empty()) root.fault("bodies", "says how rigid bodies are stepped, and the scene has none: [[body]] makes one");
  }

  for (const EffectKind& kind : kinds) {
    if (kind.of_solids || !root.has(kind.name)) continue;
    Parameters table = root.table(kind.name, kind.what);
    scene.effects.push_back(kind.read(table, scene.frame_time(scene.frames)));
  }
  if (scene.effects.empty() && !(scene.obstacles.empty() && scene.bodies.empty())) {
    const Node nothing;
    Parameters told(nothing);  // its own table has been read
    for (const EffectKind& kind : kinds) {
      if (!kind.of_solids) continue;
      scene.effects.push_back(kind.read(told, scene.frame_time(scene.frames)));
      scene.effects.back().estimate = estimate_bodies(scene.body_settings, scene.bodies.size(), scene.frame_time(scene.frames));
    }
  }
  if (scene.effects.empty()) {
    std::string names;
    for (const EffectKind& kind : kinds) names += (names.empty() ? "[" : ", [") + (kind.of_solids ? "[body]" : kind.name) + "]";
    root.fault("", fmt::format("the scene names no effect, wanted at least one of {}", names));
  }
  return scene;
}

}  // namespace effuse::flow
