#include "geometry/collide/collision_mesh.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <limits>

#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/collide/obstacles.h"
#include "geometry/mesh/validate.h"
#include "tests/geometry/collide/truth.h"

namespace effuse::geometry {
namespace {

constexpr Real kDistance = 1e-6;                             // relative: the bar
constexpr Real kNormal = 0.1 * kPi / 180;                    // the bar
constexpr Real kRounding = 1e-14;                            // of the coordinates

/// Contacts of `count` points with the shape at random places, against every triangle asked.
void meets_the_truth(const TriMesh& mesh, bool solid, std::size_t count, std::uint64_t seed) {
  const CollisionMesh shape(mesh);
  EXPECT_EQ(shape.solid(), solid) << to_string(shape.report());
  Real worst = 0, worst_angle = 0;
  std::size_t inside = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const RigidPose pose = truth::random_pose(seed, k, 10);
    Obstacles obstacles;
    obstacles.add({shape, RigidMotion(pose), 0, 1});
    obstacles.update();
    const Vec3 p = pose.world(truth::random_point(mesh, seed, k));
    Contact contact;
    ASSERT_EQ(obstacles.contacts(p, std::numeric_limits<Real>::infinity(), std::span(&contact, 1)), 1);

    const TriMesh there = truth::placed(shape.mesh(), pose);
    const truth::Nearest expected = truth::nearest(there, p);
    const auto distance = static_cast<Real>(expected.distance);
    const Real scale = p.cwiseAbs().maxCoeff() + truth::bounds(there).sizes().maxCoeff();
    const Real error = std::max(Real{0}, std::abs(std::abs(contact.distance) - distance) - kRounding * scale);
    EXPECT_LE(error, kDistance * distance) << "seed " << seed << " point " << k;
    worst = std::max(worst, error / distance);
    EXPECT_NEAR((contact.point - p).norm(), distance, kDistance * distance + kRounding * scale);

    const bool is_inside = solid && std::abs(truth::winding(there, p)) > 0.5;
    inside += is_inside;
    if (distance < 1e-9) continue;
    EXPECT_EQ(contact.distance < 0, is_inside) << "seed " << seed << " point " << k << " at " << distance;
    Real angle = kPi;
    for (const Vec3& towards : expected.towards) {
      const Vec3 normal = is_inside ? towards : Vec3(-towards);
      angle = std::min(angle, std::atan2(normal.cross(contact.normal).norm(), normal.dot(contact.normal)));
    }
    EXPECT_LE(angle, kNormal) << "seed " << seed << " point " << k << " at " << distance;
    worst_angle = std::max(worst_angle, angle);
  }
  if (solid) {
    EXPECT_GT(inside, count / 60) << "the points miss the inside";
  }
  testing::Test::RecordProperty("worst_distance", fmt::format("{:.1e}", worst));
  testing::Test::RecordProperty("worst_angle_deg", fmt::format("{:.1e}", worst_angle * 180 / kPi));
}

class ContactTruth : public testing::TestWithParam<truth::Shape> {};
TEST_P(ContactTruth, DistanceAndNormalAgreeWithEveryTriangleAsked) { meets_the_truth(GetParam().mesh, GetParam().solid, 150, 3); }
INSTANTIATE_TEST_SUITE_P(Shapes, ContactTruth, testing::ValuesIn(truth::shapes()), [](const auto& name) { return name.param.name; });

class ContactTruthSlow : public testing::TestWithParam<truth::Shape> {};
TEST_P(ContactTruthSlow, TwoThousandPosesAgreeWithEveryTriangleAsked) { meets_the_truth(GetParam().mesh, GetParam().solid, 2000, 4); }
INSTANTIATE_TEST_SUITE_P(Shapes, ContactTruthSlow, testing::ValuesIn(truth::shapes()), [](const auto& name) { return name.param.name; });

TEST(CollisionMesh, OnTheSurfaceTheNormalIsTheAngleWeightedPseudonormal) {
  const CollisionMesh box(make_box({0, 0, 0}, {1, 2, 3}));
  const auto normal = [&](const Vec3& p) { return box.nearest(p)->normal; };
  EXPECT_NEAR((normal({0.3, 1.1, 3}) - Vec3(0, 0, 1)).norm(), 0, 1e-14);
  EXPECT_NEAR((normal({1, 1.1, 3}) - Vec3(1, 0, 1).normalized()).norm(), 0, 1e-14);
  EXPECT_NEAR((normal({1, 2, 3}) - Vec3(1, 1, 1).normalized()).norm(), 0, 1e-14);
  EXPECT_EQ(box.nearest({1, 2, 3})->distance, 0);
}

TEST(CollisionMesh, SignIsRightBesideTheEdgesOfAThinPlate) {
  const Real thick = 1e-6;
  const CollisionMesh plate(make_box({-1, -1, 0}, {1, 1, thick}));
  for (std::uint64_t k = 0; k < 2000; ++k) {
    const auto u = [&](std::uint64_t stream) { return random_uniform(21, stream, k); };
    const Vec3 p(1 + 4e-6 * (u(0) - 0.5), 2.1 * (u(1) - 0.5), 4e-6 * (u(2) - 0.5));
    const bool inside = p.x() < 1 && std::abs(p.y()) < 1 && p.z() > 0 && p.z() < thick;
    EXPECT_EQ(plate.signed_distance(p) < 0, inside) << p.transpose();
  }
}

TEST(CollisionMesh, ASheetHasTwoSidesAndNoInside) {
  const CollisionMesh sheet(make_grid({-1, -1, 0}, {1, 1}, 2, 2));
  EXPECT_EQ(sheet.report().sheets, 1u);
  EXPECT_EQ(sheet.report().solids, 0u);
  for (const Real z : {-0.25, 0.25}) {
    const auto found = sheet.nearest({0.3, 0.2, z});
    ASSERT_TRUE(found);
    EXPECT_EQ(found->distance, 0.25);
    EXPECT_EQ(found->normal.z(), z > 0 ? 1 : -1);
    EXPECT_FALSE(sheet.inside({0.3, 0.2, z}));
  }
}

TEST(CollisionMesh, NothingBeyondReachAndNothingForNaN) {
  const CollisionMesh box(make_box({0, 0, 0}, {1, 1, 1}));
  EXPECT_FALSE(box.nearest({0.5, 0.5, 1.5}, 0.49));
  EXPECT_TRUE(box.nearest({0.5, 0.5, 1.5}, 0.5));
  EXPECT_FALSE(box.nearest({0.5, 0.5, 0.5}, 0.4)) << "deeper than the reach";
  EXPECT_TRUE(box.inside({0.5, 0.5, 0.5}));
  EXPECT_FALSE(box.nearest({std::numeric_limits<Real>::quiet_NaN(), 0, 0}));
  EXPECT_FALSE(box.nearest({0, std::numeric_limits<Real>::infinity(), 0}));
  EXPECT_NEAR(box.nearest({1e12, 0.5, 0.5})->distance, 1e12, 1);
  EXPECT_NEAR(box.nearest({0.5, -1e30, 0.5})->distance, 1e30, 1e15);
}

/// The shape's box, seen through meshes of very different places and sizes: nothing about a tree of floats may show.
TEST(CollisionMesh, FarFromTheOriginAndAtAnySizeTheAnswerIsAsExactAsTheCoordinates) {
  for (const Real size : {1e-9, 1e-3, 1e6, 1e12}) {
    for (const Real away : {0.0, 1e3, 1e7}) {
      const Vec3 shift = Vec3(1, -0.7, 0.3) * away * size;
      TriMesh torus = make_torus({0, 0, 0}, 1, 0.3, 32, 16);
      for (Vec3& x : torus.positions) x = size * x + shift;
      const CollisionMesh mesh(torus);
      for (std::uint64_t k = 0; k < 60; ++k) {
        const Vec3 p = truth::random_point(torus, 9, k);
        const auto expected = static_cast<Real>(truth::nearest(mesh.mesh(), p).distance);
        EXPECT_NEAR(std::abs(mesh.signed_distance(p)), expected, kDistance * expected + kRounding * p.norm()) << "size " << size << " away " << away;
      }
    }
  }
}

TEST(CollisionMesh, InwardPartsAreTurnedAndPartsOfBothWaysAreFlipped) {
  TriMesh inward = make_box({0, 0, 0}, {1, 1, 1});
  for (auto& t : inward.triangles) std::swap(t[1], t[2]);
  const CollisionMesh turned(inward);
  EXPECT_EQ(turned.report().turned, 1u);
  EXPECT_EQ(turned.report().flipped, 0u);
  EXPECT_EQ(turned.signed_distance({0.5, 0.5, 0.4}), -0.4);
  EXPECT_TRUE(validate(turned.mesh()).solid());

  TriMesh mixed = make_sphere({0, 0, 0}, 1, 2);
  for (std::size_t k = 0; k < mixed.triangles.size(); k += 3) std::swap(mixed.triangles[k][0], mixed.triangles[k][1]);
  const CollisionMesh sphere(mixed);
  EXPECT_EQ(sphere.report().flipped, (mixed.triangles.size() + 2) / 3);
  EXPECT_EQ(sphere.report().solids, 1u);
  EXPECT_TRUE(validate(sphere.mesh()).solid());
  meets_the_truth(mixed, true, 60, 5);
}

TEST(CollisionMesh, OpenOneSidedAndFlatPartsAreSheets) {
  TriMesh open = make_box({0, 0, 0}, {1, 1, 1});
  open.triangles.pop_back();
  EXPECT_EQ(CollisionMesh(open).report().sheets, 1u);

  // Moebius' strip is open; two copies of one triangle back to back are closed, and enclose nothing.
  TriMesh flat;
  flat.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  flat.triangles = {{0, 1, 2}, {0, 2, 1}};
  const CollisionMesh folded(flat);
  EXPECT_EQ(folded.report().doubled, 1u);
  EXPECT_EQ(folded.report().sheets, 1u);
  EXPECT_EQ(folded.signed_distance({0.2, 0.2, -0.5}), 0.5);

  // Every triangle of a box there twice, once each way round: a box, written for a renderer that culls.
  TriMesh both = make_box({0, 0, 0}, {1, 1, 1});
  for (std::size_t k = 0; k < 12; ++k) both.triangles.push_back({both.triangles[k][0], both.triangles[k][2], both.triangles[k][1]});
  EXPECT_EQ(CollisionMesh(both).report().solids, 1u) << to_string(CollisionMesh(both).report());
  // A shelf in an open box is no wall between solids.
  TriMesh shelf = make_box({0, 0, 0}, {1, 1, 1});
  append(shelf, make_box({0, 0, 1}, {1, 1, 2}));
  shelf.triangles.pop_back();
  EXPECT_EQ(CollisionMesh(shelf).signed_distance({0.5, 0.5, 1.1}), 0.10000000000000009);

  // A tetrahedron pressed flat: closed, no doubled triangle, no volume.
  TriMesh pressed;
  pressed.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  pressed.triangles = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}};
  EXPECT_EQ(CollisionMesh(pressed).report().sheets, 1u);
}

