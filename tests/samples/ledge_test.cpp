// Lava on ground that no grid can hold: it runs to a lip, falls past a hollow and goes on below.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "samples/effuse/load_scene.h"

namespace effuse {
namespace {

const std::filesystem::path kLedge = std::filesystem::path(EFFUSE_SOURCE_DIR) / "samples" / "scenes" / "ledge.toml";

TEST(Ledge, HasRockOverRock) {
  const auto loaded = load_scene(kLedge, {"lava.spacing=0.6 m"}, 1);
  const geometry::Terrain& ground = *loaded->terrain;
  EXPECT_FALSE(ground.is_height_field());
  // Three metres behind the lip, in the middle: the top of the ledge, and the floor of the hollow under it.
  const auto top = ground.height(12.5, 10), floor = ground.height_below(12.5, 10, 7);
  ASSERT_TRUE(top && floor);
  EXPECT_GT(*top - *floor, 5);
  EXPECT_GT(ground.signed_distance(Vec3(12.5, 10, *floor + 1)), 0.5) << "room under the roof";
  EXPECT_LT(ground.signed_distance(Vec3(12.5, 10, *top - 0.5)), 0);
}

TEST(LedgeSlow, LavaFallsOverItAndGoesOnBelow) {
  const auto loaded = load_scene(kLedge, {"lava.spacing=0.5 m"}, 48);
  const geometry::Terrain& ground = *loaded->terrain;
  double deepest = 0, lowest = 1e9;
  std::size_t falling = 0;
  while (loaded->simulation->frame() < loaded->scene.frames) {
    ASSERT_TRUE(loaded->simulation->advance([] { return true; }));
    for (const Vec3& x : loaded->simulation->effects().front()->points().position) {
      const double d = ground.signed_distance(x);
      if (x.x() > 1 && x.x() < 35 && x.y() > 1 && x.y() < 19) deepest = std::min(deepest, d);
      lowest = std::min(lowest, x.z());
      falling += x.x() > 13 && x.x() < 17 && d > 1.5;
    }
  }
  EXPECT_GT(deepest, -0.05) << "nothing is in the rock by more than a tenth of a spacing";
  EXPECT_LT(lowest, 4) << "it has come down 8 m";
  EXPECT_GT(falling, 20u) << "through the air";
}

}  // namespace
}  // namespace effuse
