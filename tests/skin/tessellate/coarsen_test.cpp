#include "skin/tessellate/coarsen.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/procedural/primitives.h"
#include "geometry/query/mesh_tree.h"
#include "skin/detail/refine.h"
#include "skin/surface/level_set.h"
#include "tests/skin/surface/shapes.h"

namespace effuse::skin {
namespace {

using geometry::TriMesh;
using testing_shapes::Cloud;
using testing_shapes::cube;
using testing_shapes::fill;

TriMesh surface_of(const Cloud& cloud) {
  LevelSetOptions options;
  options.spacing = 1;
  return mesh_level_set(build_level_set(cloud.points(), cloud.volume(), nullptr, options));
}

CoarsenReport coarsen_to(TriMesh& mesh, Real error, Real longest = 0) {
  CoarsenOptions options;
  options.error = error;
  options.longest = longest;
  return coarsen(mesh, options);
}

/// The farthest that any of ten points of each of a's triangles is from b.
Real farthest(const TriMesh& a, const TriMesh& b) {
  const geometry::MeshTree tree(b.positions, b.triangles);
  Real most = 0;
  for (const geometry::Triangle& t : a.triangles)
    for (int i = 0; i <= 3; ++i)
      for (int j = 0; i + j <= 3; ++j) {
        const Vec3 p = (i * a.positions[t[0]] + j * a.positions[t[1]] + (3 - i - j) * a.positions[t[2]]) / 3;
        most = std::max(most, tree.nearest(p)->distance);
      }
  return most;
}

class Coarsen : public testing::TestWithParam<Real> {};

TEST_P(Coarsen, StaysWithinItsErrorOnBothSidesAndClosed) {
  const Real error = GetParam();
  const TriMesh fines[] = {
      surface_of(fill(
          cube(5), 1, [](const Vec3& p) { return p.norm() < 4; }, 0.2)),
      surface_of(fill(
          Box3(Vec3(-6, -6, -0.5), Vec3(6, 6, 0.5)), 1, [](const Vec3& p) { return p.norm() < 6; }, 0.25)),
      surface_of(fill(
          cube(6), 1, [](const Vec3& p) { return std::hypot(std::hypot(p.x(), p.y()) - 3.5, p.z()) < 1.3; }, 0.2)),
  };
  for (const TriMesh& fine : fines) {
    TriMesh mesh = fine;
    const CoarsenReport report = coarsen_to(mesh, error);
    const geometry::MeshReport before = geometry::validate(fine), after = geometry::validate(mesh);
    EXPECT_TRUE(after.solid()) << geometry::to_string(after);
    EXPECT_EQ(after.components, before.components);
    EXPECT_EQ(after.euler, before.euler);
    EXPECT_LE(report.error, error);
    // Rounding of closest points.
    EXPECT_LE(farthest(fine, mesh), report.error + 1e-9);
    EXPECT_LE(farthest(mesh, fine), report.error + 1e-9);
    EXPECT_EQ(report.removed, fine.positions.size() - mesh.positions.size());
    EXPECT_LT(static_cast<Real>(mesh.triangles.size()), static_cast<Real>(fine.triangles.size()) / (error < 0.05 ? 1.15 : 1.9));
  }
}
INSTANTIATE_TEST_SUITE_P(Errors, Coarsen, testing::Values(0.02, 0.1));

TEST(Coarsening, LeavesVerticesAsTheyWere) {
  const TriMesh fine = surface_of(fill(
      cube(4), 1, [](const Vec3& p) { return p.norm() < 3; }, 0.2));
  TriMesh mesh = fine;
  const CoarsenReport report = coarsen_to(mesh, 0.1);
  ASSERT_EQ(report.kept.size(), mesh.positions.size());
  for (std::size_t v = 0; v < report.kept.size(); ++v) {
    const std::size_t old = report.kept[v];
    EXPECT_EQ(mesh.positions[v], fine.positions[old]);
    EXPECT_EQ(mesh.normals[v], fine.normals[old]);
    for (const auto& [name, attribute] : fine.attributes) {
      const auto width = static_cast<std::size_t>(attribute.width);
      for (std::size_t k = 0; k < width; ++k)
        EXPECT_EQ(mesh.attributes.at(name).values[v * width + k], attribute.values[old * width + k]) << name;
    }
  }
}

TEST(Coarsening, TakesAllItCanFromFlatSides) {
  // A box cut fine is a box: what is left stands at corners and along edges.
  TriMesh mesh = geometry::make_box(Vec3(0, 0, 0), Vec3(4, 2, 1));
  for (int k = 0; k < 4; ++k) mesh = refine(mesh);
  const Real volume = geometry::signed_volume(mesh);
  const std::size_t fine = mesh.triangles.size();
  const CoarsenReport report = coarsen_to(mesh, 1e-6);
  EXPECT_TRUE(geometry::validate(mesh).solid());
  EXPECT_NEAR(geometry::signed_volume(mesh), volume, 1e-5);
  EXPECT_LE(report.error, 1e-6);
  EXPECT_LT(mesh.triangles.size(), fine / 4);
}

TEST(Coarsening, MakesNoEdgeLongerThanAsked) {
  TriMesh mesh = geometry::make_box(Vec3(0, 0, 0), Vec3(4, 4, 4));
  for (int k = 0; k < 4; ++k) mesh = refine(mesh);
  coarsen_to(mesh, 1e-3, 0.9);
  Real longest = 0;
  for (const geometry::Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) longest = std::max(longest, (mesh.positions[t[k]] - mesh.positions[t[(k + 1) % 3]]).norm());
  EXPECT_LE(longest, 0.9);
  EXPECT_GT(longest, 0.5);
}

TEST(Coarsening, MakesNoThinTriangles) {
  TriMesh mesh = geometry::make_sphere(Vec3::Zero(), 1, 4);
  coarsen_to(mesh, 0.01);
  Real least = kPi;
  for (const geometry::Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 a = mesh.positions[t[(k + 1) % 3]] - mesh.positions[t[k]], b = mesh.positions[t[(k + 2) % 3]] - mesh.positions[t[k]];
      least = std::min(least, std::atan2(a.cross(b).norm(), a.dot(b)));
    }
  EXPECT_GT(least, 14.9 * kPi / 180);
  EXPECT_TRUE(geometry::validate(mesh).solid());
}

TEST(Coarsening, OfRandomClustersStaysClosed) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    Cloud cloud;
    for (std::uint64_t i = 0; i < 80; ++i)
      cloud.add(1.6 * Vec3(random_normal(seed, 0, i), random_normal(seed, 1, i), random_normal(seed, 2, i)), 1);
    const TriMesh fine = surface_of(cloud);
    TriMesh mesh = fine;
    // So coarse that drops and spikes come down to the least that is closed.
    const CoarsenReport report = coarsen_to(mesh, 0.5);
    const geometry::MeshReport before = geometry::validate(fine), after = geometry::validate(mesh);
    EXPECT_TRUE(after.solid()) << "seed " << seed << ": " << geometry::to_string(after);
    EXPECT_EQ(after.euler, before.euler);
    EXPECT_EQ(after.components, before.components);
    EXPECT_LE(farthest(fine, mesh), report.error + 1e-9);
    EXPECT_LE(farthest(mesh, fine), report.error + 1e-9);
  }
}

