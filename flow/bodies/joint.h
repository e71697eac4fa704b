#pragma once

#include <limits>
#include <string_view>

#include "geometry/base/types.h"

namespace effuse::flow::bodies {

using BodyId = Index;
using JointId = Index;

/// What holds two bodies together, or one to the world, as it stands when it is made: anchor and axis are given in the world.
///   kBall      one point in common
///   kHinge     that, and one axis: turns about it
///   kSlider    one axis, no turning: moves along it
///   kFixed     nothing moves
///   kDistance  the two anchors stay as far apart as they are, or within [low, high]
struct Joint {
  enum class Kind { kBall, kHinge, kSlider, kFixed, kDistance };
  static constexpr Real kFree = std::numeric_limits<Real>::infinity();
  static constexpr BodyId kWorld = ~BodyId{0};  ///< in place of one of the bodies: what nothing moves

  Kind kind = Kind::kBall;
  BodyId a = 0, b = 0;             ///< the second moves relative to the first
  Vec3 anchor = Vec3::Zero();      ///< [m]; of a distance joint that on a
  Vec3 anchor_b = Vec3::Zero();    ///< [m]; of a distance joint only
  Vec3 axis = Vec3::UnitZ();       ///< of hinge and slider; of a ball with a limit the middle of the cone. Any length > 0
  /// Limits, from where it stands when made: hinge [rad] within (-pi, pi), slider [m] (low <= 0 <= high); of a ball
  /// high is the half angle of the cone b's axis stays in [rad], low is not used; of a distance joint the two
  /// lengths themselves [m]: 0 <= low <= high, both free: rigid.
  Real low = -kFree, high = kFree;
  /// Motor of hinge [rad/s, N m] and slider [m/s, N]: drives b along the axis at `speed` with at most `strength`.
  Real motor_speed = 0, motor_strength = 0;
  /// A spring and a damper along the freedom of a hinge [N m/rad, N m s/rad] or slider [N/m, N s/m] with rest where it stands,
  /// instead of a motor; of a distance joint [N/m, N s/m] instead of a rod (limits may stand beside it). Solved implicitly, so
  /// that any stiffness does. Both 0: none. A distance joint has no damping without stiffness.
  Real stiffness = 0, damping = 0;
  /// Whether the two may touch each other. The ground is touched in any case.
  bool collide = false;
};

inline constexpr std::string_view kJointNames[] = {"ball", "hinge", "slider", "fixed", "distance"};

}  // namespace effuse::flow::bodies
