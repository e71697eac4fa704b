#include "samples/effuse/load_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <ctime>

#include "flow/effects/registry.h"
#include "geometry/terrain/plane.h"
#include "geometry/base/hash.h"
#include "geometry/base/zones.h"
#include "importers/scene/jello_scene.h"
#include "importers/scene/scene_file.h"
#include "importers/terrain/import_dem.h"
#include "importers/terrain/import_terrain.h"
#include "importers/worlds/jello_world.h"
#include "samples/effuse/flow_writer.h"
#include "samples/effuse/misspelt.h"
#include "samples/effuse/solid_things.h"
#include "samples/effuse/terrain_options.h"

namespace effuse {

namespace {
/// Tables of a scene that may name files, each by its key `file`: things, and emitters within particles.
std::vector<flow::Node*> tables_with_files(const std::string& name, flow::Node& table) {
  std::vector<flow::Node*> all;
  const bool things = name == "obstacle" || name == "body" || name == "springs" || name == "elastic" || name == "figure";
  for (flow::Node& one : table.items) {
    if (things) all.push_back(&one);
    if (name != "particles") continue;
    for (auto& [key, value] : one.entries)
      if (key == "emitter")
        for (flow::Node& emitter : value.items)
          if (emitter.find("file")) all.push_back(&emitter);
  }
  return all;
}

void erase(flow::Node& table, const std::string& key) {
  for (std::size_t k = 0; k < table.entries.size(); ++k) {
    if (table.entries[k].first != key) continue;
    table.entries.erase(table.entries.begin() + static_cast<std::ptrdiff_t>(k));
    if (k < table.key_places.size()) table.key_places.erase(table.key_places.begin() + static_cast<std::ptrdiff_t>(k));
    return;
  }
}

/// The tables that decide the state of frame n, whatever the number of frames and the files made of it.
std::string state_key(const flow::Node& resolved, const geometry::Terrain& terrain, const SolidThings& solids, const flow::Simulation& start) {
  StateHash hash;
  for (const auto& [name, value] : resolved.entries) {
    if (name == "skin" || name == "output" || name == "preview" || name == "name") continue;
    flow::Node part;
    flow::Node& copy = part.set(name, value);
    if (name == "film") copy.set("frames", flow::Node{});
    // What files hold counts, not where they lie.
    if (name == "terrain") copy.set("file", flow::Node{});
    for (flow::Node* one : tables_with_files(name, copy)) one->set("file", flow::Node{});
    hash.add(importers::to_toml(part));
  }
  for (const flow::PlacedObstacle& each : solids.obstacles) {
    hash.add(std::span<const Vec3>(each.shape.mesh().positions));
    // Of a figure, its clip: of scenes' own obstacles the tables say it, too.
    for (const geometry::PoseKey& key : each.track.keys()) hash.add(std::span<const Vec3>(&key.pose.position, 1));
  }
  for (const flow::PlacedBody& each : solids.bodies) hash.add(std::span<const Vec3>(each.mesh.positions));
  hash.add(std::span<const Vec3>(terrain.mesh().positions));
  hash.add(terrain.georeference().origin.x());
  hash.add(terrain.georeference().origin.y());
  hash.add(start.state_hash());
  return hash.hex();
}
/// A scene that says how right it is to be need not say how large particles are, or says spacing = "auto": until they are chosen, any size
/// lets the rest be read.
bool leave_spacing_open(flow::Node& scene) {
  const flow::Node *quality = scene.find("quality"), *accuracy = scene.find("accuracy");
  if (!(quality && quality->text != "none") && !(accuracy && accuracy->find("front"))) return false;
  for (auto& [name, table] : scene.entries) {
    if (name != "lava" || table.kind != flow::Node::Kind::kTable) continue;
    if (const flow::Node* said = table.find("spacing"); said && !(said->kind == flow::Node::Kind::kText && said->text == "auto")) continue;
    flow::Node any;
    any.kind = flow::Node::Kind::kReal;
    any.real = 1;
    any.place = table.place;
    table.set("spacing", any);
    return true;
  }
  return false;
}
void forget_spacing(flow::Node& scene) {
  for (auto& [name, table] : scene.entries)
    if (name == "lava") erase(table, "spacing");
}
}  // namespace

importers::ReadLimits read_limits(const CommonOptions& common) {
  const importers::ReadLimits apart{true, 0, 0};
  return common.read_limit.empty() ? apart : importers::parse_read_limits(common.read_limit, apart);
}

std::unique_ptr<LoadedScene> load_scene(const std::filesystem::path& file, const std::vector<std::string>& overrides, int frames, const importers::ReadLimits& limits) {
  ZONE("load");
  flow::Node node = file.extension() == ".w" ? importers::jello_scene(importers::read_jello_world(file), file) : importers::read_scene_file(file);
  for (const std::string& assignment : overrides) importers::apply_override(node, assignment);
  if (frames > 0) importers::apply_override(node, "film.frames=" + std::to_string(frames));

  auto loaded = std::make_unique<LoadedScene>();
  std::vector<Fault> faults;
  const bool open = leave_spacing_open(node);
  std::optional<flow::Parameters> root(node);
  loaded->scene = flow::read_scene(*root, flow::effect_kinds());
  loaded->skin = skin::read_skin_settings(*root);
  try {
    root->finish();
  } catch (const InputError& error) {
    faults = error.faults();
  }

  const flow::Scene& scene = loaded->scene;
  std::vector<std::filesystem::path> terrain_paths;
  bool is_grid = false;
  if (!scene.terrain.files.empty()) {
    try {
      for (const std::string& name : scene.terrain.files) terrain_paths.push_back(std::filesystem::path(name).is_relative() ? file.parent_path() / name : std::filesystem::path(name));
      is_grid = terrain_paths.size() > 1 || importers::is_dem(terrain_paths.front());
      if (std::filesystem::exists(terrain_paths.front()))
        for (const Fault& fault : flow::misfits(*node.find("terrain"), "terrain", is_grid, scene.terrain.files.front())) faults.push_back(fault);
      importers::TerrainImport import = importers::import_terrain(terrain_paths, terrain_options(scene.terrain, limits));
      loaded->terrain = std::move(import.terrain);
      loaded->notes = std::move(import.notes);
    } catch (const InputError& error) {
      // Told at the scene's line that names the file; the file's own line and column stay in the words.
      for (const Fault& fault : error.faults()) faults.push_back({scene.terrain.place, to_string(fault)});
    }
  }
  if (const auto& plane = scene.terrain.plane; plane && plane->size.minCoeff() > 0) {
    loaded->terrain = geometry::Terrain::from_height_field(geometry::make_plane(plane->size, plane->slope, plane->downhill, 32, plane->height), {}, scene.terrain.temperature);
    loaded->notes.push_back(fmt::format("plane of {:g} x {:g} m, slope {:.3g} deg", plane->size.x(), plane->size.y(), plane->slope * 180 / kPi));
  }
  if (loaded->terrain) {
    loaded->solids.obstacles = load_obstacles(scene, {file.parent_path(), limits}, *loaded->terrain, faults, loaded->notes);
    loaded->solids.bodies = load_bodies(scene, {file.parent_path(), limits}, *loaded->terrain, faults, loaded->notes);
    SolidThings& solids = loaded->solids;
    if (solids.obstacles.size() == scene.obstacles.size() && solids.bodies.size() == scene.bodies.size())
      solids.joints = load_joints(scene, solids.obstacles, solids.bodies, *loaded->terrain, faults, loaded->notes);
    // Behind the scene's own obstacles, whose numbers joints have.
    for (flow::PlacedObstacle& bone : load_figures(scene, {file.parent_path(), limits}, *loaded->terrain, faults, loaded->notes)) solids.obstacles.push_back(std::move(bone));
  }
  const auto world = [&] {
    return flow::World{&*loaded->terrain, scene.seed, &loaded->solids.obstacles, &loaded->solids.bodies, &loaded->solids.joints, scene.body_settings,
                       [&](const flow::PlannedForm& form) { return load_form(form, {file.parent_path(), limits}, loaded->notes); }};
  };
  if (!faults.empty() && loaded->terrain) {
    for (const flow::EffectPlan& plan : scene.effects)
      for (const Fault& fault : plan.misfits(world())) faults.push_back(fault);
  }
  if (faults.empty() && loaded->terrain && scene.accuracy) {
    if (open) forget_spacing(node);
    ZONE("rehearse");
    const auto start = std::chrono::steady_clock::now();
    const std::clock_t processor = std::clock();
    loaded->forecast = budget::forecast(node, *scene.accuracy, world());
    loaded->rehearsal_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    loaded->rehearsal_processor_seconds = static_cast<double>(std::clock() - processor) / CLOCKS_PER_SEC;
    root.emplace(node);
    loaded->scene = flow::read_scene(*root, flow::effect_kinds());
    loaded->skin = skin::read_skin_settings(*root);
    root->finish();
  }
  if (faults.empty() && loaded->terrain) {
    loaded->simulation = std::make_unique<flow::Simulation>(scene, world());
    loaded->solids.make_looks();
    check_map(loaded->skin, *loaded->terrain, *loaded->simulation);
    skin::check_camera(loaded->skin, *loaded->terrain, scene.frames, scene.fps);
    check_camera_among(loaded->solids, loaded->skin, *loaded->terrain, scene);
    flow::Node resolved = root->resolved();
    // What was wanted has been chosen: the resolved scene says that, and needs no rehearsal.
    erase(resolved, "accuracy");
    erase(resolved, "quality");
    // The resolved scene is written elsewhere: there, too, it must find its files.
    const auto whole = [](const std::filesystem::path& path) {
      flow::Node node_of;
      node_of.kind = flow::Node::Kind::kText;
      node_of.text = path.string();
      return node_of;
    };
    for (auto& [name, table] : resolved.entries) {
      if (name == "terrain" && !scene.terrain.plane) {
        flow::Node files;
        files.kind = flow::Node::Kind::kArray;
        for (const std::filesystem::path& path : terrain_paths) files.items.push_back(whole(std::filesystem::absolute(path).lexically_normal()));
        table.set("file", files.items.size() == 1 ? files.items.front() : files);
        flow::drop_misfits(table, is_grid);
      }
      for (flow::Node* one : tables_with_files(name, table))
        if (const flow::Node* path = one->find("file"); path && !path->text.empty()) one->set("file", whole(std::filesystem::absolute(file.parent_path() / path->text).lexically_normal()));
    }
    loaded->resolved = importers::to_toml(resolved);
    loaded->key = state_key(resolved, *loaded->terrain, loaded->solids, *loaded->simulation);
  }
  if (!faults.empty()) {
    std::vector<std::string> effects;
    for (const flow::EffectKind& kind : flow::effect_kinds()) effects.push_back(kind.name);
    faults = told_once(std::move(faults), effects);
    std::stable_sort(faults.begin(), faults.end(), [](const Fault& a, const Fault& b) { return a.place.line < b.place.line; });
    throw InputError(faults);
  }
  return loaded;
}

}  // namespace effuse
