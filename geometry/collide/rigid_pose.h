#pragma once

#include "geometry/base/types.h"

namespace effuse::geometry {

/// Where a body is: world = position + orientation * body. orientation is unit.
struct RigidPose {
  Vec3 position = Vec3::Zero();               ///< [m]
  Quat orientation = Quat::Identity();        ///< w x y z

  Vec3 world(const Vec3& body) const { return position + orientation * body; }
  Vec3 body(const Vec3& world) const { return orientation.conjugate() * (world - position); }
};

/// A body's way through one step: the origin of its frame goes straight at constant speed, the orientation turns at
/// constant angular velocity by the shorter way (half a turn a step is the most there can be).
///
///   from, to  at the step's begin (s = 0) and end (s = 1)
///   duration  [s] >= 0; 0: nothing moves, whatever the poses say of the way
class RigidMotion {
 public:
  /// At rest at the origin.
  RigidMotion() = default;
  /// At rest.
  explicit RigidMotion(const RigidPose& pose) : RigidMotion(pose, pose, 0) {}
  /// Poses must be finite, the quaternions not zero (they are normalised), duration finite and >= 0 (checked).
  RigidMotion(const RigidPose& from, const RigidPose& to, Real duration);

  const RigidPose& from() const { return from_; }
  const RigidPose& to() const { return to_; }
  Real duration() const { return duration_; }
  /// s in [0, 1]; exactly from and to at its ends.
  RigidPose pose(Real s) const;

  const Vec3& shift() const { return shift_; }  ///< of the origin, in the whole step [m]
  const Vec3& turn() const { return turn_; }    ///< axis times angle of the whole step [rad]
  bool turns() const { return !turn_.isZero(0); }
  bool moves() const { return turns() || !shift_.isZero(0); }

  /// Of the body's point that is at `world` at s [m/s]; zero when the duration is.
  Vec3 velocity_at(const Vec3& world, Real s) const;

  /// The same velocities on a way that ends where this one begins.
  RigidMotion turned_back() const;

  /// Contains every place that a point of `box` (in the body's frame) visits. Empty for an empty box.
  Box3 swept_box(const Box3& box) const;

 private:
  RigidPose from_, to_;
  Vec3 shift_ = Vec3::Zero(), turn_ = Vec3::Zero();
  Real duration_ = 0;
};

/// Box around a box of the body's frame, in the world.
Box3 placed_box(const RigidPose& pose, const Box3& box);

}  // namespace effuse::geometry
