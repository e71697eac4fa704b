#pragma once

#include <string>
#include <vector>

#include "flow/scene/parameters.h"
#include "geometry/collide/rigid_pose.h"
#include "geometry/mesh/tri_mesh.h"
#include "geometry/terrain/terrain.h"

/// What obstacles and bodies of a scene have in common: a mesh put somewhere.
namespace effuse::flow {

/// The keys position and rotation.
geometry::RigidPose read_pose(Parameters& p, bool required, const geometry::RigidPose& fallback);

/// The mesh in metres, z up.
geometry::TriMesh upright(geometry::TriMesh mesh, Real scale, bool y_up);

/// A fault at `place` when the mesh is larger than any thing: a slip in its scale.
bool too_large(const geometry::TriMesh& mesh, const std::string& what, const Place& place, std::vector<Fault>& faults);

/// From the terrain file's coordinates to those of the world, heights over the ground or over the map's zero. False after a fault at
/// `place`: no ground there. what: "obstacle 'house'".
bool put_on_terrain(geometry::RigidPose& pose, bool on_ground, const geometry::Terrain& terrain, const std::string& what, const Place& place, std::vector<Fault>& faults);

}  // namespace effuse::flow
