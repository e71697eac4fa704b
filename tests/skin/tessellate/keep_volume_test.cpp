#include "skin/tessellate/keep_volume.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/parallel.h"
#include "geometry/mesh/measure.h"
#include "geometry/procedural/primitives.h"
#include "geometry/terrain/height_field.h"
#include "skin/surface/level_set.h"
#include "tests/skin/surface/shapes.h"

/// A mesh that is moved until it encloses what it should.
namespace effuse::skin {
namespace {

using testing_shapes::cube;
using testing_shapes::fill;

using geometry::TriMesh;

/// A ball of particles' surface: round, and many triangles.
TriMesh ball() {
  LevelSetOptions options;
  options.spacing = 1;
  return mesh_level_set(build_level_set(fill(cube(6), 1, [](const Vec3& p) { return p.norm() < 5; }).bare(), 520, nullptr, options));
}

geometry::Terrain plane(Real height, Real rise) {
  std::vector<Real> z;
  for (int j = 0; j < 41; ++j)
    for (int i = 0; i < 41; ++i) z.push_back(height + rise * (i - 20));
  return geometry::Terrain::from_height_field(geometry::HeightField(Vec2(-20, -20), Vec2(1, 1), 41, 41, z));
}

TEST(KeepVolume, OfAClosedMeshIsWhatWasAskedFor) {
  for (const Real factor : {0.9, 1.0, 1.06}) {
    TriMesh mesh = ball();
    const Real before = geometry::signed_volume(mesh), wanted = factor * before;
    const std::vector<Vec3> ways = mesh.normals;
    const VolumeKept kept = keep_volume(mesh, ways, wanted, nullptr, 1);
    EXPECT_NEAR(kept.before, before, 1e-9 * before);
    EXPECT_NEAR(geometry::signed_volume(mesh), wanted, 1e-4 * wanted) << factor;
    EXPECT_NEAR(kept.after, geometry::signed_volume(mesh), 1e-9 * wanted);
    // V = 4/3 pi r^3: by so much the radius grows.
    EXPECT_NEAR(kept.offset, std::cbrt(before * 3 / (4 * kPi)) * (std::cbrt(factor) - 1), 0.01) << factor;
  }
}

TEST(KeepVolume, AboveAPlaneIsThatOfTheCap) {
  for (const Real rise : {0.0, 0.3}) {
    const geometry::Terrain ground = plane(1, rise);
    TriMesh mesh = ball();
    const Real radius = std::cbrt(geometry::signed_volume(mesh) * 3 / (4 * kPi)), h = radius - 1 / std::hypot(1, rise), cap = kPi * h * h * (3 * radius - h) / 3;
    const std::optional<Real> found = volume_above(mesh, &ground);
    ASSERT_TRUE(found);
    EXPECT_NEAR(*found / cap, 1, 0.03) << rise;  // a ball of particles is round to a tenth of a spacing
    const std::vector<Vec3> ways = mesh.normals;
    keep_volume(mesh, ways, 1.05 * *found, &ground, 1);
    EXPECT_NEAR(*volume_above(mesh, &ground) / (1.05 * *found), 1, 1e-3) << rise;
  }
}

TEST(KeepVolume, GoesNoFartherThanItMayAndNowhereWithoutGround) {
  TriMesh mesh = ball();
  const TriMesh before = mesh;
  const std::vector<Vec3> ways = mesh.normals;
  EXPECT_EQ(keep_volume(mesh, ways, 2 * geometry::signed_volume(mesh), nullptr, 0.125).offset, 0.125);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) ASSERT_NEAR((mesh.positions[v] - before.positions[v]).norm(), 0.125, 1e-12);
  // A terrain that ends under the ball.
  const geometry::Terrain small = geometry::Terrain::from_height_field(geometry::HeightField(Vec2(0, 0), Vec2(1, 1), 2, 2, {0, 0, 0, 0}));
  mesh = before;
  EXPECT_EQ(keep_volume(mesh, ways, 1000, &small, 1).offset, 0);
  EXPECT_EQ(mesh.positions, before.positions);
  EXPECT_FALSE(volume_above(mesh, &small));
  TriMesh none;
  EXPECT_EQ(keep_volume(none, {}, 1, nullptr, 1).after, 0);
}

TEST(KeepVolume, SameBitsOnAnyThreads) {
  const geometry::Terrain ground = plane(-1, 0.2);
  const auto moved = [&](int threads) {
    const ThreadLimit limit(threads);
    TriMesh mesh = ball();
    const std::vector<Vec3> ways = mesh.normals;
    keep_volume(mesh, ways, 400, &ground, 1);
    return mesh.positions;
  };
  EXPECT_EQ(moved(1), moved(3));
}

}  // namespace
}  // namespace effuse::skin