TEST(Coarsening, LeavesEachLabelAVertex) {
  // A flat-sided box cut fine, in patches: without labels next to nothing is left of its sides.
  TriMesh mesh = geometry::make_box(Vec3(0, 0, 0), Vec3(4, 2, 1));
  for (int k = 0; k < 4; ++k) mesh = refine(mesh);
  TriMesh bare = mesh;
  std::vector<Index> label;
  std::vector<std::uint8_t> seen(64, 0);
  for (const Vec3& x : mesh.positions) {
    label.push_back(static_cast<Index>(std::min(3.0, x.x()) + 4 * std::min(3.0, std::floor(2 * x.y())) + 16 * std::min(3.0, std::floor(4 * x.z()))));
    seen[label.back()] = 1;
  }
  CoarsenOptions options;
  options.error = 1e-6;
  const CoarsenReport without = coarsen(bare, options), with = coarsen(mesh, options, label);
  EXPECT_TRUE(geometry::validate(mesh).solid());
  const auto labels_left = [&](const CoarsenReport& report) {
    std::vector<std::uint8_t> left(64, 0);
    for (const Index v : report.kept) left[label[v]] = 1;
    return std::count(left.begin(), left.end(), 1);
  };
  EXPECT_EQ(labels_left(with), std::count(seen.begin(), seen.end(), 1));
  EXPECT_LT(labels_left(without), labels_left(with)) << "the test would tell nothing";
  EXPECT_GT(with.removed, without.removed / 2);
}

TEST(Coarsening, OfNothingIsNothing) {
  TriMesh mesh;
  EXPECT_EQ(coarsen_to(mesh, 1).removed, 0u);
}

TEST(CoarseningDeath, RefusesAMeshWithAHole) {
  TriMesh mesh = geometry::make_grid(Vec3::Zero(), Vec2(1, 1), 3, 3);
  EXPECT_DEATH(coarsen_to(mesh, 0.1), "CHECK failed");
}

}  // namespace
}  // namespace effuse::skin
