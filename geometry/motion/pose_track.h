#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "geometry/collide/rigid_pose.h"

namespace effuse::geometry {

/// Where something is at one moment [s].
struct PoseKey {
  Real time = 0;
  RigidPose pose;
};

/// The way from key to key.
///   kHold    stays, then jumps
///   kLinear  straight at constant speed, turning at constant rate by the shorter way
///   kSmooth  position: cubic Hermite; orientation: cubic Bezier in exponentials (Kim, Kim & Shin 1995), both through every key with
///            the speed there that of the parabola through it and its neighbours; velocities have no jump. At the ends
///            it starts and stops with the speed of the straight way
enum class KeyMotion { kHold, kLinear, kSmooth };
inline constexpr std::array<std::string_view, 3> kKeyMotionNames = {"hold", "linear", "smooth"};

/// A keyframed pose: where it is at any time. Before the first key it is at the first, after the last at the last.
/// Two keys a turn do not say which way round: less than half a turn from key to key.
/// Source of the orientation's curve: Kim, Kim & Shin 1995, SIGGRAPH, 369-376.
class PoseTrack {
 public:
  /// Throws InputError unless there is a key, times rise and poses are finite with quaternions that are not zero (they are normalised).
  explicit PoseTrack(std::vector<PoseKey> keys, KeyMotion motion = KeyMotion::kSmooth);

  RigidPose at(Real time) const;
  /// The way from one moment to another, as one step takes it.
  RigidMotion between(Real from, Real to) const { return {at(from), at(to), to - from}; }
  /// Of the last key; nothing moves from then on.
  Real end() const { return keys_.back().time; }
  const std::vector<PoseKey>& keys() const { return keys_; }

 private:
  std::vector<PoseKey> keys_;
  KeyMotion motion_;
  std::vector<Vec3> velocity_, turning_;  // at the keys: [m/s]; [rad/s] in the key's own axes
};

/// Axis times angle of a unit quaternion, the shorter way; and back.
Vec3 rotation_vector(const Quat& q);
Quat rotation_by(const Vec3& axis_angle);

}  // namespace effuse::geometry
