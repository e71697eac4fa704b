#include "flow/effects/pins.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "flow/scene/placing.h"
#include "geometry/terrain/terrain.h"

namespace effuse::flow {

std::vector<Pin> read_pins(Parameters& p) {
  std::vector<Pin> pins;
  for (const std::vector<Real>& pin : p.number_lists("pins", "m", 4, false, "[x, y, z, radius], x, y and z in the terrain's map coordinates, also where on_ground is true: points that start this near are held")) {
    if (!(pin[3] >= 0)) p.fault("pins", fmt::format("has a radius of {:g} m, wanted 0 m or more", pin[3]));
    pins.push_back({Vec3(pin[0], pin[1], pin[2]), pin[3], p.place("pins")});
  }
  return pins;
}

std::vector<Pin> in_scene(std::vector<Pin> pins, const geometry::Terrain* terrain) {
  if (terrain)
    for (Pin& pin : pins) pin.at -= terrain->georeference().origin;
  return pins;
}

bool is_pinned(std::span<const Pin> pins, const Vec3& point) {
  return std::any_of(pins.begin(), pins.end(), [&](const Pin& pin) { return pin.holds(point); });
}

void check_start(std::span<const Vec3> points, std::span<const Pin> pins, const geometry::Terrain* met, const std::string& what, const Place& place, std::vector<Fault>& faults) {
  constexpr Real kDeepest = 0.1;  // of the size
  if (points.empty()) return;
  for (std::size_t k = 0; k < pins.size(); ++k) {
    Real nearest = std::numeric_limits<Real>::infinity();
    for (const Vec3& x : points) nearest = std::min(nearest, (x - pins[k].at).norm());
    if (nearest > pins[k].radius)
      faults.push_back({pins[k].place, fmt::format("{}: pins[{}] holds no point, the nearest starts {:.3g} m from it, its radius is {:g} m", what, k, nearest, pins[k].radius)});
  }
  if (!met) return;
  Box3 box;
  Real deepest = 0;
  for (const Vec3& x : points) {
    box.extend(x);
    if (const std::optional<Real> ground = met->height(x.x(), x.y()); ground && !is_pinned(pins, x)) deepest = std::max(deepest, *ground - x.z());
  }
  if (deepest > kDeepest * box.sizes().norm())
    faults.push_back({place, fmt::format("{} starts up to {:.3g} m under the ground and would be thrown out of it, wanted {:.2g} m at most, a tenth of its size", what, deepest, kDeepest * box.sizes().norm())});
}

void check_driver(const std::string& pinned_to, const World& world, const std::string& what, const Place& place, std::vector<Fault>& faults) {
  if (pinned_to.empty()) return;
  std::vector<std::string> names;
  if (world.obstacles)
    for (const PlacedObstacle& each : *world.obstacles) names.push_back(each.name);
  if (std::find(names.begin(), names.end(), pinned_to) != names.end()) return;
  const std::string near = nearest_name(pinned_to, names);
  faults.push_back({place, fmt::format("{}: pinned_to names '{}', no obstacle of the scene{}", what, pinned_to, near.empty() ? "" : fmt::format(" (did you mean {}?)", near))});
}

bool put_in_scene(geometry::RigidPose& pose, bool on_ground, const World& world, const std::string& what, const Place& place, std::vector<Fault>& faults) {
  if (world.terrain) return put_on_terrain(pose, on_ground, *world.terrain, what, place, faults);
  if (on_ground) faults.push_back({place, what + ": on_ground, and the scene has no [terrain]"});
  return !on_ground;
}

}  // namespace effuse::flow
