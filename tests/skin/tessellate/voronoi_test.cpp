#include "skin/tessellate/voronoi.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/procedural/primitives.h"
#include "geometry/query/mesh_tree.h"
#include "skin/surface/level_set.h"
#include "skin/tessellate/surface_walk.h"
#include "tests/skin/surface/shapes.h"

namespace effuse::skin {
namespace {

using geometry::TriMesh;
using testing_shapes::Cloud;
using testing_shapes::cube;
using testing_shapes::fill;

/// Particles with ids, their surface and its tessellation. Spacing 1 m.
struct Skin {
  Cloud cloud;
  std::vector<std::uint64_t> id;
  TriMesh surface;
  Tessellation tessellation;

  explicit Skin(Cloud c, const VoronoiOptions& options = {}, Real voxel = 0.5) : cloud(std::move(c)) {
    LevelSetOptions level;
    level.spacing = 1;
    level.voxel = voxel;
    surface = mesh_level_set(build_level_set(cloud.points(), cloud.volume(), nullptr, level));
    for (std::size_t i = 0; i < cloud.x.size(); ++i) id.push_back(500 + 3 * i);
    tessellation = tessellate_voronoi(surface, Regions(points(), 1), points(), options);
  }
  geometry::Points points() const {
    geometry::Points p = cloud.points();
    p.id = id;
    return p;
  }
};

/// What every tessellation must be.
void expect_sound(const Skin& skin) {
  const Tessellation& t = skin.tessellation;
  // Closed, oriented, manifold; in as many pieces with as many handles as the surface.
  const geometry::MeshReport report = geometry::validate(t.mesh), fine = geometry::validate(skin.surface);
  ASSERT_TRUE(report.solid()) << geometry::to_string(report);
  EXPECT_EQ(report.components, fine.components);
  EXPECT_EQ(report.euler, fine.euler);
  EXPECT_EQ(report.unused_vertices, 0u);

  // Regions: the particles nearest to the surface's vertices, and nobody else.
  const Regions regions(skin.points(), 1);
  std::set<Index> nearest;
  for (const Vec3& x : skin.surface.positions) nearest.insert(regions.nearest(x));
  EXPECT_EQ(std::vector<Index>(nearest.begin(), nearest.end()), t.particle);
  ASSERT_EQ(t.id.size(), t.particle.size());
  for (std::size_t r = 0; r < t.id.size(); ++r) EXPECT_EQ(t.id[r], skin.id[t.particle[r]]);

  // Every triangle is of one fan: a centre and two nodes, of the centre's region. Every region has a triangle.
  ASSERT_EQ(t.region.size(), t.mesh.triangles.size());
  ASSERT_EQ(t.center.size(), t.mesh.positions.size());
  std::vector<std::uint8_t> has(t.id.size(), 0);
  for (std::size_t k = 0; k < t.mesh.triangles.size(); ++k) {
    const geometry::Triangle& c = t.mesh.triangles[k];
    ASSERT_EQ(t.center[c[0]], t.region[k]);
    ASSERT_EQ(t.center[c[1]], Regions::kNone);
    ASSERT_EQ(t.center[c[2]], Regions::kNone);
    has[t.region[k]] = 1;
  }
  EXPECT_EQ(std::count(has.begin(), has.end(), 1), static_cast<std::ptrdiff_t>(has.size()));
  EXPECT_EQ(t.report.regions, t.id.size());
  EXPECT_EQ(t.report.fans,
            static_cast<std::size_t>(std::count_if(t.center.begin(), t.center.end(), [](Index r) { return r != Regions::kNone; })));

  // Shape: issue's bar for thin triangles.
  EXPECT_LE(t.report.thin, 0.005);
}

/// Share of the triangles whose least angle, from the cosine rule, is under 5 degrees: the report's twin.
Real share_of_thin(const TriMesh& mesh) {
  std::size_t thin = 0;
  for (const geometry::Triangle& t : mesh.triangles) {
    Real least = kPi;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 a = mesh.positions[t[(k + 1) % 3]] - mesh.positions[t[k]], b = mesh.positions[t[(k + 2) % 3]] - mesh.positions[t[k]];
      least = std::min(least, std::atan2(a.cross(b).norm(), a.dot(b)));
    }
    thin += least < 5 * kPi / 180;
  }
  return static_cast<Real>(thin) / static_cast<Real>(mesh.triangles.size());
}

Cloud random_cluster(std::uint64_t seed, std::uint64_t n) {
  Cloud cloud;
  for (std::uint64_t i = 0; i < n; ++i)
    cloud.add(1.7 * Vec3(random_normal(seed, 0, i), random_normal(seed, 1, i), random_normal(seed, 2, i)), 1);
  return cloud;
}

Cloud ball(const Vec3& at, Real radius, std::uint64_t seed) {
  Cloud cloud;
  for (const Vec3& x : fill(
                           cube(radius + 1), 1, [&](const Vec3& p) { return p.norm() < radius; }, 0.2, seed)
                           .x)
    cloud.add(x + at, 1);
  return cloud;
}

TEST(Voronoi, OfTenRandomClustersIsClosedOrientedAndManifold) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    const Skin skin(random_cluster(seed, 150));
    expect_sound(skin);
    EXPECT_NEAR(skin.tessellation.report.thin, share_of_thin(skin.tessellation.mesh), 1e-12);
  }
}

