#include "skin/detail/refine.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "skin/detail/displace.h"
#include "skin/surface/level_set.h"
#include "skin/tessellate/make_skin.h"
#include "skin/tessellate/regions.h"
#include "tests/skin/surface/shapes.h"

namespace effuse::skin {
namespace {

using geometry::TriMesh;

/// A sphere of radius 1 with its exact normals: an icosahedron cut in four `times` times.
TriMesh sphere(int times) {
  const Real g = (1 + std::sqrt(5.0)) / 2;
  TriMesh mesh;
  for (const Real a : {-1.0, 1.0})
    for (const Real b : {-g, g}) mesh.positions.emplace_back(0, a, b);
  for (const Real a : {-1.0, 1.0})
    for (const Real b : {-g, g}) mesh.positions.emplace_back(a, b, 0);
  for (const Real a : {-1.0, 1.0})
    for (const Real b : {-g, g}) mesh.positions.emplace_back(b, 0, a);
  // Faces: triples of vertices two apart.
  const auto& x = mesh.positions;
  for (Index i = 0; i < 12; ++i)
    for (Index j = i + 1; j < 12; ++j)
      for (Index k = j + 1; k < 12; ++k) {
        if ((x[i] - x[j]).norm() > 2.1 || (x[j] - x[k]).norm() > 2.1 || (x[k] - x[i]).norm() > 2.1) continue;
        if ((x[j] - x[i]).cross(x[k] - x[i]).dot(x[i]) > 0) mesh.triangles.push_back({i, j, k});
        else mesh.triangles.push_back({i, k, j});
      }
  for (; times > 0; --times) mesh = refine(mesh);
  for (Vec3& p : mesh.positions) p.normalize();
  mesh.normals = mesh.positions;
  return mesh;
}

Real longest_edge_over(const TriMesh& mesh, const std::function<Real(const Vec3&)>& wanted) {
  Real most = 0;
  for (const auto& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) {
      const Vec3 &p = mesh.positions[t[static_cast<std::size_t>(k)]], &q = mesh.positions[t[static_cast<std::size_t>((k + 1) % 3)]];
      most = std::max(most, (p - q).norm() / wanted((p + q) / 2));
    }
  return most;
}

std::vector<Real> smallest_angles(const TriMesh& mesh) {
  std::vector<Real> angles;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3 p[3] = {mesh.positions[a], mesh.positions[b], mesh.positions[c]};
    Real least = kPi;
    for (int k = 0; k < 3; ++k) {
      const Vec3 u = p[(k + 1) % 3] - p[k], v = p[(k + 2) % 3] - p[k];
      least = std::min(least, std::atan2(u.cross(v).norm(), u.dot(v)));
    }
    angles.push_back(least * 180 / kPi);
  }
  std::sort(angles.begin(), angles.end());
  return angles;
}

TEST(RefineTo, NoEdgeIsLongerThanAskedAndTheMeshStaysSolid) {
  TriMesh mesh = sphere(1);
  RefineOptions options;
  options.edge = 0.11;
  const RefineToReport report = refine_to(mesh, options);
  EXPECT_TRUE(report.enough);
  EXPECT_GT(report.rounds, 1);
  EXPECT_LE(longest_edge_over(mesh, [](const Vec3&) { return 0.11; }), 1);
  const geometry::MeshReport valid = geometry::validate(mesh);
  EXPECT_TRUE(valid.solid()) << geometry::to_string(valid);
  EXPECT_EQ(valid.euler, 2);
  // Every triangle lies on the one it is a part of.
  const TriMesh coarse = sphere(1);
  ASSERT_EQ(report.parent.size(), mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto middle = [](const TriMesh& m, std::size_t k) -> Vec3 {
      const auto& [a, b, c] = m.triangles[k];
      return (m.positions[a] + m.positions[b] + m.positions[c]) / 3;
    };
    ASSERT_LT((middle(mesh, t) - middle(coarse, report.parent[t])).norm(), 0.4);
  }
}

TEST(RefineTo, AttributesOfAFlatRefinementAreLinearAndItsShapeStays) {
  TriMesh mesh = sphere(1);
  mesh.attributes["height"] = {1, {}};
  for (const Vec3& p : mesh.positions) mesh.attributes["height"].values.push_back(static_cast<float>(p.z()));
  const Real volume = geometry::signed_volume(mesh);
  RefineOptions options;
  options.edge = 0.11;
  options.curved = false;
  refine_to(mesh, options);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) ASSERT_NEAR(mesh.attributes["height"].values[i], mesh.positions[i].z(), 1e-6);
  EXPECT_NEAR(geometry::signed_volume(mesh), volume, 1e-12);
}

