#include "skin/detail/displace.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/procedural/noise.h"
#include "skin/detail/refine.h"
#include "skin/surface/level_set.h"
#include "tests/skin/surface/shapes.h"

namespace effuse::skin {
namespace {

using geometry::TriMesh;
using testing_shapes::Cloud;
using testing_shapes::cube;
using testing_shapes::fill;

/// Skin of a ball of lava, spacing 0.5, all of it at that temperature.
TriMesh ball(Real radius = 6, float temperature = 1000, const geometry::Terrain* terrain = nullptr) {
  const Cloud cloud =
      fill(cube(radius), 0.5, [&](const Vec3& p) { return p.norm() < radius - 0.25 && (!terrain || terrain->signed_distance(p) > 0.25); });
  LevelSetOptions options;
  options.spacing = 0.5;
  TriMesh mesh = mesh_level_set(build_level_set(cloud.points(), cloud.volume(), terrain, options));
  mesh.attributes["temperature"].values.assign(mesh.positions.size(), temperature);
  mesh.attributes["crust"].values.assign(mesh.positions.size(), 0.0f);
  return mesh;
}

DisplaceOptions half_metre() {
  DisplaceOptions options;
  options.spacing = 0.5;
  return options;
}

std::uint64_t hash_of(const TriMesh& mesh) {
  StateHash hash;
  hash.add(std::span<const Vec3>(mesh.positions));
  hash.add(std::span<const float>(mesh.attributes.at("detail").values));
  return hash.value();
}

Real roughness(const TriMesh& before, const TriMesh& after) {
  Real sum = 0;
  for (std::size_t i = 0; i < before.positions.size(); ++i) sum += (after.positions[i] - before.positions[i]).squaredNorm();
  return std::sqrt(sum / static_cast<Real>(before.positions.size()));
}

TEST(Displace, KeepsTheMeshSolidAndItsVolume) {
  for (const float temperature : {1500.0f, 1300.0f, 900.0f}) {
    TriMesh mesh = ball(6, temperature);
    const Real volume = geometry::signed_volume(mesh);
    const DisplaceReport report = displace(mesh, nullptr, half_metre());
    const geometry::MeshReport valid = geometry::validate(mesh);
    EXPECT_TRUE(valid.solid()) << geometry::to_string(valid);
    EXPECT_NEAR(geometry::signed_volume(mesh) / volume, 1, 0.02) << temperature;
    EXPECT_GT(report.largest, 0.01);
    EXPECT_LE(report.largest, 0.35 * 0.5 + 1e-12);
    EXPECT_LT(static_cast<double>(report.held_back), 0.02 * static_cast<double>(mesh.positions.size()));
    EXPECT_EQ(report.refined, 0);
    const auto& detail = mesh.attributes.at("detail").values;
    ASSERT_EQ(detail.size(), mesh.positions.size());
    for (const float d : detail) {
      ASSERT_GE(d, -1);
      ASSERT_LE(d, 1);
    }
  }
}

TEST(Displace, MovesWithTheMaterialNotThroughSpace) {
  const TriMesh at_home = ball();
  TriMesh a = at_home, b = at_home;
  const Quat turn(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()));
  const Vec3 shift(13.7, -4.1, 2.2);
  for (Vec3& p : b.positions) p = turn * p + shift;
  for (Vec3& n : b.normals) n = turn * n;
  // The material coordinates went along: they are where the lava was, not where it is.
  displace(a, nullptr, half_metre());
  displace(b, nullptr, half_metre());
  ASSERT_EQ(a.positions.size(), b.positions.size());
  for (std::size_t i = 0; i < a.positions.size(); ++i) ASSERT_LT((turn * a.positions[i] + shift - b.positions[i]).norm(), 1e-9);
  EXPECT_EQ(a.attributes.at("detail").values, b.attributes.at("detail").values);