TEST(Voronoi, OfASheetOneParticleThickHasBothItsSides) {
  Cloud cloud;
  for (const Vec3& x : fill(
                           Box3(Vec3(-7, -7, -0.5), Vec3(7, 7, 0.5)), 1, [](const Vec3& p) { return p.norm() < 7; }, 0.25)
                           .x)
    cloud.add(Vec3(x.x(), x.y(), 0), 1);
  const Skin skin(std::move(cloud));
  expect_sound(skin);
  // Every particle is seen, and all but those of the rim from above and from below.
  EXPECT_EQ(skin.tessellation.report.regions, skin.cloud.x.size());
  EXPECT_EQ(skin.tessellation.report.folded, 0u);
  std::vector<int> sides(skin.cloud.x.size(), 0);
  for (std::size_t v = 0; v < skin.tessellation.report.fans; ++v)
    sides[skin.tessellation.center[v]] |= skin.tessellation.mesh.normals[v].z() > 0 ? 1 : 2;
  for (std::size_t i = 0; i < sides.size(); ++i) {
    if (skin.cloud.x[i].norm() > 5.5) continue;
    EXPECT_EQ(sides[i], 3) << skin.cloud.x[i].transpose();
  }
}

TEST(Voronoi, OnAThickLayerEveryTriangleLooksOut) {
  // Where four regions all but meet, their nodes may be on the wrong side of one another: three triangles in ten thousand, until nodes are
  // moved for it. And round the layer's edges a fan's centre may be nearest to another piece of its region.
  struct Case {
    Real jitter;
    std::uint64_t seed;
  };
  for (const auto& [jitter, seed] : {Case{0.1, 2}, Case{0.3, 1}, Case{0.3, 3}, Case{0.4, 1}}) {
    SCOPED_TRACE(testing::Message() << "jitter " << jitter << ", seed " << seed);
    const Skin skin(fill(
        Box3(Vec3(-15, -15, -1.5), Vec3(15, 15, 1.5)), 1, [](const Vec3&) { return true; }, jitter, seed));
    // Beyond 0.3 particles touch, and on a rim of single particles that stand out two or three nodes find no place.
    EXPECT_LE(skin.tessellation.report.folded, jitter > 0.3 ? 3u : 0u);
    if (jitter <= 0.3) {
      EXPECT_GT(skin.tessellation.report.least_angle, 5);
    }
    EXPECT_GT(skin.tessellation.report.regions, 1800u);
  }
}