TEST(CollisionMesh, SolidsThatShareAnEdgeOrAFaceAreSolids) {
  TriMesh two = make_box({0, 0, 0}, {1, 1, 1});
  append(two, make_box({1, 1, 0}, {2, 2, 1}));
  const CollisionMesh by_edge(two);
  EXPECT_EQ(by_edge.report().solids, 2u) << to_string(by_edge.report());
  EXPECT_TRUE(by_edge.inside({0.5, 0.5, 0.5}));
  EXPECT_TRUE(by_edge.inside({1.5, 1.5, 0.5}));
  EXPECT_FALSE(by_edge.inside({1.5, 0.5, 0.5}));
  EXPECT_FALSE(by_edge.inside({1 + 1e-6, 1 - 1e-6, 0.5}));

  TriMesh wall = make_box({0, 0, 0}, {1, 1, 1});
  append(wall, make_box({1, 0, 0}, {2, 1, 1}));
  const CollisionMesh by_face(wall);
  EXPECT_EQ(by_face.report().sheets, 0u) << to_string(by_face.report());
  EXPECT_TRUE(by_face.inside({0.5, 0.5, 0.5}));
  EXPECT_TRUE(by_face.inside({1.5, 0.5, 0.5}));
  EXPECT_NEAR(by_face.signed_distance({0.95, 0.5, 0.7}), -0.3, 1e-12) << "the wall between the two is no way out";
}