TEST(RefineTo, CurvedVerticesLieOnASphereFlatOnesOnlyOnTheFirstMesh) {
  for (const int coarse : {2, 3, 4}) {
    const TriMesh first = sphere(coarse);
    TriMesh curved = first, flat = first;
    const Real edge = mean_edge(first);
    RefineOptions options;
    options.edge = edge / 4;
    refine_to(curved, options);
    options.curved = false;
    refine_to(flat, options);
    Real error = 0, turned = 0, flat_error = 0;
    for (std::size_t i = 0; i < curved.positions.size(); ++i) {
      error = std::max(error, std::abs(curved.positions[i].norm() - 1));
      turned = std::max(turned, (curved.normals[i] - curved.positions[i].normalized()).norm());
    }
    for (const Vec3& p : flat.positions) flat_error = std::max(flat_error, 1 - p.norm());
    // Second order with a small constant; a flat triangle's own is 1/6. Normals first order: the vertices round a point are not symmetric.
    EXPECT_LT(error, 0.002 * edge * edge) << coarse;
    EXPECT_LT(turned, 0.1 * edge) << coarse;
    EXPECT_GT(flat_error, 50 * error) << coarse;
  }
}

// A thin sheet over rough ground has rims, sharp edges under the ground and bubbles: the smooth surface must not fold there.
TEST(RefineTo, NothingFoldsOnAThinSheetWithSharpRims) {
  using namespace testing_shapes;
  std::vector<Real> z;
  for (int k = 0; k < 40 * 40; ++k) z.push_back(0.4 * std::sin(0.7 * (k % 40)) * std::sin(0.9 * (k / 40)));
  const auto ground = geometry::Terrain::from_height_field(geometry::HeightField(Vec2(-12, -12), Vec2(1, 1), 40, 40, z));
  const Cloud cloud = fill(Box3(Vec3(0, 0, -1), Vec3(14, 14, 2)), 1, [&](const Vec3& p) {
    const Real h = ground.signed_distance(p);
    return h > 0.2 && h < 1.3 && (p.head<2>() - Vec2(7, 7)).norm() < 6.5;
  }, 0.2);
  LevelSetOptions set;
  set.spacing = 1;
  TriMesh mesh = mesh_level_set(build_level_set(cloud.points(), cloud.volume(), &ground, set));
  const auto against = [](const TriMesh& m) {
    std::size_t n = 0;
    for (const auto& [a, b, c] : m.triangles) {
      const Vec3 face = (m.positions[b] - m.positions[a]).cross(m.positions[c] - m.positions[a]);
      n += face.dot(m.normals[a] + m.normals[b] + m.normals[c]) <= 0;
    }
    return static_cast<Real>(n) / static_cast<Real>(m.triangles.size());
  };
  TriMesh flat = mesh, curved = mesh;
  RefineOptions options;
  options.edge = 0.15;
  refine_to(curved, options);
  options.curved = false;
  refine_to(flat, options);
  EXPECT_LT(against(curved), against(flat) + 0.002);
  EXPECT_NEAR(static_cast<double>(curved.triangles.size()) / static_cast<double>(flat.triangles.size()), 1, 0.05) << "no edge ran away";
  EXPECT_NEAR(geometry::signed_volume(curved) / geometry::signed_volume(mesh), 1, 0.02);
  EXPECT_TRUE(geometry::validate(curved).solid());
}

