#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "flow/scene/parameters.h"
#include "geometry/collide/rigid_pose.h"
#include "geometry/mesh/tri_mesh.h"
#include "geometry/terrain/terrain.h"

/// What obstacles and bodies of a scene have in common: a mesh put somewhere.
namespace effuse::flow {

/// What a thing is called and looks like: a mesh's file, or a box or a ball without one. Exactly one of them in a table without faults.
struct PlannedForm {
  std::string name;         ///< for people and files: the table's, or else the file's, "box" or "ball"
  std::string file;         ///< as written, relative to the scene file; "": none
  Place file_place, place;  ///< of what says the form; of the table
  Real scale = 1;           ///< of the mesh's numbers
  bool y_up = false;        ///< the mesh's own axis
  Vec3 box = Vec3::Zero();  ///< edges [m] of a box about its own origin; 0: none
  Real ball = 0;            ///< radius [m] of a ball about its own origin; 0: none
  Vec3 color = Vec3::Constant(-1);  ///< sRGB, 0..1, in pictures and files; negative: none given
};

/// The keys file, scale, up, box, ball, name and color. file_what: what is said of the key file.
void read_form(Parameters& p, std::string_view file_what, PlannedForm& form);

/// Whether it has a file, a box or a ball; what is wrong otherwise has been told.
bool has_shape(const PlannedForm& form);

/// The mesh of a box or a ball (of 1,280 triangles).
geometry::TriMesh mesh_of(const PlannedForm& form);

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
