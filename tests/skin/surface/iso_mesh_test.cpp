#include "skin/surface/iso_mesh.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "skin/surface/dual_cells.h"

namespace effuse::skin {
namespace {

using geometry::TriMesh;

/// f(voxel) on a cube of blocks, `side` of them along each axis, the first at (-1, -1, -1).
template <class F>
Field sampled(const Blocks& blocks, F&& f) {
  Field phi(blocks.size() * kVoxels);
  for (std::size_t b = 0; b < blocks.size(); ++b)
    for (std::size_t v = 0; v < kVoxels; ++v) {
      const BlockCoord& c = blocks.coords()[b];
      phi[b * kVoxels + v] = static_cast<float>(f(Vec3(kSide * c[0] + static_cast<int>(v >> 6), kSide * c[1] + static_cast<int>((v >> 3) & 7),
                                                       kSide * c[2] + static_cast<int>(v & 7))));
    }
  return phi;
}

Blocks cube_of_blocks(int side) {
  std::vector<BlockCoord> coords;
  for (int a = 0; a < side; ++a)
    for (int b = 0; b < side; ++b)
      for (int c = 0; c < side; ++c) coords.push_back({a - 1, b - 1, c - 1});
  return Blocks(coords);
}

TEST(DualCells, ComplementsHaveTheSameCrossingsAndEveryPatchACycle) {
  for (unsigned c = 0; c < 256; ++c) {
    const DualCell cell = dual_cell(c), other = dual_cell(255 - c);
    EXPECT_EQ(cell.ambiguous, other.ambiguous);
    EXPECT_LE(cell.patches, 4);
    for (std::uint8_t p = 0; p < cell.patches; ++p) EXPECT_GE(std::count(cell.patch.begin(), cell.patch.end(), p), 3) << c;
    for (std::size_t e = 0; e < 12; ++e) EXPECT_EQ(cell.patch[e] == DualCell::kNoPatch, other.patch[e] == DualCell::kNoPatch);
  }
  EXPECT_EQ(dual_cell(0).patches, 0);
  EXPECT_EQ(dual_cell(0b10000001).patches, 2);  // opposite corners
  EXPECT_EQ(dual_cell(0b01101001).patches, 4);  // every other one
}

TEST(IsoMesh, SphereIsSmoothAndOfItsVolume) {
  const Blocks blocks = cube_of_blocks(4);
  const Vec3 middle(7.3, 8.1, 6.9);
  for (const Real radius : {3.1, 6.2, 12.4}) {
    const TriMesh mesh = iso_mesh(blocks, 30, sampled(blocks, [&](const Vec3& x) { return (x - middle).norm() - radius; }));
    const geometry::MeshReport report = geometry::validate(mesh);
    EXPECT_TRUE(report.solid()) << geometry::to_string(report);
    EXPECT_EQ(report.euler, 2);
    // Facets cut corners: second order.
    EXPECT_NEAR(geometry::signed_volume(mesh) / (4 * kPi / 3 * std::pow(radius, 3)), 1, 1.2 / (radius * radius)) << radius;
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
      ASSERT_NEAR((mesh.positions[i] - middle).norm(), radius, 0.5 / radius);
      ASSERT_GT(mesh.normals[i].dot((mesh.positions[i] - middle).normalized()), radius > 6 ? 0.999 : 0.99);
    }
  }
}

// Every configuration and every pair of neighbours occur in noise, those that pinch among them.
TEST(IsoMesh, NoiseBecomesASolid) {
  for (const Real share : {0.1, 0.3, 0.5, 0.7, 0.9})
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      const Blocks blocks = cube_of_blocks(3);
      std::uint64_t n = 0;
      // Inside voxels at the rim, too: blocks are added.
      const Field phi = sampled(blocks, [&](const Vec3&) { return random_uniform(seed, 0, n++) - share; });
      const TriMesh mesh = iso_mesh(blocks, 1, phi);
      const geometry::MeshReport report = geometry::validate(mesh);
      ASSERT_TRUE(report.solid()) << "share " << share << ", seed " << seed << ": " << geometry::to_string(report);
      ASSERT_GT(geometry::signed_volume(mesh), 0);
      ASSERT_EQ(mesh.normals.size(), mesh.positions.size());
      for (const Vec3& normal : mesh.normals) ASSERT_NEAR(normal.norm(), 1, 1e-5);
    }
}

// A checkerboard of two values on a plane: ambiguous faces side by side.
TEST(IsoMesh, PinchedFacesArePartedOnBothSides) {
  const Blocks blocks = cube_of_blocks(2);
  const auto solid = [&](const std::vector<Vec3>& inside) {
    const TriMesh mesh = iso_mesh(blocks, 1, sampled(blocks, [&](const Vec3& x) {
      return std::find(inside.begin(), inside.end(), x) != inside.end() ? -1 : 1;
    }));
    const geometry::MeshReport report = geometry::validate(mesh);
    EXPECT_TRUE(report.solid()) << geometry::to_string(report);
    return report.components;
  };
  EXPECT_EQ(solid({Vec3(0, 0, 0)}), 1u);
  EXPECT_EQ(solid({Vec3(0, 0, 0), Vec3(1, 1, 0)}), 2u);  // touching in an edge: apart
  // The same two joined above and below but not beside: without turned faces four triangles would share an edge.
  EXPECT_EQ(solid({Vec3(0, 0, 0), Vec3(0, 0, 1), Vec3(0, 1, 1), Vec3(1, 1, 1), Vec3(1, 1, 0), Vec3(0, 0, -1), Vec3(0, 1, -1), Vec3(1, 1, -1)}), 1u);
}

TEST(IsoMesh, IsTheSameOnAnyNumberOfThreadsAndNothingOfNothing) {
  const Blocks blocks = cube_of_blocks(4);
  std::uint64_t n = 0;
  const Field phi = sampled(blocks, [&](const Vec3& x) { return (x - Vec3(8, 8, 8)).norm() - 7 + random_uniform(1, 0, n++); });
  const TriMesh mesh = iso_mesh(blocks, 3, phi);
  const ThreadLimit one(1);
  const TriMesh again = iso_mesh(blocks, 3, phi);
  EXPECT_EQ(mesh.positions, again.positions);
  EXPECT_EQ(mesh.triangles, again.triangles);
  EXPECT_EQ(mesh.normals, again.normals);
  EXPECT_TRUE(iso_mesh(Blocks(), 1, {}).triangles.empty());
}

}  // namespace
}  // namespace effuse::skin
