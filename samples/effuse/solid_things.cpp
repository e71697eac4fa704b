#include "samples/effuse/solid_things.h"

#include <fmt/format.h>

#include <algorithm>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/procedural/primitives.h"
#include "geometry/repair/repair.h"
#include "importers/clips/read_bvh.h"
#include "importers/mesh/import_mesh.h"
#include "samples/effuse/solid_look.h"

namespace effuse {

namespace {
constexpr float kAir = 288;  // [K]

/// One without a form has been told of.
bool has_form(const flow::PlannedForm& form) { return !form.file.empty() || form.ball > 0 || form.box.minCoeff() > 0; }

}  // namespace

geometry::TriMesh load_form(const flow::PlannedForm& form, const SceneFiles& files, std::vector<std::string>& notes) {
  if (form.file.empty()) return flow::mesh_of(form);
  const std::filesystem::path path = std::filesystem::path(form.file).is_relative() ? files.folder / form.file : std::filesystem::path(form.file);
  try {
    importers::MeshOptions options;
    options.limits = files.limits;
    geometry::TriMesh mesh = importers::import_mesh(path, options).mesh;
    const geometry::RepairReport repairs = geometry::repair(mesh);
    std::string told;
    for (const std::string& line : geometry::to_lines(repairs)) told += (told.empty() ? "" : "; ") + line;
    if (repairs.inward_shells > 0) told += fmt::format("{}{} inside, facing inward: room", told.empty() ? "" : "; ", repairs.inward_shells == 1 ? "a part" : "parts");
    if (!told.empty()) notes.push_back(fmt::format("'{}': {}", form.name, told));
    if (mesh.triangles.empty()) throw InputError({path.string()}, "holds no triangle with an area");
    return mesh;
  } catch (const InputError& error) {
    std::vector<Fault> faults;
    for (const Fault& fault : error.faults()) faults.push_back({form.file_place, to_string(fault)});
    throw InputError(faults);
  }
}

std::vector<flow::PlacedObstacle> load_obstacles(const flow::Scene& scene, const SceneFiles& files, const geometry::Terrain& terrain, std::vector<Fault>& faults,
                                                 std::vector<std::string>& notes) {
  std::vector<flow::PlacedObstacle> placed;
  for (const flow::PlannedObstacle& plan : scene.obstacles) {
    if (!has_form(plan)) continue;
    try {
      const std::size_t before = placed.size();
      flow::place_obstacle(plan, load_form(plan, files, notes), terrain, placed, faults);
      if (placed.size() > before) notes.push_back(fmt::format("obstacle '{}': {}", plan.name, geometry::to_string(placed.back().shape.report())));
    } catch (const InputError& error) {
      faults.insert(faults.end(), error.faults().begin(), error.faults().end());
    }
  }
  return placed;
}

std::vector<flow::PlacedObstacle> load_figures(const flow::Scene& scene, const SceneFiles& files, const geometry::Terrain& terrain, std::vector<Fault>& faults,
                                               std::vector<std::string>& notes) {
  std::vector<flow::PlacedObstacle> placed;
  for (const flow::PlannedFigure& plan : scene.figures) {
    if (plan.file.empty() || plan.path.size() < 2) continue;
    const std::filesystem::path path = std::filesystem::path(plan.file).is_relative() ? files.folder / plan.file : std::filesystem::path(plan.file);
    try {
      flow::place_figure(plan, importers::read_bvh(path, plan.scale), terrain, scene.frame_time(scene.frames), placed, faults, notes);
    } catch (const InputError& error) {
      for (const Fault& fault : error.faults()) faults.push_back({plan.file_place, to_string(fault)});
    }
  }
  return placed;
}

std::vector<flow::PlacedBody> load_bodies(const flow::Scene& scene, const SceneFiles& files, const geometry::Terrain& terrain, std::vector<Fault>& faults,
                                          std::vector<std::string>& notes) {
  std::vector<flow::PlacedBody> placed;
  std::string first;  // of those that are alike, by name
  const auto same = [](const flow::PlacedBody& a, const flow::PlacedBody& b) { return a.volume == b.volume && a.density == b.density; };
  for (const flow::PlannedBody& plan : scene.bodies) {
    if (!has_form(plan)) continue;
    try {
      const std::size_t before = placed.size();
      flow::place_body(plan, load_form(plan, files, notes), terrain, placed, faults);
      if (placed.size() == before) continue;
      const std::string what = fmt::format("{:.4g} m3, {:.4g} kg{}", placed.back().volume, placed.back().volume * plan.density,
                                           placed.back().cells ? fmt::format(", {} cells, breaks at {:.4g} Pa", placed.back().cells->cells.size(), placed.back().strength) : "");
      if (before > 0 && same(placed[before - 1], placed.back())) {
        notes.back() = fmt::format("bodies '{}' to '{}': {} each", first, plan.name, what);
      } else {
        first = plan.name;
        notes.push_back(fmt::format("body '{}': {}", first, what));
      }
    } catch (const InputError& error) {
      for (const Fault& fault : error.faults())
        if (faults.empty() || to_string(faults.back()) != to_string(fault)) faults.push_back(fault);
    }
  }
  return placed;
}

std::vector<flow::PlacedJoint> load_joints(const flow::Scene& scene, const std::vector<flow::PlacedObstacle>& obstacles, const std::vector<flow::PlacedBody>& bodies,
                                           const geometry::Terrain& terrain, std::vector<Fault>& faults, std::vector<std::string>& notes) {
  std::vector<flow::PlacedJoint> placed;
  for (const flow::PlannedJoint& plan : scene.joints) flow::place_joint(plan, obstacles, bodies, terrain, placed, faults);
  std::size_t first = 0;  // of those of one table
  for (std::size_t k = 0; k < placed.size() && placed.size() == scene.joints.size(); ++k) {
    if (k + 1 < placed.size() && scene.joints[k + 1].place.line == scene.joints[first].place.line) continue;
    const auto what = [&](const flow::PlacedJoint& j) { return fmt::format("{} of '{}' and '{}'", flow::kJointKindNames[static_cast<std::size_t>(j.kind)], j.names[0], j.names[1]); };
    notes.push_back(k == first ? "joint: " + what(placed[k]) : fmt::format("{} joints: {} to {}", k - first + 1, what(placed[first]), what(placed[k])));
    first = k + 1;
  }
  return placed;
}

void SolidThings::make_looks() {
  looks.clear();
  for (const flow::PlacedObstacle& each : obstacles) looks.push_back(make_look(each.shape.mesh(), each.color, LookKind::kObstacle, 0));
  std::size_t number[3] = {0, 0, 0};
  for (const flow::PlacedBody& each : bodies) {
    const LookKind kind = each.ball > 0 ? LookKind::kBall : each.box ? LookKind::kBox : LookKind::kRock;
    looks.push_back(make_look(each.mesh, each.color, kind, number[kind == LookKind::kRock]++));
  }
}

std::size_t SolidThings::triangles() const {
  std::size_t sum = 0;
  for (const flow::PlacedObstacle& each : obstacles) sum += each.shape.mesh().triangles.size();
  for (const flow::PlacedBody& each : bodies) sum += each.mesh.triangles.size();
  return sum;
}

bool SolidThings::any_moves() const {
  return !bodies.empty() || std::any_of(obstacles.begin(), obstacles.end(), [](const flow::PlacedObstacle& each) { return each.track.keys().size() > 1; });
}

bool SolidThings::any_breaks() const {
  return std::any_of(bodies.begin(), bodies.end(), [](const flow::PlacedBody& each) { return each.cells != nullptr; });
}

geometry::TriMesh SolidThings::at(Real time, const std::vector<geometry::RigidPose>& poses, const std::vector<flow::SolidPiece>& pieces) const {
  CHECK_EQ(looks.size(), obstacles.size() + bodies.size());
  geometry::TriMesh all;
  geometry::VertexAttribute& color = all.attributes["color"];
  color.width = 3;
  const auto add = [&](const geometry::TriMesh& look, const geometry::RigidPose& pose) {
    const auto first = static_cast<Index>(all.positions.size());
    for (const geometry::Triangle& t : look.triangles) all.triangles.push_back({first + t[0], first + t[1], first + t[2]});
    for (const Vec3& p : look.positions) all.positions.push_back(pose.world(p));
    for (const Vec3& n : look.normals) all.normals.push_back(pose.orientation * n);
    const std::vector<float>& own = look.attributes.at("color").values;
    color.values.insert(color.values.end(), own.begin(), own.end());
  };
  for (std::size_t i = 0; i < obstacles.size(); ++i) add(looks[i], obstacles[i].track.at(time));
  for (std::size_t b = 0; b < bodies.size(); ++b)
    if (!bodies[b].cells || pieces.empty()) add(looks[obstacles.size() + b], b < poses.size() ? poses[b] : bodies[b].pose);
  if (!any_breaks() && pieces.empty()) return all;
  std::vector<float> number(all.positions.size(), 0), inner(all.positions.size(), 0);
  for (const flow::SolidPiece& piece : pieces) {
    const float* color_of_body = piece.body == flow::SolidPiece::kNoBody ? nullptr : looks[obstacles.size() + piece.body].attributes.at("color").values.data();
    add(make_piece_look(*piece.mesh, color_of_body, piece.id < bodies.size() ? 0 : piece.id), piece.pose);
    const std::vector<float>& own_inner = piece.mesh->attributes.at("inner").values;
    inner.insert(inner.end(), own_inner.begin(), own_inner.end());
    number.resize(all.positions.size(), static_cast<float>(piece.id + 1));
  }
  all.attributes["piece"] = {1, std::move(number)};
  all.attributes["inner"] = {1, std::move(inner)};
  return all;
}

geometry::TriMesh in_one_picture(geometry::TriMesh lava, const geometry::TriMesh& obstacles) {
  if (obstacles.triangles.empty()) return lava;
  geometry::TriMesh cold = obstacles;
  const std::size_t n = cold.positions.size();
  if (lava.positions.empty()) return obstacles;
  // Only what the picture is made of goes on.
  for (const char* name : {"piece", "inner"}) cold.attributes.erase(name);
  for (const auto& [name, attribute] : lava.attributes) {
    if (name == "color" || name == "water" || (name == "glow" && cold.attributes.contains("glow"))) continue;
    geometry::VertexAttribute& own = cold.attributes[name];
    own.width = attribute.width;
    own.values.assign(n * static_cast<std::size_t>(attribute.width), name == "temperature" ? kAir : name == "crust" ? 1 : 0.0f);
  }
  if (cold.attributes.contains("glow") && !lava.attributes.contains("glow")) lava.attributes["glow"] = {3, std::vector<float>(3 * lava.positions.size(), 0.0f)};
  if (cold.attributes.contains("water")) lava.attributes["water"] = {1, std::vector<float>(lava.positions.size(), 0.0f)};
  if (lava.normals.empty()) cold.normals.clear();
  if (!lava.attributes.contains("color")) cold.attributes.erase("color");
  geometry::append(lava, cold);
  return lava;
}

void check_camera_among(const SolidThings& things, const skin::SkinSettings& settings, const geometry::Terrain& terrain, const flow::Scene& scene) {
  if (!settings.preview || things.obstacles.empty()) return;
  for (int frame = 1; frame <= scene.frames; ++frame) {
    const Vec3 eye = skin::picture_at(settings, terrain, frame / scene.fps).camera.eye;
    for (const flow::PlacedObstacle& each : things.obstacles) {
      const geometry::RigidPose pose = each.track.at(scene.frame_time(frame));
      if (!each.shape.inside(pose.body(eye))) continue;
      throw InputError(settings.camera.place, fmt::format("preview: in frame {} the camera stands in obstacle '{}'; more elevation, another azimuth or distance would do", frame, each.name));
    }
  }
}

}  // namespace effuse
