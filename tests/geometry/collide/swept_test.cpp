#include "geometry/collide/swept.h"

#include <gtest/gtest.h>

#include "geometry/query/closest_point.h"
#include "tests/geometry/collide/truth.h"

namespace effuse::geometry {
namespace {

Real distance_to(const TriMesh& mesh, const Vec3& p) {
  Real least = std::numeric_limits<Real>::infinity();
  for (const auto& [a, b, c] : mesh.triangles)
    least = std::min(least, (p - closest_point_on_triangle(p, mesh.positions[a], mesh.positions[b], mesh.positions[c]).point).norm());
  return least;
}

/// First s at which distance(s) <= r, by steps that cannot jump over it: |distance'| <= rate. Found to `close` above r.
template <class Distance>
std::optional<Real> first_touch(const Distance& distance, Real r, Real rate, Real close) {
  for (Real s = 0; s <= 1;) {
    const Real gap = distance(s) - r;
    if (gap <= close) return s;
    s += gap / rate;
  }
  return std::nullopt;
}

TEST(SweptTriangle, FaceSideAndCornerAreMetAtTheirTimes) {
  const Vec3 a(0, 0, 0), b(4, 0, 0), c(0, 4, 0);
  EXPECT_NEAR(sweep_triangle({1, 1, 5}, {0, 0, -8}, 1, a, b, c).value(), 0.5, 1e-15);
  EXPECT_NEAR(sweep_triangle({1, 1, -5}, {0, 0, 8}, 1, a, b, c).value(), 0.5, 1e-15) << "from behind";
  EXPECT_NEAR(sweep_triangle({2, -5, 0}, {0, 8, 0}, 1, a, b, c).value(), 0.5, 1e-15) << "the side, in its plane";
  EXPECT_NEAR(sweep_triangle({2, -0.6, 5}, {0, 0, -8}, 1, a, b, c).value(), (5 - 0.8) / 8, 1e-15) << "the side, past it";
  EXPECT_NEAR(sweep_triangle({-5, -0.6, 0}, {8, 0, 0}, 1, a, b, c).value(), (5 - 0.8) / 8, 1e-15) << "the corner";
  EXPECT_NEAR(sweep_triangle({1, 1, 5}, {0, 0, -10}, 0, a, b, c).value(), 0.5, 1e-15) << "a point";
  EXPECT_FALSE(sweep_triangle({1, 1, 5}, {0, 0, -3.9}, 1, a, b, c)) << "not so far";
  EXPECT_FALSE(sweep_triangle({-1.5, 1, 5}, {0, 0, -10}, 1, a, b, c)) << "past it";
  EXPECT_FALSE(sweep_triangle({1, 1, 0.5}, {3, 0, 1}, 1, a, b, c)) << "within, and leaving";
  EXPECT_EQ(sweep_triangle({1, 1, 0.5}, {3, 0, -1}, 1, a, b, c).value(), 0) << "within, and coming nearer";
  EXPECT_FALSE(sweep_triangle({1, 1, 5}, {0, 0, 0}, 1, a, b, c)) << "at rest";
}

TEST(SweptTriangle, AgreesWithTheDistanceAlongTheWay) {
  std::size_t hits = 0;
  for (std::uint64_t k = 0; k < 8000; ++k) {
    const auto u = [&](std::uint64_t stream) { return random_uniform(51, stream, k); };
    const Vec3 a = truth::unit(52, k), b = truth::unit(53, k), c = u(9) < 0.2 ? Vec3(a + 0.5 * (b - a) + 1e-6 * truth::unit(54, k)) : truth::unit(54, k);
    const Real r = std::pow(10.0, -4 + 4 * u(0));
    const Vec3 p = 3 * truth::unit(55, k), d = 2 * (0.6 * truth::unit(56, k) - p / 1.5);
    const auto distance = [&](Real s) { return (p + s * d - closest_point_on_triangle(p + s * d, a, b, c).point).norm(); };
    const auto expected = first_touch(distance, r, d.norm(), 1e-9);
    const auto found = sweep_triangle(p, d, r, a, b, c);
    if (distance(expected.value_or(0)) < r + 2e-9 && !found) {
      // It may graze within what the steps were stopped at.
      Real least = 10;
      for (Real s = 0; s <= 1; s += 1e-4) least = std::min(least, distance(s));
      EXPECT_GT(least, r - 1e-6) << k;
      continue;
    }
    ASSERT_EQ(found.has_value(), expected.has_value()) << k;
    if (!found) continue;
    ++hits;
    EXPECT_NEAR(distance(*found), r, 1e-12) << k;
    EXPECT_GE(*found, *expected - 1e-12) << k;
    // Nothing nearer before.
    for (int m = 0; m < 50; ++m) EXPECT_GE(distance(*found * m / 50), r - 1e-12) << k;
  }
  EXPECT_GT(hits, 1000u);
}

TEST(SweptMesh, AnyWayThatEntersAMeshIsSeen) {
  for (const truth::Shape& shape : truth::shapes()) {
    const CollisionMesh mesh(shape.mesh);
    std::size_t hits = 0;
    for (std::uint64_t k = 0; k < 300; ++k) {
      const auto u = [&](std::uint64_t stream) { return random_uniform(61, stream, k); };
      const Vec3 a = 4 * truth::unit(62, k), b = 0.5 * truth::unit(63, k) + (2 * u(1) - 1.5) * a;
      const Real r = k % 4 == 0 ? 0 : std::pow(10.0, -5 + 5 * u(0));
      if (distance_to(shape.mesh, a) <= r) continue;
      const auto found = sweep(mesh, a, b, r);
      const auto expected = first_touch([&](Real s) { return distance_to(shape.mesh, a + s * (b - a)); }, r, (b - a).norm(), 1e-8);
      if (found.has_value() != expected.has_value()) {
        Real least = 10;
        for (Real s = 0; s <= 1; s += 1e-3) least = std::min(least, distance_to(shape.mesh, a + s * (b - a)));
        EXPECT_NEAR(least, r, 1e-5) << shape.name << k << ": only those that graze may differ";
        continue;
      }
      if (!found) continue;
      ++hits;
      EXPECT_NEAR(distance_to(shape.mesh, a + found->time * (b - a)), r, 1e-11) << shape.name << k;
      EXPECT_NEAR(found->time, *expected, 1e-3) << shape.name << k;
      if (r > 0) {
        EXPECT_NEAR((found->point + r * found->normal - (a + found->time * (b - a))).norm(), 0, 1e-11) << shape.name << k;
      } else {
        EXPECT_LE(found->normal.dot(b - a), 0) << shape.name << k;
      }
    }
    EXPECT_GT(hits, 50u) << shape.name;
  }
}

TEST(SweptMesh, PointsDoNotSlipThroughTheSidesThatTrianglesShare) {
  // Straight at the edges and vertices of a closed mesh, from outside: in must be seen.
  const TriMesh sphere = make_sphere({0, 0, 0}, 1, 3);
  const CollisionMesh mesh(sphere);
  std::size_t tried = 0;
  for (const auto& t : sphere.triangles) {
    for (int k = 0; k < 3; ++k) {
      const Vec3 &a = sphere.positions[t[k]], &b = sphere.positions[t[(k + 1) % 3]];
      for (const Real share : {0.0, 0.5, random_uniform(71, 0, tried)}) {
        const Vec3 at = a + share * (b - a), from = at + 3 * truth::unit(72, tried);
        ++tried;
        if (mesh.signed_distance(from) < 0.1) continue;
        EXPECT_TRUE(sweep(mesh, from, from + 1.001 * (Vec3::Zero() - from), 0)) << tried;
        const auto at_edge = sweep(mesh, from, at + (at - from) * 0.1 - 0.2 * at, 0);
        EXPECT_TRUE(at_edge) << tried;
      }
    }
  }
  EXPECT_GT(tried, 3000u);
}

TEST(SweptMesh, WhoStartsNearerThanItsRadiusKeepsItsDistance) {
  const CollisionMesh plate(make_grid({-5, -5, 0}, {1, 1}, 10, 10));
  EXPECT_FALSE(sweep(plate, {0.2, 0.3, 0.4}, {3.2, 2.1, 0.4}, 1)) << "along it";
  EXPECT_FALSE(sweep(plate, {0.2, 0.3, 0.4}, {0.2, 0.3, 5}, 1)) << "away from it";
  const auto down = sweep(plate, {0.2, 0.3, 0.4}, {3.2, 2.1, -8}, 1);
  ASSERT_TRUE(down);
  EXPECT_NEAR(down->time, 0, 1e-9);
  EXPECT_EQ(down->normal.z(), 1);
  const auto below = sweep(plate, {0.2, 0.3, -0.4}, {3.2, 2.1, 8}, 1);
  ASSERT_TRUE(below);
  EXPECT_EQ(below->normal.z(), -1);
  // Inside a solid, even deeper than the radius: nothing holds it.
  const CollisionMesh box(make_box({-2, -2, -2}, {2, 2, 2}));
  EXPECT_FALSE(sweep(box, {0, 0, 0}, {0, 0, 9}, 0.1));
  EXPECT_FALSE(sweep(box, {1.95, 0, 0}, {9, 0, 0}, 0.1));
  EXPECT_FALSE(sweep(box, {0, 0, 0}, {0, 0, 9}, 0));
}

TEST(SweptMesh, MovingAndTurningMeshesAreMetAtTheirTimes) {
  const TriMesh meshes[2] = {make_box({-2, -0.1, -1}, {2, 0.1, 1}), make_torus({0.5, 0, 0}, 1, 0.2, 16, 8)};
  std::size_t hits = 0, misses = 0;
  for (std::uint64_t k = 0; k < 400; ++k) {
    const TriMesh& shape = meshes[k % 2];
    const CollisionMesh mesh(shape);
    const auto u = [&](std::uint64_t stream) { return random_uniform(81, stream, k); };
    RigidPose from = truth::random_pose(82, k, 1), to = from;
    to.position += 3 * u(0) * truth::unit(84, k);
    if (k % 3) to.orientation = Quat(Eigen::AngleAxisd(3.1 * u(1), truth::unit(85, k))) * from.orientation;
    const RigidMotion motion(from, to, 0.5);
    const Vec3 a = (4 + u(3)) * truth::unit(86, k), b = truth::unit(87, k) - 0.5 * a;
    const Real r = std::pow(10.0, -3 + 2.5 * u(2));
    const auto distance = [&](Real s) { return distance_to(shape, motion.pose(s).body(a + s * (b - a))); };
    const Real rate = (b - a).norm() + motion.shift().norm() + motion.turn().norm() * 8;
    const auto found = sweep(mesh, motion, a, b, r);
    const auto expected = first_touch(distance, r * (1 + 2 * kChord), rate, 1e-6);
    if (!found) {
      ++misses;
      if (expected) {
        Real least = 10;
        for (Real s = 0; s <= 1; s += 1e-3) least = std::min(least, distance(s));
        EXPECT_GT(least, r) << k;
      }
      continue;
    }
    ++hits;
    ASSERT_TRUE(expected) << k;
    EXPECT_GE(distance(found->time), r * (1 - 1e-9)) << k;
    EXPECT_LE(distance(found->time), r * (1 + 2 * kChord) + 1e-9) << k;
    EXPECT_GE(found->time, *expected - 1e-4) << k;
    const Vec3 at = a + found->time * (b - a);
    EXPECT_NEAR((found->point + distance(found->time) * found->normal - at).norm(), 0, 1e-9) << k;
    for (int m = 0; m <= 100; ++m) EXPECT_GE(distance(found->time * m / 100), r * (1 - 1e-9)) << k;
  }
  EXPECT_GT(hits, 60u);
  EXPECT_GT(misses, 20u);
}

TEST(RigidMotion, PosesVelocitiesAndSweptBoxesAgree) {
  for (std::uint64_t k = 0; k < 200; ++k) {
    const RigidPose from = truth::random_pose(91, k, 2), to = truth::random_pose(93, k, 2);
    const RigidMotion motion(from, to, 0.25);
    EXPECT_LE(motion.turn().norm(), kPi + 1e-9);
    const Box3 box(Vec3(-1, -0.5, 0), Vec3(0.5, 2, 0.1));
    const Box3 swept = motion.swept_box(box);
    const Vec3 corner = box.corner(static_cast<Box3::CornerType>(k % 8));
    for (Real s = 0; s <= 1; s += 0.05) {
      const Vec3 x = motion.pose(s).world(corner);
      EXPECT_TRUE(swept.contains(x)) << k;
      const Real h = 1e-6;
      if (s < h || s > 1 - h) continue;
      const Vec3 numeric = (motion.pose(s + h).world(corner) - motion.pose(s - h).world(corner)) / (2 * h) / motion.duration();
      EXPECT_NEAR((motion.velocity_at(x, s) - numeric).norm(), 0, 1e-6) << k;
    }
    EXPECT_NEAR(std::abs(motion.pose(1 - 1e-12).orientation.dot(to.orientation)), 1, 1e-9);
  }
  const RigidMotion rest(truth::random_pose(95, 0, 1));
  EXPECT_FALSE(rest.moves());
  EXPECT_EQ(rest.velocity_at({1, 2, 3}, 1), Vec3(0, 0, 0));
}

}  // namespace
}  // namespace effuse::geometry