TEST(CollisionMesh, ASideSplitOnOneSideOnlyStillCloses) {
  // A vertex in the middle of a side, with a triangle of no area to close the gap, as exporters write it.
  TriMesh box = make_box({0, 0, 0}, {1, 1, 1});
  const auto [a, b, c] = box.triangles[0];
  const auto middle = static_cast<Index>(box.positions.size());
  box.positions.push_back((box.positions[a] + box.positions[b]) / 2);
  box.triangles[0] = {a, middle, c};
  box.triangles.push_back({middle, b, c});
  box.triangles.push_back({a, b, middle});
  const CollisionMesh mesh(box);
  EXPECT_EQ(mesh.report().dropped, 1u);
  EXPECT_EQ(mesh.report().solids, 1u) << to_string(mesh.report());
  for (std::uint64_t k = 0; k < 500; ++k) {
    const Vec3 p = truth::random_point(mesh.mesh(), 31, k);
    const bool inside = (p.array() > 0).all() && (p.array() < 1).all();
    EXPECT_EQ(mesh.signed_distance(p) < 0, inside) << p.transpose();
  }
}

TEST(CollisionMesh, OutOfOverlappingSolidsIsOutOfAllOfThem) {
  // A cross, a nested box and a sphere that reaches into both.
  TriMesh parts = make_box({-3, -1, -1}, {3, 1, 1});
  append(parts, make_box({-1, -3, -1}, {1, 3, 1}));
  append(parts, make_box({-0.2, -0.2, -0.2}, {0.2, 0.2, 0.2}));
  append(parts, make_sphere({1, 1, 0.5}, 0.9, 3));
  const CollisionMesh mesh(parts);
  EXPECT_EQ(mesh.report().solids, 4u);
  std::size_t inside = 0;
  for (std::uint64_t k = 0; k < 1000; ++k) {
    const Vec3 p = Vec3(random_uniform(17, 0, k) - 0.5, random_uniform(17, 1, k) - 0.5, random_uniform(17, 2, k) - 0.5).cwiseProduct(Vec3(7, 7, 3));
    const bool in = truth::winding(parts, p) > 0.5;
    const auto found = mesh.nearest(p);
    ASSERT_TRUE(found);
    ASSERT_EQ(found->distance < 0, in) << p.transpose();
    if (!in) continue;
    ++inside;
    EXPECT_LT(truth::winding(parts, p + (1e-9 - found->distance) * found->normal), 0.5) << p.transpose();
  }
  EXPECT_GT(inside, 200u);
  // In the middle of the cross the nearest surfaces are all inside: straight up is out.
  EXPECT_NEAR(mesh.signed_distance({0.3, 0.3, 0.25}), -0.75, 1e-12);
}

