#include "skin/tessellate/shapes.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/random.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/procedural/primitives.h"
#include "geometry/query/mesh_tree.h"

namespace effuse::skin {
namespace {

using geometry::TriMesh;

/// One triangle a b c with normals up.
TriMesh triangle(const Vec3& c) {
  TriMesh mesh;
  mesh.positions = {Vec3(0, 0, 0), Vec3(1, 0, 0), c};
  mesh.triangles = {{0, 1, 2}};
  mesh.normals.assign(3, Vec3::UnitZ());
  return mesh;
}

TEST(TriangleShapes, AnglesAreThoseOfKnownTriangles) {
  EXPECT_NEAR(triangle_shapes(triangle(Vec3(0.5, std::sqrt(0.75), 0))).least_angle, 60, 1e-9);
  EXPECT_NEAR(triangle_shapes(triangle(Vec3(0, 1, 0))).least_angle, 45, 1e-9);
  for (const Real degrees : {4.9, 5.1}) {
    const TriangleShapes shapes = triangle_shapes(triangle(Vec3(1, std::tan(degrees * kPi / 180), 0)));
    EXPECT_NEAR(shapes.least_angle, degrees, 1e-9);
    EXPECT_EQ(shapes.thin, degrees < 5 ? 1 : 0);
    EXPECT_EQ(shapes.folded, 0u);
  }
  EXPECT_EQ(triangle_shapes(triangle(Vec3(0.5, -1, 0))).folded, 1u);
  EXPECT_EQ(triangle_shapes(triangle(Vec3(0.5, 0, 0))).least_angle, 0);
  EXPECT_EQ(triangle_shapes(TriMesh{}).thin, 0);
}

/// A sphere whose vertices were pushed about along it until triangles got thin.
TriMesh shaken_sphere() {
  TriMesh mesh = geometry::make_sphere(Vec3::Zero(), 1, 3);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    mesh.positions[v] =
        (mesh.positions[v] + 0.075 * Vec3(random_normal(1, 0, v), random_normal(1, 1, v), random_normal(1, 2, v))).normalized();
  mesh.attributes["height"].values.clear();
  for (const Vec3& x : mesh.positions) mesh.attributes["height"].values.push_back(static_cast<float>(x.z()));
  geometry::compute_normals(mesh);
  return mesh;
}

TEST(WidenThin, MakesThinTrianglesFewAndStaysOnTheMesh) {
  const TriMesh before = shaken_sphere();
  TriMesh mesh = before;
  const Real thin = triangle_shapes(before).thin;
  ASSERT_GT(thin, 0.02);
  const std::size_t moved = widen_thin(mesh, 10, 0.1);
  EXPECT_LT(triangle_shapes(mesh).thin, thin / 3);
  EXPECT_TRUE(geometry::validate(mesh).solid());
  EXPECT_EQ(mesh.triangles, before.triangles);
  // On the triangles there were, within its tether, with the attributes of the place; the rest as it was.
  const geometry::MeshTree tree(before.positions, before.triangles);
  std::size_t other = 0;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const Vec3& x = mesh.positions[v];
    EXPECT_LT(tree.nearest(x)->distance, 1e-9);
    EXPECT_LT((x - before.positions[v]).norm(), 0.1 + 1e-9);
    EXPECT_NEAR(mesh.attributes.at("height").values[v], x.z(), 1e-6);
    other += x != before.positions[v];
  }
  EXPECT_GT(moved, 0u);
  EXPECT_LE(other, moved);
}

TEST(WidenThin, LeavesAMeshWithoutThinTrianglesAsItIs) {
  TriMesh mesh = geometry::make_sphere(Vec3::Zero(), 1, 3);
  geometry::compute_normals(mesh);
  const TriMesh before = mesh;
  EXPECT_EQ(widen_thin(mesh, 10, 0.1), 0u);
  EXPECT_EQ(mesh.positions, before.positions);
  EXPECT_EQ(mesh.normals, before.normals);
}

TEST(LiftFacets, GivesASphereItsVolumeBack) {
  for (int level : {1, 2, 3}) {
    TriMesh mesh = geometry::make_sphere(Vec3(3, 1, 2), 2, level);
    mesh.normals.clear();
    for (const Vec3& x : mesh.positions) mesh.normals.push_back((x - Vec3(3, 1, 2)).normalized());
    const Real whole = 4.0 / 3 * kPi * 8, missing = 1 - geometry::signed_volume(mesh) / whole;
    lift_facets(mesh);
    EXPECT_LT(std::abs(1 - geometry::signed_volume(mesh) / whole), 0.12 * missing) << "level " << level << " missed " << missing;
  }
}

TEST(LiftFacets, LeavesPlanesAndSharpEdgesAsTheyAre) {
  TriMesh box = geometry::make_box(Vec3(0, 0, 0), Vec3(4, 2, 1));
  geometry::compute_normals(box);
  const TriMesh before = box;
  lift_facets(box);
  // Normals at a box's corners are 70 or more degrees apart.
  EXPECT_EQ(box.positions, before.positions);
  TriMesh grid = geometry::make_grid(Vec3::Zero(), Vec2(2, 1), 4, 3);
  geometry::compute_normals(grid);
  const TriMesh flat = grid;
  lift_facets(grid);
  EXPECT_EQ(grid.positions, flat.positions);
}

}  // namespace
}  // namespace effuse::skin
