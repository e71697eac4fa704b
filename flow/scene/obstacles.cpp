#include "flow/scene/obstacles.h"

#include <fmt/format.h>

#include <cmath>

#include "flow/scene/placing.h"

namespace effuse::flow {

using geometry::PoseKey;
using geometry::RigidPose;

std::vector<PlannedObstacle> read_obstacles(Parameters& root) {
  std::vector<PlannedObstacle> plans;
  for (Parameters& p : root.tables("obstacle", "a mesh that lava flows around: standing, or moving by keys")) {
    PlannedObstacle plan;
    read_form(p, "any mesh, relative to the scene file; closed parts are solids, open ones sheets with two sides", plan);
    plan.on_ground = p.flag("on_ground", plan.on_ground, "heights count from the terrain at x, y");
    plan.temperature = p.number("temperature", "K", plan.temperature, {0, 5000}, "of its surface; 0: the ground's");
    plan.friction = p.number("friction", "", plan.friction, {0, 1}, "of lava on it: 1 no slip, 0 free slip");
    plan.material = read_material(p);
    plan.motion = static_cast<geometry::KeyMotion>(
        p.choice("motion", {geometry::kKeyMotionNames.begin(), geometry::kKeyMotionNames.end()}, static_cast<std::size_t>(plan.motion), "from key to key"));
    std::vector<Parameters> keys = p.tables("key", "where it is at a time; before the first and after the last it stands");
    const RigidPose first = read_pose(p, keys.empty(), {});
    if (!keys.empty() && p.has("position")) p.fault("position", "found with keys, wanted one or the other: keys say where it is");
    std::vector<Real> last = {0, 0, 0};
    if (keys.empty()) plan.keys.push_back({0, first});
    for (Parameters& key : keys) {
      const Real time = key.number("time", "s", std::nullopt, {}, "simulated");
      if (!plan.keys.empty() && time <= plan.keys.back().time)
        key.fault("time", fmt::format("{:g} s does not come after the key before, at {:g} s", time, plan.keys.back().time));
      if (const std::vector<Real> angles = key.numbers("rotation", "rad", 3, false, "about x, then y, then z, counter-clockwise"); angles.size() == 3) {
        for (std::size_t a = 0; a < 3 && !plan.keys.empty(); ++a)
          if (std::abs(angles[a] - last[a]) > kPi * (1 + 1e-9)) {
            key.fault("rotation", "turns by more than 180 deg from the key before, which says not which way round: keys between would do");
            break;
          }
        last = angles;
      }
      plan.keys.push_back({time, read_pose(key, plan.keys.empty(), plan.keys.empty() ? first : plan.keys.back().pose)});
    }
    plans.push_back(std::move(plan));
  }
  return plans;
}

void place_obstacle(const PlannedObstacle& plan, geometry::TriMesh mesh, const geometry::Terrain& terrain, std::vector<PlacedObstacle>& placed, std::vector<Fault>& faults) {
  std::vector<PoseKey> keys = plan.keys;
  for (PoseKey& key : keys)
    if (!put_on_terrain(key.pose, plan.on_ground, terrain, fmt::format("obstacle '{}'", plan.name), plan.place, faults)) return;
  mesh = upright(std::move(mesh), plan.scale, plan.y_up);
  if (too_large(mesh, fmt::format("obstacle '{}'", plan.name), plan.file_place, faults)) return;
  try {
    placed.push_back({plan.name, geometry::CollisionMesh(mesh), geometry::PoseTrack(std::move(keys), plan.motion), plan.temperature, plan.friction, plan.color, plan.material});
  } catch (const InputError& error) {
    for (const Fault& fault : error.faults()) faults.push_back({plan.file_place, fmt::format("obstacle '{}': {}", plan.name, fault.message)});
  }
}

}  // namespace effuse::flow
