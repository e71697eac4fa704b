#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>

#include "flow/effects/registry.h"
#include "geometry/base/log.h"
#include "importers/scene/scene_file.h"
#include "samples/effuse/commands.h"
#include "samples/effuse/load_scene.h"

namespace effuse {

namespace {
std::string bytes(double b) {
  if (b < 1e6) return fmt::format("{:.0f} kB", b / 1e3);
  return b < 1e9 ? fmt::format("{:.0f} MB", b / 1e6) : fmt::format("{:.1f} GB", b / 1e9);
}

/// Triangles of a skin: of the level set's mesh twenty a particle at voxels of half a spacing, as Maunga Whau's thin flow has them
/// (thicker ones have fewer), and refined to edges. By pixels: no finer.
double triangles(double particles, const skin::SkinSettings& s) {
  const double meshed = std::pow(0.5 / s.voxel, 2), edge = s.detail.edge;
  if (s.detail.kind != skin::SkinKind::kNoise) return 20 * particles * std::max(meshed, 0.19 / (edge * edge));
  // All in fours until they are fine enough, three times at most (refine_for).
  double fours = 1;
  for (double mean = 1.15 * s.voxel; mean > 1.7 * edge && fours < 64; mean /= 2) fours *= 4;
  return 20 * particles * meshed * fours;
}

/// Bytes a frame's files take, as Maunga Whau's do: a vertex for two triangles.
double disk_per_frame(double particles, const skin::SkinSettings& s) {
  return triangles(particles, s) * (57 * s.ply + 82 * s.obj + 57 * s.glb) + particles * 400 * std::pow(0.5 / s.voxel, 2) * s.vdb + (s.preview ? 1.2 * s.picture.width * s.picture.height : 0);
}

/// Bytes beyond the effects': the program with its libraries, the terrain, and the skin of the last frame as it is made, written and
/// drawn. Measured on Maunga Whau at edges of 0.5, 0.25 and 0.15 with one format, all, and pictures: within a quarter, voronoi too.
double memory_of_skin(double particles, std::size_t posts, const skin::SkinSettings& s) {
  double bytes = 79e6 + static_cast<double>(posts) * (s.preview ? 460 : 225);
  if (!s.ply && !s.obj && !s.glb && !s.vdb && !s.preview) return bytes;
  bytes += particles * (3500 * std::pow(0.5 / s.voxel, 2) + (s.detail.kind == skin::SkinKind::kNoise ? 0 : 5000));
  bytes += triangles(particles, s) * (155 + 40 * s.obj + 60 * s.glb + 40 * s.preview);
  return bytes + (s.preview ? 25.0 * s.picture.width * s.picture.height : 0);
}

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
  return text + fmt::format(": {} triangles, {} of memory", solids.triangles(), bytes(solids.memory()));
}
}  // namespace