TEST(Voronoi, OfLoneParticlesPairsAndChainsIsClosed) {
  Cloud cloud;
  for (int n = 1; n <= 4; ++n) {
    SCOPED_TRACE(testing::Message() << n << " particles in a row, one apart");
    cloud.add(Vec3(0.9 * n, 0.1 * n, 0), 1);
    Cloud with_drop = cloud;
    with_drop.add(Vec3(0, 6, 0), 1);
    const Skin skin(with_drop);
    expect_sound(skin);
    EXPECT_EQ(skin.tessellation.report.regions, with_drop.x.size());
    EXPECT_EQ(geometry::validate(skin.tessellation.mesh).components, 2u);
    EXPECT_EQ(skin.tessellation.report.folded, 0u);
  }
}

TEST(Voronoi, OfATorusHasItsHandle) {
  const Skin skin(fill(
      cube(7), 1, [](const Vec3& p) { return std::hypot(std::hypot(p.x(), p.y()) - 4.5, p.z()) < 1.6; }, 0.2));
  expect_sound(skin);
  EXPECT_EQ(geometry::validate(skin.tessellation.mesh).euler, 0);
  // Thin enough that regions are rings round it: particles in a circle, one thick.
  Cloud ring;
  for (int k = 0; k < 12; ++k) ring.add(2 * Vec3(std::cos(2 * kPi * k / 12), std::sin(2 * kPi * k / 12), 0), 1);
  const Skin thin(ring);
  expect_sound(thin);
  EXPECT_EQ(geometry::validate(thin.tessellation.mesh).euler, 0);
}

TEST(Voronoi, StaysSoundWhileTwoBlobsMerge) {
  for (int frame = 0; frame < 48; ++frame) {
    SCOPED_TRACE(testing::Message() << "frame " << frame);
    const Real apart = 6.5 - 4.5 * frame / 47;
    Cloud cloud = ball(Vec3(apart / 2, 0, 0), 2.4, 1);
    for (const Vec3& x : ball(Vec3(-apart / 2, 0, 0), 2.4, 2).x) cloud.add(x, 1);
    const Skin skin(std::move(cloud));
    expect_sound(skin);
    EXPECT_LE(skin.tessellation.report.folded, skin.tessellation.mesh.triangles.size() / 200);
    if (testing::Test::HasFatalFailure()) return;
  }
}

TEST(Voronoi, StaysSoundWhileABlobIsDrawnApart) {
  std::set<std::size_t> pieces;
  for (int frame = 0; frame < 24; ++frame) {
    SCOPED_TRACE(testing::Message() << "frame " << frame);
    const Real stretch = 1 + 2.2 * frame / 23;
    Cloud cloud;
    for (const Vec3& x : ball(Vec3::Zero(), 3.2, 3).x) {
      const Real neck = 1 - 0.34 * (stretch - 1) * std::exp(-x.x() * x.x() / 4);
      cloud.add(Vec3(x.x() * stretch, x.y() * neck, x.z() * neck), 1);
    }
    const Skin skin(std::move(cloud));
    expect_sound(skin);
    pieces.insert(geometry::validate(skin.surface).components);
    if (testing::Test::HasFatalFailure()) return;
  }
  EXPECT_GT(pieces.size(), 1u) << "it was to come apart";
}

TEST(Voronoi, KeepsVolumeAndStaysNearTheSurface) {
  const Skin skin(ball(Vec3::Zero(), 5.5, 4));
  expect_sound(skin);
  EXPECT_EQ(skin.tessellation.report.folded, 0u);
  EXPECT_EQ(skin.tessellation.report.thin, 0);
  // A sphere of radius R cut by facets of size a loses 3 a^2 / (8 R^2) or so: 1.2 % for a = 1.
  const Real volume = geometry::signed_volume(skin.tessellation.mesh) / geometry::signed_volume(skin.surface);
  EXPECT_NEAR(volume, 0.985, 0.01);
  const geometry::MeshTree tree(skin.tessellation.mesh.positions, skin.tessellation.mesh.triangles);
  Real farthest = 0, sum = 0;
  for (const Vec3& x : skin.surface.positions) {
    const Real d = tree.nearest(x)->distance;
    farthest = std::max(farthest, d);
    sum += d;
  }
  EXPECT_LT(farthest, 0.5);
  EXPECT_LT(sum / static_cast<Real>(skin.surface.positions.size()), 0.06);
}

