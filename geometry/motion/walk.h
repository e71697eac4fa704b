#pragma once

#include <functional>
#include <string>
#include <vector>

#include "geometry/motion/skeleton_clip.h"
#include "geometry/mesh/tri_mesh.h"

namespace effuse::geometry {

/// A leg by its joints; the foot is what stands.
struct Leg {
  Index hip = 0, knee = 0, foot = 0;
};

/// The legs of a skeleton: joints whose name has "foot" or "ankle" in it, with their parents and grandparents; at most one on a limb.
std::vector<Leg> find_legs(const std::vector<ClipJoint>& joints);

/// The clip again and again, cross-faded where its end is most like its beginning (best_transition), at least so long [s], and with its lowest joint
/// at z = 0. One that travels keeps on.
SkeletonClip repeated(const SkeletonClip& clip, Real length, Real fade = 0.2);

struct WalkOptions {
  std::vector<Vec2> path;  ///< at least two points, apart [m]; a smooth curve goes through them
  Real start = 0;          ///< [s]; before it stands
  Real duration = 0;       ///< [s] that are wanted, from 0
  Real rate = 60;          ///< samples a second
  Real pace = 1;           ///< of the clip's: 2 is twice as fast
};

/// A skeleton that walks along a path over ground that rises and falls: the clip's own travel is laid along the path, its root follows the ground,
/// and each foot stays where it has been set down until it lifts off (two-bone inverse kinematics; hips come down where legs would not reach).
/// What is seen between samples lies straight between them.
struct Walk {
  Real step = 1. / 60;                       ///< [s]
  std::vector<std::vector<RigidPose>> poses;  ///< by sample: world_from_joint
  struct Plant {
    std::size_t leg, first, last;  ///< samples in which that leg's foot stands
  };
  std::vector<Plant> plants;
  Real slide = 0;     ///< the farthest that a standing foot comes from its place [m]
  Real travelled = 0;  ///< along the path [m]
};

/// height: of the ground at x, y [m]. Throws InputError when the clip does not travel, a leg is missing or the path is too short.
Walk walk_along(const SkeletonClip& clip, const std::function<Real(const Vec2&)>& height, const WalkOptions& options);

/// A capsule from the origin to `end`, closed: its radius shrinks from the one to the other.
TriMesh make_capsule(const Vec3& end, Real radius_from, Real radius_to, int round = 12, int cap = 4);

/// What makes a body of a skeleton: of each bone that is no shorter than a twentieth of a body's height, its capsule in the frame of its joint.
struct Bone {
  Index joint = 0;  ///< in whose frame
  std::string name;
  TriMesh mesh;
};
std::vector<Bone> body_of(const std::vector<ClipJoint>& joints, const SkeletonPose& standing);

}  // namespace effuse::geometry
