#include "samples/effuse/run_folder.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/zones.h"
#include "geometry/mesh/measure.h"
#include "importers/input_file.h"
#include "importers/mesh/import_mesh.h"
#include "importers/mesh/ply_reader.h"
#include "importers/points/import_points.h"
#include "samples/effuse/air_look.h"
#include "skin/write/read_volume.h"

namespace effuse {

namespace fs = std::filesystem;
using geometry::TriMesh;
using nlohmann::json;

namespace {

bool there(const fs::path& path) {
  std::error_code ignored;
  return fs::exists(path, ignored);
}

/// As it stands in the file: vertices that a crease parts stay apart.
TriMesh mesh_of(importers::PlyMesh ply) {
  TriMesh mesh;
  mesh.positions = std::move(ply.positions);
  mesh.normals = std::move(ply.normals);
  mesh.attributes = std::move(ply.attributes);
  for (std::size_t face = 0; face + 1 < ply.face_start.size(); ++face)
    for (std::size_t corner = ply.face_start[face] + 2; corner < ply.face_start[face + 1]; ++corner)
      mesh.triangles.push_back({ply.corners[ply.face_start[face]], ply.corners[corner - 1], ply.corners[corner]});
  return mesh;
}

TriMesh read_ply_mesh(const fs::path& file) { return mesh_of(importers::parse_ply(read_file(file), file.string())); }

TriMesh read_mesh(const fs::path& file) {
  return importers::lower_extension(file) == ".ply" ? read_ply_mesh(file) : importers::import_mesh(file).mesh;
}

/// more's triangles behind those of all; both with normals and "color".
void append(TriMesh& all, TriMesh more) {
  if (more.triangles.empty()) return;
  if (more.normals.empty()) geometry::compute_normals(more);
  const std::size_t n = more.positions.size();
  const auto color = more.attributes.find("color");
  const auto first = static_cast<Index>(all.positions.size());
  all.positions.insert(all.positions.end(), more.positions.begin(), more.positions.end());
  all.normals.insert(all.normals.end(), more.normals.begin(), more.normals.end());
  for (const geometry::Triangle& t : more.triangles) all.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  geometry::VertexAttribute& colors = all.attributes["color"];
  colors.width = 3;
  if (color != more.attributes.end() && color->second.width == 3) colors.values.insert(colors.values.end(), color->second.values.begin(), color->second.values.end());
  else colors.values.insert(colors.values.end(), 3 * n, 0.25f);
}

/// "comment key: value" lines of a PLY header.
skin::Metadata comments_of(std::string_view bytes) {
  skin::Metadata all;
  const std::string_view header = bytes.substr(0, bytes.find("end_header"));
  constexpr std::string_view kHead = "\ncomment ";
  for (std::size_t at = header.find(kHead); at != std::string_view::npos; at = header.find(kHead, at + 1)) {
    const std::string_view line = header.substr(at + kHead.size(), header.find('\n', at + 1) - at - kHead.size());
    if (const std::size_t colon = line.find(": "); colon != std::string_view::npos) all.emplace_back(line.substr(0, colon), line.substr(colon + 2));
  }
  return all;
}

/// The fields of a line of CSV without quotes.
std::vector<std::string> fields_of(const std::string& line) {
  std::vector<std::string> fields(1);
  for (const char c : line) {
    if (c == ',') fields.emplace_back();
    else if (c != '\r') fields.back() += c;
  }
  return fields;
}

/// A curve for each column of flow.csv that has one.
struct Column {
  const char *column, *chart, *name, *unit;
};
constexpr Column kColumns[] = {
    {"front_m", "Front", "", "m"},
    {"max_temperature_K", "Temperature", "hottest", "°C"},
    {"mean_temperature_K", "Temperature", "mean", "°C"},
    {"min_temperature_K", "Temperature", "coldest", "°C"},
    {"vent_J", "Heat", "vent", "J"},
    {"radiated_J", "Heat", "radiated", "J"},
    {"convected_J", "Heat", "to the air", "J"},
    {"ground_J", "Heat", "to the ground", "J"},
    {"volume_m3", "Volume", "", "m³"},
    {"discharge_m3_s", "Discharge", "", "m³/s"},
    {"max_speed_m_s", "Fastest", "", "m/s"},
};

}  // namespace

RunFolder::RunFolder(fs::path folder) : folder_(std::move(folder)) {
  std::error_code ignored;
  const Place place{folder_.string()};
  if (!there(folder_)) throw InputError(place, "no such folder");
  if (!fs::is_directory(folder_, ignored)) throw InputError(place, "is a file, wanted the folder of a run (effuse run SCENE -o DIR)");
  const fs::path manifest = folder_ / "manifest.json";
  if (!there(manifest)) throw InputError(place, "is a folder that holds no run (no manifest.json), wanted one that effuse run has written");
  try {
    const json m = json::parse(read_file(manifest));
    name_ = m.at("name").get<std::string>();
    times_ = m.at("frame_times").get<std::vector<Real>>();
    fps_ = m.at("fps").get<Real>();
    time_scale_ = m.value("time_scale", 1.0);
    crs_ = m.value("crs", "");
    const auto origin = m.at("origin").get<std::array<Real, 3>>();
    origin_ = Vec3(origin[0], origin[1], origin[2]);
    const json files = m.at("files");
    for (const char* ending : {"ply", "glb", "obj"})
      if (files.contains(ending)) skins_.emplace_back(ending);
    for (const auto& [key, pattern] : files.items()) {
      patterns_[key] = pattern.get<std::string>();
      if (key == "ply" || key == "glb" || key == "obj" || key == "vdb" || key == "preview" || !pattern.get<std::string>().ends_with(".####.ply")) continue;
      layers_.push_back(key);
    }
    still_obstacles_ = m.contains("obstacles") && !files.contains("obstacles");
    if (m.contains("flow")) series_file_ = m.at("flow").value("series", "");
  } catch (const json::exception& error) {
    throw InputError(Place{manifest.string()}, fmt::format("is damaged: {}", error.what()));
  }
  if (!(fps_ > 0) || !std::is_sorted(times_.begin(), times_.end()) || std::any_of(times_.begin(), times_.end(), [](Real t) { return !std::isfinite(t); }))
    throw InputError(Place{manifest.string()}, "is damaged: fps must be above 0, and frame_times must rise");
  if (times_.empty()) throw InputError(place, "is a run without frames: it was ended before the first one was done");

  // Layers of points have no faces: told by the first file of each.
  std::erase_if(layers_, [&](const std::string& layer) {
    for (int frame = 1; frame <= frames(); ++frame) {
      const fs::path file = frame_file(layer, frame, "ply");
      if (!there(file)) continue;
      const std::string bytes = read_file(file);
      const bool points = bytes.substr(0, bytes.find("end_header")).find("element face") == std::string::npos;
      if (points) point_layers_.push_back(layer);
      return points;
    }
    return true;
  });
}

fs::path RunFolder::frame_file(const std::string& stem, int frame, const std::string& ending) const {
  return folder_ / "frames" / fmt::format("{}.{:04}.{}", stem, frame, ending);
}

TriMesh RunFolder::terrain() const {
  for (const char* name : {"terrain.ply", "terrain.glb"})
    if (there(folder_ / name)) return read_mesh(folder_ / name);
  return {};
}

std::optional<TriMesh> RunFolder::lava(int frame) const {
  for (const std::string& ending : skins_)
    if (const fs::path file = frame_file("skin", frame, ending); there(file)) {
      // A frame before the lava comes: importers refuse what has no triangles.
      if (ending != "ply" && fs::file_size(file) < 4096 && read_file(file).find(ending == "obj" ? "\nf " : "\"POSITION\"") == std::string::npos) return TriMesh{};
      return read_mesh(file);
    }
  return std::nullopt;
}

TriMesh RunFolder::others(int frame) const {
  TriMesh all;
  if (still_obstacles_ && there(folder_ / "obstacles.ply")) append(all, read_ply_mesh(folder_ / "obstacles.ply"));
  for (const std::string& layer : layers_)
    if (const fs::path file = frame_file(layer, frame, "ply"); there(file)) append(all, read_ply_mesh(file));
  return all;
}

geometry::Terrain RunFolder::ground() const {
  TriMesh mesh = terrain();
  if (mesh.triangles.empty()) throw InputError(Place{(folder_ / "terrain.ply").string()}, "is missing or empty: there is no ground to draw");
  return geometry::Terrain::from_mesh(std::move(mesh), {origin_, crs_});
}

RunFolder::Shown RunFolder::shown(int frame) const {
  ZONE("read.frame");
  Shown shown;
  if (!skins_.empty() && skins_.front() != "ply")
    throw InputError(Place{folder_.string()}, fmt::format("has its skins as {} alone, and pictures are made of PLY: wanted a run with that among its output.formats", fmt::join(skins_, ", ")));
  if (!skins_.empty()) shown.lava = read_ply_mesh(frame_file("skin", frame, "ply"));
  if (still_obstacles_) shown.others = read_ply_mesh(folder_ / "obstacles.ply");
  for (const auto& [name, pattern] : patterns_) {
    const std::size_t number = pattern.find("####");
    // The skin is there already.
    if (!pattern.starts_with("frames/") || number == std::string::npos || name == "ply" || name == "vdb") continue;
    const fs::path file = folder_ / (pattern.substr(0, number) + fmt::format("{:04}", frame) + pattern.substr(number + 4));
    if (name != "obstacles" && !there(file)) continue;
    if (pattern.ends_with(".ply")) {
      const std::string bytes = read_file(file);
      importers::PlyMesh ply = importers::parse_ply(bytes, file.string());
      if (ply.face_start.size() > 1) {
        append_to_picture(shown.others, mesh_of(std::move(ply)));
      } else if (!ply.positions.empty()) {
        flow::NamedCloud cloud;
        if (!take_look(comments_of(bytes), cloud)) {
          if (std::find(left_out_.begin(), left_out_.end(), name) == left_out_.end()) left_out_.push_back(name);
          continue;
        }
        const importers::PointCloud points = importers::parse_points(bytes, file.string());
        cloud.x = points.position;
        cloud.v = points.velocity.empty() ? std::vector<Vec3>(points.size(), Vec3::Zero()) : points.velocity;
        cloud.radius = points.radius.empty() ? std::vector<Real>(points.size(), 0.01) : points.radius;
        cloud.temperature = points.temperature.empty() ? std::vector<Real>(points.size(), 0) : points.temperature;
        cloud.opacity = points.opacity.empty() ? std::vector<Real>(points.size(), 1) : points.opacity;
        add_cloud(shown.air, cloud, kShutter * time_scale_ / fps_);
      }
    } else if (pattern.ends_with(".vdb")) {
      skin::Metadata about;
      geometry::GridVolume volume = skin::read_volume_vdb(file, &about);
      if (const auto color = color_of(about)) add_volume(shown.air, std::move(volume), *color);
    }
  }
  return shown;
}

void RunFolder::read_series(std::vector<Real>& times, std::vector<skin::PageSeries>& series) const {
  const fs::path file = folder_ / (series_file_.empty() ? "flow.csv" : series_file_);
  if (!there(file)) return;
  const std::string text = read_file(file);
  std::vector<std::vector<std::string>> rows;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    if (end > at) rows.push_back(fields_of(text.substr(at, end - at)));
    at = end + 1;
  }
  if (rows.size() < 2) return;
  const std::vector<std::string> head = rows.front();
  const auto column = [&](const std::string& name) { return static_cast<std::size_t>(std::find(head.begin(), head.end(), name) - head.begin()); };
  const auto value = [&](std::size_t row, std::size_t field) {
    const std::string& word = field < rows[row].size() ? rows[row][field] : "";
    Real v = std::numeric_limits<Real>::quiet_NaN();
    if (word.empty()) return v;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), v);
    if (error != std::errc() || end != word.data() + word.size())
      throw InputError(Place{file.string(), static_cast<int>(row + 1)}, fmt::format("found '{}' in column {}, wanted a number", word, field < head.size() ? head[field] : "?"));
    return v;
  };
  if (column("time_s") == head.size()) throw InputError(Place{file.string(), 1}, "has no column time_s");
  for (std::size_t row = 1; row < rows.size(); ++row) {
    times.push_back(value(row, column("time_s")));
    if (!std::isfinite(times.back())) throw InputError(Place{file.string(), static_cast<int>(row + 1)}, "has no time_s");
  }
  for (const Column& wanted : kColumns) {
    const std::size_t field = column(wanted.column);
    if (field == head.size()) continue;
    skin::PageSeries one{wanted.chart, wanted.name, wanted.unit, {}};
    for (std::size_t row = 1; row < rows.size(); ++row) one.values.push_back(value(row, field) - (one.unit == "°C" ? kZeroCelsius : 0));
    if (std::any_of(one.values.begin(), one.values.end(), [](Real v) { return std::isfinite(v); })) series.push_back(std::move(one));
  }
}

}  // namespace effuse