TEST(Voronoi, CarriesTheSurfacesAttributesLinearly) {
  // An attribute that is linear in space stays so, because every vertex lies on a triangle of the surface.
  Skin skin(random_cluster(11, 120));
  geometry::VertexAttribute& linear = skin.surface.attributes["linear"];
  linear.width = 2;
  for (const Vec3& x : skin.surface.positions)
    for (const Real value : {x.x() - 2 * x.y() + 0.5 * x.z(), 3 - x.z()}) linear.values.push_back(static_cast<float>(value));
  const Tessellation t = tessellate_voronoi(skin.surface, Regions(skin.points(), 1), skin.points());
  const geometry::MeshTree tree(skin.surface.positions, skin.surface.triangles);
  const std::vector<float>& values = t.mesh.attributes.at("linear").values;
  for (std::size_t v = 0; v < t.mesh.positions.size(); ++v) {
    const Vec3& x = t.mesh.positions[v];
    EXPECT_LT(tree.nearest(x)->distance, 1e-12);
    EXPECT_NEAR(t.mesh.normals[v].norm(), 1, 1e-12);
    // Floats of a size of ten.
    EXPECT_NEAR(values[2 * v], x.x() - 2 * x.y() + 0.5 * x.z(), 1e-5);
    EXPECT_NEAR(values[2 * v + 1], 3 - x.z(), 1e-5);
  }
  for (const char* name : {"temperature", "velocity", "crust", "rest", "rest2"})
    EXPECT_EQ(t.mesh.attributes.at(name).values.size(),
              t.mesh.positions.size() * static_cast<std::size_t>(t.mesh.attributes.at(name).width));
}

TEST(Voronoi, PutsNodesWhereThreeParticlesAreEquallyNear) {
  VoronoiOptions as_found;
  as_found.merge = 0;
  as_found.sweeps = 0;
  const Skin skin(ball(Vec3::Zero(), 5.5, 5), as_found);
  const Tessellation& t = skin.tessellation;
  std::vector<std::set<Index>> around(t.mesh.positions.size());
  for (std::size_t k = 0; k < t.mesh.triangles.size(); ++k)
    for (const Index v : t.mesh.triangles[k]) around[v].insert(t.region[k]);
  int nodes = 0, exact = 0;
  for (std::size_t v = 0; v < around.size(); ++v) {
    if (around[v].size() != 3) continue;
    ++nodes;
    Real least = 1e9, most = 0;
    for (const Index r : around[v]) {
      const Real d = (t.mesh.positions[v] - skin.cloud.x[t.particle[r]]).norm();
      least = std::min(least, d);
      most = std::max(most, d);
    }
    const Index nearest = Regions(skin.points(), 1).nearest(t.mesh.positions[v]);
    exact += most - least < 1e-3 &&
             around[v].count(static_cast<Index>(std::lower_bound(t.particle.begin(), t.particle.end(), nearest) - t.particle.begin()));
  }
  EXPECT_GT(nodes, 300);
  // The rest are where four regions all but meet, and the surface's triangles cannot tell which two do.
  EXPECT_GT(exact, 0.85 * nodes) << exact << " of " << nodes;
}

TEST(Voronoi, MovesWithTheSurface) {
  // Turned and shifted, surface and particles alike: the same triangles at the turned places. (The sweeps try directions
  // of the world's, so they are left out.)
  VoronoiOptions options;
  options.sweeps = 0;
  const Skin skin(ball(Vec3::Zero(), 4, 6), options);
  const Mat3 turn = Eigen::AngleAxisd(0.8, Vec3(2, -1, 3).normalized()).toRotationMatrix();
  const Vec3 shift(120, -40, 7);
  Skin moved = skin;
  for (Vec3& x : moved.cloud.x) x = turn * x + shift;
  for (Vec3& x : moved.surface.positions) x = turn * x + shift;
  for (Vec3& n : moved.surface.normals) n = turn * n;
  const Tessellation t = tessellate_voronoi(moved.surface, Regions(moved.points(), 1), moved.points(), options);
  ASSERT_EQ(t.mesh.triangles, skin.tessellation.mesh.triangles);
  EXPECT_EQ(t.region, skin.tessellation.region);
  for (std::size_t v = 0; v < t.mesh.positions.size(); ++v)
    EXPECT_LT((t.mesh.positions[v] - (turn * skin.tessellation.mesh.positions[v] + shift)).norm(), 1e-9);
}

