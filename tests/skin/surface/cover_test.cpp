#include <gtest/gtest.h>

#include <cmath>

#include "geometry/query/mesh_tree.h"
#include "skin/surface/level_set.h"
#include "tests/skin/surface/shapes.h"

/// Particles that stand out keep a ball of their own.
namespace effuse::skin {
namespace {

using testing_shapes::Cloud;
using testing_shapes::fill;

using geometry::TriMesh;

/// The surface of a block of lattice 12 x 10 x 5, each particle moved by up to `jitter`.
TriMesh block(Real jitter, Real cover, Real voxel) {
  LevelSetOptions options;
  options.spacing = 1;
  options.voxel = voxel;
  options.cover = cover;
  return mesh_level_set(build_level_set(fill(Box3(Vec3(0, 0, 0), Vec3(12, 10, 5)), 1, [](const Vec3&) { return true; }, jitter).bare(), 600, nullptr, options));
}

Real corner_from(const TriMesh& mesh) {
  const geometry::MeshTree tree(mesh.positions, mesh.triangles);
  Real farthest = 0;
  for (int k = 0; k < 8; ++k) farthest = std::max(farthest, tree.nearest(Vec3(k & 1 ? 12 : 0, k & 2 ? 10 : 0, k & 4 ? 5 : 0))->distance);
  return farthest;
}

TEST(Cover, BringsTheSurfaceToWithinHalfASpacingOfABoxsCorners) {
  for (const Real voxel : {0.5, 1.0 / 3, 0.25}) {
    EXPECT_LT(corner_from(block(0, 0.44, voxel)), 0.5) << voxel;
    EXPECT_GT(corner_from(block(0, 0, voxel)), 0.65) << "the test would tell nothing";
  }
}

TEST(Cover, IsNotFeltOnFaces) {
  const TriMesh with = block(0.1, 0.44, 0.5), without = block(0.1, 0, 0.5);
  const geometry::MeshTree tree(without.positions, without.triangles);
  for (const Vec3& p : with.positions) {
    if (p.z() < 4 || p.x() < 3 || p.x() > 9 || p.y() < 3 || p.y() > 7) continue;
    ASSERT_LT(tree.nearest(p)->distance, 0.03) << p.transpose();  // the volume's shift
  }
}

TEST(Cover, GivesALoneParticleBackAPartOfWhatItLacks) {
  Cloud lone;
  lone.add(Vec3(0.1, 0.2, 0.3), 1);
  LevelSetOptions options;
  options.spacing = 1;
  options.match_volume = false;
  const Real with = volume_above_ground(build_level_set(lone.bare(), 1, nullptr, options), nullptr);
  options.cover = 0;
  const Real without = volume_above_ground(build_level_set(lone.bare(), 1, nullptr, options), nullptr);
  EXPECT_LT(without, 0.9) << "the test would tell nothing";
  EXPECT_GE(with, without);
  EXPECT_LT(with, 1.1);
}

}  // namespace
}  // namespace effuse::skin
