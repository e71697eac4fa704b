#include "geometry/terrain/terrain.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "geometry/base/error.h"
#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "geometry/procedural/primitives.h"
#include "geometry/query/mesh_surface.h"
#include "tests/geometry/terrain/fields.h"

namespace effuse::geometry {
namespace {

constexpr Real kNaN = std::numeric_limits<Real>::quiet_NaN();
constexpr Real kInfinity = std::numeric_limits<Real>::infinity();

/// Distance from p to the bilinear surface the long way: in every cell, for the best X at each of many Y (a clamped
/// projection), then golden sections about the best few.
Real brute_force(const HeightField& field, const Vec3& p) {
  Real best2 = kInfinity;
  const Vec2 s = field.spacing();
  for (int j = 0; j + 1 < field.ny(); ++j) {
    for (int i = 0; i + 1 < field.nx(); ++i) {
      if (!field.whole(i, j)) continue;
      const Real z00 = field.post(i, j), z10 = field.post(i + 1, j), z01 = field.post(i, j + 1), z11 = field.post(i + 1, j + 1);
      const Vec3 q(p.x() - field.corner().x() - i * s.x(), p.y() - field.corner().y() - j * s.y(), p.z());
      const Box3 box(Vec3(0, 0, std::min({z00, z10, z01, z11})), Vec3(s.x(), s.y(), std::max({z00, z10, z01, z11})));
      if (box.squaredExteriorDistance(q) >= best2) continue;
      const auto at = [&](Real v) {
        const Real a = z00 + v * (z01 - z00), b = z10 + v * (z11 - z10), slope = (b - a) / s.x();
        const Real X = std::clamp((q.x() + slope * (q.z() - a)) / (1 + slope * slope), 0.0, s.x());
        return (Vec3(X, v * s.y(), a + slope * X) - q).squaredNorm();
      };
      constexpr int kSteps = 64;
      Real value[kSteps + 1];
      for (int k = 0; k <= kSteps; ++k) value[k] = at(Real(k) / kSteps);
      for (int k = 0; k <= kSteps; ++k) {
        if ((k > 0 && value[k] > value[k - 1]) || (k < kSteps && value[k] > value[k + 1])) continue;
        Real low = std::max(0.0, Real(k - 1) / kSteps), high = std::min(1.0, Real(k + 1) / kSteps);
        for (int n = 0; n < 80; ++n) {
          const Real a = high - 0.6180339887498949 * (high - low), b = low + 0.6180339887498949 * (high - low);
          (at(a) < at(b) ? high : low) = at(a) < at(b) ? b : a;
        }
        best2 = std::min({best2, at(low), at(high), value[k]});
      }
    }
  }
  return std::sqrt(best2);
}

/// A random point over the field's box, at a height within spread [m] of the ground there (or of the box where none is).
Vec3 point_over(const HeightField& field, std::uint64_t seed, std::uint64_t k, Real spread) {
  const Box3 box = field.bounds();
  Vec3 p = box.min() + Vec3(random_uniform(seed, 0, k), random_uniform(seed, 1, k), 0.5).cwiseProduct(box.sizes());
  const Real h = field.height(p.x(), p.y());
  p.z() = (h == h ? h : p.z()) + spread * (2 * random_uniform(seed, 2, k) - 1);
  return p;
}

struct FieldCase {
  const char* name;
  HeightField field;
};
const std::vector<FieldCase>& field_cases() {
  static const std::vector<FieldCase> cases{
      {"maunga whau", fields::maunga_whau()},
      {"maunga whau three times as steep", fields::maunga_whau(3)},
      {"gentle random", fields::random_field(1, 23, 17, 0.1, 0)},
      {"rough random", fields::random_field(2, 23, 17, 1, 0)},
      {"cliffs with holes", fields::random_field(3, 31, 27, 3, 0.1)},
      {"mostly holes", fields::random_field(4, 40, 30, 0.5, 0.5)},
      {"a single twisted cell", HeightField({0, 0}, {1, 1}, 2, 2, {0, 3, 3, 0})},
      {"one strip", fields::random_field(5, 40, 2, 0.7, 0)},
  };
  return cases;
}

class OverFields : public testing::TestWithParam<std::size_t> {
 protected:
  const FieldCase& param() const { return field_cases()[GetParam()]; }
};
INSTANTIATE_TEST_SUITE_P(All, OverFields, testing::Range(std::size_t{0}, std::size_t{8}));

TEST_P(OverFields, TheDistanceIsThatOfBruteForceNearAndFar) {
  const HeightField& field = param().field;
  const Terrain terrain = Terrain::from_height_field(field);
  const Real cell = field.spacing().minCoeff();
  for (const Real spread : {0.05 * cell, cell, 30 * cell}) {
    for (std::uint64_t k = 0; k < 150; ++k) {
      const Vec3 p = point_over(field, 17, k, spread);
      const Contact contact = terrain.contact(p);
      ASSERT_EQ(contact.any(), field.covers(p.x(), p.y())) << param().name;
      if (!contact.any()) continue;
      const Real expected = brute_force(field, p);
      // The contract: 1e-3 cells up to a cell away. The search does better: rounding at any distance.
      EXPECT_NEAR(std::abs(contact.distance), expected, 1e-9 * (cell + expected)) << param().name << ", point " << p.transpose();
      EXPECT_NEAR((contact.point - p).norm(), std::abs(contact.distance), 1e-12 * (cell + expected));
      EXPECT_NEAR(field.height(contact.point.x(), contact.point.y()), contact.point.z(), 1e-9 * (cell + field.bounds().sizes().z())) << "not on the ground";
      EXPECT_NEAR(contact.normal.norm(), 1, 1e-14);
    }
  }
}

TEST_P(OverFields, TheSignIsThatOfTheHeightDifference) {
  const HeightField& field = param().field;
  const Terrain terrain = Terrain::from_height_field(field);
  for (std::uint64_t k = 0; k < 2000; ++k) {
    const Vec3 p = point_over(field, 23, k, 1e-6 * std::pow(10.0, static_cast<Real>(k % 8)));
    const Real h = field.height(p.x(), p.y());
    if (h != h) continue;
    const Real d = terrain.signed_distance(p);
    EXPECT_EQ(d < 0, p.z() < h) << param().name << " " << p.transpose();
    EXPECT_LE(std::abs(d), std::abs(p.z() - h) * (1 + 1e-12) + 1e-15);
  }
}

TEST_P(OverFields, ReachOnlyHidesWhatIsFarther) {
  const HeightField& field = param().field;
  const Terrain terrain = Terrain::from_height_field(field);
  const Real cell = field.spacing().minCoeff();
  for (std::uint64_t k = 0; k < 1000; ++k) {
    const Vec3 p = point_over(field, 29, k, 2 * cell);
    const Real reach = cell * 3 * random_uniform(31, 0, k);
    const Contact all = terrain.contact(p), near = terrain.contact(p, reach);
    EXPECT_EQ(near.any(), all.any() && all.distance <= reach) << param().name << " " << all.distance << " " << reach;
    if (near.any()) {
      EXPECT_NEAR(near.distance, all.distance, 1e-12 * cell);
    }
  }
}

TEST_P(OverFields, TheNormalOfASlidingPointTurnsByNoMoreThanCTimesTheStep) {
  const HeightField& field = param().field;
  const Terrain terrain = Terrain::from_height_field(field);
  const Real cell = field.spacing().minCoeff();
  // Slopes differ by at most 4 S from post to post (S bounds each), so the normal's field turns by at most 4 S sqrt(2) a
  // cell; the foot moves by at most 2 + (that times the distance, at most half a cell) steps.
  const Real turning = 4 * std::sqrt(2.0) * field.max_slope() / cell;
  const Real bound = turning * (2 + field.max_slope() + turning * 0.5 * cell);
  const Real step = 1e-5 * cell;
  for (std::uint64_t line = 0; line < 40; ++line) {
    // Lines along x, y, both diagonals of the cells and askew, through a random post or anywhere.
    const int i = 1 + static_cast<int>(random_bits(1, 0, line) % std::max(1, field.nx() - 2)), j = 1 + static_cast<int>(random_bits(1, 1, line) % std::max(1, field.ny() - 2));
    const Vec2 directions[] = {{1, 0}, {0, 1}, field.spacing().normalized(), Vec2(field.spacing().x(), -field.spacing().y()).normalized(), Vec2(0.6, 0.8)};
    const Vec2 d = directions[line % 5];
    Vec2 centre = field.corner() + Vec2(i, j).cwiseProduct(field.spacing());
    if (line % 2) centre += 0.3 * field.spacing();
    const Real offset = cell * 0.5 * (2 * random_uniform(1, 2, line) - 1);
    Contact before;
    for (int n = -200; n <= 200; ++n) {
      const Vec2 xy = centre + n * step * d;
      const Real h = field.height(xy.x(), xy.y());
      const Contact contact = h == h ? terrain.contact({xy.x(), xy.y(), h + offset}) : Contact{};
      if (before.any() && contact.any()) {
        ASSERT_LE((contact.normal - before.normal).norm(), bound * step + 1e-13) << param().name << " line " << line << " step " << n;
        ASSERT_LE(std::abs(contact.distance - before.distance), step * (1 + field.max_slope()) * (1 + 1e-6)) << "the distance jumped";
      }
      before = contact;
    }
  }
}

TEST(HeightFieldTerrain, TheNormalIsContinuousOverWholeTraversesOfTheVolcano) {
  const HeightField field = fields::maunga_whau();
  const Terrain terrain = Terrain::from_height_field(field);
  const Real step = 0.01;
  Real worst = 0;
  for (const Real y : {430.0, 433.7}) {
    Vec3 before = terrain.contact({20, y, field.height(20, y) + 0.5}).normal;
    for (Real x = 20 + step; x < 580; x += step) {
      const Vec3 normal = terrain.contact({x, y, field.height(x, y) + 0.5}).normal;
      worst = std::max(worst, (normal - before).norm());
      before = normal;
    }
  }
  EXPECT_LE(worst, 0.15 * step) << "per metre at most 0.15 rad: slopes change by at most 1 or so within 10 m";
}

TEST(HeightFieldTerrain, AContactOnATiltedPlaneIsExactToRounding) {
  const Vec3 normal = Vec3(-0.5, 0.25, 1).normalized();
  const HeightField field = fields::sampled({100, 200}, {10, 10}, 30, 40, [](Real x, Real y) { return 0.5 * x - 0.25 * y + 3; });
  const Terrain terrain = Terrain::from_height_field(field, {}, 285);
  for (std::uint64_t k = 0; k < 2000; ++k) {
    const Vec3 foot(150 + 200 * random_uniform(1, 0, k), 250 + 250 * random_uniform(1, 1, k), 0);
    const Vec3 on(foot.x(), foot.y(), field.height(foot.x(), foot.y()));
    const Real distance = 20 * (2 * random_uniform(1, 2, k) - 1);
    const Contact contact = terrain.contact(on + distance * normal);
    // Coordinates of some hundred metres round to 1e-13.
    EXPECT_NEAR(contact.distance, distance, 5e-13);
    EXPECT_LT((contact.point - on).norm(), 2e-12);
    EXPECT_LT((contact.normal - normal).norm(), 1e-13);
    EXPECT_EQ(contact.surface_temperature, 285);
  }
}

TEST(HeightFieldTerrain, OnASmoothHillTheNormalIsTheDirectionFromTheClosestPoint) {
  // A dome of radius 50 sampled each metre; a metre from it.
  const HeightField field = fields::sampled({-20, -20}, {1, 1}, 41, 41, [](Real x, Real y) { return std::sqrt(2500 - x * x - y * y); });
  const Terrain terrain = Terrain::from_height_field(field);
  for (std::uint64_t k = 0; k < 500; ++k) {
    const Vec3 radial = Vec3(-0.3 + 0.6 * random_uniform(1, 0, k), -0.3 + 0.6 * random_uniform(1, 1, k), 1).normalized();
    const Contact contact = terrain.contact((50 + 2 * random_uniform(1, 2, k) - 1) * radial);
    EXPECT_LT((contact.normal - radial).norm(), 1e-3) << "second order in the spacing over the radius: (1 / 50)^2 = 4e-4";
  }
}

TEST(HeightFieldTerrain, OutsideTheCoveredAreaInHolesAndForBrokenPointsThereIsNoContact) {
  std::vector<Real> z(25, 0.0);
  z[12] = kNaN;
  const Terrain terrain = Terrain::from_height_field(HeightField({0, 0}, {1, 1}, 5, 5, z));
  for (const Vec3& p : {Vec3(-0.1, 2, 0), Vec3(2, 4.1, -3), Vec3(1.5, 1.5, 0.1), Vec3(2.4, 1.7, -5), Vec3(kNaN, 0, 0), Vec3(1, kNaN, 0),
                        Vec3(0.5, 0.5, kNaN), Vec3(0.5, 0.5, kInfinity), Vec3(0.5, 0.5, -kInfinity), Vec3(1e300, 0, 0)}) {
    EXPECT_FALSE(terrain.contact(p).any()) << p.transpose();
    EXPECT_EQ(terrain.signed_distance(p), kInfinity);
  }
  EXPECT_TRUE(terrain.contact({0.5, 0.5, 0.1}).any());
  EXPECT_FALSE(terrain.contact({0.5, 0.5, 0.1}, 0.05).any());
  EXPECT_FALSE(terrain.height(1.5, 1.5).has_value());
  EXPECT_FALSE(terrain.height(kNaN, 1).has_value());
}

TEST(HeightFieldTerrain, PointsDeepInTheGroundAreFoundWhateverTheReach) {
  const Terrain terrain = Terrain::from_height_field(fields::maunga_whau());
  const Contact contact = terrain.contact({300, 400, -500}, 0.1);
  ASSERT_TRUE(contact.any());
  EXPECT_LT(contact.distance, -500);
}

TEST(HeightFieldTerrain, ACliffAcrossAHoleIsNotMissed) {
  // Flat ground, a hole two cells wide, then a tower: the nearest ground is its top, which no slope in the field foretells.
  std::vector<Real> z(8 * 8, 0.0);
  for (int j = 0; j < 8; ++j) {
    z[j * 8 + 3] = kNaN;
    for (int i = 4; i < 8; ++i) z[j * 8 + i] = 100;
  }
  const HeightField field({0, 0}, {1, 1}, 8, 8, z);
  const Contact contact = Terrain::from_height_field(field).contact({1.9, 3.5, 100}, 3);
  ASSERT_TRUE(contact.any());
  EXPECT_NEAR(contact.distance, 2.1, 1e-12);
}

TEST(HeightFieldTerrain, BulkContactsEqualSingleOnesOnAnyNumberOfThreads) {
  const HeightField field = fields::maunga_whau();
  const Terrain terrain = Terrain::from_height_field(field);
  std::vector<Vec3> points;
  for (std::uint64_t k = 0; k < 20000; ++k) points.push_back(point_over(field, 7, k, 5));
  std::vector<std::uint64_t> hashes;
  for (const int threads : {1, 2, 4}) {
    const ThreadLimit limit(threads);
    std::vector<Contact> contacts(points.size());
    terrain.contacts(points, 2, contacts);
    StateHash hash;
    for (std::size_t k = 0; k < points.size(); ++k) {
      if (k % 97 == 0) {
        EXPECT_EQ(contacts[k].distance, terrain.contact(points[k], 2).distance);
      }
      hash.add(std::span<const Vec3>(&contacts[k].point, 1));
      hash.add(std::span<const Vec3>(&contacts[k].normal, 1));
      hash.add(contacts[k].distance);
    }
    hashes.push_back(hash.value());
  }
  EXPECT_EQ(hashes[0], hashes[1]);
  EXPECT_EQ(hashes[0], hashes[2]);
}

TEST(HeightFieldTerrain, RaysMeetTheTrianglesOfItsMesh) {
  for (const HeightField& field : {fields::maunga_whau(), fields::random_field(3, 31, 27, 3, 0.1)}) {
    const Terrain terrain = Terrain::from_height_field(field), as_mesh = Terrain::from_mesh(field.mesh());
    const Box3 box = field.bounds();
    int hits = 0;
    for (std::uint64_t k = 0; k < 1500; ++k) {
      const Vec3 from = box.min() + Vec3(random_uniform(1, 0, k), random_uniform(1, 1, k), 2 * random_uniform(1, 2, k)).cwiseProduct(box.sizes());
      const Vec3 to = box.min() + Vec3(random_uniform(1, 3, k), random_uniform(1, 4, k), random_uniform(1, 5, k) - 0.5).cwiseProduct(box.sizes());
      const auto a = terrain.ray(from, to - from, 1), b = as_mesh.ray(from, to - from, 1);
      ASSERT_EQ(a.has_value(), b.has_value()) << k;
      if (a) {
        EXPECT_NEAR(*a, *b, 1e-9);
      }
      hits += a.has_value();
    }
    EXPECT_GT(hits, 200);
    EXPECT_LT(hits, 1500);
  }
}

TEST(HeightFieldTerrain, VerticalRaysThroughPostsAndAlongCellBordersNeverMiss) {
  const HeightField field = fields::maunga_whau();
  const Terrain terrain = Terrain::from_height_field(field);
  for (int j = 0; j < field.ny(); ++j) {
    for (int i = 0; i < field.nx(); ++i) {
      const auto t = terrain.ray({10.0 * i, 10.0 * j, 1000}, {0, 0, -2}, kInfinity);
      ASSERT_TRUE(t.has_value()) << i << " " << j;
      ASSERT_NEAR(1000 - 2 * *t, field.post(i, j), 1e-9);
    }
  }
  EXPECT_TRUE(terrain.ray({5, 10, 1000}, {0, 0, -1}, kInfinity).has_value());
  EXPECT_FALSE(terrain.ray({5, 10, 1000}, {0, 0, -1}, 100).has_value());
  EXPECT_FALSE(terrain.ray({5, 10, 1000}, {0, 0, 1}, kInfinity).has_value());
  EXPECT_FALSE(terrain.ray({5, 10, 1000}, {0, 0, 0}, kInfinity).has_value());
  EXPECT_FALSE(terrain.ray({5, kNaN, 1000}, {0, 0, -1}, kInfinity).has_value());
}

TEST(HeightFieldTerrain, HeightBelowRespectsItsCeiling) {
  const Terrain terrain = Terrain::from_height_field(HeightField({0, 0}, {1, 1}, 2, 2, {1, 1, 3, 3}));
  EXPECT_EQ(terrain.height(0.5, 0.5), 2);
  EXPECT_EQ(terrain.height_below(0.5, 0.5, 2), 2);
  EXPECT_EQ(terrain.height_below(0.5, 0.5, 1.9), std::nullopt);
  EXPECT_EQ(terrain.height(2, 0.5), std::nullopt);
}

// ---- Meshes ----------------------------------------------------------------------------------------------------

TEST(MeshTerrain, MeshesThatAreNoSurfaceAreRefused) {
  EXPECT_THROW(Terrain::from_mesh({}), InputError);
  TriMesh flat;
  flat.positions = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  flat.triangles = {{0, 1, 2}, {0, 0, 1}};
  EXPECT_THROW(Terrain::from_mesh(flat), InputError);
  TriMesh broken = make_box({0, 0, 0}, {1, 1, 1});
  broken.positions[3].x() = kNaN;
  EXPECT_THROW(Terrain::from_mesh(broken), InputError);
  broken = make_box({0, 0, 0}, {1, 1, 1});
  broken.triangles[0][0] = 99;
  EXPECT_THROW(Terrain::from_mesh(broken), InputError);
}

TEST(MeshTerrain, DegenerateTrianglesAreHarmless) {
  TriMesh box = make_box({0, 0, 0}, {1, 1, 1});
  box.triangles.push_back({0, 0, 1});
  box.positions.push_back({0.5, 0, 0});
  box.triangles.push_back({0, 1, 8});
  const Terrain terrain = Terrain::from_mesh(box);
  EXPECT_NEAR(terrain.signed_distance({0.5, -0.3, -0.4}), 0.5, 1e-15);
  EXPECT_NEAR(terrain.signed_distance({0.5, 0.5, 0.9}), -0.1, 1e-15);
}

Real box_distance(const Vec3& p, const Vec3& half) {
  const Vec3 q = p.cwiseAbs() - half;
  return q.cwiseMax(0.0).norm() + std::min(q.maxCoeff(), 0.0);
}

TEST(MeshTerrain, TheSignedDistanceOfABoxIsExactInsideOutsideAtEdgesAndCorners) {
  const Vec3 half(1, 2, 3);
  const Terrain terrain = Terrain::from_mesh(make_box(-half, half));
  for (std::uint64_t k = 0; k < 5000; ++k) {
    const Vec3 p = 9 * Vec3(random_uniform(1, 0, k) - 0.5, random_uniform(1, 1, k) - 0.5, random_uniform(1, 2, k) - 0.5);
    EXPECT_NEAR(terrain.signed_distance(p), box_distance(p, half), 1e-14) << p.transpose();
  }
}

TEST(MeshTerrain, TheSameBoxAsASoupOfTrianglesHasTheSameSigns) {
  const TriMesh box = make_box({-1, -1, -1}, {1, 1, 1});
  TriMesh soup;
  for (const Triangle& t : box.triangles) {
    const auto first = static_cast<Index>(soup.positions.size());
    for (Index i : t) soup.positions.push_back(box.positions[i]);
    soup.triangles.push_back({first, first + 1, first + 2});
  }
  const Terrain terrain = Terrain::from_mesh(soup);
  for (std::uint64_t k = 0; k < 2000; ++k) {
    const Vec3 p = 4 * Vec3(random_uniform(1, 0, k) - 0.5, random_uniform(1, 1, k) - 0.5, random_uniform(1, 2, k) - 0.5);
    EXPECT_NEAR(terrain.signed_distance(p), box_distance(p, {1, 1, 1}), 1e-14);
  }
}

/// Mesh with thin spikes, where plain vertex normals give wrong signs.
TEST(MeshTerrain, ThePseudonormalsSignIsThatOfTheInsideAtSpikesToo) {
  // A star: a sphere whose vertices are pulled in and out at random.
  TriMesh star = make_sphere({0, 0, 0}, 1, 2);
  for (std::size_t i = 0; i < star.positions.size(); ++i) star.positions[i] *= 0.3 + 1.4 * random_uniform(5, 0, i);
  const Terrain terrain = Terrain::from_mesh(star);
  int inside = 0;
  for (std::uint64_t k = 0; k < 4000; ++k) {
    const Vec3 p = 3 * Vec3(random_uniform(1, 0, k) - 0.5, random_uniform(1, 1, k) - 0.5, random_uniform(1, 2, k) - 0.5);
    // Inside: the solid angle of all triangles seen from p is 4 pi (Van Oosterom & Strackee 1983).
    Real angle = 0;
    for (const auto& [a, b, c] : star.triangles) {
      const Vec3 u = star.positions[a] - p, v = star.positions[b] - p, w = star.positions[c] - p;
      const Real lu = u.norm(), lv = v.norm(), lw = w.norm();
      angle += 2 * std::atan2(u.dot(v.cross(w)), lu * lv * lw + u.dot(v) * lw + v.dot(w) * lu + w.dot(u) * lv);
    }
    const bool expected = angle > 2 * kPi;
    inside += expected;
    EXPECT_EQ(terrain.signed_distance(p) < 0, expected) << p.transpose();
  }
  EXPECT_GT(inside, 300);
}

TEST(MeshTerrain, TheDistanceIsThatOfBruteForceWithAndWithoutReach) {
  const TriMesh mesh = fields::random_field(2, 23, 17, 1, 0).mesh();
  const Terrain terrain = Terrain::from_mesh(mesh);
  for (std::uint64_t k = 0; k < 600; ++k) {
    // Above the middle, so that the rim is never nearest.
    const Vec3 p(-7 + 44 * (0.3 + 0.4 * random_uniform(1, 0, k)), 3 + 48 * (0.3 + 0.4 * random_uniform(1, 1, k)), -1 + 8 * random_uniform(1, 2, k));
    Real expected = kInfinity;
    for (const auto& [a, b, c] : mesh.triangles)
      expected = std::min(expected, (closest_point_on_triangle(p, mesh.positions[a], mesh.positions[b], mesh.positions[c]).point - p).norm());
    const Contact contact = terrain.contact(p);
    EXPECT_NEAR(std::abs(contact.distance), expected, 1e-12);
    const Real reach = 2 * random_uniform(1, 3, k);
    EXPECT_EQ(terrain.contact(p, reach).any(), expected <= reach);
    if (expected <= reach) {
      EXPECT_EQ(terrain.contact(p, reach).distance, contact.distance);
    }
  }
}

TEST(MeshTerrain, ASphereAgreesWithItsFormulaToTheSagOfItsTriangles) {
  const Terrain terrain = Terrain::from_mesh(make_sphere({5, 6, 7}, 2, 4));
  // Edges of about 0.15 on a radius of 2 sag by e^2 / 8 r = 1.4e-3; triangles' middles by a bit more.
  for (std::uint64_t k = 0; k < 2000; ++k) {
    const Vec3 d = Vec3(random_normal(1, 0, k), random_normal(1, 1, k), random_normal(1, 2, k)).normalized();
    const Real r = 0.5 + 3 * random_uniform(1, 9, k);
    const Contact contact = terrain.contact(Vec3(5, 6, 7) + r * d);
    EXPECT_NEAR(contact.distance, r - 2, 4e-3);
    // Near the centre every triangle is about equally close, and which one is closest jumps.
    if (r > 1.5) {
      EXPECT_LT((contact.normal - d).norm(), 0.02) << "a tenth of an edge over the radius";
    }
  }
}

TEST(MeshTerrain, TheNormalAboveARolledSurfaceTurnsContinuously) {
  const Terrain terrain = Terrain::from_mesh(make_torus({0, 0, 0}, 5, 2, 60, 30));
  const Real step = 1e-4;
  Vec3 before = terrain.contact({0, 0, 0}).normal;
  Real worst = 0;
  bool first = true;
  for (int n = 0; n < 20000; ++n) {
    // Round the tube, outside it, and along the ring.
    const Real b = -kPi / 2 + n * step * 1.5, a = n * step * 0.4, r = 5 + 2.3 * std::cos(b);
    const Vec3 normal = terrain.contact({r * std::cos(a), r * std::sin(a), 2.3 * std::sin(b)}).normal;
    if (!first) worst = std::max(worst, (normal - before).norm());
    before = normal;
    first = false;
  }
  EXPECT_LT(worst, 10 * step) << "1.5 steps round the tube at once, steeper where a triangle is crossed askew";
}

TEST(MeshTerrain, ABoxKeepsItsFacesFlatAndTurnsAtItsEdges) {
  const Terrain terrain = Terrain::from_mesh(make_box({-1, -1, -1}, {1, 1, 1}));
  EXPECT_LT((terrain.contact({0.9, 0.3, 1.2}).normal - Vec3::UnitZ()).norm(), 1e-15) << "flat ground must not push sideways near its edge";
  EXPECT_LT((terrain.contact({0.9, 0.3, 0.95}).normal - Vec3::UnitZ()).norm(), 1e-15);
  EXPECT_LT((terrain.contact({1.1, 0.3, 1.1}).normal - Vec3(1, 0, 1).normalized()).norm(), 1e-14);
  EXPECT_LT((terrain.contact({1.1, 1.1, 1.1}).normal - Vec3(1, 1, 1).normalized()).norm(), 1e-14);
  EXPECT_LT((terrain.contact({1, 0.3, 1}).normal - Vec3(1, 0, 1).normalized()).norm(), 1e-14) << "exactly on the edge";
  // Round the edge, 0.2 outside: the normal turns by step / 0.2 at most.
  Vec3 before = Vec3::UnitZ();
  for (int n = 0; n <= 4000; ++n) {
    const Real s = n * 1e-4 * 2;  // path: along the top, round the edge, down the side
    const Vec3 p = s < 0.3 ? Vec3(0.7 + s, 0.1, 1.2) : s < 0.3 + 0.1 * kPi ? Vec3(1 + 0.2 * std::sin((s - 0.3) / 0.2), 0.1, 1 + 0.2 * std::cos((s - 0.3) / 0.2)) : Vec3(1.2, 0.1, 1 - (s - 0.3 - 0.1 * kPi));
    const Vec3 normal = terrain.contact(p).normal;
    EXPECT_LE((normal - before).norm(), 2e-4 / 0.2 * 1.01) << s;
    before = normal;
  }
  EXPECT_LT((before - Vec3::UnitX()).norm(), 1e-12);
}

TEST(MeshTerrain, BeyondTheRimOfAnOpenSheetThereIsNoContact) {
  const Terrain terrain = Terrain::from_mesh(make_grid({0, 0, 0}, {1, 1}, 4, 3));
  EXPECT_NEAR(terrain.signed_distance({2, 1.3, 0.7}), 0.7, 1e-15);
  EXPECT_NEAR(terrain.signed_distance({2, 1.3, -0.7}), -0.7, 1e-15);
  for (const Vec3& p : {Vec3(-0.01, 1.3, 0.5), Vec3(4.2, 1, 0), Vec3(2, 3.001, -0.1), Vec3(-0.1, -0.1, 0.3), Vec3(4.1, 3.1, -0.2), Vec3(-0.1, 1, 0.3), Vec3(5, 0, 0)})
    EXPECT_FALSE(terrain.contact(p).any()) << p.transpose();
  for (const Vec3& p : {Vec3(0, 1.3, 0.5), Vec3(4, 1, -0.25), Vec3(0, 0, 0.4), Vec3(4, 3, 0.1), Vec3(2, 3, 0)}) EXPECT_TRUE(terrain.contact(p).any()) << p.transpose();
}

/// Ground with a standing ring on it: an arch to pass under, and a sheltered floor.
Terrain arch() {
  TriMesh ring = make_torus({0, 0, 0}, 3, 0.5, 64, 32);
  for (Vec3& x : ring.positions) x = Vec3(x.x(), -x.z(), x.y() + 2);  // stands in the x-z plane, its foot in the ground
  TriMesh mesh = make_box({-10, -10, -4}, {10, 10, -2});
  append(mesh, ring);
  return Terrain::from_mesh(mesh);
}

TEST(MeshTerrain, UnderAnArchTheFloorIsFoundAndOnItTheTop) {
  const Terrain terrain = arch();
  ASSERT_TRUE(terrain.height(0, 0).has_value());
  EXPECT_NEAR(*terrain.height(0, 0), 5.5, 0.02) << "top of the arch";
  EXPECT_NEAR(*terrain.height_below(0, 0, 4), -0.5, 0.02) << "under its roof: top of its lower half";
  EXPECT_NEAR(*terrain.height_below(0, 0, 5), -0.5, 0.02) << "from within its roof: the roof's underside is no ground";
  EXPECT_NEAR(*terrain.height_below(0, 0, -1.9), -2, 1e-12) << "below the ring: the box";
  EXPECT_FALSE(terrain.height_below(0, 0, -5).has_value());
  EXPECT_NEAR(*terrain.height(6, 6), -2, 1e-12);
  EXPECT_FALSE(terrain.height(11, 0).has_value());
  // Under the roof the nearest ground is overhead, its normal points down.
  const Contact roof = terrain.contact({0, 0, 4.3});
  EXPECT_NEAR(roof.distance, 0.2, 0.01);
  EXPECT_LT(roof.normal.z(), -0.99);
  EXPECT_LT(terrain.signed_distance({0, 0, 5}), -0.4);
  EXPECT_GT(terrain.signed_distance({0, 0, 2}), 2.4);
  EXPECT_NEAR(*terrain.ray({0, 0, 2}, {0, 0, 1}, 10), 2.5, 0.02);
  EXPECT_FALSE(terrain.ray({0, 0, 2}, {0, 0, 1}, 2).has_value());
  EXPECT_FALSE(terrain.ray({0, -5, 2}, {0, 1, 0}, 10).has_value()) << "through the ring";
}

TEST(MeshTerrain, HeightsAtVerticesAndOnEdgesNeverMiss) {
  const HeightField field = fields::maunga_whau();
  const Terrain terrain = Terrain::from_mesh(field.mesh());
  for (int j = 0; j < field.ny(); ++j) {
    for (int i = 0; i < field.nx(); ++i) {
      const auto h = terrain.height(10.0 * i, 10.0 * j);
      ASSERT_TRUE(h.has_value()) << i << " " << j;
      ASSERT_NEAR(*h, field.post(i, j), 1e-9);
      if (i + 1 < field.nx()) {
        ASSERT_NEAR(*terrain.height(10.0 * i + 3.7, 10.0 * j), field.height(10.0 * i + 3.7, 10.0 * j), 1e-9);
      }
    }
  }
  EXPECT_FALSE(terrain.height(kNaN, 3).has_value());
}

TEST(MeshTerrain, AboveVerticalWallsTheTopIsTheHeight) {
  const Terrain terrain = Terrain::from_mesh(make_box({0, 0, 0}, {1, 1, 1}));
  for (const Vec2& xy : {Vec2(0, 0), Vec2(0, 0.5), Vec2(1, 1), Vec2(0.5, 0.5), Vec2(1, 0.3)}) {
    ASSERT_TRUE(terrain.height(xy.x(), xy.y()).has_value()) << xy.transpose();
    EXPECT_NEAR(*terrain.height(xy.x(), xy.y()), 1, 1e-15);
  }
}

TEST(MeshTerrain, MeshAndHeightFieldAgreeToTheTwistOfTheCells) {
  const HeightField field = fields::maunga_whau();
  const Terrain a = Terrain::from_height_field(field), b = Terrain::from_mesh(field.mesh());
  // A bilinear cell and its two triangles differ by at most a quarter of its twist, here at most 19 m of posts' steps.
  Real twist = 0;
  for (int j = 0; j + 1 < field.ny(); ++j)
    for (int i = 0; i + 1 < field.nx(); ++i)
      twist = std::max(twist, std::abs(field.post(i + 1, j + 1) - field.post(i + 1, j) - field.post(i, j + 1) + field.post(i, j)));
  for (std::uint64_t k = 0; k < 3000; ++k) {
    const Vec3 p(50 + 500 * random_uniform(1, 0, k), 50 + 750 * random_uniform(1, 1, k), 80 + 120 * random_uniform(1, 2, k));
    EXPECT_NEAR(a.signed_distance(p), b.signed_distance(p), twist / 4);
  }
  EXPECT_TRUE(a.is_height_field());
  EXPECT_FALSE(b.is_height_field());
  EXPECT_EQ(b.height_field(), nullptr);
  EXPECT_EQ(a.mesh().triangles.size(), b.mesh().triangles.size());
  EXPECT_EQ(a.bounds().max(), b.bounds().max());
}

TEST(MeshTerrain, FarFromTheOriginADistanceKeepsItsDigits) {
  const Vec3 origin(2667400, 6478700, 150);
  const Terrain terrain = Terrain::from_mesh(make_box(origin - Vec3(1, 1, 1), origin + Vec3(1, 1, 1)));
  for (std::uint64_t k = 0; k < 500; ++k) {
    const Vec3 q = 4 * Vec3(random_uniform(1, 0, k) - 0.5, random_uniform(1, 1, k) - 0.5, random_uniform(1, 2, k) - 0.5);
    const Vec3 p = origin + q;
    EXPECT_NEAR(terrain.signed_distance(p), box_distance(p - origin, {1, 1, 1}), 1e-8) << "coordinates round to 1e-9";
  }
}

TEST(MeshTerrain, BulkContactsEqualSingleOnesOnAnyNumberOfThreads) {
  const Terrain terrain = Terrain::from_mesh(fields::maunga_whau().mesh());
  const HeightField field = fields::maunga_whau();
  std::vector<Vec3> points;
  for (std::uint64_t k = 0; k < 4000; ++k) points.push_back(point_over(field, 7, k, 5));
  std::vector<std::uint64_t> hashes;
  for (const int threads : {1, 4}) {
    const ThreadLimit limit(threads);
    std::vector<Contact> contacts(points.size());
    terrain.contacts(points, 3, contacts);
    StateHash hash;
    for (const Contact& contact : contacts) {
      hash.add(std::span<const Vec3>(&contact.point, 1));
      hash.add(std::span<const Vec3>(&contact.normal, 1));
      hash.add(contact.distance);
    }
    hashes.push_back(hash.value());
  }
  EXPECT_EQ(hashes[0], hashes[1]);
}

TEST(MeshTerrain, ALandscapeFromAnotherProgramHasHeightsEverywhereInside) {
  const char* folder = std::getenv("EFFUSE_SHARED_DATA");
  const std::filesystem::path path = std::filesystem::path(folder ? folder : EFFUSE_SOURCE_DIR "/../shared/data") / "meshes/terrain-meshes/three_peaks.off";
  std::ifstream in(path);
  if (!in) GTEST_SKIP() << "needs " << path << " (set EFFUSE_SHARED_DATA)";
  std::string magic;
  std::size_t vertices = 0, faces = 0, edges = 0;
  in >> magic >> vertices >> faces >> edges;
  TriMesh mesh;
  for (std::size_t i = 0; i < vertices; ++i) {
    Real x = 0, y = 0, z = 0;
    in >> x >> y >> z;
    mesh.positions.emplace_back(x, y, z);
  }
  for (std::size_t t = 0; t < faces; ++t) {
    Index n = 0, a = 0, b = 0, c = 0;
    in >> n >> a >> b >> c;
    ASSERT_EQ(n, 3u);
    mesh.triangles.push_back({a, b, c});
  }
  ASSERT_TRUE(in.good() || in.eof());
  // y is up and the faces look down: turn it over into z up, facing up.
  for (Vec3& x : mesh.positions) x = Vec3(x.x(), -x.z(), x.y());
  for (Triangle& t : mesh.triangles) std::swap(t[0], t[1]);
  const Terrain terrain = Terrain::from_mesh(mesh);
  int tops = 0;
  for (const Triangle& t : mesh.triangles) {
    const Vec3 middle = (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3;
    const auto h = terrain.height(middle.x(), middle.y());
    ASSERT_TRUE(h.has_value());
    ASSERT_GE(*h, middle.z() - 1e-9 * terrain.bounds().sizes().norm());
    ++tops;
    const Contact contact = terrain.contact(middle);
    ASSERT_TRUE(contact.any());
    EXPECT_LT(std::abs(contact.distance), 1e-9 * terrain.bounds().sizes().norm());
  }
  EXPECT_EQ(tops, 3671);
}

}  // namespace
}  // namespace effuse::geometry
