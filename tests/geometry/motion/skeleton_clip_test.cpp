#include "geometry/motion/skeleton_clip.h"

#include <gtest/gtest.h>

#include "tests/geometry/motion/sample_walk.h"

namespace effuse::geometry {
namespace {

Quat about(const Vec3& axis, Real angle) { return Quat(Eigen::AngleAxisd(angle, axis)); }

std::vector<Vec3> places(const SkeletonClip& clip, const SkeletonPose& pose) {
  std::vector<Vec3> all;
  for (const RigidPose& each : forward_kinematics(clip.joints, pose)) all.push_back(each.position);
  return all;
}

Real farthest(const SkeletonClip& clip, const SkeletonPose& a, const SkeletonPose& b) {
  Real most = 0;
  const std::vector<Vec3> p = places(clip, a), q = places(clip, b);
  for (std::size_t j = 0; j < p.size(); ++j) most = std::max(most, (p[j] - q[j]).norm());
  return most;
}

TEST(SkeletonClip, TurnsOfParentsCarryTheirChildren) {
  const std::vector<ClipJoint> arm = {{"a", ClipJoint::kNone, Vec3::Zero()}, {"b", 0, Vec3(1, 0, 0)}, {"c", 1, Vec3(1, 0, 0)}};
  const auto world = forward_kinematics(arm, {Vec3(0, 0, 3), {about(Vec3::UnitZ(), kPi / 2), about(Vec3::UnitY(), kPi / 2), Quat::Identity()}});
  EXPECT_LT((world[1].position - Vec3(0, 1, 3)).norm(), 1e-12);
  EXPECT_LT((world[2].position - Vec3(0, 1, 2)).norm(), 1e-12);
}

TEST(SkeletonClip, TheSampleWalksFeetStandAndItsKneesBend) {
  const SkeletonClip walk = sample_walk();
  const auto foot = [&](Real t) { return forward_kinematics(walk.joints, walk.at(t))[7].position; };
  EXPECT_EQ(walk.joints[7].name, "LeftFoot");
  EXPECT_LT((foot(0.1) - foot(0.6)).head<2>().norm(), 0.04) << "sways with the hips only";
  EXPECT_NEAR(foot(0.3).z(), 0.08, 1e-9);
  EXPECT_GT(foot(0.88).z(), 0.15);
}

TEST(SkeletonClip, PoseDistanceIsNoneForThePoseMovedAlongTheGround) {
  const SkeletonClip walk = sample_walk();
  const SkeletonPose a = walk.at(0.4), far = GroundMove{2.1, Vec2(30, -7)}(a);
  GroundMove back;
  EXPECT_LT(pose_distance(walk.joints, a, far, &back), 1e-20);
  EXPECT_LT(farthest(walk, back(far), a), 1e-9);
  EXPECT_GT(pose_distance(walk.joints, a, walk.at(0.7)), 1e-3);
}

TEST(SkeletonClip, TheBestTransitionOfAWalkIntoItselfIsAWholeCycle) {
  const SkeletonClip walk = sample_walk(1.3, 1.1, 3.3);
  const Transition best = best_transition(walk, walk, 0.1, 2.2, 0.8);
  const Real cycles = (best.from - best.to) / 1.1;
  EXPECT_NEAR(cycles, std::round(cycles), 1.5 / 60 / 1.1);
  EXPECT_LT(best.distance, 1e-4);
}

TEST(SkeletonClip, ABlendJumpsNeitherInPositionNorInVelocity) {
  // A walk into a faster one that goes elsewhere.
  const SkeletonClip slow = sample_walk(1.0, 1.3, 2.6), fast = sample_walk(1.8, 0.9, 2.7);
  SkeletonClip turned = fast;
  for (SkeletonPose& pose : turned.frames) pose = GroundMove{1.9, Vec2(40, 11)}(pose);
  const Transition at = best_transition(slow, turned, 0.1, 1, 1);
  const SkeletonClip blend = blended(slow, turned, at.from, at.to, 0.5);
  const auto velocity_jump = [&](const SkeletonClip& clip) {
    Real most = 0;
    for (std::size_t f = 1; f + 1 < clip.frames.size(); ++f) {
      const auto a = places(clip, clip.frames[f - 1]), b = places(clip, clip.frames[f]), c = places(clip, clip.frames[f + 1]);
      for (std::size_t j = 0; j < a.size(); ++j) most = std::max(most, ((c[j] - b[j]) - (b[j] - a[j])).norm() / clip.frame_time);
    }
    return most;
  };
  const auto step = [&](const SkeletonClip& clip) {
    Real most = 0;
    for (std::size_t f = 1; f < clip.frames.size(); ++f) most = std::max(most, farthest(clip, clip.frames[f - 1], clip.frames[f]));
    return most;
  };
  // No more from frame to frame than the livelier of the two has of its own, and what closing the gap in the fade adds.
  EXPECT_LT(velocity_jump(blend), 1.5 * std::max(velocity_jump(slow), velocity_jump(turned)));
  EXPECT_LT(step(blend), 1.3 * std::max(step(slow), step(turned)));
  // Before and after it is the clips'.
  EXPECT_LT(farthest(slow, blend.at(at.from * 0.5), slow.at(at.from * 0.5)), 1e-12);
  const Vec3 gait = (blend.frames.back().root - blend.frames[blend.frames.size() - 31].root) / 0.5;
  EXPECT_NEAR(gait.norm(), 1.8, 0.1);
  // A hard cut, by contrast, jumps.
  SkeletonClip hard = cut(slow, 0, at.from);
  const SkeletonClip rest = cut(turned, at.to, turned.length());
  hard.frames.insert(hard.frames.end(), rest.frames.begin(), rest.frames.end());
  EXPECT_GT(step(hard), 5 * step(blend));
}

TEST(SkeletonClip, WarpedItShowsTheSameAtAnotherTime) {
  const SkeletonClip walk = sample_walk();
  const SkeletonClip late = time_warped(walk, 5, [](Real u) { return u * u; });
  EXPECT_NEAR(late.length(), 5, 1e-9);
  EXPECT_LT(farthest(walk, late.at(2.5), walk.at(walk.length() / 4)), 0.01);
  EXPECT_LT(farthest(walk, late.frames.back(), walk.frames.back()), 1e-9);
}

}  // namespace
}  // namespace effuse::geometry
