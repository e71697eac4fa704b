#pragma once

#include <string>
#include <vector>

#include "flow/scene/material.h"
#include "flow/scene/parameters.h"
#include "geometry/collide/rigid_pose.h"
#include "geometry/mesh/tri_mesh.h"
#include "geometry/terrain/terrain.h"

namespace effuse::flow {

/// A rigid body as its table [[body]] describes it.
struct PlannedBody {
  std::string name;  ///< the table's, or else the file's
  std::string file;  ///< as written; relative to the scene file
  Place file_place, place;
  Real scale = 1;
  bool y_up = false;
  bool hull = true;       ///< its convex hull stands for it; else the mesh itself
  bool on_ground = true;  ///< the height counts from the terrain under the place
  geometry::RigidPose pose;  ///< in the terrain file's coordinates
  Real density = 0;       ///< [kg/m^3]
  Vec3 velocity = Vec3::Zero(), spin = Vec3::Zero();
  Real friction = 0.5, restitution = 0;  ///< against bodies, obstacles and the ground
  Real temperature = 0;   ///< [K]; 0: the ground's
  Real lava_friction = 1; ///< of lava on it: 1 no slip, 0 free slip
  Material material;
};

/// The tables [[body]] of a scene. Faults stay in root.
std::vector<PlannedBody> read_bodies(Parameters& root);

/// A body in the world: metres, z up, from the terrain's origin.
struct PlacedBody {
  std::string name;
  geometry::TriMesh mesh;  ///< in the frame that pose places; closed, or its hull stands for it
  bool hull = true;
  Real volume = 0;         ///< of what stands for it [m^3]
  Real density = 0;
  geometry::RigidPose pose;
  Real friction = 0.5, restitution = 0;
  Vec3 velocity = Vec3::Zero(), spin = Vec3::Zero();
  Real temperature = 0;
  Real lava_friction = 1;
  Material material = {};
};

/// The mesh of a plan's file, put on its terrain. What does not fit is a fault at the plan's place; the body is then left out.
void place_body(const PlannedBody& plan, geometry::TriMesh mesh, const geometry::Terrain& terrain, std::vector<PlacedBody>& placed, std::vector<Fault>& faults);

}  // namespace effuse::flow
