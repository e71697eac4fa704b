#include <gtest/gtest.h>

#include <limits>

#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/mesh/weld.h"
#include "geometry/procedural/primitives.h"

namespace effuse::geometry {
namespace {

/// Every triangle with corners of its own, as STL files have it.
TriMesh soup(const TriMesh& mesh) {
  TriMesh apart;
  for (const Triangle& triangle : mesh.triangles) {
    const auto first = static_cast<Index>(apart.positions.size());
    for (Index i : triangle) apart.positions.push_back(mesh.positions[i]);
    apart.triangles.push_back({first, first + 1, first + 2});
  }
  return apart;
}

TEST(Validate, AClosedShapeIsASolidOfItsEulerCharacteristic) {
  EXPECT_TRUE(validate(make_box({0, 0, 0}, {1, 2, 3})).solid());
  EXPECT_EQ(validate(make_box({0, 0, 0}, {1, 2, 3})).euler, 2);
  EXPECT_EQ(validate(make_sphere({0, 0, 0}, 1, 3)).euler, 2);
  const MeshReport torus = validate(make_torus({0, 0, 0}, 3, 1, 20, 10));
  EXPECT_TRUE(torus.solid());
  EXPECT_EQ(torus.euler, 0);
  EXPECT_EQ(torus.edges, 600u);
  EXPECT_EQ(to_string(validate(make_sphere({0, 0, 0}, 1, 0))), "12 vertices, 20 triangles, closed, manifold, oriented, 1 component");
}

TEST(Validate, AnOpenSheetHasItsBorderCounted) {
  const MeshReport sheet = validate(make_grid({0, 0, 0}, {1, 1}, 4, 3));
  EXPECT_EQ(sheet.boundary_edges, 14u);
  EXPECT_EQ(sheet.euler, 1);
  EXPECT_FALSE(sheet.closed());
  EXPECT_TRUE(sheet.manifold());
  EXPECT_TRUE(sheet.oriented());
}

TEST(Validate, EachDefectIsCounted) {
  TriMesh flipped = make_box({0, 0, 0}, {1, 1, 1});
  std::swap(flipped.triangles[0][0], flipped.triangles[0][1]);
  EXPECT_EQ(validate(flipped).misoriented_edges, 3u);
  EXPECT_FALSE(validate(flipped).solid());

  TriMesh fin = make_grid({0, 0, 0}, {1, 1}, 1, 1);  // two triangles share 0-3; a third on that edge
  fin.positions.push_back({0, 0, 5});
  fin.triangles.push_back({0, 3, 4});
  EXPECT_EQ(validate(fin).non_manifold_edges, 1u);
  EXPECT_EQ(validate(fin).non_manifold_vertices, 0u);

  TriMesh bow = soup(make_grid({0, 0, 0}, {1, 1}, 1, 1));  // two triangles that share one vertex only
  bow.triangles[1][0] = bow.triangles[0][0];
  const MeshReport bow_report = validate(bow);
  EXPECT_EQ(bow_report.non_manifold_vertices, 1u);
  EXPECT_EQ(bow_report.unused_vertices, 1u);
  EXPECT_EQ(bow_report.components, 1u);

  TriMesh thin = make_grid({0, 0, 0}, {1, 1}, 1, 1);
  thin.positions.push_back({2, 0, 0});
  thin.triangles.push_back({0, 1, 4});
  thin.triangles.push_back({0, 0, 1});
  EXPECT_EQ(validate(thin).zero_area, 1u);
  EXPECT_EQ(validate(thin).repeated_indices, 1u);
  EXPECT_FALSE(validate(thin).solid());
}

TEST(Validate, ComponentsOfASoupAreItsTriangles) {
  EXPECT_EQ(validate(soup(make_box({0, 0, 0}, {1, 1, 1}))).components, 12u);
  TriMesh two = make_box({0, 0, 0}, {1, 1, 1});
  append(two, make_sphere({5, 0, 0}, 1, 1));
  EXPECT_EQ(validate(two).components, 2u);
  EXPECT_EQ(validate(two).euler, 4);
}

TEST(Validate, AnEmptyMeshIsNeitherClosedNorAnError) {
  EXPECT_FALSE(validate({}).closed());
  EXPECT_EQ(validate({}).euler, 0);
}

TEST(Validate, WhatIsNotWellFormedIsRefusedAndNamed) {
  TriMesh mesh = make_box({0, 0, 0}, {1, 1, 1});
  mesh.triangles[3][1] = 8;
  mesh.positions[5].y() = std::numeric_limits<Real>::quiet_NaN();
  mesh.normals.resize(3);
  mesh.attributes["temperature"] = {1, {1, 2, 3}};
  mesh.attributes["empty"] = {0, {}};
  try {
    validate(mesh);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_EQ(error.faults().size(), 5u) << error.what();
    EXPECT_NE(std::string(error.what()).find("triangle 3 names vertex 8, but there are only 8"), std::string::npos) << error.what();
  }
}

TEST(Measure, VolumeAndAreaOfABoxAreExactFarFromTheOrigin) {
  const TriMesh box = make_box({2667400, 6478700, 100}, {2667402, 6478703, 104});
  EXPECT_NEAR(signed_volume(box), 24, 1e-12);
  EXPECT_NEAR(surface_area(box), 52, 1e-12);
  TriMesh inside_out = box;
  for (Triangle& triangle : inside_out.triangles) std::swap(triangle[0], triangle[1]);
  EXPECT_NEAR(signed_volume(inside_out), -24, 1e-12);
  EXPECT_EQ(signed_volume({}), 0);
}

TEST(Measure, SphereAndTorusConvergeToTheirVolumesWithSecondOrder) {
  const auto sphere_error = [](int level) { return 4 * kPi / 3 - signed_volume(make_sphere({1, 2, 3}, 1, level)); };
  EXPECT_NEAR(std::log2(sphere_error(3) / sphere_error(4)), 2, 0.05);
  const auto torus_error = [](int n) { return 2 * kPi * kPi * 3 - signed_volume(make_torus({1, 2, 3}, 3, 1, 2 * n, n)); };
  EXPECT_NEAR(std::log2(torus_error(20) / torus_error(40)), 2, 0.05);
}

TEST(Measure, NormalsOfASpherePointOutwardAlongTheRadius) {
  TriMesh sphere = make_sphere({10, 20, 30}, 5, 3);
  compute_normals(sphere);
  for (std::size_t i = 0; i < sphere.positions.size(); ++i)
    EXPECT_GT(sphere.normals[i].dot((sphere.positions[i] - Vec3(10, 20, 30)).normalized()), 1 - 1e-3);
}

TEST(Measure, ABoxCornersNormalDoesNotDependOnItsDiagonals) {
  TriMesh box = make_box({0, 0, 0}, {1, 2, 3});
  compute_normals(box);
  EXPECT_LT((box.normals[7] - Vec3(1, 1, 1).normalized()).norm(), 1e-15);
  EXPECT_LT((box.normals[0] - Vec3(-1, -1, -1).normalized()).norm(), 1e-15);
}

TEST(Measure, NormalsHaveTheSameBitsOnAnyNumberOfThreadsAndFallBackToUp) {
  TriMesh one = make_torus({0, 0, 0}, 3, 1, 200, 100);
  one.positions.push_back({9, 9, 9});
  TriMesh four = one;
  {
    const ThreadLimit limit(1);
    compute_normals(one);
  }
  {
    const ThreadLimit limit(4);
    compute_normals(four);
  }
  EXPECT_EQ(one.normals, four.normals);
  EXPECT_EQ(one.normals.back(), Vec3::UnitZ());
}

TEST(Weld, ASoupBecomesTheSolidItWas) {
  const TriMesh sphere = make_sphere({1, 2, 3}, 2, 2);
  TriMesh mesh = soup(sphere);
  const std::size_t corners = mesh.positions.size();
  const WeldReport report = weld(mesh);
  EXPECT_EQ(report.merged_vertices, corners - sphere.positions.size());
  EXPECT_EQ(report.dropped_triangles, 0u);
  EXPECT_TRUE(validate(mesh).solid());
  EXPECT_EQ(validate(mesh).unused_vertices, 0u);
  EXPECT_EQ(signed_volume(mesh), signed_volume(soup(sphere)));
}

TEST(Weld, CollapsedTrianglesAndUnusedVerticesGoAttributesFollow) {
  TriMesh mesh;
  mesh.positions = {{9, 9, 9}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-0.0, 0, 0}, {5, 5, 5}};
  mesh.triangles = {{1, 2, 3}, {1, 4, 2}};
  mesh.normals.assign(6, Vec3::UnitZ());
  mesh.attributes["velocity"] = {2, {0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5}};
  const WeldReport report = weld(mesh);
  EXPECT_EQ(report.merged_vertices, 1u) << "0 and -0 are equal";
  EXPECT_EQ(report.dropped_triangles, 1u);
  EXPECT_EQ(report.dropped_vertices, 2u);
  EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{0, 1, 2}}));
  EXPECT_EQ(mesh.attributes["velocity"].values, (std::vector<float>{1, 1, 2, 2, 3, 3}));
  EXPECT_TRUE(mesh.normals.empty());
  EXPECT_NO_THROW(validate(mesh));
}

TEST(Weld, AWeldedMeshKeepsItsNormalsAndOrder) {
  TriMesh mesh = make_torus({0, 0, 0}, 3, 1, 12, 8);
  compute_normals(mesh);
  const TriMesh before = mesh;
  const WeldReport report = weld(mesh);
  EXPECT_EQ(report.merged_vertices + report.dropped_triangles + report.dropped_vertices, 0u);
  EXPECT_EQ(mesh.positions, before.positions);
  EXPECT_EQ(mesh.triangles, before.triangles);
  EXPECT_EQ(mesh.normals, before.normals);
}

}  // namespace
}  // namespace effuse::geometry