ExitCode check(const CheckCommand& command, const CommonOptions& common) {
  const std::unique_ptr<LoadedScene> loaded = load_scene(command.scene, command.set, 0, read_limits(common));
  const flow::Scene& scene = loaded->scene;
  flow::Estimate sum;
  std::string simulated, left_out;
  for (const flow::EffectPlan& plan : scene.effects) {
    sum.particles += plan.estimate.particles;
    sum.mean_particles += plan.estimate.mean_particles;
    sum.bytes += plan.estimate.bytes;
    sum.steps += plan.estimate.steps;
    sum.seconds += plan.estimate.seconds;
    sum.drawn += plan.estimate.drawn;
    sum.cells += plan.estimate.cells;
    simulated += (simulated.empty() ? "" : ", ") + (plan.name == plan.kind ? plan.name : fmt::format("{} ({})", plan.name, plan.kind));
  }
  for (const flow::EffectKind& kind : flow::effect_kinds()) {
    bool named = false;
    for (const flow::EffectPlan& plan : scene.effects) named |= plan.kind == kind.name;
    if (!named && !kind.of_solids) left_out += (left_out.empty() ? "" : ", ") + kind.name;
  }
  // Skin and files of a frame, as Maunga Whau takes them: 80 us a particle, and 0.7 us a pixel for the picture.
  const double frame_s = 80e-6 * sum.mean_particles + 5e-6 * sum.drawn + (loaded->skin.preview ? 4e-8 : 2e-8) * sum.cells + (loaded->skin.preview ? 7e-7 * loaded->skin.picture.width * loaded->skin.picture.height : 0);
  const SolidThings& solids = loaded->solids;
  const bool drawn = loaded->skin.preview || (loaded->skin.ply && solids.any_moves());
  const double seconds = sum.seconds + solids.start_seconds() + scene.frames * (frame_s + (drawn ? solids.frame_seconds() : 0));
  const double disk = scene.frames * (disk_per_frame(sum.mean_particles, loaded->skin) + (loaded->skin.ply && solids.any_moves() ? 94.0 * static_cast<double>(solids.triangles()) : 0) + 40 * sum.drawn + 2 * sum.cells);
  const double memory = sum.bytes + solids.memory() + memory_of_skin(sum.particles, loaded->terrain->mesh().positions.size(), loaded->skin);

  if (common.json) {
    nlohmann::ordered_json j;
    j["scene"] = scene.name;
    j["ok"] = true;
    j["frames"] = scene.frames;
    j["simulated_s"] = scene.frame_time(scene.frames);
    j["effects"] = nlohmann::ordered_json::array();
    for (const flow::EffectPlan& plan : scene.effects)
      j["effects"].push_back({{"name", plan.name}, {"kind", plan.kind}, {"particles", plan.estimate.particles}, {"memory_bytes", plan.estimate.bytes}, {"steps", plan.estimate.steps}, {"seconds", plan.estimate.seconds}});
    j["seconds"] = seconds;
    j["memory_bytes"] = memory;
    j["disk_bytes"] = disk;
    j["solids"] = {{"obstacles", solids.obstacles.size()}, {"bodies", solids.bodies.size()}, {"joints", solids.joints.size()}, {"triangles", solids.triangles()}, {"memory_bytes", solids.memory()}};
    j["terrain"] = loaded->notes;
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
  fmt::print("  steps        about {:.0f}\n", sum.steps);
  fmt::print("  memory       about {} at the end, {} of it the simulation's\n", bytes(memory), bytes(sum.bytes));
  fmt::print("  disk         about {}\n", bytes(disk));
  fmt::print("  time         about {:.0f} s on two cores (within a factor of two)\n", seconds);
  return ExitCode::kDone;
}

namespace {

/// A parameter of an effect, and the choices that make the effect read it: "model = classic". None: it always does.
struct Listed {
  flow::ParameterDoc doc;
  std::string with;
};

/// What an effect reads is what it can be told: ask it to read a table that holds one of each list, and set `choices`.
std::vector<flow::ParameterDoc> read_docs(const flow::EffectKind& kind, const std::vector<std::string>& choices) {
  flow::Node root;
  flow::Node list;
  list.kind = flow::Node::Kind::kArray;
  list.items.emplace_back();
  root.set(kind.name, flow::Node{}).set("vent", list);
  for (const std::string& choice : choices) importers::apply_override(root, choice);
  flow::Parameters parameters(root);
  flow::Parameters effect = parameters.table(kind.name, kind.what);
  kind.read(effect, 1);
  return parameters.docs();
}

/// The names of a choice; none of anything else.
std::vector<std::string> names_of(const flow::ParameterDoc& doc) {
  std::vector<std::string> names;
  constexpr std::string_view kHead = "choice: ", kBetween = " | ";
  if (!doc.unit.starts_with(kHead) || doc.path.find('[') != std::string::npos) return names;
  std::string_view rest = std::string_view(doc.unit).substr(kHead.size());
  for (std::size_t end = 0; end != std::string_view::npos; rest.remove_prefix(std::min(rest.size(), end + kBetween.size()))) {
    end = rest.find(kBetween);
    names.emplace_back(rest.substr(0, end));
  }
  return names;
}

/// All parameters there are: those of the defaults first, then those that each other choice brings, a choice within a
/// choice too; the last choices first, so that a law's parameters are told with the law, not with a preset that has it.
std::vector<Listed> list_parameters(const flow::EffectKind& kind) {
  std::vector<Listed> all;
  const auto explore = [&](const auto& self, const std::vector<std::string>& choices) -> void {
    const std::size_t first = all.size();
    for (flow::ParameterDoc& doc : read_docs(kind, choices)) {
      const bool known = std::any_of(all.begin(), all.end(), [&](const Listed& l) { return l.doc.path == doc.path; });
      if (known) continue;
      std::string with;
      for (const std::string& choice : choices) with += (with.empty() ? "" : ", ") + choice.substr(kind.name.size() + 1);
      all.push_back({std::move(doc), std::move(with)});
    }
    const std::size_t last = all.size();
    for (std::size_t k = last; k-- > first;) {
      const flow::ParameterDoc doc = all[k].doc;
      for (const std::string& name : names_of(doc)) {
        if (name == doc.default_value) continue;
        std::vector<std::string> more = choices;
        more.push_back(doc.path + "=" + name);
        self(self, more);
      }
    }
  };
  explore(explore, {});
  return all;
}

}  // namespace

ExitCode effects(const CommonOptions& common) {
  nlohmann::ordered_json j = nlohmann::ordered_json::array();
  for (const flow::EffectKind& kind : flow::effect_kinds()) {
    nlohmann::ordered_json entries = nlohmann::ordered_json::array();
    if (!common.json) fmt::print("[{}]  {}\n", kind.name, kind.what);
    std::string with;
    for (const Listed& listed : list_parameters(kind)) {
      const flow::ParameterDoc& doc = listed.doc;
      if (common.json) {
        entries.push_back({{"path", doc.path}, {"unit", doc.unit}, {"default", doc.default_value}, {"what", doc.what}});
        if (!listed.with.empty()) entries.back()["with"] = listed.with;
        continue;
      }
      if (listed.with != with) fmt::print(" with {}:\n", listed.with);
      with = listed.with;
      fmt::print("  {:<32} {:<18} {:<18} {}\n", doc.path, doc.unit, doc.default_value.empty() ? "(required)" : doc.default_value, doc.what);
    }
    j.push_back({{"name", kind.name}, {"what", kind.what}, {"parameters", entries}});
  }
  if (common.json) print_document(j.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  return ExitCode::kDone;
}

}  // namespace effuse
