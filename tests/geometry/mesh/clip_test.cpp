#include "geometry/mesh/clip.h"

#include <gtest/gtest.h>

#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/procedural/primitives.h"
#include "geometry/repair/repair.h"

namespace effuse::geometry {
namespace {

TEST(Clip, ASheetKeepsItsAreaPieceByPiece) {
  TriMesh sheet = make_grid(Vec3::Zero(), Vec2(1, 1), 5, 4);
  sheet.attributes["x"].width = 1;
  for (const Vec3& p : sheet.positions) sheet.attributes["x"].values.push_back(static_cast<float>(p.x()));
  const Vec3 normal = Vec3(1, 0.3, 0).normalized();
  const TriMesh right = clip(sheet, Vec3(2.3, 1, 0), normal), left = clip(sheet, Vec3(2.3, 1, 0), -normal);
  EXPECT_NEAR(surface_area(right) + surface_area(left), 20, 1e-12);
  for (const TriMesh& half : {right, left}) {
    const MeshReport report = validate(half);
    EXPECT_TRUE(sound(report)) << to_string(report);
    EXPECT_EQ(report.components, 1u) << "no crack at the cut edges";
    for (std::size_t v = 0; v < half.positions.size(); ++v) EXPECT_NEAR(half.attributes.at("x").values[v], half.positions[v].x(), 1e-6);
  }
}

TEST(Clip, ACropIsTheBoxAskedFor) {
  const TriMesh cut = crop(make_grid(Vec3(-3, -3, 7), Vec2(1, 1), 6, 6), Vec2(-1.25, -0.5), Vec2(2, 1.75));
  EXPECT_NEAR(surface_area(cut), 3.25 * 2.25, 1e-12);
  EXPECT_EQ(bounds(cut).min(), Vec3(-1.25, -0.5, 7));
  EXPECT_EQ(bounds(cut).max(), Vec3(2, 1.75, 7));
  EXPECT_TRUE(sound(validate(cut))) << to_string(validate(cut));
  const TriMesh whole = make_grid(Vec3::Zero(), Vec2(1, 1), 3, 3);
  EXPECT_EQ(crop(whole, Vec2(-1, -1), Vec2(9, 9)).positions, whole.positions);
  EXPECT_TRUE(crop(whole, Vec2(5, 5), Vec2(9, 9)).triangles.empty());
}

TEST(Clip, AClosedBodyIsOpenAtTheCut) {
  const TriMesh half = clip(make_sphere(Vec3::Zero(), 1, 3), Vec3(0, 0, 0.1), Vec3::UnitZ());
  const MeshReport report = validate(half);
  EXPECT_FALSE(report.closed());
  EXPECT_TRUE(sound(report)) << to_string(report);
  EXPECT_NEAR(surface_area(half), 2 * kPi * 0.9, 0.03);
}

}  // namespace
}  // namespace effuse::geometry
