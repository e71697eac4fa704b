#pragma once

#include <string>
#include <vector>

#include "geometry/collide/rigid_pose.h"

namespace effuse::geometry {

/// A joint of a skeleton: its place in its parent's frame [m]. Parents come before their children; the first is the root.
struct ClipJoint {
  static constexpr Index kNone = ~Index{0};
  std::string name;
  Index parent = kNone;
  Vec3 offset = Vec3::Zero();
};

/// Where the root is [m], and how each joint is turned in its parent's frame.
struct SkeletonPose {
  Vec3 root = Vec3::Zero();
  std::vector<Quat> turn;
};

/// A skeleton's motion, by frames of equal distance: motion capture, or what is made of it. z up, on the plane z = 0.
struct SkeletonClip {
  std::vector<ClipJoint> joints;
  Real frame_time = 1. / 60;  ///< [s]
  std::vector<SkeletonPose> frames;

  /// Of the last frame [s]; the first is at 0.
  Real length() const { return frames.empty() ? 0 : frame_time * static_cast<Real>(frames.size() - 1); }
  /// Straight between frames, orientations along the shorter arc; held before the first and after the last.
  SkeletonPose at(Real time) const;
};

/// world_from_joint of every joint.
std::vector<RigidPose> forward_kinematics(const std::vector<ClipJoint>& joints, const SkeletonPose& pose);

/// A turn about the vertical and a shift along the ground.
struct GroundMove {
  Real turn = 0;  ///< [rad], first
  Vec2 shift = Vec2::Zero();
  SkeletonPose operator()(const SkeletonPose& pose) const;
};

/// The frames from one time to another [s], at the clip's own distance.
SkeletonClip cut(const SkeletonClip& clip, Real from, Real to);

/// The clip at another pace: moment u [0, 1] of the new one shows the old clip's `when(u)`, which is a share of its length and must not fall.
/// length: of the new one [s], > 0 (checked).
template <class When>
SkeletonClip time_warped(const SkeletonClip& clip, Real length, When&& when) {
  SkeletonClip out{clip.joints, clip.frame_time, {}};
  for (Real t = 0; t <= length * (1 + 1e-12); t += clip.frame_time) out.frames.push_back(clip.at(when(t / length) * clip.length()));
  return out;
}

/// How far b is from a pose a: the mean square distance of joints [m^2] at the ground move that makes it least, which is also returned.
/// Source: Kovar, Gleicher & Pighin 2002, Motion graphs, ACM TOG 21, 473-482 (their closed form, all joints alike).
Real pose_distance(const std::vector<ClipJoint>& joints, const SkeletonPose& a, const SkeletonPose& b, GroundMove* b_onto_a = nullptr);

/// Where to leave one clip for another of the same skeleton: times [s] of the least pose distance over a window of frames that both have before it.
struct Transition {
  Real from = 0, to = 0, distance = 0;
};
Transition best_transition(const SkeletonClip& a, const SkeletonClip& b, Real window, Real earliest_from = 0, Real latest_to = 1e9);

/// a, cross-faded into b over `fade` seconds: it begins where a is at `from`, meets b at `to`, and b is moved along the ground and turned so
/// that both agree where they meet. Weights are a cubic of zero slope at both ends: neither positions nor velocities jump beyond the clips' own.
/// Skeletons must agree in their joints (checked).
SkeletonClip blended(const SkeletonClip& a, const SkeletonClip& b, Real from, Real to, Real fade);

}  // namespace effuse::geometry
