#include "geometry/remesh/remesh.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/error.h"
#include "geometry/mesh/measure.h"
#include "geometry/procedural/primitives.h"
#include "geometry/repair/repair.h"

namespace effuse::geometry {
namespace {

/// Hills over a sheet of n by n quads of 1 m, at map coordinates.
TriMesh hills(int n) {
  TriMesh mesh = make_grid(Vec3(2667400, 6478700, 0), Vec2(1, 1), n, n);
  for (Vec3& p : mesh.positions) p.z() = 3 * std::sin(0.31 * (p.x() - 2667400)) * std::cos(0.23 * (p.y() - 6478700));
  mesh.attributes["height"].width = 1;
  for (const Vec3& p : mesh.positions) mesh.attributes["height"].values.push_back(static_cast<float>(p.z()));
  return mesh;
}

TEST(SurfaceDistance, IsKnownOfTwoSheetsAndOfABallInABall) {
  const TriMesh low = make_grid(Vec3(0, 0, 0), Vec2(1, 1), 4, 4), high = make_grid(Vec3(1, 1, 0.25), Vec2(1, 1), 4, 4);
  // From low to high: farthest is the corner that high does not cover.
  EXPECT_NEAR(distance_to(low, high, 0.1).largest, std::sqrt(1 + 1 + 0.0625), 1e-12);
  EXPECT_NEAR(distance_to(make_grid(Vec3(1, 1, 0), Vec2(1, 1), 2, 2), high, 0.1).largest, 0.25, 1e-12);
  const TriMesh small = make_sphere(Vec3::Zero(), 1, 4), large = make_sphere(Vec3::Zero(), 1.1, 4);
  const SurfaceDistance d = hausdorff_distance(small, large, 0.05);
  EXPECT_NEAR(d.largest, 0.1, 0.004);  // facets lie 0.2 % inside their spheres
  EXPECT_GT(d.samples, 2 * small.triangles.size());
}

TEST(SurfaceDistance, SeesASpikeBetweenVertices) {
  TriMesh flat = make_grid(Vec3::Zero(), Vec2(10, 10), 1, 1), tent = make_grid(Vec3::Zero(), Vec2(1, 1), 10, 10);
  for (Vec3& p : tent.positions)
    if (p.x() == 3 && p.y() == 4) p.z() = 0.7;
  EXPECT_NEAR(distance_to(tent, flat, 1).largest, 0.7, 1e-12);
  EXPECT_GT(distance_to(flat, tent, 0.1).largest, 0.3) << "from the flat side the tent is nearer, but seen";
}

TEST(Remesh, EdgesAreAsLongAsAskedAndCornersStay) {
  const TriMesh box = make_box(Vec3::Zero(), Vec3(2, 2, 2));
  const Remeshed fine = remesh(box, 0.25);
  EXPECT_TRUE(validate(fine.mesh).solid());
  EXPECT_NEAR(signed_volume(fine.mesh), 8, 1e-9);
  EXPECT_LT(fine.error.largest, 1e-9);
  Real sum = 0;
  std::size_t n = 0;
  for (const Triangle& t : fine.mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k, ++n) sum += (fine.mesh.positions[t[k]] - fine.mesh.positions[t[(k + 1) % 3]]).norm();
  EXPECT_NEAR(sum / static_cast<Real>(n), 0.25, 0.06);
}

TEST(Remesh, AnOpenSheetAtMapCoordinatesKeepsItsRimAndItsAttributes) {
  const TriMesh sheet = hills(24);
  const Remeshed coarse = remesh(sheet, 2);
  EXPECT_TRUE(sound(validate(coarse.mesh)));
  EXPECT_LT(coarse.mesh.triangles.size(), sheet.triangles.size() / 2);
  EXPECT_LT(coarse.error.largest, 0.5);
  EXPECT_EQ(bounds(coarse.mesh).min().head<2>(), bounds(sheet).min().head<2>());
  const VertexAttribute& height = coarse.mesh.attributes.at("height");
  ASSERT_EQ(height.values.size(), coarse.mesh.positions.size());
  for (std::size_t v = 0; v < height.values.size(); ++v) EXPECT_NEAR(height.values[v], coarse.mesh.positions[v].z(), 0.2);
}

TEST(SimplifySlow, KeepsItsPromiseMeasuredBothWays) {
  const TriMesh sheet = hills(24);
  std::size_t before = sheet.triangles.size() + 1;
  for (const Real error : {0.02, 0.2, 1.0}) {
    const Remeshed simple = simplify(sheet, error);
    EXPECT_LE(simple.bound, error);
    EXPECT_GE(simple.bound, simple.error.largest) << "no sample refutes the proof";
    EXPECT_LE(hausdorff_distance(sheet, simple.mesh, 0.1).largest, error) << "measured more finely than by itself";
    EXPECT_TRUE(sound(validate(simple.mesh)));
    EXPECT_LT(simple.mesh.triangles.size(), before) << error;
    before = simple.mesh.triangles.size();
  }
  EXPECT_LT(before, sheet.triangles.size() / 20);
}

TEST(Simplify, AFlatSheetIsTwoTrianglesAndABoxTwelve) {
  EXPECT_EQ(simplify(make_grid(Vec3::Zero(), Vec2(1, 1), 8, 8), 1e-3).mesh.triangles.size(), 2u);
  const TriMesh box = remesh(make_box(Vec3::Zero(), Vec3(2, 2, 2)), 0.5).mesh;
  const Remeshed simple = simplify(box, 1e-3);
  EXPECT_LE(simple.mesh.triangles.size(), 16u);
  EXPECT_TRUE(validate(simple.mesh).solid());
  EXPECT_NEAR(signed_volume(simple.mesh), 8, 0.02);
}

TEST(Remesh, WhatIsNotSoundIsRefused) {
  TriMesh mesh = make_box(Vec3::Zero(), Vec3::Ones());
  std::swap(mesh.triangles[0][1], mesh.triangles[0][2]);
  for (const auto& call : {+[](const TriMesh& m) { remesh(m, 0.5); }, +[](const TriMesh& m) { simplify(m, 0.5); }}) {
    try {
      call(mesh);
      ADD_FAILURE();
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find("repair it first"), std::string::npos) << error.what();
    }
  }
  EXPECT_THROW(remesh(make_box(Vec3::Zero(), Vec3(1000, 1000, 1000)), 0.01), InputError);
}

}  // namespace
}  // namespace effuse::geometry
