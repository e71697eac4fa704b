#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/random.h"
#include "geometry/collide/obstacles.h"
#include "geometry/collide/slide.h"
#include "geometry/collide/swept.h"
#include "geometry/procedural/primitives.h"

/// Obstacles whose surface deforms: refitted trees, velocities by vertex, particles in their way.
namespace effuse::geometry {
namespace {

/// Bent, squeezed and waved; at s = 0 where it was.
Vec3 bent(const Vec3& p, Real s) { return {p.x() + 0.5 * s * p.z() * p.z(), p.y() * (1 - 0.3 * s), p.z() + 0.25 * s * std::sin(3 * p.x() + s)}; }

std::vector<Vec3> moved(const std::vector<Vec3>& x, Real s) {
  std::vector<Vec3> y;
  for (const Vec3& p : x) y.push_back(bent(p, s));
  return y;
}

/// Numbers in turn, of one seed.
struct Random {
  std::uint64_t seed, next = 0;
  Real uniform(Real low, Real high) { return low + (high - low) * random_uniform(seed, 0, next++); }
};
Vec3 random_point(Random& random, Real size) {
  const Real x = random.uniform(-size, size), y = random.uniform(-size, size), z = random.uniform(-size, size);
  return {x, y, z};
}

TEST(DeformingObstacles, ARefittedMeshAnswersAsOneMadeAnew) {
  const TriMesh ball = make_sphere(Vec3(0.1, 0, 0.2), 1, 3);
  CollisionMesh mesh(ball);
  const CollisionMesh before = mesh;
  for (const Real s : {0.2, 0.7, 1.0}) {
    TriMesh now = before.mesh();
    now.positions = moved(now.positions, s);
    ASSERT_TRUE(mesh.follow(now.positions));
    const CollisionMesh anew(now);
    Random random{7};
    int hits = 0;
    for (int k = 0; k < 2000; ++k) {
      const Vec3 p = random_point(random, 2), q = random_point(random, 2);
      const auto a = mesh.nearest(p), b = anew.nearest(p);
      ASSERT_EQ(a->triangle, b->triangle) << k;
      EXPECT_EQ(a->distance, b->distance);
      EXPECT_EQ(a->normal, b->normal);
      const auto c = sweep(mesh, p, q, 0.05), d = sweep(anew, p, q, 0.05);
      ASSERT_EQ(c.has_value(), d.has_value()) << k;
      EXPECT_EQ(c ? c->time : -1, d ? d->time : -1);
      hits += c.has_value();
      CollisionMesh::Nearest e[4], f[4];
      ASSERT_EQ(mesh.surroundings(p, 1, e), anew.surroundings(p, 1, f)) << k;
    }
    EXPECT_GT(hits, 100);
    EXPECT_EQ(before.mesh().positions[5], ball.positions[5]) << "a copy keeps what it had";
  }
}

TEST(DeformingObstacles, AClosedMeshThatATriangleWithoutAreaClosesStaysSolid) {
  // A vertex in the middle of a box's edge, of which one side knows only: a T-junction.
  TriMesh box = make_box({-1, -1, -1}, {1, 1, 1});
  const Triangle t = box.triangles[0];
  const auto middle = static_cast<Index>(box.positions.size());
  box.positions.push_back((box.positions[t[0]] + box.positions[t[1]]) / 2);
  box.triangles[0] = {t[0], middle, t[2]};
  box.triangles.push_back({middle, t[1], t[2]});
  box.triangles.push_back({t[0], t[1], middle});
  const CollisionMesh mesh(box);
  ASSERT_TRUE(mesh.solid());
  Obstacles obstacles;
  obstacles.add({mesh, {}, 0, 1});
  std::vector<Vec3> x = mesh.mesh().positions;
  for (int step = 0; step < 3; ++step) {
    for (Vec3& p : x) p.z() += 0.1;
    obstacles.deform(0, x, std::vector<Vec3>(x.size(), Vec3(0, 0, 1)), 0.1);
    obstacles.update();
    EXPECT_TRUE(obstacles[0].shape.solid()) << step;
    Contact found;
    ASSERT_EQ(obstacles.contacts(Vec3(0.8, 0, 0.1 * (step + 1)), 1, std::span(&found, 1)), 1);
    EXPECT_NEAR(found.distance, -0.2, 1e-12) << "inside";
  }
}

TEST(DeformingObstacles, SeveralPartsAreMadeAnew) {
  TriMesh two = make_sphere(Vec3::Zero(), 1, 1);
  const TriMesh other = make_sphere(Vec3(3, 0, 0), 1, 1);
  const auto first = static_cast<Index>(two.positions.size());
  two.positions.insert(two.positions.end(), other.positions.begin(), other.positions.end());
  for (const Triangle& t : other.triangles) two.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  CollisionMesh mesh(two);
  EXPECT_FALSE(mesh.follow(mesh.mesh().positions));
  Obstacles obstacles;
  obstacles.add({mesh, {}, 0, 1});
  std::vector<Vec3> x = two.positions;
  for (Vec3& p : x) p.z() += 5;
  obstacles.deform(0, x, std::vector<Vec3>(x.size(), Vec3(0, 0, 2)), 0.1);
  obstacles.update();
  Contact found;
  ASSERT_EQ(obstacles.contacts(Vec3(3, 0, 6.5), 1, std::span(&found, 1)), 1);
  EXPECT_NEAR(found.distance, 0.5, 0.05);
  EXPECT_EQ(found.surface_velocity, Vec3(0, 0, 2));
}

TEST(DeformingObstacles, AContactHasTheVelocityOfItsPlaceOnTheTriangle) {
  Obstacles obstacles;
  const TriMesh box = make_box(Vec3::Zero(), Vec3(1, 1, 1));
  obstacles.add({CollisionMesh(box), {}, 0, 1});
  const std::vector<Vec3> x = obstacles[0].shape.mesh().positions;
  // A linear field is met exactly.
  const auto field = [](const Vec3& p) { return Vec3(1 + 2 * p.y(), p.x() - p.z(), 0.5 * p.x()); };
  std::vector<Vec3> v;
  for (const Vec3& p : x) v.push_back(field(p));
  obstacles.deform(0, x, v, 0.25);
  obstacles.update();
  Contact found[3];
  for (const Vec3& p : {Vec3(0.3, 0.6, 1.2), Vec3(0.9, -0.1, 0.2), Vec3(1.1, 1.1, 1.1)}) {
    ASSERT_GE(obstacles.contacts(p, 0.5, found), 1);
    EXPECT_LT((found[0].surface_velocity - field(found[0].point)).norm(), 1e-12);
  }
  obstacles.move(0, RigidMotion(RigidPose{}));
  obstacles.update();
  ASSERT_GE(obstacles.contacts(Vec3(0.3, 0.6, 1.2), 0.5, found), 1);
  EXPECT_EQ(found[0].surface_velocity, Vec3::Zero()) << "it stands";
  EXPECT_FALSE(obstacles[0].moves());
}

TEST(DeformingObstacles, NoParticleIsLeftInsideAndTheSurfaceLeadsThemAlong) {
  // A ball bends and waves to and fro through 40 steps; 400 particles lie about on it.
  const Real r = 0.05, dt = 0.02;
  Obstacles obstacles;
  obstacles.add({CollisionMesh(make_sphere(Vec3::Zero(), 1, 3)), {}, 0, 1});
  const std::vector<Vec3> rest = obstacles[0].shape.mesh().positions;
  Random random{3};
  std::vector<Vec3> x, v;
  for (int k = 0; k < 400; ++k) {
    x.push_back(1.06 * random_point(random, 1).normalized());
    v.push_back(random_point(random, 0.5));
  }
  std::vector<Vec3> now = moved(rest, 0);
  Real most = 0;
  std::size_t met = 0;
  std::vector<Index> touched(x.size());
  for (int step = 1; step <= 40; ++step) {
    const std::vector<Vec3> next = moved(rest, std::sin(0.1 * step));
    std::vector<Vec3> speed, way;
    for (std::size_t i = 0; i < rest.size(); ++i) {
      speed.push_back((next[i] - now[i]) / dt);
      most = std::max(most, (next[i] - now[i]).norm());
    }
    obstacles.deform(0, next, speed, dt);
    obstacles.update();
    for (std::size_t k = 0; k < x.size(); ++k) {
      v[k] -= 4 * dt * x[k];  // back to the ball
      way.push_back(dt * v[k]);
    }
    const SlideReport report = slide_all(obstacles, x, way, v, std::span(&r, 1), {}, touched);
    met += report.met;
    for (std::size_t k = 0; k < x.size(); ++k) {
      const auto near = obstacles[0].shape.nearest(x[k]);
      ASSERT_GT(near->distance, 0.9 * r) << "step " << step << " particle " << k;
      // Who has been pushed and lies on it goes no slower outward than it does.
      const Real leaving = (v[k] - obstacles[0].velocity_at(near->triangle, near->point)).dot(near->normal);
      EXPECT_TRUE(touched[k] == 0 || near->distance > 1.01 * r || leaving > -1e-9) << step << " " << k << " " << leaving;
    }
    now = next;
  }
  EXPECT_GT(most, r / 2) << "it hardly moves";
  EXPECT_GT(met, 1000u);
}

}  // namespace
}  // namespace effuse::geometry
