#include "samples/effuse/run_frames.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/zones.h"
#include "importers/mesh/ply_reader.h"
#include "importers/points/import_points.h"
#include "samples/effuse/air_look.h"
#include "skin/write/read_volume.h"

namespace effuse {

namespace fs = std::filesystem;

namespace {

/// Triangles as a writer of ours wrote them.
geometry::TriMesh mesh_of(importers::PlyMesh ply, const fs::path& file) {
  geometry::TriMesh mesh;
  for (std::size_t f = 0; f + 1 < ply.face_start.size(); ++f) {
    if (ply.face_start[f + 1] - ply.face_start[f] != 3) throw InputError(Place{file.string()}, "has polygons that are no triangles: not a file of a run");
    mesh.triangles.push_back({ply.corners[ply.face_start[f]], ply.corners[ply.face_start[f] + 1], ply.corners[ply.face_start[f] + 2]});
  }
  mesh.positions = std::move(ply.positions);
  mesh.normals = std::move(ply.normals);
  mesh.attributes = std::move(ply.attributes);
  return mesh;
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

}  // namespace

RunFrames::RunFrames(fs::path folder) : folder_(std::move(folder)) {
  std::error_code error;
  const fs::path manifest = folder_ / "manifest.json";
  if (!fs::is_regular_file(manifest, error)) throw InputError(Place{folder_.string()}, "holds no run: there is no manifest.json in it");
  try {
    const nlohmann::json m = nlohmann::json::parse(read_file(manifest));
    frames_ = m.at("frames").get<int>();
    fps_ = m.at("fps").get<double>();
    time_scale_ = m.at("time_scale").get<double>();
    for (int c = 0; c < 3; ++c) georeference_.origin[c] = m.at("origin").at(static_cast<std::size_t>(c)).get<double>();
    georeference_.crs = m.at("crs").get<std::string>();
    obstacles_ = m.contains("obstacles");
    for (const auto& [name, value] : m.at("files").items()) patterns_[name] = value.get<std::string>();
  } catch (const nlohmann::json::exception& broken) {
    throw InputError(Place{manifest.string()}, std::string("is damaged or of another version: ") + broken.what());
  }
}

geometry::Terrain RunFrames::terrain() const {
  const fs::path file = folder_ / "terrain.ply";
  return geometry::Terrain::from_mesh(mesh_of(importers::parse_ply(read_file(file), file.string()), file), georeference_);
}

fs::path RunFrames::file_of(const std::string& pattern, int number) const {
  std::string name = pattern;
  if (const std::size_t at = name.find("####"); at != std::string::npos) name.replace(at, 4, fmt::format("{:04}", number));
  return folder_ / name;
}

RunFrames::Shown RunFrames::frame(int number) const {
  ZONE("read.frame");
  Shown shown;
  if (obstacles_ && !patterns_.contains("obstacles")) {
    const fs::path file = folder_ / "obstacles.ply";
    shown.others = mesh_of(importers::parse_ply(read_file(file), file.string()), file);
  }
  for (const auto& [name, pattern] : patterns_) {
    const fs::path file = file_of(pattern, number);
    if (!pattern.starts_with("frames/")) continue;
    std::error_code error;
    // An effect's own files come when it has something to show; the skin's and obstacles' always.
    const bool always = name == "ply" || name == "obstacles";
    if (!always && !fs::exists(file, error)) continue;
    if (pattern.ends_with(".ply")) {
      const std::string bytes = read_file(file);
      importers::PlyMesh ply = importers::parse_ply(bytes, file.string());
      if (name == "ply") {
        shown.lava = mesh_of(std::move(ply), file);
      } else if (ply.face_start.size() > 1) {
        append_to_picture(shown.others, mesh_of(std::move(ply), file));
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
        cloud.opacity.assign(points.size(), 1);
        add_cloud(shown.air, cloud, kShutter * time_scale_ / fps_);
      }
    } else if (pattern.ends_with(".vdb") && name != "vdb") {
      skin::Metadata about;
      geometry::GridVolume volume = skin::read_volume_vdb(file, &about);
      if (const auto color = color_of(about)) add_volume(shown.air, std::move(volume), *color);
    }
  }
  return shown;
}

}  // namespace effuse
