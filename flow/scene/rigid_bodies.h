#pragma once

#include <string>
#include <vector>

#include "flow/scene/breaking.h"
#include "flow/scene/material.h"
#include "flow/scene/parameters.h"
#include "flow/scene/placing.h"
#include "geometry/collide/rigid_pose.h"
#include "geometry/mesh/tri_mesh.h"
#include "geometry/terrain/terrain.h"

namespace effuse::flow {

/// A rigid body as its table [[body]] describes it.
struct PlannedBody : PlannedForm {
  bool hull = true;       ///< its convex hull stands for it; else the mesh itself
  bool on_ground = true;  ///< the height counts from the terrain under the place
  geometry::RigidPose pose;  ///< in the terrain file's coordinates
  Real density = 0;       ///< [kg/m^3]
  Vec3 velocity = Vec3::Zero(), spin = Vec3::Zero();
  Real friction = 0.5, restitution = 0;  ///< against bodies, obstacles and the ground
  Real rolling = 0;       ///< lever arm of rolling resistance [m]
  Real temperature = 0;   ///< [K]; 0: the ground's
  Real lava_friction = 1; ///< of lava on it: 1 no slip, 0 free slip
  PlannedBreaking breaking;
  Material material;
};

/// The tables [[body]] of a scene; one with copies = n stands for n bodies, name.1 to name.n, each a `step` further. Faults stay in root.
std::vector<PlannedBody> read_bodies(Parameters& root, std::uint64_t seed = 1);

/// A body in the world: metres, z up, from the terrain's origin.
struct PlacedBody {
  std::string name;
  geometry::TriMesh mesh;  ///< in the frame that pose places; closed, or its hull stands for it
  bool hull = true;
  Real ball = 0;           ///< radius [m]: the ball itself stands for it, not its mesh
  bool box = false;        ///< made of a box's edges, not of a file
  Real volume = 0;         ///< of what stands for it [m^3]
  Real density = 0;
  geometry::RigidPose pose;
  Real friction = 0.5, restitution = 0, rolling = 0;
  Vec3 velocity = Vec3::Zero(), spin = Vec3::Zero();
  Real temperature = 0;
  Real lava_friction = 1;
  Vec3 color = Vec3::Constant(-1);  ///< as PlannedForm has it
  std::shared_ptr<const geometry::FracturedBody> cells;  ///< of one that may break: of the hull, where that stands for it; null: it does not
  Real strength = 0, smallest = 0;  ///< [Pa], [m^3]
  Material material = {};
};

/// How bodies of a scene are stepped, by its table [bodies].
struct BodySettings {
  bool penalty = false;      ///< contacts are springs and dampers, not impulses
  Real penalty_frequency = 60, penalty_damping = 0.5;  ///< [1/s]; of critical
  Real step = 1.0 / 120;     ///< [s]: contacts are looked for at least this often
  int substeps = 4;          ///< of one such step
  Real ground_friction = 0.6, ground_restitution = 0;
  Real sleep_speed = 0.03;   ///< [m/s]; 0: never
  Real sleep_delay = 0.5;    ///< [s]
};
BodySettings read_body_settings(Parameters& bodies);

/// The mesh of a plan's file, put on its terrain. What does not fit is a fault at the plan's place; the body is then left out.
void place_body(const PlannedBody& plan, geometry::TriMesh mesh, const geometry::Terrain& terrain, std::vector<PlacedBody>& placed, std::vector<Fault>& faults);

}  // namespace effuse::flow