  // Without them the noise stands still in space.
  TriMesh c = at_home;
  c.attributes.erase("rest");
  c.attributes.erase("rest2");
  for (Vec3& p : c.positions) p = turn * p + shift;
  for (Vec3& n : c.normals) n = turn * n;
  displace(c, nullptr, half_metre());
  EXPECT_NE(a.attributes.at("detail").values, c.attributes.at("detail").values);
}

TEST(Displace, BlendsTheTwoRestPositionsWithoutLosingContrast) {
  const TriMesh mesh = ball();
  const auto deviation = [&](Real ratio) {
    TriMesh m = mesh;
    DisplaceOptions options = half_metre();
    options.rest_ratio = ratio;
    options.roughness = 0;  // swells: what the nonlinear clinker does to contrast is another matter
    displace(m, nullptr, options);
    return roughness(mesh, m);
  };
  const Real first = deviation(0), half = deviation(0.5), second = deviation(1);
  EXPECT_NEAR(half, (first + second) / 2, 0.15 * first);
  // The ends are each one's own: as if the other were not there.
  TriMesh with = mesh, without = mesh;
  without.attributes.erase("rest2");
  displace(with, nullptr, half_metre());
  displace(without, nullptr, half_metre());
  EXPECT_EQ(with.attributes.at("detail").values, without.attributes.at("detail").values);
}

TEST(Displace, ColdOrCrustedIsRougherThanMolten) {
  const auto rough = [](float temperature, float crust) {
    const TriMesh before = ball(6, temperature);
    TriMesh after = before;
    after.attributes["crust"].values.assign(before.positions.size(), crust);
    displace(after, nullptr, half_metre());
    return roughness(before, after);
  };
  const Real molten = rough(1480, 0), cold = rough(1000, 0), crusted = rough(1480, 1);
  EXPECT_GT(cold, 1.8 * molten);
  EXPECT_NEAR(crusted, cold, 0.01 * cold);
}

TEST(Displace, LeavesTheCutAtTheGroundAlone) {
  std::vector<Real> z(25, 0.0);
  const auto ground = geometry::Terrain::from_height_field(geometry::HeightField(Vec2(-20, -20), Vec2(10, 10), 5, 5, z));
  const TriMesh before = ball(6, 1000, &ground);
  TriMesh after = before;
  displace(after, &ground, half_metre());
  Real high = 0;
  for (std::size_t i = 0; i < before.positions.size(); ++i) {
    const Real moved = (after.positions[i] - before.positions[i]).norm();
    if (before.positions[i].z() <= 0) {
      ASSERT_EQ(moved, 0);
    }
    ASSERT_LE(moved, std::max(0.0, before.positions[i].z()));
    high = std::max(high, moved);
  }
  EXPECT_GT(high, 0.05);
  EXPECT_TRUE(geometry::validate(after).solid());
}

TEST(Displace, ASheetOneParticleThickStaysWhole) {
  Cloud cloud = fill(Box3(Vec3(0, 0, 0), Vec3(15, 15, 1)), 1, [](const Vec3&) { return true; });
  LevelSetOptions options;
  options.spacing = 1;
  TriMesh mesh = mesh_level_set(build_level_set(cloud.points(), cloud.volume(), nullptr, options));
  const Real volume = geometry::signed_volume(mesh);
  DisplaceOptions strong;
  strong.spacing = 1;
  strong.amplitude = 5;  // asks for far too much
  mesh.attributes.erase("temperature");
  const DisplaceReport report = displace(mesh, nullptr, strong);
  EXPECT_LE(report.largest, 0.35 + 1e-12);
  EXPECT_TRUE(geometry::validate(mesh).solid());
  EXPECT_GT(geometry::signed_volume(mesh), 0.5 * volume);
}

TEST(Displace, RefinesToTheEdgeAskedFor) {
  TriMesh mesh = ball(3);
  const Real before = mean_edge(mesh);
  const std::size_t triangles = mesh.triangles.size();
  DisplaceOptions options = half_metre();
  options.edge = 0.25;
  options.octaves = 6;
  EXPECT_EQ(displace(mesh, nullptr, options).refined, 1);
  EXPECT_EQ(mesh.triangles.size(), 4 * triangles);
  EXPECT_LT(mean_edge(mesh), 0.7 * before);
  EXPECT_TRUE(geometry::validate(mesh).solid());
  for (const auto& [name, attribute] : mesh.attributes)
    EXPECT_EQ(attribute.values.size(), mesh.positions.size() * static_cast<std::size_t>(attribute.width)) << name;
}

TEST(Refine, KeepsShapeAndEulerCharacteristic) {
  const TriMesh coarse = ball(2);
  const TriMesh fine = refine(coarse);
  EXPECT_NEAR(geometry::signed_volume(fine), geometry::signed_volume(coarse), 1e-9);
  EXPECT_NEAR(geometry::surface_area(fine), geometry::surface_area(coarse), 1e-9);
  const geometry::MeshReport a = geometry::validate(coarse), b = geometry::validate(fine);
  EXPECT_EQ(b.euler, a.euler);
  EXPECT_TRUE(b.solid());
  EXPECT_EQ(b.vertices, a.vertices + a.edges);
  EXPECT_NEAR(mean_edge(fine), mean_edge(coarse) / 2, 1e-9);
}

TEST(Displace, IsTheSameBitsOnAnyThreads) {
  const TriMesh mesh = ball(4);
  std::uint64_t first = 0;
  for (const int threads : {1, 2, 4}) {
    const ThreadLimit limit(threads);
    TriMesh m = mesh;
    displace(m, nullptr, half_metre());
    if (threads == 1) first = hash_of(m);
    EXPECT_EQ(hash_of(m), first) << threads;
  }
  TriMesh other = mesh;
  DisplaceOptions options = half_metre();
  options.seed = 2;
  displace(other, nullptr, options);
  EXPECT_NE(hash_of(other), first);
}

TEST(Displace, CracksCoverASixthOfAColdSurfaceAndPlatesAverageTheMeanTheyAreFreedOf) {
  // The constants in displace.cpp: the share of one octave's clinker below 0.36, and its mean.
  double below = 0, mean = 0;
  const int n = 100000;
  for (std::uint64_t i = 0; i < n; ++i) {
    const Vec3 p = 300 * Vec3(random_uniform(4, 0, i), random_uniform(4, 1, i), random_uniform(4, 2, i));
    const double level = -std::expm1(-std::abs(geometry::gradient_noise(p, 1)) / (0.45 * 0.28));
    below += level < 0.36;
    mean += level;
  }
  EXPECT_NEAR(below / n, 1.0 / 6, 0.04);
  EXPECT_NEAR(mean / n, 0.69, 0.02);
}

TEST(Displace, AnEmptyMeshStaysEmpty) {
  TriMesh mesh;
  EXPECT_EQ(displace(mesh, nullptr, half_metre()).largest, 0);
  EXPECT_TRUE(mesh.positions.empty());
}

}  // namespace
}  // namespace effuse::skin
