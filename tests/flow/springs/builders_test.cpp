#include "flow/springs/builders.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "geometry/base/error.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/procedural/primitives.h"

namespace effuse::flow::springs {
namespace {

Real total_mass(const SpringBody& body) { return std::accumulate(body.network.mass.begin(), body.network.mass.end(), 0.0); }

TEST(JelloCube, HasTheSpringsOfTheAssignment) {
  const SpringBody body = jello_cube(8, Vec3::Zero(), 1, 1. / 512, {200, 0.25, 0});
  EXPECT_EQ(body.network.size(), 512u);
  std::map<long, int> by_square;  // of the length in cells
  for (const Spring& s : body.network.springs) ++by_square[std::lround(s.rest * s.rest * 49)];
  // Structural 3 * 7 * 64, face diagonals 6 * 49 * 8, body diagonals 4 * 343, bend 3 * 6 * 64.
  EXPECT_EQ(by_square, (std::map<long, int>{{1, 1344}, {2, 2352}, {3, 1372}, {4, 1152}}));
  const geometry::MeshReport report = geometry::validate(body.surface);
  EXPECT_TRUE(report.solid());
  EXPECT_EQ(report.triangles, 6u * 49 * 2);
  EXPECT_NEAR(geometry::signed_volume(body.surface), 1, 1e-12);
}

TEST(JelloCube, ItsSurfaceFollowsItsPoints) {
  SpringBody body = jello_cube(3, Vec3::Zero(), 2, 1, {1, 0, 0});
  for (Vec3& x : body.state.x) x = 3 * x + Vec3(1, 2, 3);
  const std::vector<Vec3> shown = surface_positions(body, body.state.x);
  for (std::size_t q = 0; q < shown.size(); ++q) EXPECT_LT((shown[q] - 3 * body.surface.positions[q] - Vec3(1, 2, 3)).norm(), 1e-12);
}

TEST(Cloth, WeighsItsAreaAndBendsAcrossEveryInnerEdge) {
  const SpringBody body = cloth(geometry::make_grid(Vec3::Zero(), Vec2(0.1, 0.1), 10, 10), 0.3, {100, 0, 0}, {1, 0, 0});
  EXPECT_NEAR(total_mass(body), 0.3, 1e-12);
  std::size_t stretch = 0, bend = 0;
  for (const Spring& s : body.network.springs) ++(s.material == 0 ? stretch : bend);
  EXPECT_EQ(stretch, 320u);  // 2 * 10 * 11 along the axes, 100 diagonals
  EXPECT_GT(bend, 200u);
  EXPECT_LE(bend, 280u);     // inner edges; those whose opposite vertices an edge joins already need none
}

TEST(Cloth, RefusesVerticesWithoutMass) {
  geometry::TriMesh mesh = geometry::make_grid(Vec3::Zero(), Vec2(1, 1), 2, 2);
  mesh.positions.push_back(Vec3(9, 9, 9));
  EXPECT_THROW(cloth(mesh, 1, {1, 0, 0}, {1, 0, 0}), InputError);
}

TEST(Filled, HoldsTheMeshsMassAndAllItsVertices) {
  const geometry::TriMesh sphere = geometry::make_sphere(Vec3(5, 6, 7), 1, 3);
  const SpringBody body = filled(sphere, 0.2, 1000, {1e4, 10, 0});
  // Cubes counted by 64 samples: 1 %; the least share of cubes hardly touched adds a little.
  EXPECT_NEAR(total_mass(body) / (1000 * geometry::signed_volume(sphere)), 1, 0.02);
  const std::vector<Vec3> shown = surface_positions(body, body.state.x);
  for (std::size_t q = 0; q < shown.size(); ++q) ASSERT_LT((shown[q] - sphere.positions[q]).norm(), 1e-6);
}

TEST(Filled, RefusesOpenMeshesAndTooFineLattices) {
  geometry::TriMesh open = geometry::make_sphere(Vec3::Zero(), 1, 2);
  open.triangles.pop_back();
  EXPECT_THROW(filled(open, 0.2, 1000, {1e4, 10, 0}), InputError);
  EXPECT_THROW(filled(geometry::make_sphere(Vec3::Zero(), 1, 2), 1e-3, 1000, {1e4, 10, 0}), InputError);
  EXPECT_THROW(filled(geometry::make_sphere(Vec3::Zero(), 1, 2), 1e-9, 1000, {1e4, 10, 0}), InputError);
}

}  // namespace
}  // namespace effuse::flow::springs
