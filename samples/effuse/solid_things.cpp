#include "samples/effuse/solid_things.h"

#include <fmt/format.h>

#include <algorithm>

#include "geometry/procedural/primitives.h"
#include "importers/mesh/import_mesh.h"

namespace effuse {

namespace {
constexpr float kGrey[] = {0.42f, 0.40f, 0.37f};  // linear light
constexpr float kAir = 288;                       // [K]
}  // namespace

std::vector<flow::PlacedObstacle> load_obstacles(const flow::Scene& scene, const std::filesystem::path& folder, const geometry::Terrain& terrain, std::vector<Fault>& faults,
                                                 std::vector<std::string>& notes) {
  std::vector<flow::PlacedObstacle> placed;
  for (const flow::PlannedObstacle& plan : scene.obstacles) {
    if (plan.file.empty()) continue;  // told already
    const std::filesystem::path path = std::filesystem::path(plan.file).is_relative() ? folder / plan.file : std::filesystem::path(plan.file);
    try {
      const std::size_t before = placed.size();
      flow::place_obstacle(plan, importers::import_mesh(path).mesh, terrain, placed, faults);
      if (placed.size() > before) notes.push_back(fmt::format("obstacle '{}': {}", plan.name, geometry::to_string(placed.back().shape.report())));
    } catch (const InputError& error) {
      for (const Fault& fault : error.faults()) faults.push_back({plan.file_place, to_string(fault)});
    }
  }
  return placed;
}

std::vector<flow::PlacedBody> load_bodies(const flow::Scene& scene, const std::filesystem::path& folder, const geometry::Terrain& terrain, std::vector<Fault>& faults,
                                          std::vector<std::string>& notes) {
  std::vector<flow::PlacedBody> placed;
  for (const flow::PlannedBody& plan : scene.bodies) {
    if (plan.file.empty()) continue;  // told already
    const std::filesystem::path path = std::filesystem::path(plan.file).is_relative() ? folder / plan.file : std::filesystem::path(plan.file);
    try {
      const std::size_t before = placed.size();
      flow::place_body(plan, importers::import_mesh(path).mesh, terrain, placed, faults);
      if (placed.size() > before) notes.push_back(fmt::format("body '{}': {:.4g} m3, {:.4g} kg", plan.name, placed.back().volume, placed.back().volume * plan.density));
    } catch (const InputError& error) {
      for (const Fault& fault : error.faults()) faults.push_back({plan.file_place, to_string(fault)});
    }
  }
  return placed;
}

bool SolidThings::any_moves() const {
  return !bodies.empty() || std::any_of(obstacles.begin(), obstacles.end(), [](const flow::PlacedObstacle& each) { return each.track.keys().size() > 1; });
}

geometry::TriMesh SolidThings::at(Real time, const std::vector<geometry::RigidPose>& poses) const {
  geometry::TriMesh all;
  const auto add = [&](const geometry::TriMesh& mesh, const geometry::RigidPose& pose) {
    for (const geometry::Triangle& t : mesh.triangles) {
      const Vec3 a = pose.world(mesh.positions[t[0]]), b = pose.world(mesh.positions[t[1]]), c = pose.world(mesh.positions[t[2]]);
      const Vec3 n = (b - a).cross(c - a).normalized();
      const auto first = static_cast<Index>(all.positions.size());
      all.triangles.push_back({first, first + 1, first + 2});
      for (const Vec3& p : {a, b, c}) {
        all.positions.push_back(p);
        all.normals.push_back(n);
      }
    }
  };
  for (const flow::PlacedObstacle& each : obstacles) add(each.shape.mesh(), each.track.at(time));
  for (std::size_t b = 0; b < bodies.size(); ++b) add(bodies[b].mesh, b < poses.size() ? poses[b] : bodies[b].pose);
  return all;
}

geometry::TriMesh in_one_picture(geometry::TriMesh lava, const geometry::TriMesh& obstacles) {
  if (obstacles.triangles.empty()) return lava;
  geometry::TriMesh grey = obstacles;
  const std::size_t n = grey.positions.size();
  if (lava.positions.empty()) {
    lava = geometry::TriMesh();
    lava.attributes["color"].width = 3;
  }
  for (const auto& [name, attribute] : lava.attributes) {
    geometry::VertexAttribute& own = grey.attributes[name];
    own.width = attribute.width;
    own.values.assign(n * static_cast<std::size_t>(attribute.width), name == "temperature" ? kAir : name == "crust" ? 1 : 0.0f);
    if (name != "color") continue;
    for (std::size_t k = 0; k < own.values.size(); ++k) own.values[k] = kGrey[k % 3];
  }
  if (lava.normals.empty() && !lava.positions.empty()) grey.normals.clear();
  if (lava.positions.empty()) return grey;
  geometry::append(lava, grey);
  return lava;
}

}  // namespace effuse
