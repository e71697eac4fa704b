// A terrain asked as a height field and as a mesh: the same contacts.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/random.h"
#include "geometry/mesh/measure.h"
#include "geometry/terrain/sample_heights.h"
#include "geometry/terrain/terrain.h"
#include "tests/geometry/terrain/fields.h"

namespace effuse::geometry {
namespace {

Real angle_deg(const Vec3& a, const Vec3& b) { return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / kPi; }

/// Hills 6 m high and 50 m apart, posts every 20 cm: their cells are twisted by half a millimetre at most, so that flat triangles
/// and bilinear cells are the same surface to that.
HeightField hills() {
  return fields::sampled({0, 0}, {0.2, 0.2}, 251, 201, [](Real x, Real y) { return 3 * std::sin(2 * kPi * x / 50) * std::cos(2 * kPi * y / 50) + 0.05 * x; });
}

TEST(GridAndMesh, TenThousandContactsAreTheSame) {
  const HeightField field = hills();
  const Terrain grid = Terrain::from_height_field(field), mesh = Terrain::from_mesh(field.mesh());
  ASSERT_TRUE(grid.is_height_field());
  ASSERT_FALSE(mesh.is_height_field());
  Real farthest = 0, most_turned = 0, offset = 0;
  std::size_t met = 0;
  for (std::uint64_t k = 0; k < 10000; ++k) {
    const Real x = 3 + 44 * random_uniform(7, 0, k), y = 3 + 34 * random_uniform(7, 1, k);
    const Vec3 p(x, y, field.height(x, y) - 0.5 + 2.0 * random_uniform(7, 2, k));
    const Contact a = grid.contact(p, 1.5), b = mesh.contact(p, 1.5);
    ASSERT_EQ(a.any() && std::abs(a.distance) < 1.499, b.any() && std::abs(a.distance) < 1.499) << p.transpose();
    if (!a.any() || !b.any()) continue;
    ++met;
    farthest = std::max(farthest, std::abs(a.distance - b.distance));
    most_turned = std::max(most_turned, angle_deg(a.normal, b.normal));
    offset = std::max(offset, (a.point - b.point).norm());
  }
  EXPECT_GT(met, 9000u);
  EXPECT_LT(farthest, 1e-3);
  EXPECT_LT(most_turned, 1);
  EXPECT_LT(offset, 0.1) << "a twentieth of the way to a centre of curvature may slide along the ground";
}

TEST(GridAndMesh, HeightsAndRaysAreTheSame) {
  const HeightField field = hills();
  const Terrain grid = Terrain::from_height_field(field), mesh = Terrain::from_mesh(field.mesh());
  for (std::uint64_t k = 0; k < 2000; ++k) {
    const Real x = 50 * random_uniform(8, 0, k), y = 40 * random_uniform(8, 1, k);
    EXPECT_NEAR(grid.height(x, y).value(), mesh.height(x, y).value(), 1e-3);
  }
}

/// A cliff that hangs over: flats at 0 and 8 m, the edge of the upper one 3 m beyond the foot of the wall.
TriMesh overhang() {
  TriMesh mesh;
  const Real profile[][2] = {{0, 0}, {12, 0}, {9, 4}, {9, 8}, {22, 8}};
  for (const auto& [x, z] : profile)
    for (const Real y : {0.0, 20.0}) mesh.positions.emplace_back(x, y, z);
  for (Index k = 0; k + 3 < mesh.positions.size(); k += 2) {
    mesh.triangles.push_back({k, k + 2, k + 3});
    mesh.triangles.push_back({k, k + 3, k + 1});
  }
  return mesh;
}

TEST(GridAndMesh, AnOverhangHasContactsAboveAndBelow) {
  const Terrain cliff = Terrain::from_mesh(overhang());
  // Under the lip: the floor below, the slanting wall beside and above.
  const Contact floor = cliff.contact(Vec3(10.5, 10, 0.3));
  EXPECT_NEAR(floor.distance, 0.3, 1e-12);
  EXPECT_NEAR(floor.normal.z(), 1, 1e-9);
  const Vec3 wall_normal = Vec3(-4, 0, -3).normalized();
  const Contact wall = cliff.contact(Vec3(9.75, 10, 3) + 0.25 * wall_normal);
  EXPECT_NEAR(wall.distance, 0.25, 1e-12);
  // It faces down and out; towards the fold of 37 degrees above it, normals turn by up to half of that (kCreaseAngle).
  EXPECT_LT(angle_deg(wall.normal, wall_normal), 18.5);
  EXPECT_LT(wall.normal.z(), -0.2);
  EXPECT_NEAR(cliff.contact(Vec3(15, 10, 8.5)).distance, 0.5, 1e-12);
  EXPECT_LT(cliff.contact(Vec3(11, 10, 5)).distance, 0) << "in the rock";
  EXPECT_EQ(cliff.height(10.5, 10), 8.0);
  EXPECT_EQ(cliff.height_below(10.5, 10, 5), 0.0);

  const SampledHeights grid = sample_heights(cliff, 1, Vec2::Zero(), 1000);
  EXPECT_EQ(grid.nx, 23);
  EXPECT_EQ(grid.ny, 21);
  EXPECT_EQ(grid.holes, 0u);
  EXPECT_EQ(grid.roofed, 4u * 21) << "x from 9 to 12";
  EXPECT_EQ(grid.z[static_cast<std::size_t>(23 * 4 + 8)], 0);
  EXPECT_EQ(grid.z[static_cast<std::size_t>(23 * 4 + 10)], 8);
}

}  // namespace
}  // namespace effuse::geometry
