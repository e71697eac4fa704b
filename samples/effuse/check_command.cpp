#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "flow/effects/registry.h"
#include "geometry/base/log.h"
#include "geometry/base/parallel.h"
#include "samples/effuse/accuracy_report.h"
#include "samples/effuse/commands.h"
#include "samples/effuse/cost.h"
#include "samples/effuse/load_scene.h"

namespace effuse {

namespace {
/// "2 obstacles, 10 bodies of 5000 kg, 1 joint: 5132 triangles, 7 MB of memory"
std::string told(const SolidThings& solids) {
  std::string text;
  const auto add = [&](std::size_t n, const char* one, const char* many) {
    if (n > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", n, n == 1 ? one : many);
  };
  add(solids.obstacles.size(), "obstacle", "obstacles");
  add(solids.bodies.size(), "body", "bodies");
  double mass = 0;
  for (const flow::PlacedBody& each : solids.bodies) mass += each.volume * each.density;
  if (mass > 0) text += fmt::format(" of {:.4g} kg", mass);
  add(solids.joints.size(), "joint", "joints");
  return text + fmt::format(": {} triangles, {} of memory", solids.triangles(), bytes_text(solids.memory()));
}
}  // namespace

ExitCode check(const CheckCommand& command, const CommonOptions& common) {
  const std::unique_ptr<LoadedScene> loaded = load_scene(command.scene, command.set, 0, read_limits(common));
  const flow::Scene& scene = loaded->scene;
  std::string why;
  const budget::Machine machine = budget::known_machine(why);
  const Cost cost = cost_of(*loaded, machine);
  const flow::Estimate& sum = cost.sum;
  std::string simulated, left_out;
  for (const flow::EffectPlan& plan : scene.effects) {
    simulated += (simulated.empty() ? "" : ", ") + (plan.name == plan.kind ? plan.name : fmt::format("{} ({})", plan.name, plan.kind));
  }
  for (const flow::EffectKind& kind : flow::effect_kinds()) {
    bool named = false;
    for (const flow::EffectPlan& plan : scene.effects) named |= plan.kind == kind.name;
    if (!named && !kind.of_solids) left_out += (left_out.empty() ? "" : ", ") + kind.name;
  }
  const SolidThings& solids = loaded->solids;

  if (common.json) {
    nlohmann::ordered_json j;
    j["scene"] = scene.name;
    j["ok"] = true;
    j["frames"] = scene.frames;
    j["simulated_s"] = scene.frame_time(scene.frames);
    j["effects"] = nlohmann::ordered_json::array();
    for (const flow::EffectPlan& plan : scene.effects)
      j["effects"].push_back({{"name", plan.name}, {"kind", plan.kind}, {"particles", plan.estimate.particles}, {"memory_bytes", plan.estimate.bytes}, {"steps", plan.estimate.steps}, {"seconds", plan.estimate.seconds}});
    j["seconds"] = cost.seconds;
    j["memory_bytes"] = cost.memory;
    j["disk_bytes"] = cost.disk;
    j["solids"] = {{"obstacles", solids.obstacles.size()}, {"bodies", solids.bodies.size()}, {"joints", solids.joints.size()}, {"triangles", solids.triangles()}, {"memory_bytes", solids.memory()}};
    j["terrain"] = loaded->notes;
    if (loaded->forecast) j["accuracy"] = nlohmann::ordered_json::parse(accuracy_json(*loaded->forecast, cost, why));
    print_document(j.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
    return ExitCode::kDone;
  }
  fmt::print("{}: sound\n", command.scene.string());
  for (const std::string& note : loaded->notes) fmt::print("  terrain      {}\n", note);
  fmt::print("  film         {} frames at {} a second, {:.1f} s of film, {:.0f} s simulated\n", scene.frames, scene.fps, scene.frames / scene.fps, scene.frame_time(scene.frames));
  fmt::print("  simulated    {}\n", simulated);
  fmt::print("  not asked    {}\n", left_out.empty() ? "-" : left_out);
  if (solids.any()) fmt::print("  solids       {}\n", told(solids));
  if (sum.particles > 0) fmt::print("  particles    about {:.0f} at the end\n", sum.particles);
  if (sum.drawn > 0) fmt::print("  drawn        about {:.0f} particles one by one\n", sum.drawn);
  if (sum.cells > 0) fmt::print("  cells        about {:.0f} of grids\n", sum.cells);
  for (const auto& effect : loaded->simulation->effects())
    for (const std::string& remark : effect->remarks()) fmt::print("  {:<12} {}\n", effect->name(), remark);
  if (loaded->forecast)
    for (const auto& [name, text] : told(*loaded->forecast)) fmt::print("  {:<12} {}\n", name, text);
  fmt::print("  steps        about {:.0f}\n", sum.steps);
  fmt::print("  memory       about {} at the end, {} of it the simulation's\n", bytes_text(cost.memory), bytes_text(sum.bytes));
  fmt::print("  disk         about {}\n", bytes_text(cost.disk));
  if (cost.rehearsed) fmt::print("  time         about {} on {} threads, {} of it the lava's steps ({})\n", time_text(cost.seconds), thread_count(), time_text(cost.lava_seconds), why);
  else fmt::print("  time         about {:.0f} s on two cores (within a factor of two)\n", cost.seconds);
  return ExitCode::kDone;
}

}  // namespace effuse
