#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/random.h"
#include "geometry/procedural/primitives.h"
#include "geometry/query/closest_point.h"
#include "geometry/query/mesh_surface.h"
#include "geometry/query/mesh_tree.h"

namespace effuse::geometry {
namespace {

constexpr Real kNaN = std::numeric_limits<Real>::quiet_NaN();

Vec3 random_point(std::uint64_t stream, std::uint64_t k) {
  return Vec3(random_uniform(stream, 0, k), random_uniform(stream, 1, k), random_uniform(stream, 2, k)) - Vec3::Constant(0.5);
}

TEST(ClosestPoint, NoPointOfTheTriangleIsNearer) {
  for (std::uint64_t k = 0; k < 400; ++k) {
    const Vec3 a = random_point(1, k), b = random_point(2, k), c = random_point(3, k), p = 3 * random_point(4, k);
    const TrianglePoint found = closest_point_on_triangle(p, a, b, c);
    const Real distance = (p - found.point).norm();
    EXPECT_LT((found.point - (found.weights[0] * a + found.weights[1] * b + found.weights[2] * c)).norm(), 1e-12) << "weights and point differ";
    EXPECT_NEAR(found.weights.sum(), 1, 1e-14);
    EXPECT_GE(found.weights.minCoeff(), 0);
    const int zeros = static_cast<int>((found.weights.array() == 0).count());
    EXPECT_EQ(zeros, found.feature == TrianglePoint::Feature::kFace ? 0 : found.feature == TrianglePoint::Feature::kEdge ? 1 : 2);
    constexpr int n = 40;
    for (int i = 0; i <= n; ++i)
      for (int j = 0; i + j <= n; ++j) ASSERT_GE((p - (a * i + b * j + c * (n - i - j)) / n).norm(), distance - 1e-12);
  }
}

TEST(ClosestPoint, OnATriangleOfNoAreaItIsOnOneOfItsSides) {
  const Vec3 a(0, 0, 0), b(1, 0, 0), c(3, 0, 0);
  EXPECT_LT((closest_point_on_triangle({2, 5, 0}, a, b, c).point - Vec3(2, 0, 0)).norm(), 1e-15);
  EXPECT_EQ(closest_point_on_triangle({2, 5, 0}, a, a, a).point, a);
  EXPECT_EQ(closest_point_on_segment({2, 5, 0}, a, a), a);
  EXPECT_EQ(closest_point_on_segment({2, 5, 0}, a, b), b);
}

TEST(MeshTree, AnEmptyTreeAnswersWithNothing) {
  const MeshTree tree({}, {});
  EXPECT_EQ(tree.size(), 0u);
  EXPECT_FALSE(tree.nearest({0, 0, 0}).has_value());
  EXPECT_FALSE(tree.ray({0, 0, 0}, {0, 0, 1}, 1).has_value());
  EXPECT_TRUE(tree.vertical(0, 0).empty());
}

TEST(MeshTree, BrokenQuestionsHaveNoAnswer) {
  const TriMesh box = make_box({0, 0, 0}, {1, 1, 1});
  const MeshTree tree(box.positions, box.triangles);
  EXPECT_FALSE(tree.nearest({kNaN, 0, 0}).has_value());
  EXPECT_FALSE(tree.nearest({0, 0, 5}, -1).has_value());
  EXPECT_FALSE(tree.nearest({0, 0, 5}, kNaN).has_value());
  EXPECT_FALSE(tree.ray({0, 0, 0}, {0, 0, kNaN}, 1).has_value());
  EXPECT_FALSE(tree.ray({0, 0, -1}, {0, 0, 1}, kNaN).has_value());
  EXPECT_FALSE(tree.ray({0, 0, -1}, {0, 0, 0}, 1).has_value());
  EXPECT_TRUE(tree.vertical(0.5, kNaN).empty());
}

TEST(MeshTree, TheFirstCrossingOfARayIsTheNearest) {
  const TriMesh torus = make_torus({0, 0, 0}, 3, 1, 40, 20);
  const MeshTree tree(torus.positions, torus.triangles);
  for (std::uint64_t k = 0; k < 500; ++k) {
    const Vec3 p = 10 * random_point(1, k), d = random_point(2, k);
    Real first = 40;
    for (const auto& [ia, ib, ic] : torus.triangles) {
      // Plane by plane, inside by the signs of three volumes.
      const Vec3 &a = torus.positions[ia], &b = torus.positions[ib], &c = torus.positions[ic];
      const Real u = d.dot((a - p).cross(b - p)), v = d.dot((b - p).cross(c - p)), w = d.dot((c - p).cross(a - p));
      if (!((u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0))) continue;
      const Vec3 n = (b - a).cross(c - a);
      const Real t = n.dot(a - p) / n.dot(d);
      if (t > 0 && t < first) first = t;
    }
    const auto found = tree.ray(p, d, 40);
    ASSERT_EQ(found.has_value(), first < 40);
    if (found) {
      EXPECT_NEAR(found->t, first, 1e-9);
    }
    EXPECT_EQ(found.has_value(), tree.ray(p, d, std::numeric_limits<Real>::infinity()).has_value());
  }
}

/// Surfaces that enclose nothing clean: whatever the answer, it is finite and near the truth in distance.
TEST(MeshSurface, NonManifoldFlippedAndTouchingSurfacesAnswerWithTheRightDistance) {
  std::vector<TriMesh> meshes;
  TriMesh fin = make_grid({0, 0, 0}, {1, 1}, 1, 1);
  fin.positions.push_back({0.5, 0.5, 1});
  fin.triangles.push_back({0, 3, 4});
  meshes.push_back(fin);
  TriMesh flipped = make_box({-1, -1, -1}, {1, 1, 1});
  std::swap(flipped.triangles[4][0], flipped.triangles[4][1]);
  meshes.push_back(flipped);
  TriMesh touching = make_box({-1, -1, -1}, {0, 0, 0});
  append(touching, make_box({0, 0, 0}, {1, 1, 1}));
  meshes.push_back(touching);
  TriMesh twice = make_box({-1, -1, -1}, {1, 1, 1});
  append(twice, make_box({-1, -1, -1}, {1, 1, 1}));
  meshes.push_back(twice);
  TriMesh back_to_back = make_grid({0, 0, 0}, {1, 1}, 2, 2);
  const std::size_t front = back_to_back.triangles.size();
  for (std::size_t t = 0; t < front; ++t) back_to_back.triangles.push_back({back_to_back.triangles[t][1], back_to_back.triangles[t][0], back_to_back.triangles[t][2]});
  meshes.push_back(back_to_back);
  TriMesh random;
  for (std::uint64_t k = 0; k < 40; ++k) random.positions.push_back(random_point(9, k));
  for (std::uint64_t k = 0; k < 200; ++k) random.triangles.push_back({Index(random_bits(1, 0, k) % 40), Index(random_bits(1, 1, k) % 40), Index(random_bits(1, 2, k) % 40)});
  meshes.push_back(random);

  for (std::size_t m = 0; m < meshes.size(); ++m) {
    const MeshSurface surface(meshes[m]);
    for (std::uint64_t k = 0; k < 500; ++k) {
      const Vec3 p = k < 40 && k < meshes[m].positions.size() ? meshes[m].positions[k] : Vec3(3 * random_point(5, k));
      const Contact contact = surface.contact(p);
      if (!contact.any()) continue;  // beyond a rim
      Real expected = std::numeric_limits<Real>::infinity();
      for (const auto& [a, b, c] : meshes[m].triangles)
        expected = std::min(expected, (closest_point_on_triangle(p, meshes[m].positions[a], meshes[m].positions[b], meshes[m].positions[c]).point - p).norm());
      EXPECT_NEAR(std::abs(contact.distance), expected, 1e-12) << "mesh " << m;
      EXPECT_NEAR(contact.normal.norm(), 1, 1e-12) << "mesh " << m << " point " << p.transpose();
    }
  }
}

}  // namespace
}  // namespace effuse::geometry
