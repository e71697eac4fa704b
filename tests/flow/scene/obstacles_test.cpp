#include "flow/scene/obstacles.h"

#include <gtest/gtest.h>

#include <cmath>

#include "flow/effects/solid_world.h"
#include "geometry/procedural/primitives.h"
#include "tests/flow/effects/scene_lines.h"

namespace effuse::flow {
namespace {

/// A slope of 1 in 10 towards +x, 40 m by 40 m, its origin at (1000, 2000) of the map.
geometry::Terrain slope() {
  std::vector<Real> z;
  for (int j = 0; j < 21; ++j)
    for (int i = 0; i < 21; ++i) z.push_back(-0.2 * i);
  return geometry::Terrain::from_height_field(geometry::HeightField(Vec2::Zero(), Vec2(2, 2), 21, 21, z), {Vec3(1000, 2000, 0), ""});
}

std::vector<PlannedObstacle> read(const Lines& lines, std::vector<Fault>* faults = nullptr) {
  const Node root = scene_of(lines);
  Parameters all(root);
  std::vector<PlannedObstacle> plans = read_obstacles(all);
  if (faults) *faults = all.faults();
  else all.finish();
  return plans;
}

TEST(Obstacles, StandWhereTheSceneSaysOnTheGround) {
  const auto plans = read({{"obstacle[0].file", "house.obj"}, {"obstacle[0].position", "[1010, 2020, 0.5]"}, {"obstacle[0].rotation", "[0 deg, 0 deg, 90 deg]"}, {"obstacle[0].scale", "2"}, {"obstacle[0].friction", "0.5"}});
  ASSERT_EQ(plans.size(), 1u);
  EXPECT_EQ(plans[0].name, "house");
  std::vector<PlacedObstacle> placed;
  std::vector<Fault> faults;
  place_obstacle(plans[0], geometry::make_box(Vec3(0, 0, 0), Vec3(1, 2, 3)), slope(), placed, faults);
  ASSERT_TRUE(faults.empty()) << faults[0].message;
  const geometry::RigidPose pose = placed[0].track.at(5);
  EXPECT_NEAR((pose.position - Vec3(10, 20, -1 + 0.5)).norm(), 0, 1e-9);
  // The corner (1, 2, 3), twice as large, turned by a quarter.
  EXPECT_NEAR((pose.world(Vec3(2, 4, 6)) - Vec3(10 - 4, 20 + 2, -0.5 + 6)).norm(), 0, 1e-9);
  EXPECT_NEAR((placed[0].shape.bounds().max() - Vec3(2, 4, 6)).norm(), 0, 1e-12);
}

TEST(Obstacles, MoveByTheirKeysAndMeshesWithYUpAreTurned) {
  const auto plans = read({{"obstacle[0].file", "arm.glb"}, {"obstacle[0].up", "y"}, {"obstacle[0].motion", "linear"}, {"obstacle[0].on_ground", "false"},
                           {"obstacle[0].key[0].time", "1"}, {"obstacle[0].key[0].position", "[1000, 2000, 5]"},
                           {"obstacle[0].key[1].time", "3"}, {"obstacle[0].key[1].position", "[1010, 2000, 5]"}});
  std::vector<PlacedObstacle> placed;
  std::vector<Fault> faults;
  place_obstacle(plans[0], geometry::make_box(Vec3(0, 0, 0), Vec3(1, 3, 2)), slope(), placed, faults);
  ASSERT_EQ(placed.size(), 1u);
  EXPECT_NEAR((placed[0].track.at(2).position - Vec3(5, 0, 5)).norm(), 0, 1e-12);
  EXPECT_NEAR((placed[0].shape.bounds().max() - Vec3(1, 0, 3)).norm(), 0, 1e-12) << "up is z";
  SolidWorld moving(placed, {}, nullptr);
  const sph::SolidOptions solids = moving.solids();
  ASSERT_TRUE(solids.move);
  solids.move(1.5, 2);
  const geometry::RigidMotion& motion = (*solids.obstacles)[0].motion;
  EXPECT_NEAR((motion.velocity_at(Vec3::Zero(), 0.5) - Vec3(5, 0, 0)).norm(), 0, 1e-12);
  solids.move(4, 5);
  EXPECT_FALSE((*solids.obstacles)[0].motion.moves()) << "it stands after the last key";
}

TEST(Obstacles, FaultsAreToldWithTheirPlace) {
  std::vector<Fault> faults;
  read({{"obstacle[0].fiel", "a.obj"}}, &faults);
  EXPECT_GE(faults.size(), 2u) << "no file, no position";
  read({{"obstacle[0].file", "a.obj"}, {"obstacle[0].key[0].time", "2"}, {"obstacle[0].key[0].position", "[0, 0, 0]"}, {"obstacle[0].key[1].time", "1"}}, &faults);
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_NE(faults[0].message.find("does not come after"), std::string::npos) << faults[0].message;

  const auto plans = read({{"obstacle[0].file", "a.obj"}, {"obstacle[0].position", "[0, 0, 0]"}});
  std::vector<PlacedObstacle> placed;
  faults.clear();
  place_obstacle(plans[0], geometry::make_box(Vec3(0, 0, 0), Vec3(1, 1, 1)), slope(), placed, faults);
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_NE(faults[0].message.find("is not on the terrain"), std::string::npos) << faults[0].message;
  const auto good = read({{"obstacle[0].file", "a.obj"}, {"obstacle[0].position", "[1001, 2001, 0]"}});
  faults.clear();
  place_obstacle(good[0], geometry::TriMesh{}, slope(), placed, faults);
  ASSERT_EQ(faults.size(), 1u) << "an empty mesh";
  EXPECT_TRUE(placed.empty());
}

}  // namespace
}  // namespace effuse::flow