// A part that faces inward within a solid is room in it; one that faces outward there, or cuts through another part, is none.
TEST(CollisionMesh, APartThatFacesInwardWithinASolidIsACavity) {
  const auto inward = [](TriMesh m) {
    for (Triangle& t : m.triangles) std::swap(t[1], t[2]);
    return m;
  };
  TriMesh room = make_box({0, 0, 0}, {6, 6, 6});
  append(room, inward(make_box({1, 1, 1}, {5, 5, 5})));
  append(room, make_box({2, 2, 2}, {3, 3, 3}));  // and what stands in the room
  const CollisionMesh mesh(room);
  EXPECT_EQ(mesh.report().cavities, 1u);
  EXPECT_EQ(mesh.report().solids, 2u);
  EXPECT_EQ(mesh.report().turned, 0u);
  EXPECT_NEAR(mesh.signed_distance({4, 4, 4}), 1, 1e-12);
  EXPECT_NEAR(mesh.signed_distance({0.5, 3, 3}), -0.5, 1e-12);
  EXPECT_NEAR(mesh.signed_distance({2.5, 2.5, 2.5}), -0.5, 1e-12);
  EXPECT_NEAR(mesh.signed_distance({-1, 3, 3}), 1, 1e-12);
  EXPECT_FALSE(mesh.inside({4, 4, 4}));
  EXPECT_EQ(mesh.nearest({3, 3, 4.8})->normal.z(), -1);
  // In its corner three walls are seen.
  std::array<CollisionMesh::Nearest, 4> walls;
  EXPECT_EQ(mesh.surroundings({4.7, 4.6, 4.5}, 1, walls), 3u);

  TriMesh cut = make_box({0, 0, 0}, {6, 6, 6});
  append(cut, inward(make_box({1, 1, 1}, {5, 5, 7})));
  EXPECT_EQ(CollisionMesh(cut).report().cavities, 0u);
  EXPECT_LT(CollisionMesh(cut).signed_distance({3, 3, 3}), 0);
  TriMesh beside = make_box({0, 0, 0}, {6, 6, 6});
  append(beside, inward(make_box({7, 1, 1}, {8, 5, 5})));
  EXPECT_EQ(CollisionMesh(beside).report().turned, 1u);
}

