#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/base/random.h"
#include "geometry/collide/obstacles.h"
#include "geometry/procedural/primitives.h"

namespace effuse::geometry {
namespace {

/// A room: a box seen from within, open at the top.
CollisionMesh room(const Vec3& size) {
  TriMesh m = make_box(Vec3::Zero(), size);
  std::erase_if(m.triangles, [&](const Triangle& t) { return std::all_of(t.begin(), t.end(), [&](Index v) { return m.positions[v].z() == size.z(); }); });
  return CollisionMesh(m);
}

TEST(Surroundings, InTheCornerOfARoomAreItsFloorAndItsWalls) {
  const CollisionMesh mesh = room(Vec3(10, 8, 6));
  for (std::uint64_t i = 0; i < 500; ++i) {
    const Vec3 p(2 * random_uniform(1, 0, i) + 1e-3, 2 * random_uniform(1, 1, i) + 1e-3, 2 * random_uniform(1, 2, i) + 1e-3);
    std::array<CollisionMesh::Nearest, 4> out;
    ASSERT_EQ(mesh.surroundings(p, 2.5, out), 3u) << p.transpose();
    std::array<Real, 3> distance = {p.x(), p.y(), p.z()};
    std::sort(distance.begin(), distance.end());
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(out[k].distance, distance[k], 1e-12);
    Mat3 normals;
    normals << out[0].normal, out[1].normal, out[2].normal;
    EXPECT_NEAR(normals.rowwise().sum().minCoeff(), 1, 1e-12) << "into the room";
  }
}

TEST(Surroundings, OfConvexMeshesAreTheNearestAlone) {
  for (const TriMesh& m : {make_box(Vec3::Zero(), Vec3(2, 3, 4)), make_sphere(Vec3(1, 1, 1), 2, 3)}) {
    const CollisionMesh mesh(m);
    for (std::uint64_t i = 0; i < 500; ++i) {
      const Vec3 p = 8 * Vec3(random_uniform(2, 0, i), random_uniform(2, 1, i), random_uniform(2, 2, i)) - Vec3::Constant(2);
      std::array<CollisionMesh::Nearest, 4> out;
      const auto nearest = mesh.nearest(p, 3);
      ASSERT_EQ(mesh.surroundings(p, 3, out), nearest ? 1u : 0u);
      if (nearest) {
        EXPECT_EQ(out[0].point, nearest->point);
      }
    }
  }
}

// What stands behind a wall is not felt through it; what stands across a gap is.
TEST(Surroundings, WallsHideWhatIsBehindThemAndGapsHaveTwoSides) {
  TriMesh m = make_box(Vec3(0, -5, -5), Vec3(0.2, 5, 5));
  append(m, make_box(Vec3(-2, -5, -5), Vec3(-1.5, 5, 5)));
  append(m, make_box(Vec3(1.5, -5, -5), Vec3(2, 5, 5)));
  const CollisionMesh mesh(m);
  std::array<CollisionMesh::Nearest, 4> out;
  ASSERT_EQ(mesh.surroundings(Vec3(0.5, 0.1, 0.2), 4, out), 2u);
  EXPECT_NEAR(out[0].distance, 0.3, 1e-12);
  EXPECT_NEAR(out[1].distance, 1, 1e-12);
  EXPECT_NEAR(out[1].normal.x(), -1, 1e-12);
}

// A torus from within its ring, a bowl, the notch of a step: every answer is a place of least distance.
TEST(Surroundings, ArePlacesOfLeastDistance) {
  const CollisionMesh mesh(make_torus(Vec3::Zero(), 3, 1, 48, 24));
  std::size_t several = 0;
  for (std::uint64_t i = 0; i < 300; ++i) {
    const Vec3 p(4 * random_uniform(3, 0, i) - 2, 4 * random_uniform(3, 1, i) - 2, 2 * random_uniform(3, 2, i) - 1);
    std::array<CollisionMesh::Nearest, 6> out;
    const std::size_t n = mesh.surroundings(p, 4.5, out);
    ASSERT_GE(n, 1u);
    several += n > 1;
    if (out[0].distance < 0) continue;
    for (std::size_t k = 0; k < n; ++k) {
      EXPECT_NEAR((p - out[k].point).norm(), out[k].distance, 1e-9);
      for (int turn = 0; turn < 16; ++turn) {
        const Vec3 side = Vec3(random_normal(4, i, k), random_normal(5, i, static_cast<std::uint64_t>(turn)), random_normal(6, i, k)).normalized();
        const auto beside = mesh.nearest(out[k].point + 1e-4 * side);
        EXPECT_GE((p - beside->point).norm(), out[k].distance - 1e-7);
      }
    }
  }
  EXPECT_GT(several, 20u);
}

TEST(Surroundings, OfObstaclesAreThoseOfEach) {
  Obstacles all;
  all.add({room(Vec3(4, 4, 4)), RigidMotion(RigidPose{Vec3(10, 0, 0), Quat::Identity()}), 300, 1});
  all.add({CollisionMesh(make_sphere(Vec3::Zero(), 0.5, 3)), RigidMotion(RigidPose{Vec3(12, 2, 1), Quat::Identity()}), 400, 2});
  all.update();
  const std::vector<Vec3> points = {Vec3(10.5, 0.6, 0.7), Vec3(12, 2, 1.7), Vec3(-20, 0, 0)};
  std::vector<Contact> out(12);
  all.surroundings(points, 1, 4, out);
  EXPECT_EQ(std::count_if(out.begin(), out.begin() + 4, [](const Contact& c) { return c.any(); }), 3);
  EXPECT_EQ(out[0].surface, 1u);
  EXPECT_NEAR(out[0].distance, 0.5, 1e-12);
  EXPECT_EQ(out[4].surface, 2u);
  EXPECT_EQ(out[4].surface_temperature, 400);
  EXPECT_FALSE(out[5].any());
  EXPECT_FALSE(out[8].any());
}

}  // namespace
}  // namespace effuse::geometry
