#include "flow/bodies/shape.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "geometry/base/error.h"
#include "geometry/base/random.h"
#include "geometry/procedural/primitives.h"

namespace effuse::flow::bodies {
namespace {

TEST(Shape, ABoxIsTheSameAsAHullAndAsAMesh) {
  const Vec3 half(0.3, 0.5, 0.8), middle(1, 2, 3);
  const geometry::TriMesh mesh = geometry::make_box(middle - half, middle + half);
  const auto box = Shape::box(half), hull = Shape::hull(mesh), solid = Shape::mesh(mesh);
  std::vector<Real> moments[3];
  int k = 0;
  for (const auto& s : {box, hull, solid}) {
    EXPECT_NEAR(s->volume(), 8 * half.prod(), 1e-12);
    EXPECT_NEAR(s->bounding_radius(), half.norm(), 1e-12);
    EXPECT_NEAR(s->core_radius(), half.minCoeff(), 1e-12);
    EXPECT_GE(s->samples().size(), 8u);
    EXPECT_EQ(s->corners(), 8u);
    moments[k].assign(s->moments().data(), s->moments().data() + 3);
    std::sort(moments[k].begin(), moments[k].end());
    ++k;
  }
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(moments[0][i], moments[1][i], 1e-12);
    EXPECT_NEAR(moments[0][i], moments[2][i], 1e-12);
  }
  // Body axes stand where the given ones say.
  EXPECT_LT(hull->body_from_given().world(middle).norm(), 1e-12);
  EXPECT_LT(solid->body_from_given().world(middle).norm(), 1e-12);
}

TEST(Shape, BoundsHoldEveryPointOfTheSurface) {
  const auto torus = Shape::mesh(geometry::make_torus(Vec3(1, 0, 0), 1, 0.3, 16, 8));
  const auto hull = Shape::hull(geometry::make_sphere(Vec3::Zero(), 0.7, 2)), ball = Shape::sphere(0.4);
  for (std::uint64_t k = 0; k < 20; ++k) {
    const Mat3 R = Quat(random_normal(1, 0, k), random_normal(1, 1, k), random_normal(1, 2, k), random_normal(1, 3, k)).normalized().toRotationMatrix();
    const Vec3 x(random_normal(1, 4, k), 2, 3);
    for (const auto& s : {torus, hull, ball}) {
      Box3 box = s->bounds(x, R);
      box = Box3(box.min() - Vec3::Constant(1e-12), box.max() + Vec3::Constant(1e-12));
      for (const Vec3& p : s->surface().positions) EXPECT_TRUE(box.contains(x + R * p));
    }
  }
}

TEST(Shape, AnOpenMeshHasNoMassAndAnInwardOneIsTurned) {
  EXPECT_FALSE(Shape::mesh(geometry::make_grid(Vec3::Zero(), Vec2(1, 1), 2, 2))->solid());
  geometry::TriMesh box = geometry::make_box(Vec3::Zero(), Vec3(1, 1, 1));
  for (auto& t : box.triangles) std::swap(t[1], t[2]);
  EXPECT_NEAR(Shape::mesh(box)->volume(), 1, 1e-12);
  EXPECT_THROW(Shape::mesh({}), InputError);
}

TEST(PointGrid, FindsEveryPointInABox) {
  std::vector<Vec3> points;
  for (std::uint64_t k = 0; k < 500; ++k) points.emplace_back(random_normal(2, 0, k), 5 * random_normal(2, 1, k), 0.1 * random_normal(2, 2, k));
  const PointGrid grid(points);
  for (std::uint64_t k = 0; k < 100; ++k) {
    const Vec3 low(random_normal(3, 0, k), random_normal(3, 1, k), random_normal(3, 2, k));
    const Box3 box(low, low + Vec3(1, 2, 0.5));
    std::set<Index> found;
    grid.near(box, [&](Index i) { EXPECT_TRUE(found.insert(i).second) << "twice"; });
    for (Index i = 0; i < points.size(); ++i)
      EXPECT_TRUE(!box.contains(points[i]) || found.count(i) == 1);
  }
  std::size_t count = 0;
  grid.near(Box3(Vec3(100, 0, 0), Vec3(101, 1, 1)), [&](Index) { ++count; });
  PointGrid().near(Box3(Vec3(0, 0, 0), Vec3(1, 1, 1)), [&](Index) { ++count; });
  EXPECT_EQ(count, 0u);
}

}  // namespace
}  // namespace effuse::flow::bodies
