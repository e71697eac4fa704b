#pragma once

#include <optional>

#include "geometry/collide/collision_mesh_internal.h"
#include "geometry/collide/rigid_pose.h"
#include "geometry/collide/swept.h"

/// The swept test that everything is made of. For geometry/collide only.
namespace effuse::geometry {

/// A centre's way: straight, at constant speed, in a frame that may itself move.
///   x(s) = frame.pose(s).world(start + (s - begin) * way),  s from begin to 1
struct Path {
  RigidMotion frame;  ///< at rest at the origin: straight in the world
  Vec3 start = Vec3::Zero(), way = Vec3::Zero();
  Real begin = 0;

  Vec3 at(Real s) const {
    const Vec3 local = start + (s - begin) * way;
    return frame.moves() ? frame.pose(s).world(local) : frame.to().world(local);
  }
  /// Contains all of it, and r around.
  Box3 box(Real r) const;
};

/// First time in [path.begin, 1] at which the centre comes within rho of the mesh that moves along. Nothing is said of
/// the start: who is within rho then is met at once if it approaches. Time is s, not a share.
std::optional<Impact> sweep_path(const CollisionMesh& mesh, const RigidMotion& motion, const Path& path, Real rho);

}  // namespace effuse::geometry
