#include "geometry/collide/convex_contact.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "geometry/base/random.h"
#include "geometry/procedural/primitives.h"
#include "geometry/query/closest_point.h"

namespace effuse::geometry {
namespace {

constexpr Real kSlop = 1e-4;

Mat3 random_rotation(std::uint64_t seed, std::uint64_t k) {
  return Quat(random_normal(seed, 0, k), random_normal(seed, 1, k), random_normal(seed, 2, k), random_normal(seed, 3, k)).normalized().toRotationMatrix();
}

ConvexHull random_hull(std::uint64_t seed, std::uint64_t k) {
  std::vector<Vec3> points;
  for (std::uint64_t i = 0; i < 12; ++i) points.emplace_back(random_normal(seed, 10 + i, k), random_normal(seed, 30 + i, k), 0.7 * random_normal(seed, 50 + i, k));
  return make_convex_hull(points);
}

/// How far B must go along n until it is clear of A: the overlap of the two along it, with sign.
Real overlap_along(const ConvexHull& a, const ConvexHull& b, const Vec3& n) {
  return n.dot(a.vertices[a.support(n)]) - n.dot(b.vertices[b.support(-n)]);
}

/// The least overlap along any direction: over all face normals and all products of edges, nothing left out.
Real least_overlap(const ConvexHull& a, const ConvexHull& b) {
  Real least = std::numeric_limits<Real>::infinity();
  const auto try_axis = [&](const Vec3& n) { least = std::min({least, overlap_along(a, b, n), overlap_along(a, b, -n)}); };
  for (const auto& f : a.faces) try_axis(f.normal);
  for (const auto& f : b.faces) try_axis(f.normal);
  for (const auto& e : a.edges)
    for (const auto& g : b.edges) {
      const Vec3 n = (a.vertices[e.vertices[1]] - a.vertices[e.vertices[0]]).cross(b.vertices[g.vertices[1]] - b.vertices[g.vertices[0]]);
      if (n.norm() > 1e-6) try_axis(n.normalized());
    }
  return least;
}

TEST(HullContact, PartsTheTwoByTheLeastWayThereIs) {
  int deep = 0;
  for (std::uint64_t k = 0; k < 500; ++k) {
    const ConvexHull a = random_hull(1, k);
    const Vec3 shift = 2.5 * Vec3(random_uniform(2, 0, k) - 0.5, random_uniform(2, 1, k) - 0.5, random_uniform(2, 2, k) - 0.5);
    const ConvexHull b = transformed(random_hull(3, k), random_rotation(4, k), shift);
    const Manifold m = hull_contact(a, b, 0, kSlop);
    const Real least = least_overlap(a, b);
    if (least < 0) {
      EXPECT_EQ(m.count, 0) << "apart by " << least << ", pose " << k;
      continue;
    }
    ++deep;
    ASSERT_GT(m.count, 0) << "overlap " << least << ", pose " << k;
    EXPECT_NEAR(m.normal.norm(), 1, 1e-12);
    // Faces are preferred by the slop.
    EXPECT_LE(overlap_along(a, b, m.normal), least + 2 * kSlop) << "pose " << k;
    Real deepest = 0;
    for (const ManifoldPoint& p : m.all()) {
      EXPECT_NEAR(m.normal.dot(p.on_b - p.on_a), p.separation, 1e-12);
      deepest = std::max(deepest, -p.separation);
    }
    EXPECT_LE(deepest, least + 2 * kSlop);
  }
  EXPECT_GT(deep, 100);
}

TEST(HullContact, OfABoxOnABoxHasTheFourCornersOfTheOverlap) {
  const ConvexHull a = make_box_hull(Vec3(1, 1, 1));
  const ConvexHull b = transformed(make_box_hull(Vec3(1, 1, 1)), Mat3::Identity(), Vec3(0.5, -0.25, 1.99));
  const Manifold m = hull_contact(a, b, 0.01, kSlop);
  ASSERT_EQ(m.count, 4);
  EXPECT_LT((m.normal - Vec3::UnitZ()).norm(), 1e-14);
  Box3 box;
  for (const ManifoldPoint& p : m.all()) {
    box.extend(p.on_a);
    EXPECT_NEAR(p.separation, -0.01, 1e-12);
    EXPECT_NEAR(p.on_a.z(), 1, 1e-12);
    EXPECT_NEAR(p.on_b.z(), 0.99, 1e-12);
  }
  EXPECT_LT((box.min() - Vec3(-0.5, -1, 1)).norm() + (box.max() - Vec3(1, 0.75, 1)).norm(), 1e-12);
}

TEST(HullContact, OfCrossedEdgesIsWhereTheyPass) {
  // Two bars on edge, crossed at right angles, 1 mm deep.
  const Mat3 on_edge = Eigen::AngleAxisd(kPi / 4, Vec3::UnitX()).toRotationMatrix();
  const ConvexHull a = transformed(make_box_hull(Vec3(5, 0.5, 0.5)), on_edge, Vec3::Zero());
  const Mat3 across = Eigen::AngleAxisd(kPi / 2, Vec3::UnitZ()).toRotationMatrix();
  const Real reach = std::sqrt(0.5);
  const ConvexHull b = transformed(a, across, Vec3(0.3, 0.2, 2 * reach - 1e-3));
  const Manifold m = hull_contact(a, b, 0.01, 1e-5);
  ASSERT_EQ(m.count, 1);
  EXPECT_LT((m.normal - Vec3::UnitZ()).norm(), 1e-12);
  EXPECT_NEAR(m.points[0].separation, -1e-3, 1e-12);
  EXPECT_LT((m.points[0].on_a - Vec3(0.3, 0, reach)).norm(), 1e-12);
}

TEST(HullContact, IsTheSameSeenFromTheOther) {
  for (std::uint64_t k = 0; k < 200; ++k) {
    const ConvexHull a = random_hull(5, k);
    const ConvexHull b = transformed(random_hull(6, k), random_rotation(7, k), Vec3(1.5, 0.5, 0.3));
    const Manifold m = hull_contact(a, b, 0.05, kSlop), n = hull_contact(b, a, 0.05, kSlop);
    EXPECT_EQ(m.count > 0, n.count > 0);
    if (m.count == 0) continue;
    const Real by_m = overlap_along(a, b, m.normal), by_n = overlap_along(a, b, -n.normal);
    EXPECT_NEAR(by_m, by_n, 3 * kSlop);
  }
}

TEST(ReduceManifold, KeepsTheDeepestAndTheLargestArea) {
  std::vector<ManifoldPoint> points;
  for (int k = 0; k < 12; ++k) {
    const Real turn = 2 * kPi * k / 12;
    points.push_back({Vec3(std::cos(turn), std::sin(turn), 0), Vec3::Zero(), k == 7 ? -1.0 : 0.0});
  }
  ASSERT_EQ(reduce_manifold(points, Vec3::UnitZ()), 4);
  EXPECT_EQ(points[0].separation, -1);
  const Vec3 p = points[0].on_a, q = points[1].on_a, r = points[2].on_a, s = points[3].on_a;
  EXPECT_NEAR((p - q).norm(), 2, 1e-12);
  const Real area = ((q - p).cross(r - p).norm() + (q - p).cross(s - p).norm()) / 2;
  EXPECT_GT(area, 1.7);  // a square has 2; these lie on opposite sides
}

TEST(NearestOnHull, AgreesWithTheTrianglesOutsideAndTheFacesInside) {
  for (std::uint64_t k = 0; k < 300; ++k) {
    const ConvexHull hull = random_hull(8, k % 10);
    const TriMesh mesh = mesh_of(hull);
    const Vec3 p = 2 * Vec3(random_normal(9, 0, k), random_normal(9, 1, k), random_normal(9, 2, k));
    const HullPoint at = nearest_on_hull(hull, p);
    Real nearest = std::numeric_limits<Real>::infinity(), inside = -nearest;
    for (const Triangle& t : mesh.triangles)
      nearest = std::min(nearest, (closest_point_on_triangle(p, mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]]).point - p).norm());
    for (const auto& face : hull.faces) inside = std::max(inside, face.normal.dot(p) - face.offset);
    EXPECT_NEAR(at.distance, inside > 0 ? nearest : -nearest, 1e-5);
    EXPECT_LT((at.point + at.distance * at.normal - p).norm(), 1e-12);
    EXPECT_NEAR(at.normal.norm(), 1, 1e-12);
  }
}