TEST(CollisionMesh, WhatCannotBeAnObstacleIsRefusedWithAReason) {
  TriMesh mesh = make_box({0, 0, 0}, {1, 1, 1});
  mesh.positions[3].x() = std::numeric_limits<Real>::quiet_NaN();
  EXPECT_THROW(CollisionMesh{mesh}, InputError);
  mesh = make_box({0, 0, 0}, {1, 1, 1});
  mesh.triangles[2][1] = 8;
  EXPECT_THROW(CollisionMesh{mesh}, InputError);
  EXPECT_THROW(CollisionMesh{TriMesh{}}, InputError);
  mesh.positions = {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}};
  mesh.triangles = {{0, 1, 2}};
  try {
    CollisionMesh{mesh};
    FAIL() << "a line is no obstacle";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("no triangle with an area"), std::string::npos) << error.what();
  }
}

TEST(CollisionMesh, TrianglesOfEverySizeInARowAreFoundAll) {
  // Sizes over 1e12 in one mesh make a very lopsided tree.
  TriMesh mesh;
  Real x = 0;
  for (int k = 0; k < 400; ++k) {
    const Real size = std::pow(10.0, -6 + 12.0 * k / 400);
    const auto first = static_cast<Index>(mesh.positions.size());
    for (const Vec3& corner : {Vec3(0, 0, 0), Vec3(size, 0, 0), Vec3(0, size, size)}) mesh.positions.push_back(corner + Vec3(x, 0, 0));
    mesh.triangles.push_back({first, first + 1, first + 2});
    x += 2 * size;
  }
  const CollisionMesh shape(mesh);
  for (std::uint64_t k = 0; k < 200; ++k) {
    const Vec3 p = mesh.positions[k * 6 % mesh.positions.size()] + std::pow(10.0, -7 + 10 * random_uniform(41, 0, k)) * truth::unit(42, k);
    const auto expected = static_cast<Real>(truth::nearest(shape.mesh(), p).distance);
    EXPECT_NEAR(shape.signed_distance(p), expected, kDistance * expected + kRounding * p.norm());
  }
}

}  // namespace
}  // namespace effuse::geometry
