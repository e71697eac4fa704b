#include "flow/scene/placing.h"

#include <fmt/format.h>

namespace effuse::flow {

using geometry::RigidPose;

namespace {

/// Turned about x, then y, then z, as Blender's XYZ angles.
Quat turned(const std::vector<Real>& angles) {
  if (angles.size() != 3) return Quat::Identity();
  return Quat(Eigen::AngleAxisd(angles[2], Vec3::UnitZ()) * Eigen::AngleAxisd(angles[1], Vec3::UnitY()) * Eigen::AngleAxisd(angles[0], Vec3::UnitX()));
}

}  // namespace

RigidPose read_pose(Parameters& p, bool required, const RigidPose& fallback) {
  RigidPose pose = fallback;
  const std::vector<Real> at = p.numbers("position", "m", 3, required, "x, y in the terrain's map coordinates, and z, of the mesh's own origin");
  if (at.size() == 3) pose.position = Vec3(at[0], at[1], at[2]);
  const std::vector<Real> angles = p.numbers("rotation", "rad", 3, false, "about x, then y, then z, counter-clockwise");
  if (angles.size() == 3) pose.orientation = turned(angles);
  return pose;
}

geometry::TriMesh upright(geometry::TriMesh mesh, Real scale, bool y_up) {
  for (Vec3& p : mesh.positions) {
    if (y_up) p = Vec3(p.x(), -p.z(), p.y());
    p *= scale;
  }
  return mesh;
}

bool too_large(const geometry::TriMesh& mesh, const std::string& what, const Place& place, std::vector<Fault>& faults) {
  constexpr Real kLargest = 1e5;  // [m]
  Box3 box;
  for (const Vec3& p : mesh.positions) box.extend(p);
  if (box.isEmpty() || box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).maxCoeff() < kLargest) return false;
  faults.push_back({place, fmt::format("{}: its mesh reaches {:.3g} m from its origin, wanted less than {:g} m: is its scale right?", what, box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).maxCoeff(), kLargest)});
  return true;
}

bool put_on_terrain(RigidPose& pose, bool on_ground, const geometry::Terrain& terrain, const std::string& what, const Place& place, std::vector<Fault>& faults) {
  constexpr Real kFarthest = 1e6;  // [m]
  const Vec3 origin = terrain.georeference().origin;
  Vec3& p = pose.position;
  if (!((p - origin).cwiseAbs().maxCoeff() < kFarthest)) {
    faults.push_back({place, fmt::format("{}: {:g}, {:g}, {:g} is more than {:g} m from the terrain's origin", what, p.x(), p.y(), p.z(), kFarthest)});
    return false;
  }
  const Vec2 map = p.head<2>();
  p.head<2>() -= origin.head<2>();
  if (!on_ground) {
    p.z() -= origin.z();
    return true;
  }
  const std::optional<Real> ground = terrain.height(p.x(), p.y());
  if (ground) {
    p.z() += *ground;
    return true;
  }
  const Vec2 low = terrain.bounds().min().head<2>() + origin.head<2>(), high = terrain.bounds().max().head<2>() + origin.head<2>();
  faults.push_back({place, fmt::format("{}: {:.12g}, {:.12g} is not on the terrain, which runs from {:.12g}, {:.12g} to {:.12g}, {:.12g}; on_ground = false counts heights as the terrain's file does", what,
                                       map.x(), map.y(), low.x(), low.y(), high.x(), high.y())});
  return false;
}

}  // namespace effuse::flow
