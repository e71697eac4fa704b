#include "geometry/motion/skeleton_clip.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"

namespace effuse::geometry {

namespace {

Quat about_z(Real angle) { return Quat(Eigen::AngleAxisd(angle, Vec3::UnitZ())); }

SkeletonPose mixed(const SkeletonPose& a, const SkeletonPose& b, Real share) {
  SkeletonPose pose;
  pose.root = (1 - share) * a.root + share * b.root;
  for (std::size_t j = 0; j < a.turn.size(); ++j) pose.turn.push_back(a.turn[j].slerp(share, b.turn[j]));
  return pose;
}

std::vector<Vec3> places(const std::vector<ClipJoint>& joints, const SkeletonPose& pose) {
  std::vector<Vec3> all;
  for (const RigidPose& each : forward_kinematics(joints, pose)) all.push_back(each.position);
  return all;
}

}  // namespace

SkeletonPose SkeletonClip::at(Real time) const {
  CHECK(!frames.empty());
  const Real k = std::clamp(time / frame_time, 0.0, static_cast<Real>(frames.size() - 1));
  const auto first = std::min(static_cast<std::size_t>(k), frames.size() - 1);
  if (first + 1 == frames.size()) return frames[first];
  return mixed(frames[first], frames[first + 1], k - static_cast<Real>(first));
}

std::vector<RigidPose> forward_kinematics(const std::vector<ClipJoint>& joints, const SkeletonPose& pose) {
  CHECK_EQ(pose.turn.size(), joints.size());
  std::vector<RigidPose> world(joints.size());
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (joints[j].parent == ClipJoint::kNone) {
      world[j] = {pose.root, pose.turn[j]};
      continue;
    }
    CHECK_LT(joints[j].parent, j);
    const RigidPose& parent = world[joints[j].parent];
    world[j] = {parent.world(joints[j].offset), parent.orientation * pose.turn[j]};
  }
  return world;
}

SkeletonPose GroundMove::operator()(const SkeletonPose& pose) const {
  SkeletonPose moved = pose;
  const Quat z = about_z(turn);
  moved.root = z * pose.root + Vec3(shift.x(), shift.y(), 0);
  if (!moved.turn.empty()) moved.turn[0] = z * pose.turn[0];
  return moved;
}

SkeletonClip cut(const SkeletonClip& clip, Real from, Real to) {
  CHECK_GE(to, from);
  SkeletonClip out{clip.joints, clip.frame_time, {}};
  const auto n = static_cast<std::size_t>(std::floor((to - from) / clip.frame_time + 1e-9));
  for (std::size_t k = 0; k <= n; ++k) out.frames.push_back(clip.at(from + static_cast<Real>(k) * clip.frame_time));
  return out;
}

Real pose_distance(const std::vector<ClipJoint>& joints, const SkeletonPose& a, const SkeletonPose& b, GroundMove* move) {
  const std::vector<Vec3> p = places(joints, a), q = places(joints, b);
  Vec3 mean_p = Vec3::Zero(), mean_q = Vec3::Zero();
  const auto n = static_cast<Real>(p.size());
  for (std::size_t j = 0; j < p.size(); ++j) mean_p += p[j] / n, mean_q += q[j] / n;
  Real sine = 0, cosine = 0;
  for (std::size_t j = 0; j < p.size(); ++j) {
    const Vec3 u = p[j] - mean_p, v = q[j] - mean_q;
    sine += v.x() * u.y() - v.y() * u.x();
    cosine += v.x() * u.x() + v.y() * u.y();
  }
  GroundMove best;
  best.turn = std::atan2(sine, cosine);
  best.shift = (mean_p - about_z(best.turn) * mean_q).head<2>();
  Real sum = 0;
  for (std::size_t j = 0; j < p.size(); ++j) sum += (about_z(best.turn) * q[j] + Vec3(best.shift.x(), best.shift.y(), 0) - p[j]).squaredNorm() / n;
  if (move) *move = best;
  return sum;
}

Transition best_transition(const SkeletonClip& a, const SkeletonClip& b, Real window, Real earliest_from, Real latest_to) {
  const auto n = static_cast<int>(std::round(window / a.frame_time));
  Transition best{0, 0, 1e300};
  constexpr int kStride = 3;  // frames between poses of the window that are compared
  for (int i = std::max(n, static_cast<int>(std::ceil(earliest_from / a.frame_time))); i < static_cast<int>(a.frames.size()); ++i)
    for (int j = n; j < static_cast<int>(b.frames.size()) && j * b.frame_time <= latest_to; ++j) {
      Real sum = 0;
      int count = 0;
      for (int k = 0; k <= n && sum < best.distance * (n / kStride + 1); k += kStride, ++count)
        sum += pose_distance(a.joints, a.frames[static_cast<std::size_t>(i - k)], b.at((j - k) * b.frame_time));
      if (count == n / kStride + 1 && sum / count < best.distance) best = {i * a.frame_time, j * b.frame_time, sum / count};
    }
  return best;
}

SkeletonClip blended(const SkeletonClip& a, const SkeletonClip& b, Real from, Real to, Real fade) {
  CHECK_EQ(a.joints.size(), b.joints.size());
  CHECK_GT(fade, 0);
  // Aligned in the middle of the fade, where both count alike.
  GroundMove move;
  pose_distance(a.joints, a.at(from + fade / 2), b.at(to + fade / 2), &move);
  SkeletonClip out{a.joints, a.frame_time, {}};
  const Real length = from + std::max(fade, b.length() - to);
  const auto n = static_cast<std::size_t>(std::floor(length / a.frame_time + 1e-9));
  for (std::size_t k = 0; k <= n; ++k) {
    const Real t = static_cast<Real>(k) * a.frame_time, u = std::clamp((t - from) / fade, 0.0, 1.0);
    if (u <= 0) out.frames.push_back(a.at(t));
    else if (u >= 1) out.frames.push_back(move(b.at(to + t - from)));
    else out.frames.push_back(mixed(a.at(t), move(b.at(to + t - from)), u * u * (3 - 2 * u)));
  }
  return out;
}

}  // namespace effuse::geometry
