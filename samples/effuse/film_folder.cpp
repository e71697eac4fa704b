#include "samples/effuse/film_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "importers/mesh/glb_attributes.h"
#include "importers/mesh/import_mesh.h"
#include "importers/mesh/mesh_frame.h"
#include "importers/mesh/ply_reader.h"
#include "importers/scene/scene_file.h"
#include "samples/effuse/views.h"
#include "skin/scene/skin_settings.h"

namespace effuse {

namespace fs = std::filesystem;
using geometry::TriMesh;

namespace {

struct FrameName {
  std::string name, extension;
  int frame = 0;
};

/// "skin.0012.ply"; not "skin.0012.part.ply".
std::optional<FrameName> frame_name(const std::string& file) {
  const std::size_t ending = file.rfind('.');
  const std::size_t number = ending == std::string::npos || ending == 0 ? std::string::npos : file.rfind('.', ending - 1);
  if (number == std::string::npos || number == 0 || ending - number < 5) return std::nullopt;
  FrameName found{file.substr(0, number), file.substr(ending), 0};
  const char* end = file.data() + ending;
  const auto [stop, error] = std::from_chars(file.data() + number + 1, end, found.frame);
  if (error != std::errc() || stop != end || found.frame < 1) return std::nullopt;
  return found;
}

/// "3, 5-9"
std::string ranges(const std::vector<int>& numbers) {
  std::string text;
  for (std::size_t k = 0; k < numbers.size();) {
    std::size_t end = k;
    while (end + 1 < numbers.size() && numbers[end + 1] == numbers[end] + 1) ++end;
    text += (text.empty() ? "" : ", ") + (end > k ? fmt::format("{}-{}", numbers[k], numbers[end]) : std::to_string(numbers[k]));
    k = end + 1;
  }
  return text;
}

void list_frames(FilmFolder& run) {
  std::map<std::string, FilmFolder::Sequence> all;
  std::error_code error;
  for (fs::directory_iterator at(run.folder / "frames", error), end; !error && at != end; at.increment(error)) {
    const std::optional<FrameName> name = frame_name(at->path().filename().string());
    if (!name || (name->extension != ".ply" && name->extension != ".glb")) continue;
    FilmFolder::Sequence& sequence = all[name->name];
    sequence.name = name->name;
    fs::path& file = sequence.files[name->frame];
    if (file.empty() || name->extension == ".ply") file = at->path();
    run.last_frame = std::max(run.last_frame, name->frame);
  }
  for (auto& [name, sequence] : all) run.sequences.push_back(std::move(sequence));
  std::stable_partition(run.sequences.begin(), run.sequences.end(), [](const FilmFolder::Sequence& s) { return s.name == "skin"; });
}

void note_gaps(FilmFolder& run, int promised) {
  const int frames = std::max(run.last_frame, promised);
  for (const FilmFolder::Sequence& sequence : run.sequences) {
    std::vector<int> missing;
    for (int frame = 1; frame <= frames; ++frame)
      if (!sequence.files.contains(frame)) missing.push_back(frame);
    if (!missing.empty()) run.notes.push_back(fmt::format("{}: {}: no file of frame{} {}, left out", (run.folder / "frames").string(), sequence.name, missing.size() > 1 ? "s" : "", ranges(missing)));
  }
}

/// What manifest.json says; the frames it promises. Throws what its parser does.
int read_manifest(FilmFolder& run) {
  const nlohmann::json m = nlohmann::json::parse(read_file(run.folder / "manifest.json"));
  FilmFolder said = run;
  said.name = m.at("name").get<std::string>();
  said.fps = m.at("fps").get<Real>();
  said.time_scale = m.at("time_scale").get<Real>();
  for (int k = 0; k < 3; ++k) said.origin[k] = m.at("origin").at(static_cast<std::size_t>(k)).get<Real>();
  said.crs = m.at("crs").get<std::string>();
  if (!(said.fps > 0 && said.time_scale > 0 && std::isfinite(said.fps) && std::isfinite(said.time_scale) && said.origin.allFinite())) throw std::runtime_error("fps, time_scale or origin is no number that can be");
  const int frames = m.at("frames").get<int>();
  if (m.contains("camera")) {
    said.views = views_of(m.at("camera").at("keys").dump());
    said.aspect = m.at("camera").at("width").get<Real>() / m.at("camera").at("height").get<Real>();
  }
  run = std::move(said);
  return std::clamp(frames, 0, 99999);
}

/// Of scene.toml what is there; faults of it are somebody else's business.
void read_scene_toml(FilmFolder& run, bool film_too) {
  try {
    flow::Node node = importers::read_scene_file(run.folder / "scene.toml");
    if (film_too) {
      if (const flow::Node* name = node.find("name")) run.name = name->text;
      flow::Parameters scene(node);
      flow::Parameters film = scene.table("film", "");
      run.fps = film.number("fps", "", run.fps, {1e-3, 1e4}, "");
      run.time_scale = film.number("time_scale", "", run.time_scale, {1e-6, 1e9}, "");
    }
    flow::Parameters root(node);
    run.color = skin::read_skin_settings(root).color;
  } catch (const InputError& error) {
    run.notes.push_back(fmt::format("{}; taken: {} frames a second of film, {} s of lava each", error.what(), run.fps, run.time_scale));
  }
}

/// Origin and CRS as a frame's own comments have them.
void read_place(FilmFolder& run) {
  const fs::path& file = !run.stills.empty() ? run.stills.begin()->second : run.sequences.front().files.begin()->second;
  const importers::MeshFrame frame = importers::frame_of_own_file(read_file(file), file.extension().string());
  run.origin = frame.origin;
  run.crs = frame.crs;
}

TriMesh mesh_of(const importers::PlyMesh& ply, const std::string& name) {
  TriMesh mesh;
  mesh.positions = ply.positions;
  mesh.normals = ply.normals;
  mesh.attributes = ply.attributes;
  for (std::size_t f = 0; f + 1 < ply.face_start.size(); ++f) {
    const std::size_t begin = ply.face_start[f];
    if (ply.face_start[f + 1] - begin != 3) throw InputError({name}, "has faces that are no triangles: effuse has not written it");
    mesh.triangles.push_back({ply.corners[begin], ply.corners[begin + 1], ply.corners[begin + 2]});
  }
  return mesh;
}

}  // namespace

skin::Metadata FilmFolder::metadata(int frame) const {
  return {{"generator", "effuse"},
          {"scene", name},
          {"frame", std::to_string(frame)},
          {"time_s", fmt::format("{}", frame > 0 ? time_of(frame) : 0)},
          {"origin", fmt::format("{:.17g} {:.17g} {:.17g}", origin.x(), origin.y(), origin.z())},
          {"crs", crs},
          {"units", "metres, seconds, kelvin"}};
}

FilmFolder read_film_folder(const fs::path& folder) {
  std::error_code error;
  const Place place{folder.string()};
  if (!fs::exists(folder, error)) throw InputError(place, "no such folder");
  if (!fs::is_directory(folder, error)) throw InputError(place, "is a file, wanted the folder of a run");
  FilmFolder run;
  run.folder = folder;
  list_frames(run);
  const auto moves = [&](const std::string& name) { return std::any_of(run.sequences.begin(), run.sequences.end(), [&](const FilmFolder::Sequence& s) { return s.name == name; }); };
  for (const std::string name : {"terrain", "obstacles"})
    for (const char* extension : {".glb", ".ply"})
      if (fs::exists(folder / (name + extension), error) && !moves(name)) run.stills[name] = folder / (name + extension);
  if (run.sequences.empty() && !fs::exists(folder / "manifest.json", error) && !fs::exists(folder / "scene.toml", error))
    throw InputError(place, "holds no run: neither manifest.json nor scene.toml nor frames/NAME.####.ply or .glb");
  int promised = 0;
  try {
    promised = read_manifest(run);
    read_scene_toml(run, false);
  } catch (const std::exception& problem) {
    run.notes.push_back(fmt::format("{}: missing or damaged ({}): fps and time scale are taken of scene.toml, the origin of a frame's comments", (folder / "manifest.json").string(), problem.what()));
    read_scene_toml(run, true);
    if (!run.stills.empty() || !run.sequences.empty()) read_place(run);
  }
  note_gaps(run, promised);
  return run;
}

TriMesh read_frame(const FilmFolder& run, const fs::path& file) {
  const std::string name = file.string();
  const std::string bytes = read_file(file);
  TriMesh mesh;
  if (file.extension() == ".ply") {
    mesh = mesh_of(importers::parse_ply(bytes, name), name);
  } else {
    std::vector<std::string> notes;
    if (importers::read_glb_primitives(bytes, name, notes).empty()) return mesh;  // before the lava comes
    mesh = importers::import_mesh(file).mesh;
    // Glow is a texture there: made anew of what it was made of.
    if (mesh.attributes.contains("temperature") && mesh.attributes.contains("detail")) skin::color_lava(mesh, run.color);
  }
  for (const char* label : {"region", "region_high"}) mesh.attributes.erase(label);
  return mesh;
}

}  // namespace effuse
