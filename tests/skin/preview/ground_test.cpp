#include "skin/preview/ground.h"

#include <gtest/gtest.h>

namespace effuse::skin {
namespace {

/// A cliff between flats, 20 m wide, that hangs over by `over` [m].
geometry::TriMesh cliff(Real over) {
  const Vec2 profile[] = {{0, 0}, {4, 0}, {8, 0}, {12, 0}, {12 - over, 3}, {12 - over, 6}, {12, 7}, {12 + over, 8}, {20, 8}, {24, 8}};
  constexpr Index kAcross = 11;
  geometry::TriMesh mesh;
  Index rows = 0;
  for (const Vec2& p : profile) {
    for (Index j = 0; j < kAcross; ++j) mesh.positions.emplace_back(p.x(), 2.0 * j, p.y());
    if (++rows == 1) continue;
    for (Index j = 0; j + 1 < kAcross; ++j) {
      const Index a = (rows - 2) * kAcross + j, b = a + kAcross;
      mesh.triangles.push_back({a, b, b + 1});
      mesh.triangles.push_back({a, b + 1, a + 1});
    }
  }
  return mesh;
}

/// The least z of the unit normals of the apron's triangles, the thinnest aside.
Real least_upward(const Ground& ground, std::size_t terrain_triangles) {
  Real least = 1;
  for (std::size_t t = terrain_triangles; t < ground.triangles.size(); ++t) {
    const auto& [a, b, c] = ground.triangles[t];
    const Vec3f normal = (ground.positions[b] - ground.positions[a]).cross(ground.positions[c] - ground.positions[a]);
    if (normal.norm() > 1e-3f) least = std::min(least, static_cast<Real>(normal.normalized().z()));
  }
  return least;
}

TEST(Ground, TheApronFacesUpWhereverTheTerrainHangsOver) {
  for (const Real over : {0.0, 1.0, 3.0, -3.0}) {
    const geometry::TriMesh mesh = cliff(over);
    const Ground ground = build_ground(mesh);
    ASSERT_GT(ground.triangles.size(), mesh.triangles.size() + 1000) << over;
    // 1e-3: the walls under the overhang stand upright, and float rounds them.
    EXPECT_GT(least_upward(ground, mesh.triangles.size()), -1e-3) << "overhang of " << over << " m";
  }
}

TEST(Ground, AnApronThatDoesNotFoldIsSewnToTheWholeBorder) {
  // Every border edge of the terrain has an apron triangle on its other side.
  const geometry::TriMesh mesh = cliff(0);
  const Ground ground = build_ground(mesh);
  const Index n = static_cast<Index>(mesh.positions.size());
  std::size_t at_border = 0;
  for (std::size_t t = mesh.triangles.size(); t < ground.triangles.size(); ++t) {
    const auto& [a, b, c] = ground.triangles[t];
    at_border += (a < n) + (b < n) + (c < n) == 2;
  }
  EXPECT_EQ(at_border, 2u * 9 + 2 * 10);
}

}  // namespace
}  // namespace effuse::skin