TEST(SphereContacts, AreExact) {
  const Manifold m = sphere_contact(Vec3(1, 2, 3), 1, Vec3(1, 2, 4.5), 0.75, 0);
  ASSERT_EQ(m.count, 1);
  EXPECT_NEAR(m.points[0].separation, -0.25, 1e-15);
  EXPECT_LT((m.points[0].on_a - Vec3(1, 2, 4)).norm(), 1e-15);
  EXPECT_EQ(sphere_contact(Vec3(0, 0, 0), 1, Vec3(0, 0, 2.1), 1, 0.05).count, 0);
  EXPECT_EQ(sphere_contact(Vec3(0, 0, 0), 1, Vec3(0, 0, 2.1), 1, 0.11).count, 1);
  EXPECT_EQ(sphere_contact(Vec3(0, 0, 0), 1, Vec3(0, 0, 0), 1, 0).normal, Vec3::UnitZ());

  const ConvexHull box = make_box_hull(Vec3(1, 1, 1));
  const Manifold corner = hull_sphere_contact(box, Vec3(1.5, 1.5, 1.5), 1, 0);
  ASSERT_EQ(corner.count, 1);
  EXPECT_LT((corner.points[0].on_a - Vec3(1, 1, 1)).norm(), 1e-14);
  EXPECT_NEAR(corner.points[0].separation, std::sqrt(0.75) - 1, 1e-14);
  const Manifold inside = hull_sphere_contact(box, Vec3(0, 0.9, 0), 0.2, 0);
  EXPECT_LT((inside.normal - Vec3::UnitY()).norm(), 1e-14);
  EXPECT_NEAR(inside.points[0].separation, -0.3, 1e-14);
}

}  // namespace
}  // namespace effuse::geometry
