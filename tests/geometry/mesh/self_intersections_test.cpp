#include "geometry/mesh/self_intersections.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/procedural/primitives.h"

namespace effuse::geometry {
namespace {

using Pairs = std::vector<std::array<Index, 2>>;

TriMesh triangles(std::vector<Vec3> positions, std::vector<Triangle> indices) {
  TriMesh mesh;
  mesh.positions = std::move(positions);
  mesh.triangles = std::move(indices);
  return mesh;
}

TriMesh both(TriMesh a, const TriMesh& b) {
  append(a, b);
  return a;
}

TriMesh tetrahedron(const Vec3& at) {
  return triangles({at, at + Vec3(1, 0, 0), at + Vec3(0, 1, 0), at + Vec3(0, 0, 1)}, {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}});
}

TEST(SelfIntersections, APierceIsFoundAndItsTwoTrianglesNamed) {
  // The second stands upright through the middle of the first; the third is far away.
  const TriMesh mesh = triangles({{0, 0, 0}, {3, 0, 0}, {0, 3, 0}, {0.5, 0.5, -1}, {1, 0.5, 1}, {0.5, 1, 1}, {9, 9, 9}, {10, 9, 9}, {9, 10, 9}}, {{6, 7, 8}, {3, 4, 5}, {0, 1, 2}});
  EXPECT_EQ(self_intersections(mesh), (Pairs{{1, 2}}));
}

TEST(SelfIntersections, OneSharedVertexIsNoMeetingButAPassThroughIs) {
  const std::vector<Vec3> x = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {-1, 0, 1}, {0, -1, 1}, {1, 0.5, 1}, {0.5, 1, -1}};
  EXPECT_TRUE(self_intersections(triangles(x, {{0, 1, 2}, {0, 3, 4}})).empty());
  EXPECT_EQ(self_intersections(triangles(x, {{0, 1, 2}, {0, 5, 6}})).size(), 1u);
}

TEST(SelfIntersections, AFoldOntoItselfMeetsAndAFlatOrBentEdgeDoesNot) {
  const std::vector<Vec3> x = {{0, 0, 0}, {1, 0, 0}, {0.5, 1, 0}, {0.5, -1, 0}, {0.4, 0.7, 0}, {0.5, 0.7, 1e-12}};
  EXPECT_TRUE(self_intersections(triangles(x, {{0, 1, 2}, {1, 0, 3}})).empty()) << "flat";
  EXPECT_EQ(self_intersections(triangles(x, {{0, 1, 2}, {1, 0, 4}})).size(), 1u) << "folded over";
  EXPECT_TRUE(self_intersections(triangles(x, {{0, 1, 2}, {1, 0, 5}})).empty()) << "almost folded over: decided exactly";
}

TEST(SelfIntersections, TheSameTriangleTwiceMeetsWhicheverWayItRuns) {
  const std::vector<Vec3> x = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  EXPECT_EQ(self_intersections(triangles(x, {{0, 1, 2}, {1, 2, 0}, {2, 1, 0}})), (Pairs{{0, 1}, {0, 2}, {1, 2}}));
}

TEST(SelfIntersections, SolidsThatTouchDoNotMeetAndOnesThatOverlapDo) {
  // They touch in a vertex, in which each has one of its own.
  EXPECT_TRUE(self_intersections(both(tetrahedron(Vec3::Zero()), tetrahedron(Vec3(1, 0, 0)))).empty());
  EXPECT_FALSE(self_intersections(both(tetrahedron(Vec3::Zero()), tetrahedron(Vec3(0.9, 0, 0)))).empty());
  // A vertex on the middle of a face is no vertex of both.
  EXPECT_FALSE(self_intersections(both(tetrahedron(Vec3::Zero()), tetrahedron(Vec3(0.3, 0.3, -1)))).empty());
}

TEST(SelfIntersections, TrianglesWithoutAreaAreLeftOut) {
  const TriMesh mesh = triangles({{0, 0, 0}, {3, 0, 0}, {0, 3, 0}, {0.5, 0.5, -1}, {0.5, 0.5, 1}, {0.5, 0.5, 3}}, {{0, 1, 2}, {3, 4, 5}, {0, 0, 1}, {3, 3, 3}});
  EXPECT_TRUE(self_intersections(mesh).empty());
  EXPECT_TRUE(self_intersections({}).empty());
}

TEST(SelfIntersections, ManyInOnePlaceAreCountedNoFurtherThanAsked) {
  constexpr std::size_t kCount = 2000;
  TriMesh mesh = triangles({{0, 0, 0}, {3, 0, 0}, {0, 3, 0}}, {});
  mesh.triangles.assign(kCount, {0, 1, 2});
  const Pairs all = self_intersections(mesh);
  ASSERT_EQ(all.size(), kCount * (kCount - 1) / 2);
  EXPECT_EQ(all.front(), (std::array<Index, 2>{0, 1}));
  EXPECT_EQ(std::adjacent_find(all.begin(), all.end()), all.end());
  for (const std::size_t most : {std::size_t{1}, std::size_t{1000}, all.size(), all.size() + 1}) EXPECT_EQ(self_intersections(mesh, most).size(), std::min(most, all.size())) << most;
  // A hundred times as many have 2e10 pairs: in memory they would take 160 GB.
  mesh.triangles.assign(100 * kCount, {0, 1, 2});
  EXPECT_EQ(self_intersections(mesh, 1000).size(), 1000u);
}

TEST(SelfIntersections, RandomTrianglesAreJudgedAsByTryingEveryPairOnAnyNumberOfThreads) {
  // Apart from the search by boxes there is a second way to know: the edges of one pierce the other.
  TriMesh mesh;
  for (std::uint64_t n = 0; n < 300; ++n) {
    const auto random = [&](std::uint64_t k) { return Vec3(random_uniform(1, 3 * k, n), random_uniform(1, 3 * k + 1, n), random_uniform(1, 3 * k + 2, n)); };
    const Vec3 at = 4 * random(0);
    const Index first = static_cast<Index>(mesh.positions.size());
    for (std::uint64_t k = 1; k < 4; ++k) mesh.positions.push_back(at + random(k));
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  const auto volume = [](const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) { return (b - a).cross(c - a).dot(d - a); };
  const auto pierces = [&](const Triangle& s, const Triangle& t) {
    const Vec3 &a = mesh.positions[t[0]], &b = mesh.positions[t[1]], &c = mesh.positions[t[2]];
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 &p = mesh.positions[s[k]], &q = mesh.positions[s[(k + 1) % 3]];
      if ((volume(a, b, c, p) > 0) == (volume(a, b, c, q) > 0)) continue;
      const bool u = volume(p, q, a, b) > 0, v = volume(p, q, b, c) > 0, w = volume(p, q, c, a) > 0;
      if (u == v && v == w) return true;
    }
    return false;
  };
  Pairs expected;
  for (Index s = 0; s < mesh.triangles.size(); ++s)
    for (Index t = s + 1; t < mesh.triangles.size(); ++t)
      if (pierces(mesh.triangles[s], mesh.triangles[t]) || pierces(mesh.triangles[t], mesh.triangles[s])) expected.push_back({s, t});
  ASSERT_GT(expected.size(), 100u);
  EXPECT_EQ(self_intersections(mesh), expected);
  const ThreadLimit one(1);
  EXPECT_EQ(self_intersections(mesh), expected);
}

}  // namespace
}  // namespace effuse::geometry
