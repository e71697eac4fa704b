#include "skin/tessellate/make_skin.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/query/mesh_tree.h"
#include "tests/skin/skin_checks.h"
#include "tests/skin/surface/shapes.h"

/// Both tessellations of shapes that flows make, as they leave the front door: smooth, displaced, cut at the ground.
namespace effuse::skin {
namespace {

using geometry::Terrain;
using geometry::TriMesh;
using skin_checks::expect_clean_ground;
using skin_checks::expect_sound;
using skin_checks::volume_above;
using testing_shapes::Cloud;
using testing_shapes::cube;
using testing_shapes::fill;

/// Spacing 1 m.
struct Particles {
  Cloud cloud;
  std::vector<std::uint64_t> id;

  explicit Particles(Cloud c) : cloud(std::move(c)) {
    for (std::size_t i = 0; i < cloud.x.size(); ++i) id.push_back(500 + 3 * i);
  }
  geometry::Points points() const {
    geometry::Points p = cloud.points();
    p.id = id;
    return p;
  }
  Skin skin(const SkinOptions& options, const Terrain* terrain = nullptr) const {
    return make_skin(points(), cloud.volume(), terrain, options);
  }
};

SkinOptions smooth(TessellationKind kind) {
  SkinOptions options;
  options.level_set.spacing = 1;
  options.tessellation = kind;
  return options;
}

SkinOptions displaced(TessellationKind tessellation, SkinKind kind, Real edge = 0.25) {
  SkinOptions options = smooth(tessellation);
  options.detail.emplace();
  options.detail->kind = kind;
  options.detail->edge = edge;
  options.detail->solid = 1300;  // clouds are of 1200 K or so: cold
  return options;
}

constexpr TessellationKind kBoth[] = {TessellationKind::kLevelSet, TessellationKind::kVoronoi};

Cloud random_cluster(std::uint64_t seed, std::uint64_t n = 150) {
  Cloud cloud;
  for (std::uint64_t i = 0; i < n; ++i)
    cloud.add(1.7 * Vec3(random_normal(seed, 0, i), random_normal(seed, 1, i), random_normal(seed, 2, i)), 1);
  return cloud;
}

Cloud sheet() {
  Cloud cloud;
  for (const Vec3& x : fill(
                           Box3(Vec3(-7, -7, -0.5), Vec3(7, 7, 0.5)), 1, [](const Vec3& p) { return p.norm() < 7; }, 0.25)
                           .x)
    cloud.add(Vec3(x.x(), x.y(), 0), 1);
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

constexpr int kMergingFrames = 48, kSplittingFrames = 24;

Cloud merging(int frame) {
  const Real apart = 6.5 - 4.5 * frame / (kMergingFrames - 1);
  Cloud cloud = ball(Vec3(apart / 2, 0, 0), 2.4, 1);
  for (const Vec3& x : ball(Vec3(-apart / 2, 0, 0), 2.4, 2).x) cloud.add(x, 1);
  return cloud;
}

Cloud splitting(int frame) {
  const Real stretch = 1 + 2.2 * frame / (kSplittingFrames - 1);
  Cloud cloud;
  for (const Vec3& x : ball(Vec3::Zero(), 3.2, 3).x) {
    const Real neck = 1 - 0.34 * (stretch - 1) * std::exp(-x.x() * x.x() / 4);
    cloud.add(Vec3(x.x() * stretch, x.y() * neck, x.z() * neck), 1);
  }
  return cloud;
}

/// Every shape there is, by its number: ten clusters, the sheet, every step-th frame of merging and splitting.
std::vector<std::pair<std::string, Cloud>> shapes(int step) {
  std::vector<std::pair<std::string, Cloud>> all;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) all.emplace_back("cluster of seed " + std::to_string(seed), random_cluster(seed));
  all.emplace_back("sheet", sheet());
  for (int f = 0; f < kMergingFrames; f += step) all.emplace_back("merging, frame " + std::to_string(f), merging(f));
  for (int f = 0; f < kSplittingFrames; f += step) all.emplace_back("splitting, frame " + std::to_string(f), splitting(f));
  return all;
}

void expect_sound_smooth(const std::string& name, const Cloud& cloud) {
  const Particles particles(cloud);
  for (const TessellationKind kind : kBoth) {
    SCOPED_TRACE(name + ", " + std::string(kTessellationNames[static_cast<std::size_t>(kind)]));
    const SkinOptions options = smooth(kind);
    expect_sound(particles.skin(options), particles.points(), options);
    if (testing::Test::HasFatalFailure()) return;
  }
}

TEST(MakeSkin, IsSoundByBothTessellations) {
  for (const auto& [name, cloud] : shapes(8)) expect_sound_smooth(name, cloud);
}

TEST(MakeSkin, StaysSoundWhenDisplaced) {
  // Each kind on another shape; all of all is slow.
  const auto all = shapes(12);
  for (std::size_t s = 0; s < all.size(); ++s) {
    const SkinKind kind = static_cast<SkinKind>(s % kSkinKindNames.size());
    const Particles particles(all[s].second);
    const SkinOptions options = displaced(kBoth[s % 2], kind, 0.35);
    SCOPED_TRACE(all[s].first + ", " + std::string(kSkinKindNames[static_cast<std::size_t>(kind)]));
    expect_sound(particles.skin(options), particles.points(), options);
  }
}

TEST(MakeSkinSlow, IsSoundByBothTessellationsInEveryFrame) {
  for (const auto& [name, cloud] : shapes(1)) expect_sound_smooth(name, cloud);
}

TEST(MakeSkinSlow, StaysSoundWhenDisplacedByEachKind) {
  for (const auto& [name, cloud] : shapes(4)) {
    const Particles particles(cloud);
    for (const TessellationKind tessellation : kBoth)
      for (std::size_t kind = 0; kind < kSkinKindNames.size(); ++kind) {
        SCOPED_TRACE(name + ", " + std::string(kTessellationNames[static_cast<std::size_t>(tessellation)]) + ", " +
                     std::string(kSkinKindNames[kind]));
        const SkinOptions options = displaced(tessellation, static_cast<SkinKind>(kind));
        expect_sound(particles.skin(options), particles.points(), options);
        if (HasFatalFailure()) return;
      }
  }
}

// The ground.

/// Bumps of a metre on a slope, over 60 m, posts every 2 m.
Terrain hill() {
  const int n = 31;
  std::vector<Real> z;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) z.push_back(100 + 0.25 * (2 * i - 30) + 0.8 * std::sin(0.9 * i) * std::cos(0.7 * j));
  return Terrain::from_height_field(geometry::HeightField(Vec2(-30, -30), Vec2(2, 2), n, n, z));
}

/// A mound on it, its lowest particles half a spacing over the ground.
Cloud mound(const Terrain& ground) {
  Cloud cloud;
  std::uint64_t number = 0;
  for (Real x = -9; x < 9; ++x)
    for (Real y = -9; y < 9; ++y)
      for (int layer = 0; layer < 4 * (1 - (x * x + y * y) / 64) - 0.5; ++layer, ++number) {
        const auto off = [&](std::uint64_t axis) { return 0.1 * (2 * random_uniform(9, axis, number) - 1); };
        cloud.add(Vec3(x + off(0), y + off(1), ground.height(x, y).value() + layer + 0.55 + off(2)), 1);
      }
  return cloud;
}

TEST(MakeSkin, IsCutCleanAtTheGroundAndEnclosesTheVolumeAboveIt) {
  const Terrain ground = hill();
  const Particles particles(mound(ground));
  for (const TessellationKind tessellation : kBoth)
    for (const bool detail : {false, true}) {
      SCOPED_TRACE(std::string(kTessellationNames[static_cast<std::size_t>(tessellation)]) + (detail ? ", displaced" : ", smooth"));
      const SkinOptions options = detail ? displaced(tessellation, SkinKind::kNoise) : smooth(tessellation);
      const Skin skin = particles.skin(options, &ground);
      expect_sound(skin, particles.points(), options, &ground);
      expect_clean_ground(skin.mesh, ground, 1, 1.5 * skin.surface.voxel());
      // Facets, and relief whose mean is not quite zero.
      EXPECT_NEAR(volume_above(skin.mesh, ground) / particles.cloud.volume(), 1, 0.03);
    }
}

TEST(MakeSkin, TheGroundChecksCanFail) {
  // Lifted by a spacing the same skin shows a gap, sunk by one it reaches too deep.
  const Terrain ground = hill();
  const Particles particles(mound(ground));
  const Skin skin = particles.skin(smooth(TessellationKind::kLevelSet), &ground);
  EXPECT_LT(skin_checks::share_of_gaps(skin.mesh, ground, 1), 1e-9);
  EXPECT_LT(skin_checks::deepest(skin.mesh, ground), 0.85);
  TriMesh lifted = skin.mesh, sunk = skin.mesh;
  for (Vec3& x : lifted.positions) x.z() += 1;
  for (Vec3& x : sunk.positions) x.z() -= 1;
  EXPECT_GT(skin_checks::share_of_gaps(lifted, ground, 1), 0.5);
  EXPECT_GT(skin_checks::deepest(sunk, ground), 1.5);
}

// Volume.

TEST(MakeSkin, BothTessellationsEncloseTheParticlesVolumeDisplacedOrNot) {
  // Facets a spacing wide lose more than a per cent of a blob, a third of a drop of one particle; vertices are moved for it.
  Cloud drop;
  drop.add(Vec3::Zero(), 1);
  for (const Cloud& cloud : {ball(Vec3::Zero(), 5.5, 4), drop}) {
    const Particles particles(cloud);
    const TriMesh surface = mesh_level_set(particles.skin(smooth(TessellationKind::kLevelSet)).surface);
    const auto missing = [&](const TriMesh& mesh) { return 1 - geometry::signed_volume(mesh) / cloud.volume(); };
    const Real facets = missing(tessellate_voronoi(surface, Regions(particles.points(), 1), particles.points()).mesh);
    ASSERT_GT(facets, 0.005) << "the test would tell nothing";
    constexpr Real kMost = 0.001;
    for (const auto tessellation : {TessellationKind::kLevelSet, TessellationKind::kVoronoi}) {
      EXPECT_LT(std::abs(missing(particles.skin(smooth(tessellation)).mesh)), kMost);
      if (cloud.x.size() == 1) continue;  // relief as high as a drop is wide takes or adds more than may be made up for
      for (const SkinKind kind : {SkinKind::kNoise, SkinKind::kAa, SkinKind::kBlock}) {
        const Skin skin = particles.skin(displaced(tessellation, kind, 0.25));
        EXPECT_LT(std::abs(missing(skin.mesh)), kMost) << static_cast<int>(kind);
        EXPECT_NEAR(skin.report.volume.after, geometry::signed_volume(skin.mesh), 1e-9 * cloud.volume());
        EXPECT_TRUE(geometry::validate(skin.mesh).solid());
      }
    }
  }
}

TEST(MakeSkin, AVolumeThatCannotBeReachedIsLeft) {
  // Twice the particles' volume, no shift of half a spacing makes that of a ball; and with match_volume off nothing is moved.
  const Particles particles(ball(Vec3::Zero(), 4, 3));
  SkinOptions options = smooth(TessellationKind::kLevelSet);
  const Skin most = make_skin(particles.points(), 3 * particles.cloud.volume(), nullptr, options);
  EXPECT_NEAR(geometry::signed_volume(most.mesh) / most.report.level_set.volume, 1, 0.001);
  options.level_set.match_volume = false;
  EXPECT_EQ(make_skin(particles.points(), particles.cloud.volume(), nullptr, options).report.volume.offset, 0);
}

/// Mean distance of a's vertices from b.
Real mean_distance(const TriMesh& a, const TriMesh& b) {
  const geometry::MeshTree tree(b.positions, b.triangles);
  Real sum = 0;
  for (const Vec3& x : a.positions) sum += tree.nearest(x)->distance;
  return sum / static_cast<Real>(a.positions.size());
}

TEST(MakeSkin, BothTessellationsShowTheSameReliefOnTheSameSurface) {
  // As near to each other as level sets of slightly different voxels are: relief is a function of the place. Another seed's is far off.
  const Particles particles(ball(Vec3::Zero(), 4, 2));
  for (const SkinKind kind : {SkinKind::kAa, SkinKind::kPahoehoe}) {
    SkinOptions options = displaced(TessellationKind::kLevelSet, kind);
    const TriMesh mesh = particles.skin(options).mesh, voronoi = particles.skin(displaced(TessellationKind::kVoronoi, kind)).mesh;
    options.level_set.voxel = 0.45;
    const Real noise = mean_distance(particles.skin(options).mesh, mesh);
    options.level_set.voxel = 0;
    options.detail->seed = 2;
    const Real other = mean_distance(particles.skin(options).mesh, mesh);
    const Real apart = mean_distance(voronoi, mesh);
    RecordProperty("apart", std::to_string(apart) + " " + std::to_string(noise) + " " + std::to_string(other));
    EXPECT_LT(apart, 1.5 * noise) << static_cast<int>(kind);
    EXPECT_GT(other, 2 * apart) << static_cast<int>(kind);
  }
}

// Regions.

TEST(MakeSkin, ARegionIsItsParticlesOwnPartOfTheSurface) {
  const Particles particles(random_cluster(3));
  const geometry::Points points = particles.points();
  for (const Real edge : {0.0, 0.25}) {
    SkinOptions options = smooth(TessellationKind::kVoronoi);
    if (edge > 0) {
      options.detail.emplace();
      options.detail->amplitude = 0;
      options.detail->edge = edge;
    }
    const Skin skin = particles.skin(options);
    // A triangle's middle is nearest to its region's particle, but for triangles on borders: nodes and centres moved for better
    // angles, edges are straight.
    std::size_t own = 0;
    Real farther = 0;
    for (std::size_t t = 0; t < skin.mesh.triangles.size(); ++t) {
      const auto& [a, b, c] = skin.mesh.triangles[t];
      const Vec3 middle = (skin.mesh.positions[a] + skin.mesh.positions[b] + skin.mesh.positions[c]) / 3;
      Real least = std::numeric_limits<Real>::infinity();
      for (const Vec3& x : points.position) least = std::min(least, (x - middle).norm());
      const Real mine = (points.position[skin.regions.particle[skin.regions.of_triangle[t]]] - middle).norm();
      own += mine <= least + 1e-9;
      farther = std::max(farther, mine - least);
    }
    EXPECT_GT(static_cast<Real>(own), 0.85 * static_cast<Real>(skin.mesh.triangles.size())) << edge;
    EXPECT_LT(farther, 0.8) << edge;
  }
}

TEST(MakeSkin, WithoutIdsRegionsGoByPlace) {
  Particles particles(random_cluster(2, 60));
  const Skin with = particles.skin(smooth(TessellationKind::kLevelSet));
  particles.id.clear();
  const Skin without = particles.skin(smooth(TessellationKind::kLevelSet));
  EXPECT_EQ(with.regions.particle, without.regions.particle);
  ASSERT_EQ(without.regions.id.size(), without.regions.particle.size());
  for (std::size_t r = 0; r < without.regions.size(); ++r) {
    EXPECT_EQ(without.regions.id[r], without.regions.particle[r]);
    EXPECT_EQ(with.regions.id[r], 500 + 3 * without.regions.particle[r]);
  }
}

// Coarsening.

TEST(MakeSkin, CoarseWhereFlatEveryRegionKeepsAVertex) {
  const Terrain ground = hill();
  const Particles particles(mound(ground));
  for (const bool detail : {false, true}) {
    SkinOptions options = detail ? displaced(TessellationKind::kLevelSet, SkinKind::kPahoehoe) : smooth(TessellationKind::kLevelSet);
    const Skin fine = particles.skin(options, &ground);
    options.coarsen = 0.1;
    const Skin coarse = particles.skin(options, &ground);
    const geometry::MeshReport report = geometry::validate(coarse.mesh);
    EXPECT_TRUE(report.solid()) << geometry::to_string(report);
    EXPECT_LE(skin_checks::share_of_thin(coarse.mesh), 0.005);
    EXPECT_LT(2 * coarse.mesh.triangles.size(), fine.mesh.triangles.size());
    EXPECT_EQ(coarse.report.coarsened, fine.mesh.positions.size() - coarse.mesh.positions.size());
    EXPECT_LE(coarse.report.coarsen_error, 0.1);
    EXPECT_EQ(coarse.regions.id, fine.regions.id);
    ASSERT_EQ(coarse.regions.of_vertex.size(), coarse.mesh.positions.size());
    EXPECT_EQ(std::set<Index>(coarse.regions.of_vertex.begin(), coarse.regions.of_vertex.end()).size(), coarse.regions.size());
    // A vertex that stayed is in the region that it was in.
    std::map<std::array<Real, 3>, Index> was;
    for (std::size_t v = 0; v < fine.mesh.positions.size(); ++v) {
      const Vec3& x = fine.mesh.positions[v];
      was[{x.x(), x.y(), x.z()}] = fine.regions.of_vertex[v];
    }
    for (std::size_t v = 0; v < coarse.mesh.positions.size(); ++v) {
      const Vec3& x = coarse.mesh.positions[v];
      ASSERT_EQ(was.at({x.x(), x.y(), x.z()}), coarse.regions.of_vertex[v]);
    }
  }
}

// Drops, and the rest.

TEST(MakeSkin, KeepsDropsUnlessAskedToLeaveThemOut) {
  Cloud cloud = ball(Vec3::Zero(), 3.5, 1);
  const std::size_t first = cloud.x.size();
  cloud.add(Vec3(9, 0, 0), 1);
  for (int n = 0; n < 27; ++n) cloud.add(Vec3(n % 3, 9 + n / 3 % 3, n / 9), 1);
  const Particles particles(cloud);
  for (const TessellationKind kind : kBoth) {
    SkinOptions options = smooth(kind);
    const auto pieces = [&](Real drop_volume) {
      options.level_set.drop_volume = drop_volume;
      const Skin skin = particles.skin(options);
      // A drop's particles have regions as long as it is there.
      const std::size_t in_drops = static_cast<std::size_t>(
          std::count_if(skin.regions.particle.begin(), skin.regions.particle.end(), [&](Index p) { return p >= first; }));
      return std::array<std::size_t, 3>{geometry::validate(skin.mesh).components, in_drops, skin.report.level_set.dropped_pieces};
    };
    // One particle, and 27 of which 26 are outside.
    EXPECT_EQ(pieces(0), (std::array<std::size_t, 3>{3, 27, 0}));
    EXPECT_EQ(pieces(5), (std::array<std::size_t, 3>{2, 26, 1}));
    EXPECT_EQ(pieces(60), (std::array<std::size_t, 3>{1, 0, 2}));
  }
}

std::uint64_t hash_of(const Skin& skin) {
  StateHash hash;
  hash.add(std::span<const Vec3>(skin.mesh.positions));
  hash.add(std::span<const Vec3>(skin.mesh.normals));
  for (const geometry::Triangle& t : skin.mesh.triangles) hash.add(std::span<const Index>(t));
  for (const auto& [name, attribute] : skin.mesh.attributes) hash.add(std::span<const float>(attribute.values));
  for (const Index r : skin.regions.of_vertex) hash.add(skin.regions.id[r]);
  for (const Index r : skin.regions.of_triangle) hash.add(skin.regions.id[r]);
  return hash.value();
}

TEST(MakeSkin, TheSameBitsOnAnyNumberOfThreads) {
  const Particles particles(random_cluster(12, 200));
  std::vector<SkinOptions> all = {displaced(TessellationKind::kLevelSet, SkinKind::kAa),
                                  displaced(TessellationKind::kVoronoi, SkinKind::kAa)};
  all.push_back(all[0]);
  all.back().coarsen = 0.05;
  for (const SkinOptions& options : all) {
    const std::uint64_t many = hash_of(particles.skin(options));
    const ThreadLimit one(1);
    EXPECT_EQ(many, hash_of(particles.skin(options)));
  }
}

TEST(MakeSkin, WhatTheFrameBeforeLeftChangesNothing) {
  // A mound of which the right half creeps.
  const Terrain ground = hill();
  for (const TessellationKind kind : kBoth) {
    SurfaceCache last;
    for (int frame = 0; frame < 3; ++frame) {
      Cloud cloud = mound(ground);
      for (Vec3& x : cloud.x)
        if (x.x() > 2) x.y() += 0.05 * frame;
      const Particles particles(cloud);
      const SkinOptions options = displaced(kind, SkinKind::kNoise, 0.5);
      const Skin with = make_skin(particles.points(), cloud.volume(), &ground, options, &last);
      EXPECT_EQ(hash_of(with), hash_of(particles.skin(options, &ground))) << "frame " << frame;
    }
  }
}

TEST(MakeSkin, OfNothingIsEmptyAndTheLevelSetAloneHasNoMesh) {
  for (const TessellationKind kind : kBoth) {
    const Skin nothing = make_skin({}, 0, nullptr, displaced(kind, SkinKind::kAa));
    EXPECT_TRUE(nothing.surface.empty());
    EXPECT_TRUE(nothing.mesh.triangles.empty() && nothing.mesh.positions.empty());
    EXPECT_EQ(nothing.regions.size(), 0u);
    SkinOptions options = smooth(kind);
    options.mesh = false;
    const Skin volume = Particles(random_cluster(1, 20)).skin(options);
    EXPECT_FALSE(volume.surface.empty());
    EXPECT_TRUE(volume.mesh.triangles.empty());
    EXPECT_GT(volume.report.level_set.volume, 0);
  }
}

TEST(MakeSkinDeath, RefusesToCoarsenVoronoi) {
  SkinOptions options = smooth(TessellationKind::kVoronoi);
  options.coarsen = 0.1;
  EXPECT_DEATH(Particles(random_cluster(1, 20)).skin(options), "CHECK failed");
}

}  // namespace
}  // namespace effuse::skin