TEST(RefineTo, CostFollowsWhatIsSeenWithoutCracks) {
  TriMesh near = sphere(2), all = near, aside = near;
  RefineOptions options;
  options.edge = 0.01;
  View view;
  view.eye = Vec3(3, 0, 0);
  view.pixel_angle = 1e-3;
  view.pixels = 8;
  options.view = view;
  EXPECT_TRUE(refine_to(near, options).enough);
  EXPECT_LE(longest_edge_over(near, [&](const Vec3& x) { return std::max(0.01, view.edge_at(x)); }), 1);
  EXPECT_TRUE(geometry::validate(near).solid()) << geometry::to_string(geometry::validate(near));
  EXPECT_EQ(geometry::validate(near).euler, 2);
  // Fine where the eye is, coarse behind.
  const auto area = [&](const TriMesh& mesh, bool front) {
    Real sum = 0;
    std::size_t n = 0;
    for (const auto& [a, b, c] : mesh.triangles) {
      const Vec3 middle = (mesh.positions[a] + mesh.positions[b] + mesh.positions[c]) / 3;
      if ((middle.x() > 0.8) != front || (!front && middle.x() > -0.8)) continue;
      sum += (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]).norm() / 2;
      ++n;
    }
    return sum / static_cast<Real>(n);
  };
  EXPECT_GT(area(near, false), 2 * area(near, true));
  options.view->pixels = 4;
  const std::size_t before = near.triangles.size();
  refine_to(all, options);
  EXPECT_NEAR(static_cast<double>(all.triangles.size()) / static_cast<double>(before), 4, 1.5) << "half the pixels, four times the triangles";
  // Looking past it: what is out of sight costs little.
  options.view->direction = Vec3(0, 1, 0);
  options.view->half_angle = 0.3;
  refine_to(aside, options);
  EXPECT_LT(aside.triangles.size(), all.triangles.size() / 8);

  const std::vector<Real> angles = smallest_angles(near);
  EXPECT_GT(angles.front(), 8);
  EXPECT_GT(angles[angles.size() / 100], 15);
}

TEST(RefineTo, StopsAtTheMostTriangles) {
  TriMesh mesh = sphere(1);
  RefineOptions options;
  options.edge = 0.001;
  options.most_triangles = 5000;
  EXPECT_FALSE(refine_to(mesh, options).enough);
  EXPECT_LE(mesh.triangles.size(), 5000u);
  EXPECT_GT(mesh.triangles.size(), 1000u);
  EXPECT_TRUE(geometry::validate(mesh).solid());
  TriMesh empty;
  EXPECT_TRUE(refine_to(empty, options).enough);
}

TEST(RefineTo, IsTheSameBitsOnAnyThreads) {
  std::uint64_t first = 0;
  for (const int threads : {1, 4}) {
    const ThreadLimit limit(threads);
    TriMesh mesh = sphere(2);
    RefineOptions options;
    options.edge = 0.05;
    refine_to(mesh, options);
    StateHash hash;
    hash.add(std::span<const Vec3>(mesh.positions));
    hash.add(std::span<const geometry::Triangle>(mesh.triangles));
    if (threads == 1) first = hash.value();
    EXPECT_EQ(hash.value(), first);
  }
}

/// Root mean square of the normal's jump over edges between triangles, where border(t, u) and where not.
struct Jumps {
  Real border = 0, inside = 0;
  Real ratio() const { return border / inside; }
};
Jumps jumps(const TriMesh& mesh, const std::function<bool(std::size_t, std::size_t)>& on_border) {
  std::map<std::pair<Index, Index>, std::size_t> first;
  Real sum[2] = {0, 0};
  std::size_t n[2] = {0, 0};
  const auto normal = [&](std::size_t t) {
    const auto& [a, b, c] = mesh.triangles[t];
    return Vec3((mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]).normalized());
  };
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = mesh.triangles[t][k], b = mesh.triangles[t][(k + 1) % 3];
      const auto [at, fresh] = first.try_emplace({std::min(a, b), std::max(a, b)}, t);
      if (fresh) continue;
      const bool border = on_border(t, at->second);
      sum[border] += (normal(t) - normal(at->second)).squaredNorm();
      ++n[border];
    }
  return {std::sqrt(sum[1] / static_cast<Real>(n[1])), std::sqrt(sum[0] / static_cast<Real>(n[0]))};
}

