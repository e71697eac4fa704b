#include "skin/tessellate/refine_on.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/query/mesh_tree.h"
#include "skin/surface/level_set.h"
#include "skin/tessellate/shapes.h"
#include "tests/skin/surface/shapes.h"

namespace effuse::skin {
namespace {

using geometry::TriMesh;
using testing_shapes::Cloud;
using testing_shapes::cube;
using testing_shapes::fill;

/// Particles a metre apart, their surface, its fans.
struct Fixture {
  Cloud cloud;
  TriMesh surface;
  Tessellation fans;

  explicit Fixture(Cloud c) : cloud(std::move(c)) {
    LevelSetOptions level;
    level.spacing = 1;
    surface = mesh_level_set(build_level_set(cloud.points(), cloud.volume(), nullptr, level));
    fans = tessellate_voronoi(surface, Regions(cloud.points(), 1), cloud.points());
  }
};

Cloud ball() {
  return fill(
      cube(5), 1, [](const Vec3& p) { return p.norm() < 4; }, 0.2);
}

Cloud thin_sheet() {
  Cloud cloud;
  for (const Vec3& x : fill(
                           Box3(Vec3(-5, -5, -0.5), Vec3(5, 5, 0.5)), 1, [](const Vec3& p) { return p.norm() < 5; }, 0.25)
                           .x)
    cloud.add(Vec3(x.x(), x.y(), 0), 1);
  return cloud;
}

Real longest(const TriMesh& mesh) {
  Real most = 0;
  for (const geometry::Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) most = std::max(most, (mesh.positions[t[k]] - mesh.positions[t[(k + 1) % 3]]).norm());
  return most;
}

TEST(RefineOn, NoEdgeIsLongerThanAskedAndRegionsKeepTheirTriangles) {
  for (const Cloud& cloud : {ball(), thin_sheet()})
    for (const Real edge : {0.8, 0.3}) {
      const Fixture f(cloud);
      Tessellation fine = f.fans;
      RefineOptions options;
      options.edge = edge;
      const RefineToReport report = refine_on(fine, f.surface, options);
      EXPECT_TRUE(report.enough);
      // The last step onto the smooth surface moves vertices by a few hundredths.
      EXPECT_LE(longest(fine.mesh), 1.15 * edge);
      const geometry::MeshReport valid = geometry::validate(fine.mesh), before = geometry::validate(f.fans.mesh);
      EXPECT_TRUE(valid.solid()) << geometry::to_string(valid);
      EXPECT_EQ(valid.euler, before.euler);
      EXPECT_EQ(valid.components, before.components);
      EXPECT_LE(triangle_shapes(fine.mesh).thin, 0.005);
      // Parts lie on their triangle's fan: all of its region, and of every region as much area as before, or nearly.
      ASSERT_EQ(report.parent.size(), fine.mesh.triangles.size());
      ASSERT_EQ(fine.region.size(), fine.mesh.triangles.size());
      ASSERT_EQ(fine.center.size(), fine.mesh.positions.size());
      const auto areas = [](const Tessellation& t) {
        std::vector<Real> sum(t.id.size(), 0);
        for (std::size_t k = 0; k < t.region.size(); ++k) {
          const auto& [a, b, c] = t.mesh.triangles[k];
          sum[t.region[k]] += (t.mesh.positions[b] - t.mesh.positions[a]).cross(t.mesh.positions[c] - t.mesh.positions[a]).norm() / 2;
        }
        return sum;
      };
      const std::vector<Real> coarse = areas(f.fans), after = areas(fine);
      Real apart = 0, all = 0;
      for (std::size_t r = 0; r < coarse.size(); ++r) {
        EXPECT_GT(after[r], 0);
        apart += std::abs(after[r] - coarse[r]);
        all += coarse[r];
      }
      EXPECT_LT(apart, 0.12 * all);
      for (std::size_t t = 0; t < fine.region.size(); ++t) ASSERT_EQ(fine.region[t], f.fans.region[report.parent[t]]);
    }
}

TEST(RefineOn, VerticesLieOnTheSurfaceRefinedByItself) {
  const Fixture f(ball());
  RefineOptions options;
  options.edge = 0.3;
  TriMesh reference = f.surface;
  refine_to(reference, options);
  Tessellation fine = f.fans;
  refine_on(fine, f.surface, options);
  const geometry::MeshTree tree(reference.positions, reference.triangles);
  Real worst = 0, mean = 0;
  for (const Vec3& x : fine.mesh.positions) {
    const Real d = tree.nearest(x)->distance;
    worst = std::max(worst, d);
    mean += d;
  }
  mean /= static_cast<Real>(fine.mesh.positions.size());
  // The facets of the reference, a third of a spacing wide on spheres of one or two: 0.3^2 / 8 / 1.5.
  EXPECT_LT(mean, 0.006);
  EXPECT_LT(worst, 0.08);
  // Fans alone are farther off in their middles: the way back is the longer one.
  const geometry::MeshTree to_fans(f.fans.mesh.positions, f.fans.mesh.triangles), to_fine(fine.mesh.positions, fine.mesh.triangles);
  Real before = 0, after = 0;
  for (const Vec3& x : reference.positions) {
    before += to_fans.nearest(x)->distance;
    after += to_fine.nearest(x)->distance;
  }
  EXPECT_LT(after, before / 4);
}

TEST(RefineOn, CarriesTheSurfacesAttributes) {
  Fixture f(ball());
  geometry::VertexAttribute& linear = f.surface.attributes["linear"];
  for (const Vec3& x : f.surface.positions) linear.values.push_back(static_cast<float>(x.x() - 2 * x.z()));
  RefineOptions options;
  options.edge = 0.3;
  refine_on(f.fans, f.surface, options);
  const TriMesh& mesh = f.fans.mesh;
  for (const auto& [name, attribute] : f.surface.attributes)
    ASSERT_EQ(mesh.attributes.at(name).values.size(), mesh.positions.size() * static_cast<std::size_t>(attribute.width)) << name;
  const geometry::MeshTree tree(f.surface.positions, f.surface.triangles);
  // Linear in space on the surface itself; the smooth surface is at most so far from it.
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const Vec3& x = mesh.positions[v];
    EXPECT_NEAR(mesh.attributes.at("linear").values[v], x.x() - 2 * x.z(), 3 * tree.nearest(x)->distance + 1e-5);
    EXPECT_NEAR(mesh.normals[v].norm(), 1, 1e-12);
  }
}

TEST(RefineOn, WithAViewOnlyWhatIsNearIsCutFine) {
  const Fixture f(ball());
  Tessellation fine = f.fans;
  RefineOptions options;
  options.edge = 0.2;
  options.view.emplace();
  options.view->eye = Vec3(7, 0, 0);
  options.view->pixel_angle = 0.02;
  options.view->pixels = 4;  // 0.24 at 3 m, 0.88 at 11 m
  refine_on(fine, f.surface, options);
  Real near = 0, far = 0;
  for (const geometry::Triangle& t : fine.mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 &a = fine.mesh.positions[t[k]], &b = fine.mesh.positions[t[(k + 1) % 3]];
      Real& most = a.x() > 3 ? near : far;
      if (a.x() > 3 || a.x() < -3) most = std::max(most, (a - b).norm());
    }
  EXPECT_LT(near, 1.7 * 0.24);  // longer ones are cut
  EXPECT_GT(far, 0.6);
}

TEST(RefineOn, ASurfaceThatSpansItselfIsNotCutForEver) {
  // Fans of one ball on the surface of another a spacing away: most of its edges' middles have far to go. It ends, and stays closed.
  const Fixture f(ball());
  Tessellation wrong = f.fans;
  for (Vec3& x : wrong.mesh.positions) x = Vec3(0.1 * x.x(), x.y(), x.z());
  RefineOptions options;
  options.edge = 0.3;
  options.most_triangles = 200'000;
  const RefineToReport report = refine_on(wrong, f.surface, options);
  EXPECT_TRUE(geometry::validate(wrong.mesh).solid());
  EXPECT_LE(report.rounds, 16);
  EXPECT_LT(wrong.mesh.triangles.size(), 200'000u);
}

}  // namespace
}  // namespace effuse::skin
