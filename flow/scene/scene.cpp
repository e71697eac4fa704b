#include "flow/scene/scene.h"

#include <fmt/format.h>

#include <algorithm>
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

/// A fault for each partner of an effect that the scene does not have.
void require_partners(Parameters& root, const std::vector<EffectPlan>& effects) {
  for (const EffectPlan& plan : effects)
    for (const Partner& partner : plan.partners) {
      std::vector<std::string> fitting;
      for (const EffectPlan& other : effects)
        if (std::find(partner.kinds.begin(), partner.kinds.end(), other.kind) != partner.kinds.end()) fitting.push_back(other.name);
      if (partner.name.empty() ? !fitting.empty() : std::find(fitting.begin(), fitting.end(), partner.name) != fitting.end()) continue;
      std::string kinds;
      for (const std::string& kind : partner.kinds) kinds += (kinds.empty() ? "[" : " or [") + kind + "]";
      if (partner.name.empty()) root.fault_at(partner.place, fmt::format("{}: {}, and the scene has no {}", partner.path, partner.what, kinds));
      else {
        const std::string near = nearest_name(partner.name, fitting);
        root.fault_at(partner.place, fmt::format("{}: names '{}', no {} of the scene{}", partner.path, partner.name, kinds, near.empty() ? "" : fmt::format(" (did you mean {}?)", near)));
      }
    }
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

  scene.accuracy = read_accuracy(root);
  scene.terrain = read_terrain_settings(root);

  scene.obstacles = read_obstacles(root);
  scene.figures = read_figures(root);
  scene.bodies = read_bodies(root, scene.seed);
  scene.joints = read_joints(root, scene.obstacles, scene.bodies);
  if (root.has("bodies") || !scene.bodies.empty()) {
    Parameters bodies = root.table("bodies", "how rigid bodies are stepped");
    scene.body_settings = read_body_settings(bodies);
    if (scene.bodies.empty()) root.fault("bodies", "says how rigid bodies are stepped, and the scene has none: [[body]] makes one");
  }

  for (const EffectKind& kind : kinds) {
    if (kind.of_solids || !root.has(kind.name)) continue;
    if (!kind.many) {
      Parameters table = root.table(kind.name, kind.what);
      scene.effects.push_back(kind.read(table, scene.frame_time(scene.frames)));
      scene.effects.back().kind = kind.name;
      continue;
    }
    for (Parameters& table : root.tables(kind.name, kind.what)) {
      EffectPlan plan = kind.read(table, scene.frame_time(scene.frames));
      plan.kind = kind.name;
      if (std::any_of(scene.effects.begin(), scene.effects.end(), [&](const EffectPlan& other) { return other.name == plan.name; }))
        table.fault("name", fmt::format("'{}' is the name of another effect, wanted one of its own: files are called by it", plan.name));
      scene.effects.push_back(std::move(plan));
    }
  }
  // Lava moves bodies with itself. Beside other effects they move before these, which meet them where they are then.
  const bool lava = std::any_of(scene.effects.begin(), scene.effects.end(), [](const EffectPlan& plan) { return plan.kind == "lava"; });
  if ((!lava && !scene.bodies.empty()) || (scene.effects.empty() && !(scene.obstacles.empty() && scene.figures.empty()))) {
    const Node nothing;
    Parameters told(nothing);  // its own table has been read
    for (const EffectKind& kind : kinds) {
      if (!kind.of_solids) continue;
      EffectPlan plan = kind.read(told, scene.frame_time(scene.frames));
      plan.kind = kind.name;
      plan.estimate = estimate_bodies(scene.body_settings, scene.bodies.size(), scene.frame_time(scene.frames));
      scene.effects.insert(scene.effects.begin(), std::move(plan));
    }
  }
  require_partners(root, scene.effects);
  if (scene.accuracy && std::none_of(scene.effects.begin(), scene.effects.end(), [](const EffectPlan& plan) { return plan.kind == "lava"; }))
    root.fault_at(scene.accuracy->place, "is of the lava's front, and the scene has no [lava]");
  if (scene.effects.empty()) {
    std::string names;
    for (const EffectKind& kind : kinds) names += (names.empty() ? "[" : ", [") + (kind.of_solids ? "[body]" : kind.name) + "]";
    root.fault("", fmt::format("the scene names no effect, wanted at least one of {}", names));
  }
  return scene;
}

}  // namespace effuse::flow