/// The bar: across the borders of patches (the first mesh's triangles) and of regions the displaced surface bends no more than
/// inside them. Measured on a ball of particles, with edges of 0.34, 0.17, 0.09 spacings; a surface with kinks would show more the
/// finer it is.
void expect_no_kinks(SkinKind kind, Real radius, int levels) {
  using namespace testing_shapes;
  const Cloud cloud = fill(cube(radius + 0.2), 1, [&](const Vec3& p) { return p.norm() < radius; }, 0.2);
  std::vector<std::uint64_t> id;
  for (std::size_t i = 0; i < cloud.x.size(); ++i) id.push_back(i);
  geometry::Points points = cloud.points();
  points.id = id;
  LevelSetOptions set;
  set.spacing = 1;
  const TriMesh coarse = tessellate_level_set(build_level_set(points, cloud.volume(), nullptr, set));
  const Regions regions(points, 1);
  for (int level = 1; level <= levels; ++level) {
    TriMesh mesh = coarse;
    RefineOptions edges;
    edges.edge = 1.2 * mean_edge(coarse) / std::exp2(level);
    const std::vector<Index> parent = refine_to(mesh, edges).parent;
    TriMesh fine = mesh;
    DisplaceOptions options;
    options.spacing = 1;
    options.kind = kind;
    options.edge = 10;    // no finer
    options.octaves = 1;  // no bumps shorter than the edges
    displace(fine, points, nullptr, options);
    ASSERT_EQ(fine.triangles, mesh.triangles);
    std::vector<Index> owner(fine.triangles.size());
    for (std::size_t t = 0; t < owner.size(); ++t) {
      const auto& [a, b, c] = mesh.triangles[t];
      owner[t] = regions.nearest((mesh.positions[a] + mesh.positions[b] + mesh.positions[c]) / 3);
    }
    const Jumps patch = jumps(fine, [&](std::size_t t, std::size_t u) { return parent[t] != parent[u]; });
    const Jumps region = jumps(fine, [&](std::size_t t, std::size_t u) { return owner[t] != owner[u]; });
    EXPECT_LT(patch.ratio(), 1.1) << level << ": " << patch.border << " / " << patch.inside;
    EXPECT_LT(region.ratio(), 1.1) << level << ": " << region.border << " / " << region.inside;
    testing::Test::RecordProperty("level_" + std::to_string(level), std::to_string(patch.ratio()) + " " + std::to_string(region.ratio()));
  }
}

TEST(Displaced, BendsNoMoreAcrossPatchesAndRegionsThanInsideThem) {
  for (const SkinKind kind : {SkinKind::kAa, SkinKind::kObsidian}) expect_no_kinks(kind, 2.3, 2);
}

class DisplacedSlow : public testing::TestWithParam<SkinKind> {};
TEST_P(DisplacedSlow, BendsNoMoreAcrossPatchesAndRegionsThanInsideThemAtThreeLevels) { expect_no_kinks(GetParam(), 3.3, 3); }
INSTANTIATE_TEST_SUITE_P(Kinds, DisplacedSlow, testing::Values(SkinKind::kAa, SkinKind::kPahoehoe, SkinKind::kBlock, SkinKind::kObsidian),
                         [](const auto& each) { return std::string(kSkinKindNames[static_cast<std::size_t>(each.param)]); });

// The same measure on the first mesh's flat triangles sees their edges.
TEST(Displaced, FlatTrianglesFailTheMeasure) {
  TriMesh mesh = sphere(2);
  RefineOptions options;
  options.edge = 0.08;
  options.curved = false;
  const std::vector<Index> parent = refine_to(mesh, options).parent;
  const Jumps patch = jumps(mesh, [&](std::size_t t, std::size_t u) { return parent[t] != parent[u]; });
  EXPECT_GT(patch.border, 100 * patch.inside);
}

}  // namespace
}  // namespace effuse::skin
