#include "geometry/motion/walk.h"

#include <gtest/gtest.h>

#include "geometry/base/error.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "tests/geometry/motion/sample_walk.h"

namespace effuse::geometry {
namespace {

Real level(const Vec2&) { return 0; }
Real hilly(const Vec2& p) { return 0.15 * p.x() + 0.25 * std::sin(0.8 * p.x()) * std::cos(0.7 * p.y()); }

TEST(Walk, FeetDoNotSlideOnACurveOverHills) {
  for (const bool hills : {false, true}) {
    const std::function<Real(const Vec2&)> ground = hills ? hilly : level;
    WalkOptions o;
    o.path = {Vec2(0, 0), Vec2(4, 1), Vec2(7, 5), Vec2(5, 9)};
    o.duration = 9;
    const SkeletonClip clip = sample_walk();
    const Walk walk = walk_along(clip, ground, o);
    EXPECT_GT(walk.plants.size(), 12u);
    EXPECT_LT(walk.slide, 0.01);
    // And by what is seen: the foot's own place, from the poses alone.
    const std::vector<Leg> legs = find_legs(clip.joints);
    ASSERT_EQ(legs.size(), 2u);
    Real worst = 0, off_ground = 0;
    for (const Walk::Plant& plant : walk.plants)
      for (std::size_t i = plant.first; i <= plant.last; ++i) {
        const Vec3 foot = walk.poses[i][legs[plant.leg].foot].position;
        worst = std::max(worst, (foot - walk.poses[plant.first][legs[plant.leg].foot].position).norm());
        off_ground = std::max(off_ground, std::abs(foot.z() - ground(foot.head<2>()) - 0.08));
      }
    EXPECT_LT(worst, 0.01);
    EXPECT_LT(off_ground, 0.07) << "the ankle's height over the lowest joint, the toe";
    // Bones keep their lengths.
    for (const auto& pose : walk.poses)
      for (const Leg& leg : legs) {
        EXPECT_NEAR((pose[leg.knee].position - pose[leg.hip].position).norm(), 0.44, 1e-9);
        EXPECT_NEAR((pose[leg.foot].position - pose[leg.knee].position).norm(), 0.43, 1e-6);
        EXPECT_LT((pose[leg.knee].world(clip.joints[leg.foot].offset) - pose[leg.foot].position).norm(), 1e-6);
      }
    EXPECT_GT(walk.travelled, 10.5);
  }
}

TEST(Walk, StandsBeforeItSetsOutAndAtThePathsEnd) {
  WalkOptions o;
  o.path = {Vec2(0, 0), Vec2(0, 3)};
  o.duration = 8;
  o.start = 1;
  const Walk walk = walk_along(sample_walk(), level, o);
  EXPECT_LT((walk.poses[0][0].position - walk.poses[55][0].position).norm(), 0.05);
  EXPECT_LT((walk.poses[400][0].position - walk.poses.back()[0].position).norm(), 1e-12);
  EXPECT_NEAR(walk.poses.back()[0].position.y(), 3, 0.15);
  EXPECT_LT(walk.slide, 0.01);
}

TEST(Walk, MovesWithoutAJump) {
  WalkOptions o;
  o.path = {Vec2(0, 0), Vec2(9, 2), Vec2(14, 0)};
  o.duration = 9;
  const Walk walk = walk_along(sample_walk(), hilly, o);
  Real fastest = 0;
  for (std::size_t i = 1; i + 60 < walk.poses.size(); ++i)
    for (std::size_t j = 0; j < walk.poses[i].size(); ++j) fastest = std::max(fastest, (walk.poses[i][j].position - walk.poses[i - 1][j].position).norm() / walk.step);
  // A swinging foot goes two and a half times as fast as who walks, at its most 1.5 times that again; 4.9 m/s.
  EXPECT_LT(fastest, 7);
}

TEST(Walk, RefusesWhatDoesNotWalk) {
  WalkOptions o;
  o.path = {Vec2(0, 0), Vec2(0, 3)};
  o.duration = 2;
  EXPECT_THROW(walk_along(sample_walk(0.001), level, o), InputError);
  SkeletonClip nameless = sample_walk();
  for (ClipJoint& joint : nameless.joints) joint.name = "j";
  EXPECT_THROW(walk_along(nameless, level, o), InputError);
  o.path = {Vec2(0, 0), Vec2(0, 0)};
  EXPECT_THROW(walk_along(sample_walk(), level, o), InputError);
}

TEST(Walk, ItsBodyIsOfClosedCapsules) {
  const SkeletonClip clip = sample_walk();
  const std::vector<Bone> bones = body_of(clip.joints, clip.frames[0]);
  EXPECT_GE(bones.size(), 13u);
  for (const Bone& bone : bones) EXPECT_TRUE(validate(bone.mesh).solid()) << bone.name;
  const TriMesh capsule = make_capsule(Vec3(0, 0, 2), 0.5, 0.5, 64, 16);
  EXPECT_NEAR(signed_volume(capsule), kPi * 0.25 * 2 + 4 / 3. * kPi * 0.125, 0.02);
}

}  // namespace
}  // namespace effuse::geometry
