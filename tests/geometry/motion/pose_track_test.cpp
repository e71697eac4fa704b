#include "geometry/motion/pose_track.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/error.h"
#include "geometry/base/random.h"

namespace effuse::geometry {
namespace {

Real angle_between(const Quat& a, const Quat& b) { return rotation_vector(a.conjugate() * b).norm(); }

std::vector<PoseKey> random_keys(std::uint64_t seed, int n) {
  std::vector<PoseKey> keys;
  Real time = -1;
  const auto u = [&](std::uint64_t a) { return 2 * random_uniform(seed, a, keys.size()) - 1; };
  for (int k = 0; k < n; ++k) {
    time += 0.3 + std::abs(u(0));
    const Vec3 turn = Vec3(u(4), u(5), u(6));
    const Quat last = keys.empty() ? Quat::Identity() : keys.back().pose.orientation;
    keys.push_back({time, {10 * Vec3(u(1), u(2), u(3)), last * rotation_by(turn)}});
  }
  return keys;
}

TEST(PoseTrack, GoesThroughItsKeysAndStaysAtTheEnds) {
  const std::vector<PoseKey> keys = random_keys(1, 7);
  for (const KeyMotion motion : {KeyMotion::kHold, KeyMotion::kLinear, KeyMotion::kSmooth}) {
    const PoseTrack track(keys, motion);
    for (const PoseKey& key : keys) {
      EXPECT_LT((track.at(key.time).position - key.pose.position).norm(), 1e-12);
      EXPECT_LT(angle_between(track.at(key.time).orientation, key.pose.orientation), 1e-12);
    }
    EXPECT_EQ(track.at(-100).position, keys.front().pose.position);
    EXPECT_EQ(track.at(1e9).position, keys.back().pose.position);
    EXPECT_EQ(track.end(), keys.back().time);
  }
}

// Speeds just before and just after a key agree; of straight ways they do not: the test can tell.
TEST(PoseTrack, SmoothMotionHasNoJumpInSpeedAtItsKeys) {
  const std::vector<PoseKey> keys = random_keys(2, 9);
  const auto jump = [&](KeyMotion motion) {
    const PoseTrack track(keys, motion);
    const Real e = 1e-6;
    Real largest = 0;
    for (std::size_t k = 1; k + 1 < keys.size(); ++k) {
      const RigidPose a = track.at(keys[k].time - e), b = track.at(keys[k].time), c = track.at(keys[k].time + e);
      largest = std::max(largest, ((c.position - b.position) - (b.position - a.position)).norm() / e);
      largest = std::max(largest, (rotation_vector(b.orientation.conjugate() * c.orientation) - rotation_vector(a.orientation.conjugate() * b.orientation)).norm() / e);
    }
    return largest;
  };
  EXPECT_LT(jump(KeyMotion::kSmooth), 1e-3);
  EXPECT_GT(jump(KeyMotion::kLinear), 1);
}

TEST(PoseTrack, OfKeysOnASteadyScrewIsTheScrew) {
  std::vector<PoseKey> keys;
  for (const Real t : {0.0, 0.4, 1.5, 1.9, 3.0}) keys.push_back({t, {t * Vec3(1, -2, 0.5), rotation_by(t * Vec3(0.3, 0.9, -0.6))}});
  for (const KeyMotion motion : {KeyMotion::kLinear, KeyMotion::kSmooth}) {
    const PoseTrack track(keys, motion);
    for (Real t = 0; t < 3; t += 0.07) {
      EXPECT_LT((track.at(t).position - t * Vec3(1, -2, 0.5)).norm(), 1e-12);
      EXPECT_LT(angle_between(track.at(t).orientation, rotation_by(t * Vec3(0.3, 0.9, -0.6))), 1e-12);
    }
  }
}

TEST(PoseTrack, OfOneKeyStandsStill) {
  const PoseTrack track({{2, {Vec3(1, 2, 3), Quat(2, 0, 0, 0)}}});
  EXPECT_EQ(track.at(5).position, Vec3(1, 2, 3));
  EXPECT_EQ(track.at(5).orientation.norm(), 1);
  EXPECT_FALSE(track.between(0, 10).moves());
}

TEST(PoseTrack, RefusesNoKeysTimesThatDoNotRiseAndPosesThatAreNone) {
  EXPECT_THROW(PoseTrack({}), InputError);
  EXPECT_THROW(PoseTrack({{1, {}}, {1, {}}}), InputError);
  EXPECT_THROW(PoseTrack({{0, {Vec3(NAN, 0, 0), Quat::Identity()}}}), InputError);
  EXPECT_THROW(PoseTrack({{0, {Vec3::Zero(), Quat(0, 0, 0, 0)}}}), InputError);
}

}  // namespace
}  // namespace effuse::geometry
