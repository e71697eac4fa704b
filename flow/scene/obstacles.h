#pragma once

#include <string>
#include <vector>

#include "flow/scene/material.h"
#include "flow/scene/parameters.h"
#include "flow/scene/placing.h"
#include "geometry/collide/collision_mesh.h"
#include "geometry/motion/pose_track.h"
#include "geometry/terrain/terrain.h"

namespace effuse::flow {

/// A mesh that stands or moves in a scene, as its table [[obstacle]] describes it.
struct PlannedObstacle : PlannedForm {
  bool on_ground = true;  ///< heights count from the terrain under the place
  std::vector<geometry::PoseKey> keys;  ///< in the terrain file's coordinates
  geometry::KeyMotion motion = geometry::KeyMotion::kSmooth;
  Real temperature = 0;  ///< of its surface [K]; 0: the ground's
  Real friction = 1;     ///< of lava on it: 1 no slip, 0 free slip
  Material material;
};

/// The tables [[obstacle]] of a scene, each with its [[obstacle.key]]s. Faults stay in root.
std::vector<PlannedObstacle> read_obstacles(Parameters& root);

/// An obstacle in the world: metres, z up, from the terrain's origin.
struct PlacedObstacle {
  std::string name;
  geometry::CollisionMesh shape;
  geometry::PoseTrack track;
  Real temperature = 0;
  Real friction = 1;
  Vec3 color = Vec3::Constant(-1);  ///< as PlannedForm has it
  Material material = {};
};

/// The mesh of a plan's file, put on its terrain. What does not fit (no ground under it, times that do not rise, a mesh that is
/// none) is a fault at the plan's place; the obstacle is then left out.
void place_obstacle(const PlannedObstacle& plan, geometry::TriMesh mesh, const geometry::Terrain& terrain, std::vector<PlacedObstacle>& placed, std::vector<Fault>& faults);

}  // namespace effuse::flow
