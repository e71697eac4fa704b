#pragma once

#include <span>
#include <string>
#include <vector>

#include "flow/scene/effect.h"
#include "flow/scene/parameters.h"

/// What holds a thing that deforms, and whether it can start where it is.
namespace effuse::flow {

/// Points that start within radius [m] of a place are held.
struct Pin {
  Vec3 at = Vec3::Zero();  ///< [m]
  Real radius = 0;
  Place place = {};

  bool holds(const Vec3& point) const { return (point - at).norm() <= radius; }
};

/// The key pins: in the terrain's map coordinates.
std::vector<Pin> read_pins(Parameters& p);
/// The same in the scene's own coordinates, from the terrain's origin; without a terrain as they are.
std::vector<Pin> in_scene(std::vector<Pin> pins, const geometry::Terrain* terrain);
bool is_pinned(std::span<const Pin> pins, const Vec3& point);

/// Faults of points at the start, in the scene's coordinates: pins that hold none of them, and, where it meets a terrain, free points so deep
/// under the ground (a tenth of the thing's size) that they would be thrown out of it.
///   what  "springs 'curtain'"
void check_start(std::span<const Vec3> points, std::span<const Pin> pins, const geometry::Terrain* met, const std::string& what, const Place& place, std::vector<Fault>& faults);

/// A fault where pinned_to names no obstacle; "" names none.
void check_driver(const std::string& pinned_to, const World& world, const std::string& what, const Place& place, std::vector<Fault>& faults);

/// A pose of the table in the scene's own coordinates: on the terrain, or from its origin; without a terrain as it is. False: a fault was added.
bool put_in_scene(geometry::RigidPose& pose, bool on_ground, const World& world, const std::string& what, const Place& place, std::vector<Fault>& faults);

}  // namespace effuse::flow
