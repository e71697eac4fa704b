#include "skin/surface/manifold.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>

#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"

namespace effuse::skin {
namespace {

using geometry::TriMesh;

/// Unit cubes at the given corners, vertices shared, faces between cubes left out: touching cubes make every fault.
TriMesh cubes(const std::vector<std::array<int, 3>>& at) {
  TriMesh mesh;
  std::map<std::array<int, 3>, Index> vertex;
  const auto number = [&](const std::array<int, 3>& p) {
    const auto [entry, added] = vertex.try_emplace(p, static_cast<Index>(mesh.positions.size()));
    if (added) mesh.positions.emplace_back(p[0], p[1], p[2]);
    return entry->second;
  };
  const auto filled = [&](const std::array<int, 3>& p) { return std::find(at.begin(), at.end(), p) != at.end(); };
  for (const auto& c : at)
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (const int side : {0, 1}) {
        std::array<int, 3> next = c;
        next[axis] += side ? 1 : -1;
        if (filled(next)) continue;
        const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
        std::array<std::array<int, 3>, 4> q;
        for (std::size_t k = 0; k < 4; ++k) {
          q[k] = c;
          q[k][axis] += side;
          q[k][u] += k == 1 || k == 2;
          q[k][v] += k >= 2;
        }
        if (!side) std::swap(q[1], q[3]);
        mesh.triangles.push_back({number(q[0]), number(q[1]), number(q[2])});
        mesh.triangles.push_back({number(q[0]), number(q[2]), number(q[3])});
      }
  return mesh;
}

TEST(Manifold, CubesThatShareAnEdgeComeApart) {
  TriMesh mesh = cubes({{0, 0, 0}, {1, 1, 0}});
  ASSERT_EQ(geometry::validate(mesh).non_manifold_edges, 1u);
  const ManifoldReport done = make_manifold(mesh);
  EXPECT_EQ(done.split_edges, 1u);
  EXPECT_EQ(done.split_vertices, 2u);
  const geometry::MeshReport report = geometry::validate(mesh);
  EXPECT_TRUE(report.solid()) << geometry::to_string(report);
  EXPECT_EQ(report.components, 2u);
  EXPECT_NEAR(geometry::signed_volume(mesh), 2, 1e-12);
}

TEST(Manifold, CubesThatShareAVertexComeApart) {
  TriMesh mesh = cubes({{0, 0, 0}, {1, 1, 1}});
  ASSERT_EQ(geometry::validate(mesh).non_manifold_vertices, 1u);
  EXPECT_EQ(make_manifold(mesh).split_vertices, 1u);
  EXPECT_TRUE(geometry::validate(mesh).solid());
  EXPECT_EQ(geometry::validate(mesh).components, 2u);
}

TEST(Manifold, AnEdgeWhoseEndsCannotPartGetsTwoMiddles) {
  // Four cubes in a ring with a step: the two that share only an edge hang together through the others at both its ends.
  TriMesh mesh = cubes({{0, 0, 0}, {1, 1, 0}, {0, 0, 1}, {0, 1, 1}, {1, 1, 1}, {0, 0, -1}, {0, 1, -1}, {1, 1, -1}});
  ASSERT_GT(geometry::validate(mesh).non_manifold_edges, 0u);
  const Real volume = geometry::signed_volume(mesh);
  make_manifold(mesh);
  const geometry::MeshReport report = geometry::validate(mesh);
  EXPECT_TRUE(report.solid()) << geometry::to_string(report);
  EXPECT_EQ(report.components, 1u);
  EXPECT_NEAR(geometry::signed_volume(mesh), volume, 1e-12);
}

TEST(Manifold, RandomVoxelsBecomeSolids) {
  std::uint64_t state = 12345;
  for (int round = 0; round < 60; ++round) {
    std::vector<std::array<int, 3>> at;
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j)
        for (int k = 0; k < 4; ++k) {
          state = state * 6364136223846793005ULL + 1442695040888963407ULL;
          if (state >> 62 < 1u + static_cast<unsigned>(round % 2)) at.push_back({i, j, k});
        }
    if (at.empty()) continue;
    TriMesh mesh = cubes(at);
    make_manifold(mesh);
    const geometry::MeshReport report = geometry::validate(mesh);
    ASSERT_TRUE(report.solid()) << "round " << round << ": " << geometry::to_string(report);
    ASSERT_NEAR(geometry::signed_volume(mesh), static_cast<Real>(at.size()), 1e-9);
  }
}

TEST(Manifold, LeavesASolidAlone) {
  TriMesh mesh = cubes({{0, 0, 0}, {1, 0, 0}});
  const TriMesh before = mesh;
  const ManifoldReport done = make_manifold(mesh);
  EXPECT_EQ(done.split_edges + done.split_vertices + done.dropped_triangles, 0u);
  EXPECT_EQ(mesh.positions, before.positions);
  EXPECT_EQ(mesh.triangles, before.triangles);
}

}  // namespace
}  // namespace effuse::skin
