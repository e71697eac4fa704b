#pragma once

#include <cmath>

#include "geometry/motion/skeleton_clip.h"

namespace effuse::geometry {

/// Somebody 1.75 m tall who walks along x at `speed` [m/s], two steps a cycle of `period` [s], frames at `rate` a second. Each foot stands for three
/// fifths of a cycle, then swings; legs by their own inverse kinematics, arms swing against them.
inline SkeletonClip sample_walk(Real speed = 1.3, Real period = 1.1, Real length = 3.3, Real rate = 60, Real bounce = 0.02) {
  SkeletonClip clip;
  const auto joint = [&](const char* name, Index parent, const Vec3& offset) {
    clip.joints.push_back({name, parent, offset});
    return static_cast<Index>(clip.joints.size() - 1);
  };
  constexpr Real kThigh = 0.44, kShin = 0.43, kAnkle = 0.08;
  const Index hips = joint("Hips", ClipJoint::kNone, Vec3::Zero());
  const Index spine = joint("Spine", hips, Vec3(0, 0, 0.22)), neck = joint("Neck", spine, Vec3(0, 0, 0.32)), head = joint("Head", neck, Vec3(0, 0, 0.1));
  joint("HeadEnd", head, Vec3(0, 0, 0.14));
  Index leg[2], knee[2], foot[2], arm[2], elbow[2];
  for (int side = 0; side < 2; ++side) {
    const Real y = side == 0 ? 1 : -1;
    const char* names[2][8] = {{"LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToe", "LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand"}, {"RightUpLeg", "RightLeg", "RightFoot", "RightToe", "RightShoulder", "RightArm", "RightForeArm", "RightHand"}};
    leg[side] = joint(names[side][0], hips, Vec3(0, 0.1 * y, -0.04));
    knee[side] = joint(names[side][1], leg[side], Vec3(0, 0, -kThigh));
    foot[side] = joint(names[side][2], knee[side], Vec3(0, 0, -kShin));
    joint(names[side][3], foot[side], Vec3(0.17, 0, -0.06));
    arm[side] = joint(names[side][5], spine, Vec3(0, 0.2 * y, 0.26));
    elbow[side] = joint(names[side][6], arm[side], Vec3(0, 0, -0.29));
    joint(names[side][7], elbow[side], Vec3(0, 0, -0.27));
  }
  clip.frame_time = 1 / rate;
  constexpr Real kStands = 0.6;
  // As high as a leg that stands ahead or behind lets the hips be.
  const Real reach = 0.995 * (kThigh + kShin), far = speed * period * kStands / 2, height = 0.04 + kAnkle - bounce + std::sqrt(reach * reach - far * far);
  const auto about_y = [](Real a) { return Quat(Eigen::AngleAxisd(a, Vec3::UnitY())); };
  for (int f = 0; f <= static_cast<int>(std::round(length * rate)); ++f) {
    const Real t = f / rate;
    SkeletonPose pose;
    pose.turn.assign(clip.joints.size(), Quat::Identity());
    pose.root = Vec3(speed * t, 0.015 * std::sin(2 * kPi * t / period), height + bounce * std::cos(4 * kPi * t / period));
    for (int side = 0; side < 2; ++side) {
      const Real phase = t / period + 0.5 * side, u = phase - std::floor(phase);
      // Where the foot is against the hips: back evenly while it stands, ahead with a lift while it swings.
      const Real stride = speed * period * kStands;
      Real x = stride * (0.5 - u / kStands), z = kAnkle;
      if (u > kStands) {
        const Real w = (u - kStands) / (1 - kStands);
        x = -stride / 2 + stride * w * w * (3 - 2 * w);
        z += 0.09 * std::sin(kPi * w) * std::sin(kPi * w);
      }
      const Vec3 to(x, 0, z - (pose.root.z() - 0.04));
      const Real d = to.norm(), bend = std::acos((kThigh * kThigh + kShin * kShin - d * d) / (2 * kThigh * kShin));
      const Real lift = std::asin(kShin * std::sin(bend) / d), swing = std::atan2(to.x(), -to.z()) + lift;
      pose.turn[leg[side]] = about_y(-swing);
      pose.turn[knee[side]] = about_y(kPi - bend);
      pose.turn[foot[side]] = about_y(swing - (kPi - bend));  // level
      pose.turn[arm[side]] = about_y(0.45 * std::cos(2 * kPi * (u - 0.05)));
      pose.turn[elbow[side]] = about_y(-0.35);
    }
    clip.frames.push_back(std::move(pose));
  }
  return clip;
}

}  // namespace effuse::geometry