std::uint64_t hash_of(const Tessellation& t) {
  StateHash hash;
  hash.add(std::span<const Vec3>(t.mesh.positions));
  hash.add(std::span<const Vec3>(t.mesh.normals));
  for (const auto& c : t.mesh.triangles) hash.add(std::span<const Index>(c));
  for (const auto& [name, attribute] : t.mesh.attributes) hash.add(std::span<const float>(attribute.values));
  for (const Index r : t.region) hash.add(t.id[r]);
  return hash.value();
}

TEST(Voronoi, IsTheSameOnAnyNumberOfThreadsAndInAnyOrderOfThePoints) {
  const Skin skin(random_cluster(12, 200));
  const ThreadLimit one(1);
  const Skin alone(random_cluster(12, 200));
  EXPECT_EQ(hash_of(skin.tessellation), hash_of(alone.tessellation));

  std::vector<std::size_t> order(skin.cloud.x.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [](std::size_t a, std::size_t b) { return random_bits(3, 0, a) < random_bits(3, 0, b); });
  Skin shuffled = skin;
  for (std::size_t i = 0; i < order.size(); ++i) {
    shuffled.cloud.x[i] = skin.cloud.x[order[i]];
    shuffled.id[i] = skin.id[order[i]];
  }
  EXPECT_EQ(hash_of(skin.tessellation), hash_of(tessellate_voronoi(skin.surface, Regions(shuffled.points(), 1), shuffled.points())));
}

TEST(Voronoi, FollowsParticlesInAShearFlow) {
  // 1 % of the spacing a frame: regions stay with their particles, centres move no more than the lava does, but for those
  // whose fan was made anew: 6 in a hundred, most of them round particles that stand out.
  const Cloud start = ball(Vec3::Zero(), 5, 7);
  std::vector<Vec3> before(start.x.size());
  std::vector<std::uint8_t> seen(start.x.size(), 0);
  std::size_t followed = 0, kept = 0, jumped = 0;
  for (int frame = 0; frame < 12; ++frame) {
    Cloud cloud;
    for (const Vec3& x : start.x) cloud.add(x + Vec3(0.01 * frame * x.z() / 5, 0, 0), 1);
    const Skin skin(std::move(cloud));
    const Tessellation& t = skin.tessellation;
    std::vector<std::uint8_t> now(start.x.size(), 0);
    for (std::size_t v = 0; v < t.report.fans; ++v) {
      const Index p = t.particle[t.center[v]];
      if (now[p]) continue;  // the first centre
      now[p] = 1;
      if (seen[p]) {
        ++kept;
        jumped += (t.mesh.positions[v] - before[p]).norm() > 0.1;
      }
      before[p] = t.mesh.positions[v];
    }
    followed += static_cast<std::size_t>(std::count(seen.begin(), seen.end(), 1));
    seen = now;
  }
  EXPECT_GT(followed, 2000u);
  EXPECT_GT(static_cast<Real>(kept), 0.98 * static_cast<Real>(followed)) << kept << " of " << followed;
  EXPECT_LT(static_cast<Real>(jumped), 0.065 * static_cast<Real>(kept)) << jumped << " of " << kept;
}

