#include "geometry/collide/convex_hull.h"

#include <gtest/gtest.h>

#include <limits>

#include "geometry/base/error.h"
#include "geometry/base/random.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/procedural/primitives.h"

namespace effuse::geometry {
namespace {

/// Every promise of the struct: planes hold all vertices, edges know their faces, Euler's formula.
void check_hull(const ConvexHull& hull) {
  const Real size = bounds(mesh_of(hull)).diagonal().norm();
  EXPECT_EQ(hull.vertices.size() + hull.faces.size(), hull.edges.size() + 2);
  for (const ConvexHull::Face& face : hull.faces) {
    EXPECT_NEAR(face.normal.norm(), 1, 1e-14);
    EXPECT_GE(face.count, 3u);
    for (const Vec3& v : hull.vertices) EXPECT_LE(face.normal.dot(v) - face.offset, 1e-5 * size);
    EXPECT_LT(face.normal.dot(hull.centre), face.offset);
  }
  for (const ConvexHull::Edge& edge : hull.edges) {
    const auto [a, b] = edge.vertices;
    for (int k = 0; k < 2; ++k) {
      // The first face runs the edge from a to b, the second back.
      const auto loop = hull.loop(hull.faces[edge.faces[k]]);
      bool found = false;
      for (std::size_t i = 0; i < loop.size(); ++i)
        found = found || (loop[i] == (k ? b : a) && loop[(i + 1) % loop.size()] == (k ? a : b));
      EXPECT_TRUE(found);
    }
  }
  const MeshReport report = validate(mesh_of(hull));
  EXPECT_TRUE(report.solid()) << to_string(report);
  EXPECT_GT(signed_volume(mesh_of(hull)), 0);
}

TEST(ConvexHull, OfABoxHasSixFacesHoweverItIsTurned) {
  for (std::uint64_t k = 0; k < 50; ++k) {
    const Quat q = Quat(random_normal(1, 0, k), random_normal(1, 1, k), random_normal(1, 2, k), random_normal(1, 3, k)).normalized();
    std::vector<Vec3> points;
    for (const Vec3& p : make_box(Vec3(0, 0, 0), Vec3(1, 2, 30)).positions) points.push_back(q * p + Vec3(1e4, -1e4, 10));
    // And points on its faces, its edges, inside.
    points.push_back((points[0] + points[7]) / 2);
    points.push_back((points[0] + points[1]) / 2);
    const ConvexHull hull = make_convex_hull(points);
    EXPECT_EQ(hull.faces.size(), 6u);
    EXPECT_EQ(hull.vertices.size(), 8u);
    EXPECT_EQ(hull.edges.size(), 12u);
    check_hull(hull);
    EXPECT_NEAR(signed_volume(mesh_of(hull)), 60, 1e-6);
  }
  check_hull(make_box_hull(Vec3(1, 2, 3)));
}

// Memory moves between calls; what is answered must not.
TEST(ConvexHull, TheSamePointsGiveTheSameBits) {
  std::vector<Vec3> points = make_sphere(Vec3(1, 2, 3), 1, 2).positions;
  for (const Vec3& p : make_box(Vec3(0, 1, 2), Vec3(2.5, 3, 4)).positions) points.push_back(p);
  const ConvexHull first = make_convex_hull(points);
  std::vector<std::vector<char>> clutter;
  for (std::size_t k = 0; k < 20; ++k) {
    clutter.emplace_back(100 * k + 7);
    const ConvexHull again = make_convex_hull(points);
    EXPECT_TRUE(first.vertices == again.vertices);
    EXPECT_TRUE(first.loops == again.loops);
  }
}

TEST(ConvexHull, HoldsAllItsPoints) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    std::vector<Vec3> points;
    for (std::uint64_t k = 0; k < 40; ++k) points.emplace_back(random_normal(seed, 0, k), 3 * random_normal(seed, 1, k), random_normal(seed, 2, k));
    const ConvexHull hull = make_convex_hull(points);
    check_hull(hull);
    for (const Vec3& p : points)
      for (const ConvexHull::Face& face : hull.faces) EXPECT_LE(face.normal.dot(p) - face.offset, 1e-5);
  }
}

TEST(ConvexHull, OfManyPointsIsThatOfTheMostExtremeOnes) {
  const TriMesh sphere = make_sphere(Vec3(1, 2, 3), 2, 4);
  const ConvexHull hull = make_convex_hull(sphere.positions, 32);
  check_hull(hull);
  EXPECT_LE(hull.vertices.size(), 32u);
  EXPECT_GT(hull.vertices.size(), 24u);
  EXPECT_GT(signed_volume(mesh_of(hull)), 0.7 * signed_volume(sphere));
}

TEST(ConvexHull, RefusesPointsThatSpanNoVolumeOrAreNotFinite) {
  const std::vector<Vec3> flat{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0.5, 0.5, 0}};
  EXPECT_THROW(make_convex_hull(flat), InputError);
  EXPECT_THROW(make_convex_hull(std::vector<Vec3>(10, Vec3(1, 2, 3))), InputError);
  EXPECT_THROW(make_convex_hull(std::vector<Vec3>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}), InputError);
  std::vector<Vec3> bad = flat;
  bad.push_back(Vec3(0, 0, std::numeric_limits<Real>::quiet_NaN()));
  EXPECT_THROW(make_convex_hull(bad), InputError);
}

}  // namespace
}  // namespace effuse::geometry
