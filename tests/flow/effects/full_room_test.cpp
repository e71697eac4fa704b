#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "flow/effects/lava.h"
#include "geometry/base/error.h"
#include "geometry/procedural/primitives.h"
#include "tests/flow/effects/scene_lines.h"

/// A vent in a room of obstacles.
namespace effuse::flow {
namespace {

/// Four walls, open at the top.
geometry::TriMesh room(Real height) {
  geometry::TriMesh walls = geometry::make_box(Vec3(0, 0, -1), Vec3(6, 6, height));
  std::erase_if(walls.triangles, [&](const geometry::Triangle& t) { return std::all_of(t.begin(), t.end(), [&](Index v) { return walls.positions[v].z() > 0; }); });
  return walls;
}

/// What is thrown while it fills for four seconds; empty: nothing.
std::string fill(bool open) {
  const geometry::Terrain terrain = geometry::Terrain::from_height_field(geometry::HeightField(Vec2(-10, -10), Vec2(14, 14), 3, 3, std::vector<Real>(9, 0.0)), {}, 288.15);
  const Node root = scene_of({{"lava.spacing", "0.5 m"}, {"lava.rheology.viscosity", "1000 Pa s"}, {"lava.vent[0].at", "[3, 3]"}, {"lava.vent[0].width", "2 m"}, {"lava.vent[0].rate", "40 m3/s"}});
  Parameters all(root);
  Parameters lava = all.table("lava", "");
  const EffectPlan plan = read_lava(lava, 10);
  all.finish();
  std::vector<PlacedObstacle> walls = {{"room", geometry::CollisionMesh(room(open ? 9 : 2)), geometry::PoseTrack(std::vector<geometry::PoseKey>(1)), 0, 1}};
  if (!open) walls.push_back({"lid", geometry::CollisionMesh(geometry::make_box(Vec3(-1, -1, 2), Vec3(7, 7, 3))), geometry::PoseTrack(std::vector<geometry::PoseKey>(1)), 0, 1});
  World world{&terrain, 7};
  world.obstacles = &walls;
  const auto effect = plan.build(world);
  try {
    while (effect->time() < 4) effect->step(4);
  } catch (const UnstableError& error) {
    return error.what();
  }
  return "";
}

TEST(FullRoomSlow, AVentThatFillsAClosedRoomEndsTheRunAndSaysWhere) {
  EXPECT_EQ(fill(true), "") << "an open one has room enough";
  const std::string told = fill(false);
  EXPECT_NE(told.find("more lava is let in there than there is room for"), std::string::npos) << told;
}

}  // namespace
}  // namespace effuse::flow
