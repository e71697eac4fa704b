#pragma once

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "geometry/base/files.h"
#include "geometry/mesh/measure.h"
#include "geometry/procedural/primitives.h"
#include "skin/color/lava_color.h"
#include "skin/write/write_mesh.h"
#include "tests/skin/sample_lava.h"

/// A run's folder without a run: a tube of lava that grows down a slope, cools and wobbles.
namespace effuse::testing_runs {

struct MadeRun {
  int frames = 4;
  int along = 30, around = 16;  ///< of the tube: 2 along around triangles
  bool lava = true, ground = true, series = true;
};

inline Real slope(Real x, Real y) { return 20 - 0.25 * x + 0.6 * std::sin(0.13 * x) * std::cos(0.17 * y); }

inline geometry::TriMesh lava_at(const MadeRun& run, int frame) {
  const Real part = static_cast<Real>(frame) / run.frames;
  geometry::TriMesh mesh = skin::testing_meshes::tube(20 + 60 * part, 4, run.along, run.around, [&](Real x, Real y) { return slope(x, y) + 0.4 * std::sin(0.8 * x + 9 * part); });
  // Crust grows from the front backwards, with cracks.
  auto& crust = mesh.attributes.at("crust").values;
  for (float& c : crust) c = std::min(1.0f, c * static_cast<float>(0.5 + part));
  skin::color_lava(mesh);
  return mesh;
}

inline void write_run(const std::filesystem::path& folder, const MadeRun& run) {
  std::filesystem::create_directories(folder / "frames");
  nlohmann::ordered_json manifest{{"format", 1}, {"name", "A made flow"}, {"frames", run.frames}, {"first_frame", 1}, {"fps", 24.0}, {"time_scale", 10.0}, {"origin", {1000.0, 2000.0, 0.0}}, {"crs", "EPSG:27200"}, {"files", nlohmann::json::object()}};
  if (run.lava) manifest["files"]["ply"] = "frames/skin.####.ply";
  std::string csv = "frame,time_s,front_m,max_temperature_K,mean_temperature_K,radiated_J,volume_m3\n";
  for (int frame = 1; frame <= run.frames; ++frame) {
    const Real time = 10 * frame / 24.0;
    manifest["frame_times"].push_back(time);
    csv += fmt::format("{},{},{},{},{},{},{}\n", frame, time, 20 + 60.0 * frame / run.frames, 1470 - frame, frame == 1 ? "" : std::to_string(1300 - frame), 1e9 * frame, 100 * frame);
    if (run.lava) skin::write_ply(folder / "frames" / fmt::format("skin.{:04}.ply", frame), lava_at(run, frame));
  }
  write_file(folder / "manifest.json", manifest.dump(1));
  if (run.series) write_file(folder / "flow.csv", csv);
  if (!run.ground) return;
  geometry::TriMesh ground = geometry::make_grid(Vec3(-20, -30, 0), Vec2(2, 2), 70, 30);
  for (Vec3& p : ground.positions) p.z() = slope(p.x(), p.y());
  geometry::compute_normals(ground);
  skin::write_ply(folder / "terrain.ply", ground);
}

}  // namespace effuse::testing_runs
