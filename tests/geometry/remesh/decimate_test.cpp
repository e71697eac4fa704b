#include "geometry/remesh/decimate.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/random.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/procedural/primitives.h"
#include "geometry/remesh/surface_distance.h"

namespace effuse::geometry {
namespace {

/// Hills on a grid, with a height as attribute.
TriMesh hills(int n) {
  TriMesh mesh = make_grid(Vec3(0, 0, 0), Vec2(1, 1), n, n);
  VertexAttribute height{1, {}};
  for (Vec3& p : mesh.positions) {
    p.z() = 4 * std::sin(0.11 * p.x()) * std::cos(0.07 * p.y()) + 0.3 * std::sin(0.5 * p.x() + 0.4 * p.y());
    height.values.push_back(static_cast<float>(p.z()));
  }
  mesh.attributes["height"] = height;
  compute_normals(mesh);
  return mesh;
}

TEST(Decimate, ASphereStaysAClosedSphereOfNearlyItsVolume) {
  TriMesh mesh = make_sphere(Vec3(100, 200, 300), 2, 5);
  const Real volume = signed_volume(mesh);
  const Decimated result = decimate(mesh, 2000);
  EXPECT_EQ(result.after, mesh.triangles.size());
  EXPECT_LE(mesh.triangles.size(), 2000u);
  EXPECT_GE(mesh.triangles.size(), 1998u);
  const MeshReport report = validate(mesh);
  EXPECT_TRUE(report.solid() && report.manifold()) << to_string(report);
  EXPECT_EQ(report.euler, 2);
  EXPECT_EQ(report.unused_vertices, 0u);
  // Vertices lie on the sphere: 2,000 equal triangles cut off 4 pi / (sqrt(3) 2000) of its volume, some 0.4 %; these are not equal.
  EXPECT_NEAR(signed_volume(mesh) / volume, 1, 0.012);
  for (const Vec3& p : mesh.positions) ASSERT_NEAR((p - Vec3(100, 200, 300)).norm(), 2, 1e-9);  // its own vertices, not moved
}

TEST(Decimate, ATorusKeepsItsHole) {
  TriMesh mesh = make_torus(Vec3::Zero(), 3, 1, 120, 60);
  decimate(mesh, 600);
  const MeshReport report = validate(mesh);
  EXPECT_TRUE(report.solid() && report.manifold()) << to_string(report);
  EXPECT_EQ(report.euler, 0);
  EXPECT_LE(report.triangles, 600u);
}

TEST(Decimate, GoesDownToWhatTheShapeAllowsAndSaysSo) {
  TriMesh mesh = make_sphere(Vec3::Zero(), 1, 4);
  const Decimated result = decimate(mesh, 0);
  EXPECT_EQ(result.after, mesh.triangles.size());
  EXPECT_GE(result.after, 4u);
  EXPECT_TRUE(validate(mesh).solid());
}

TEST(DecimateSlow, HillsKeepTheirBorderAndAttributes) {
  TriMesh mesh = hills(100);
  const TriMesh fine = mesh;
  const Decimated result = decimate(mesh, 4000);
  EXPECT_LE(mesh.triangles.size(), 4000u);
  const MeshReport report = validate(mesh);
  EXPECT_TRUE(report.manifold() && report.oriented()) << to_string(report);
  EXPECT_EQ(report.components, 1u);
  EXPECT_EQ(report.euler, 1);
  const Box3 a = bounds(fine), b = bounds(mesh);
  EXPECT_LT((a.min() - b.min()).head<2>().norm() + (a.max() - b.max()).head<2>().norm(), 1e-9);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) ASSERT_EQ(mesh.attributes.at("height").values[v], static_cast<float>(mesh.positions[v].z()));
  // An equal-edged mesh of a fifth of the triangles has edges of 2.2 m, whose chords leave the small waves (30 cm, 0.64 / m) by up to
  // 0.3 (0.64 1.1)^2 / 2 = 0.074 m: twice that, as the cost is of means.
  EXPECT_LT(hausdorff_distance(fine, mesh).largest, 0.148) << result.error;
  EXPECT_GT(result.error, 0);
}

TEST(Decimate, FlatGroundGoesFirst) {
  TriMesh mesh = make_grid(Vec3(0, 0, 0), Vec2(1, 1), 60, 60);
  for (Vec3& p : mesh.positions)
    if (p.x() > 30) p.z() = std::sin(p.x()) * std::sin(p.y());
  decimate(mesh, 3000);
  std::size_t flat = 0;
  for (const Vec3& p : mesh.positions) flat += p.x() < 30;
  EXPECT_LT(flat, mesh.positions.size() / 10);
}

TEST(Decimate, SeamsOfColourStayWhereTheyAre) {
  // Flat, and bright in a strip: without colour's cost nothing would keep the strip's edge.
  TriMesh mesh = make_grid(Vec3(0, 0, 0), Vec2(1, 1), 60, 60);
  VertexAttribute color{3, {}};
  for (const Vec3& p : mesh.positions) color.values.insert(color.values.end(), 3, p.x() >= 28 && p.x() <= 32 ? 1.0f : 0.0f);
  mesh.attributes["color"] = color;
  decimate(mesh, 1600);
  Real area = 0;  // covered by the mean of the corners' brightness
  for (const Triangle& t : mesh.triangles) {
    const Vec3 a = mesh.positions[t[0]], n = (mesh.positions[t[1]] - a).cross(mesh.positions[t[2]] - a);
    Real bright = 0;
    for (const Index v : t) bright += mesh.attributes.at("color").values[3 * v] / 3;
    area += 0.5 * n.norm() * bright;
  }
  // 4 m of brightness and half a metre of slope either side, 60 m long.
  EXPECT_NEAR(area, 5 * 60, 0.08 * 5 * 60);
}

TEST(Decimate, LeavesNonManifoldEdgesAloneAndTakesAnyTriangles) {
  TriMesh mesh = hills(40);
  // A fin on the first triangle's edge, a triangle that is none, one far away.
  mesh.positions.insert(mesh.positions.end(), {Vec3(0.5, 0.5, 9), Vec3(90, 0, 0), Vec3(91, 0, 0), Vec3(90, 1, 0)});
  mesh.normals.resize(mesh.positions.size(), Vec3::UnitZ());
  mesh.attributes.at("height").values.resize(mesh.positions.size());
  const Triangle t = mesh.triangles[100];
  const auto n = static_cast<Index>(mesh.positions.size());
  mesh.triangles.push_back({t[0], t[1], n - 4});
  mesh.triangles.push_back({t[1], t[0], n - 4});
  mesh.triangles.push_back({5, 5, 6});
  mesh.triangles.push_back({n - 3, n - 2, n - 1});
  decimate(mesh, 300);
  EXPECT_LE(mesh.triangles.size(), 300u);
  EXPECT_EQ(validate(mesh).repeated_indices, 0u);
}

TEST(Decimate, AMeshThatIsSmallEnoughIsLeftAsItIs) {
  TriMesh mesh = hills(10);
  const TriMesh before = mesh;
  const Decimated result = decimate(mesh, 200);
  EXPECT_EQ(result.after, 200u);
  EXPECT_EQ(mesh.triangles, before.triangles);
}

}  // namespace
}  // namespace effuse::geometry