TEST(Voronoi, LeavesOutPiecesThatNoParticleReaches) {
  Cloud cloud = ball(Vec3::Zero(), 2.5, 8);
  const std::size_t first = cloud.x.size();
  for (const Vec3& x : ball(Vec3(12, 0, 0), 2, 9).x) cloud.add(x, 1);
  Skin skin(cloud);
  // The second ball's particles are gone, its surface is still there.
  skin.cloud.x.resize(first);
  skin.id.resize(first);
  geometry::Points left;
  left.position = skin.cloud.x;
  left.radius = std::span(skin.cloud.radius).first(first);
  const Tessellation t = tessellate_voronoi(skin.surface, Regions(left, 1), left);
  EXPECT_EQ(t.report.dropped_pieces, 1u);
  EXPECT_EQ(t.report.unclaimed, 0u);
  const geometry::MeshReport report = geometry::validate(t.mesh);
  EXPECT_TRUE(report.solid()) << geometry::to_string(report);
  EXPECT_EQ(report.components, 1u);
  EXPECT_EQ(t.id, std::vector<std::uint64_t>(t.particle.begin(), t.particle.end())) << "without ids, places";

  // A surface that only partly is within reach: the rest goes to neighbours, and is counted.
  Regions few(left, 0.45);
  const Tessellation grown = tessellate_voronoi(skin.surface, few, left);
  EXPECT_TRUE(geometry::validate(grown.mesh).solid());
}

TEST(Voronoi, GivesWhatNobodyReachesToTheNeighbors) {
  // A long capsule with particles at one end only.
  Cloud cloud;
  for (int k = 0; k < 12; ++k) cloud.add(Vec3(0.8 * k, 0, 0), 1);
  const Skin skin(cloud);
  geometry::Points left = skin.cloud.bare();
  left.position = left.position.first(3);
  left.radius = left.radius.first(3);
  const Tessellation t = tessellate_voronoi(skin.surface, Regions(left, 1), left);
  EXPECT_GT(t.report.unclaimed, 30u);
  EXPECT_EQ(t.report.dropped_pieces, 0u);
  EXPECT_TRUE(geometry::validate(t.mesh).solid());
  EXPECT_EQ(t.particle, (std::vector<Index>{0, 1, 2}));
}

TEST(Voronoi, OfNothingIsEmpty) {
  const Tessellation t = tessellate_voronoi(TriMesh{}, Regions(geometry::Points{}, 1), geometry::Points{});
  EXPECT_TRUE(t.mesh.triangles.empty());
  EXPECT_TRUE(t.mesh.positions.empty());
  EXPECT_EQ(t.report.regions, 0u);
}

TEST(VoronoiDeath, RefusesASurfaceWithAHole) {
  Skin skin(ball(Vec3::Zero(), 3, 1));
  skin.surface.triangles.resize(skin.surface.triangles.size() / 2);
  EXPECT_DEATH(tessellate_voronoi(skin.surface, Regions(skin.points(), 1), skin.points()), "CHECK failed");
}

TEST(SurfaceWalk, FindsTheNearestPointFromAnywhereOnASphere) {
  const TriMesh sphere = geometry::make_sphere(Vec3::Zero(), 2, 3);
  const geometry::MeshTree tree(sphere.positions, sphere.triangles);
  const SurfaceWalk walk(sphere);
  for (std::uint64_t n = 0; n < 500; ++n) {
    const Vec3 p =
        Vec3(random_normal(1, 0, n), random_normal(1, 1, n), random_normal(1, 2, n)).normalized() * (1.9 + 0.3 * random_uniform(1, 3, n));
    // From a triangle a quarter turn away or nearer: a walk over many.
    const auto start = static_cast<Index>(tree.nearest(p + Vec3(0.9, -0.5, 0.7))->triangle);
    const Spot spot = walk.nearest(p, start);
    EXPECT_NEAR((spot.x - p).norm(), tree.nearest(p)->distance, 1e-3) << "a local least, no farther than the facets' sagitta";
    const geometry::Triangle& t = sphere.triangles[spot.triangle];
    const Vec3 x =
        spot.weights[0] * sphere.positions[t[0]] + spot.weights[1] * sphere.positions[t[1]] + spot.weights[2] * sphere.positions[t[2]];
    EXPECT_LT((x - spot.x).norm(), 1e-12);
    EXPECT_GT(walk.normal(spot).dot(p.normalized()), 0.99);
  }
}

}  // namespace
}  // namespace effuse::skin
