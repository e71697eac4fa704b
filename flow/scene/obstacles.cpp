#include "flow/scene/obstacles.h"

#include <fmt/format.h>

#include <filesystem>

namespace effuse::flow {

using geometry::PoseKey;
using geometry::RigidPose;

namespace {

/// Turned about x, then y, then z, as Blender's XYZ angles.
Quat turned(const std::vector<Real>& angles) {
  if (angles.size() != 3) return Quat::Identity();
  return Quat(Eigen::AngleAxisd(angles[2], Vec3::UnitZ()) * Eigen::AngleAxisd(angles[1], Vec3::UnitY()) * Eigen::AngleAxisd(angles[0], Vec3::UnitX()));
}

RigidPose read_pose(Parameters& p, bool required, const RigidPose& fallback) {
  RigidPose pose = fallback;
  const std::vector<Real> at = p.numbers("position", "m", 3, required, "x, y in the terrain file's coordinates, and z, of the mesh's own origin");
  if (at.size() == 3) pose.position = Vec3(at[0], at[1], at[2]);
  const std::vector<Real> angles = p.numbers("rotation", "rad", 3, false, "about x, then y, then z, counter-clockwise");
  if (angles.size() == 3) pose.orientation = turned(angles);
  return pose;
}

}  // namespace

std::vector<PlannedObstacle> read_obstacles(Parameters& root) {
  std::vector<PlannedObstacle> plans;
  for (Parameters& p : root.tables("obstacle", "a mesh that lava flows around: standing, or moving by keys")) {
    PlannedObstacle plan;
    plan.place = p.place("");
    plan.file = p.text("file", std::nullopt, "any mesh, relative to the scene file; closed parts are solids, open ones sheets with two sides");
    plan.file_place = p.place("file");
    if (p.has("file") && (plan.file.empty() || plan.file.find('\0') != std::string::npos)) p.fault("file", "is not the name of a file");
    plan.name = p.text("name", std::filesystem::path(plan.file).stem().string(), "for people and files");
    plan.scale = p.number("scale", "", plan.scale, Parameters::positive(), "of the mesh's numbers: 0.01 if they are centimetres");
    plan.y_up = p.choice("up", {"z", "y"}, 0, "the mesh's axis that points up") == 1;
    plan.on_ground = p.flag("on_ground", plan.on_ground, "heights count from the terrain at x, y");
    plan.temperature = p.number("temperature", "K", plan.temperature, {0, 5000}, "of its surface; 0: the ground's");
    plan.friction = p.number("friction", "", plan.friction, {0, 1}, "of lava on it: 1 no slip, 0 free slip");
    plan.motion = static_cast<geometry::KeyMotion>(
        p.choice("motion", {geometry::kKeyMotionNames.begin(), geometry::kKeyMotionNames.end()}, static_cast<std::size_t>(plan.motion), "from key to key"));
    std::vector<Parameters> keys = p.tables("key", "where it is at a time; before the first and after the last it stands");
    const RigidPose first = read_pose(p, keys.empty(), {});
    if (keys.empty()) plan.keys.push_back({0, first});
    for (Parameters& key : keys) {
      const Real time = key.number("time", "s", std::nullopt, {}, "simulated");
      if (!plan.keys.empty() && time <= plan.keys.back().time)
        key.fault("time", fmt::format("{:g} s does not come after the key before, at {:g} s", time, plan.keys.back().time));
      plan.keys.push_back({time, read_pose(key, plan.keys.empty() && !p.has("position"), plan.keys.empty() ? first : plan.keys.back().pose)});
    }
    plans.push_back(std::move(plan));
  }
  return plans;
}

void place_obstacle(const PlannedObstacle& plan, geometry::TriMesh mesh, const geometry::Terrain& terrain, std::vector<PlacedObstacle>& placed, std::vector<Fault>& faults) {
  for (Vec3& p : mesh.positions) {
    if (plan.y_up) p = Vec3(p.x(), -p.z(), p.y());
    p *= plan.scale;
  }
  const Vec3 origin = terrain.georeference().origin;
  std::vector<PoseKey> keys = plan.keys;
  for (PoseKey& key : keys) {
    Vec3& p = key.pose.position;
    const Vec2 map = p.head<2>();
    p.head<2>() -= origin.head<2>();
    if (!plan.on_ground) {
      p.z() -= origin.z();
      continue;
    }
    const std::optional<Real> ground = terrain.height(p.x(), p.y());
    if (!ground) {
      const Vec2 low = terrain.bounds().min().head<2>() + origin.head<2>(), high = terrain.bounds().max().head<2>() + origin.head<2>();
      faults.push_back({plan.place, fmt::format("obstacle '{}': {:.12g}, {:.12g} is not on the terrain, which runs from {:.12g}, {:.12g} to {:.12g}, {:.12g}; on_ground = false counts heights as the terrain's file does",
                                                plan.name, map.x(), map.y(), low.x(), low.y(), high.x(), high.y())});
      return;
    }
    p.z() += *ground;
  }
  try {
    placed.push_back({plan.name, geometry::CollisionMesh(mesh), geometry::PoseTrack(std::move(keys), plan.motion), plan.temperature, plan.friction});
  } catch (const InputError& error) {
    for (const Fault& fault : error.faults()) faults.push_back({plan.file_place, fmt::format("obstacle '{}': {}", plan.name, fault.message)});
  }
}

}  // namespace effuse::flow
