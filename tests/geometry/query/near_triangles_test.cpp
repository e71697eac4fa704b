#include "geometry/query/near_triangles.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/random.h"
#include "geometry/mesh/measure.h"
#include "geometry/procedural/primitives.h"
#include "geometry/query/mesh_surface.h"
#include "geometry/terrain/terrain.h"
#include "tests/geometry/terrain/fields.h"

namespace effuse::geometry {
namespace {

/// A mesh whose triangles come in all sizes and lie on one another's edges' prolongations: boxes, needles, a ball.
TriMesh mixed() {
  TriMesh mesh = make_sphere(Vec3(0, 0, 0), 1, 2);
  append(mesh, make_box(Vec3(1.5, -1, -1), Vec3(3.5, 1, 1)));
  append(mesh, make_grid(Vec3(-2, 1.5, 0), Vec2(0.02, 1.5), 30, 1));
  append(mesh, make_torus(Vec3(0, 4, 0), 1, 0.2, 30, 8));
  return mesh;
}

TEST(NearTrianglesSlow, FindsWhatTheTreeFinds) {
  for (const TriMesh& mesh : {mixed(), fields::maunga_whau().mesh()}) {
    const MeshTree tree(mesh.positions, mesh.triangles);
    const Real scale = std::sqrt(surface_area(mesh) / static_cast<Real>(mesh.triangles.size()));
    for (const Real reach : {0.1 * scale, scale, 3 * scale}) {
      const auto near = NearTriangles::build(mesh.positions, mesh.triangles, reach);
      ASSERT_TRUE(near.has_value()) << reach;
      const Box3 box = bounds(mesh);
      std::size_t found = 0;
      for (std::uint64_t k = 0; k < 10000; ++k) {
        // Half of them about the box, half about the surface.
        Vec3 p = box.min() + box.sizes().cwiseProduct(Vec3(random_uniform(1, 0, k), random_uniform(1, 1, k), random_uniform(1, 2, k)));
        if (k % 2) p = mesh.positions[random_bits(1, 3, k) % mesh.positions.size()] + 1.2 * reach * Vec3(random_uniform(1, 4, k) - 0.5, random_uniform(1, 5, k) - 0.5, random_uniform(1, 6, k) - 0.5);
        const auto wanted = tree.nearest(p, reach), got = near->nearest(p, reach);
        ASSERT_EQ(wanted.has_value(), got.has_value()) << p.transpose();
        if (!wanted) continue;
        ++found;
        ASSERT_NEAR(wanted->distance, got->distance, 1e-12 * box.diagonal().norm());
      }
      EXPECT_GT(found, 1000u);
    }
  }
}

TEST(NearTrianglesSlow, ASurfaceAnswersTheSameToTheBitWithItAndWithout) {
  for (const TriMesh& mesh : {mixed(), fields::maunga_whau().mesh()}) {
    const MeshSurface surface(mesh);
    const Real reach = 1.5 * std::sqrt(surface_area(mesh) / static_cast<Real>(mesh.triangles.size()));
    const auto cache = surface.make_cache(reach);
    ASSERT_TRUE(cache.has_value());
    for (std::uint64_t k = 0; k < 20000; ++k) {
      // On vertices, over edges and corners, and anywhere near: where two triangles are as near as one another.
      const Triangle& t = mesh.triangles[random_bits(2, 0, k) % mesh.triangles.size()];
      const Real share = k % 3 == 0 ? 0 : random_uniform(2, 1, k);
      const Vec3 at = mesh.positions[t[0]] + share * (mesh.positions[t[1]] - mesh.positions[t[0]]);
      const Vec3 p = at + (k % 5 == 0 ? 0 : reach) * Vec3(random_uniform(2, 2, k) - 0.5, random_uniform(2, 3, k) - 0.5, random_uniform(2, 4, k) - 0.5);
      const Contact tree = surface.contact(p, reach), cached = surface.contact(p, reach, *cache);
      ASSERT_EQ(tree.any(), cached.any()) << k;
      ASSERT_EQ(tree.distance, cached.distance) << k;
      ASSERT_EQ(tree.point, cached.point) << k;
      ASSERT_EQ(tree.normal, cached.normal) << k;
    }
  }
}

TEST(NearTriangles, ManyContactsOfATerrainAreThoseOfEach) {
  const Terrain terrain = Terrain::from_mesh(fields::maunga_whau().mesh());
  std::vector<Vec3> points;
  for (std::uint64_t k = 0; k < 3000; ++k) {
    const Real x = 600 * random_uniform(3, 0, k), y = 860 * random_uniform(3, 1, k);
    points.emplace_back(x, y, *terrain.height(x, y) + 4 * random_uniform(3, 2, k) - 1);
  }
  std::vector<Contact> many(points.size());
  for (const Real reach : {1.0, 2.0, 0.5, 400.0}) {
    terrain.contacts(points, reach, many);
    for (std::size_t k = 0; k < points.size(); ++k) {
      const Contact one = terrain.contact(points[k], reach);
      ASSERT_EQ(one.distance, many[k].distance) << reach;
      ASSERT_EQ(one.normal, many[k].normal) << reach;
      ASSERT_EQ(one.surface_temperature, many[k].surface_temperature);
    }
  }
}

TEST(NearTriangles, RefusesAReachOfTooManyTriangles) {
  const TriMesh fine = make_sphere(Vec3::Zero(), 1, 4);
  EXPECT_FALSE(NearTriangles::build(fine.positions, fine.triangles, 5).has_value());
  const TriMesh flat{{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{0, 1, 2}}, {}, {}};
  EXPECT_FALSE(NearTriangles::build(flat.positions, flat.triangles, 1).has_value()) << "nothing of area";
  const auto near = NearTriangles::build(fine.positions, fine.triangles, 0.1);
  ASSERT_TRUE(near.has_value());
  EXPECT_FALSE(near->nearest(Vec3(NAN, 0, 0), 0.1).has_value());
  EXPECT_FALSE(near->nearest(Vec3(1e30, 0, 0), 0.1).has_value());
  EXPECT_LT(near->bytes(), 2000 * fine.triangles.size());
}

}  // namespace
}  // namespace effuse::geometry
