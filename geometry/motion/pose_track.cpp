#include "geometry/motion/pose_track.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/error.h"

namespace effuse::geometry {

Vec3 rotation_vector(const Quat& q) {
  const Real sign = q.w() < 0 ? -1 : 1, s = q.vec().norm();
  if (s < 1e-9) return 2 * sign * q.vec();
  return 2 * std::atan2(s, sign * q.w()) / s * sign * q.vec();
}

Quat rotation_by(const Vec3& axis_angle) {
  if (axis_angle == Vec3::Zero()) return Quat::Identity();
  const Real half = axis_angle.norm() / 2;
  // sin(half) / (2 half): its series where the quotient would lose digits.
  const Real s = half > 1e-4 ? std::sin(half) / (2 * half) : (1 - half * half / 6) / 2;
  return Quat(std::cos(half), s * axis_angle.x(), s * axis_angle.y(), s * axis_angle.z());
}

PoseTrack::PoseTrack(std::vector<PoseKey> keys, KeyMotion motion) : keys_(std::move(keys)), motion_(motion) {
  if (keys_.empty()) throw InputError(Place{}, "keyframes: none given, wanted at least one");
  for (std::size_t k = 0; k < keys_.size(); ++k) {
    PoseKey& key = keys_[k];
    if (!std::isfinite(key.time) || !key.pose.position.allFinite() || !key.pose.orientation.coeffs().allFinite() || key.pose.orientation.norm() == 0)
      throw InputError(Place{}, fmt::format("keyframe {}: a time or pose that is not finite, or no orientation", k + 1));
    if (k > 0 && !(key.time > keys_[k - 1].time))
      throw InputError(Place{}, fmt::format("keyframe {} at {:g} s does not come after the one before it, at {:g} s", k + 1, key.time, keys_[k - 1].time));
    key.pose.orientation.normalize();
  }
  if (motion_ != KeyMotion::kSmooth) return;

  // Speeds of the straight way from key to key; at a key the parabola's.
  const std::size_t n = keys_.size();
  std::vector<Vec3> straight(n, Vec3::Zero()), turn(n, Vec3::Zero());
  for (std::size_t k = 0; k + 1 < n; ++k) {
    const Real h = keys_[k + 1].time - keys_[k].time;
    straight[k] = (keys_[k + 1].pose.position - keys_[k].pose.position) / h;
    turn[k] = rotation_vector(keys_[k].pose.orientation.conjugate() * keys_[k + 1].pose.orientation) / h;
  }
  velocity_.resize(n);
  turning_.resize(n);
  for (std::size_t k = 0; k < n; ++k) {
    const std::size_t before = k == 0 ? 0 : k - 1, after = k + 1 == n ? before : k;
    const Real h0 = k == 0 ? 1 : keys_[k].time - keys_[k - 1].time, h1 = k + 1 == n ? 1 : keys_[k + 1].time - keys_[k].time;
    const Real share = k == 0 ? 1 : k + 1 == n ? 0 : h0 / (h0 + h1);
    velocity_[k] = (1 - share) * straight[before] + share * straight[after];
    turning_[k] = (1 - share) * turn[before] + share * turn[after];
  }
}

RigidPose PoseTrack::at(Real time) const {
  if (!(time > keys_.front().time)) return keys_.front().pose;
  if (time >= keys_.back().time) return keys_.back().pose;
  const auto next = std::upper_bound(keys_.begin(), keys_.end(), time, [](Real t, const PoseKey& key) { return t < key.time; });
  const auto k = static_cast<std::size_t>(next - keys_.begin()) - 1;
  const PoseKey &a = keys_[k], &b = keys_[k + 1];
  if (motion_ == KeyMotion::kHold) return a.pose;

  const Real h = b.time - a.time, s = (time - a.time) / h;
  const Quat turn = a.pose.orientation.conjugate() * b.pose.orientation;
  RigidPose pose;
  if (motion_ == KeyMotion::kLinear) {
    pose.position = a.pose.position + s * (b.pose.position - a.pose.position);
    pose.orientation = a.pose.orientation * rotation_by(s * rotation_vector(turn));
  } else {
    const Real s2 = s * s, s3 = s2 * s, ease = 3 * s2 - 2 * s3;
    pose.position = a.pose.position + ease * (b.pose.position - a.pose.position) + h * (s - 2 * s2 + s3) * velocity_[k] + h * (s3 - s2) * velocity_[k + 1];
    const Vec3 out = h / 3 * turning_[k], in = h / 3 * turning_[k + 1];
    const Vec3 across = rotation_vector(rotation_by(-out) * turn * rotation_by(-in));
    pose.orientation = a.pose.orientation * rotation_by((1 - std::pow(1 - s, 3)) * out) * rotation_by(ease * across) * rotation_by(s3 * in);
  }
  pose.orientation.normalize();
  return pose;
}

}  // namespace effuse::geometry
