#include "geometry/terrain/plane.h"

#include <gtest/gtest.h>

#include <cmath>

namespace effuse::geometry {
namespace {

TEST(Plane, IsAsLargeAndSteepAsAskedAndFallsTheWayItIsTold) {
  const Real slope = 0.3;
  for (const Real downhill : {0.0, 1.0, kPi, -2.5}) {
    const HeightField field = make_plane(Vec2(60, 20), slope, downhill);
    EXPECT_NEAR((field.bounds().min().head<2>() - Vec2(-30, -10)).norm(), 0, 1e-12);
    EXPECT_NEAR((field.bounds().max().head<2>() - Vec2(30, 10)).norm(), 0, 1e-12);
    EXPECT_EQ(field.nx(), 33);
    EXPECT_EQ(field.ny(), 12);
    EXPECT_NEAR(field.height(0, 0), 0, 1e-12);
    EXPECT_NEAR(field.height(5 * std::cos(downhill), 5 * std::sin(downhill)), -5 * std::tan(slope), 1e-12);
    EXPECT_NEAR(field.height(-3 * std::sin(downhill), 3 * std::cos(downhill)), 0, 1e-12) << "level across";
    EXPECT_NEAR(field.max_slope(), std::tan(slope), 1e-12);
  }
}

TEST(Plane, OfOneCellIsAPlaneToo) {
  const HeightField field = make_plane(Vec2(1, 1000), 0, 0, 1);
  EXPECT_EQ(field.nx(), 2);
  EXPECT_EQ(field.ny(), 2);
  EXPECT_EQ(field.height(0.2, 433), 0);
}

}  // namespace
}  // namespace effuse::geometry
