#include "skin/surface/particle_surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/mesh/validate.h"
#include "geometry/query/mesh_tree.h"
#include "skin/surface/level_set_impl.h"
#include "skin/tessellate/make_skin.h"

namespace effuse::skin {
namespace {

using geometry::TriMesh;

/// A slab of disordered lava, spacing 1, three particles deep.
struct Slab {
  std::vector<Vec3> x;
  std::vector<Real> radius;
  explicit Slab(int across, int deep = 3) {
    for (int i = 0; i < across; ++i)
      for (int j = 0; j < across; ++j)
        for (int k = 0; k < deep; ++k) {
          const auto off = [&](std::uint64_t axis) { return 0.3 * random_uniform(11, axis, x.size()) - 0.15; };
          x.emplace_back(i + off(0), j + off(1), k + off(2));
        }
    radius.assign(x.size(), 0.5);
  }
  geometry::Points points() const {
    geometry::Points p;
    p.position = x;
    p.radius = radius;
    return p;
  }
  Real volume() const { return static_cast<Real>(x.size()); }
};

LevelSetOptions spacing_one() {
  LevelSetOptions o;
  o.spacing = 1;
  return o;
}

/// The level set's mesh with edges of a fifth at most, on the particles' surface or as it was.
TriMesh fine_mesh(const LevelSet& surface, bool projected) {
  TriMesh mesh = tessellate_level_set(surface);
  RefineOptions fine;
  fine.edge = 0.2;
  refine_to(mesh, fine);
  if (projected) ParticleSurface(surface).project(mesh);
  return mesh;
}

Real mean_distance(const TriMesh& from, const TriMesh& to) {
  const geometry::MeshTree tree(to.positions, to.triangles);
  Real sum = 0;
  for (const Vec3& p : from.positions) sum += tree.nearest(p)->distance;
  return sum / static_cast<Real>(from.positions.size());
}

TEST(ParticleSurface, GoesWithTheLavaWhereTheLatticesOwnDoesNot) {
  Slab here(9), there = here;
  const Quat turn(Eigen::AngleAxisd(0.8, Vec3::UnitZ()));
  const Vec3 shift(13.7, -94.1, 12.2);
  for (Vec3& x : there.x) x = turn * x + shift;
  LevelSetOptions options = spacing_one();
  options.match_volume = false;  // its steps are another matter
  const LevelSet a = build_level_set(here.points(), here.volume(), nullptr, options), b = build_level_set(there.points(), there.volume(), nullptr, options);
  for (const bool projected : {false, true}) {
    TriMesh moved = fine_mesh(a, projected);
    for (Vec3& p : moved.positions) p = turn * p + shift;
    const Real error = mean_distance(moved, fine_mesh(b, projected));
    // One hundredth of a relief half a spacing high is 0.005; what is left are the chords of edges of a fifth on round edges.
    if (projected) {
      EXPECT_LT(error, 0.003);
    } else {
      EXPECT_GT(error, 0.006) << "the measure cannot tell";
    }
  }
}

TEST(ParticleSurface, WithoutSmoothingAndBallsIsTheZeroOfZhuAndBridsonsField) {
  const Slab slab(7);
  LevelSetOptions options = spacing_one();
  options.smoothing = 0;
  options.cover = 0;
  const LevelSet surface = build_level_set(slab.points(), slab.volume(), nullptr, options);
  const TriMesh mesh = fine_mesh(surface, true);
  const LevelSet::Impl& s = surface.impl();
  const auto f = [&](const Vec3& x) { return zhu_bridson(s.particles, s.rule.raster, (x - s.particles.origin()) / s.voxel) * s.voxel - s.level * s.voxel; };
  std::size_t off = 0, flat = 0;
  Real worst_normal = 1;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    Vec3 slope;
    for (int a = 0; a < 3; ++a) slope[a] = f(mesh.positions[v] + 1e-3 * Vec3::Unit(a)) - f(mesh.positions[v] - 1e-3 * Vec3::Unit(a));
    worst_normal = std::min(worst_normal, slope.normalized().dot(mesh.normals[v]));
    if (slope.norm() / 2e-3 < 0.55) ++flat;  // creases of a field that is not smoothed: points go less far there
    else off += std::abs(f(mesh.positions[v])) > 1e-3;
  }
  EXPECT_EQ(off, 0u) << "of " << mesh.positions.size();
  EXPECT_LT(flat, mesh.positions.size() / 50);
  EXPECT_GT(worst_normal, std::cos(0.2));  // slopes are taken over 0.15 spacings
}

TEST(ParticleSurface, SmoothsAsMuchAsTheLevelSetDoes) {
  const Slab slab(9);
  const LevelSet surface = build_level_set(slab.points(), slab.volume(), nullptr, spacing_one());
  const TriMesh before = fine_mesh(surface, false), after = fine_mesh(surface, true);
  ASSERT_EQ(before.positions.size(), after.positions.size());
  // On top, away from the sides: deviation of the height.
  const auto roughness = [](const TriMesh& mesh) {
    Real sum = 0, squares = 0, n = 0;
    for (const Vec3& p : mesh.positions)
      if (p.z() > 1.5 && p.x() > 2 && p.x() < 6 && p.y() > 2 && p.y() < 6) sum += p.z(), squares += p.z() * p.z(), ++n;
    return std::sqrt(squares / n - sum * sum / (n * n));
  };
  Real most = 0;
  for (std::size_t v = 0; v < before.positions.size(); ++v) most = std::max(most, (after.positions[v] - before.positions[v]).norm());
  EXPECT_NEAR(roughness(after), roughness(before), 0.25 * roughness(before));
  EXPECT_GT(most, 0.02);
  EXPECT_LT(most, 0.3);  // in corners, which voxels of half a spacing round off
  EXPECT_TRUE(geometry::validate(after).solid());
}

TEST(ParticleSurface, PointsOnItStay) {
  const Slab slab(7);
  const LevelSet surface = build_level_set(slab.points(), slab.volume(), nullptr, spacing_one());
  const TriMesh once = fine_mesh(surface, true);
  TriMesh twice = once;
  ParticleSurface(surface).project(twice);
  std::vector<Real> moved;
  for (std::size_t v = 0; v < once.positions.size(); ++v) moved.push_back((twice.positions[v] - once.positions[v]).norm());
  std::sort(moved.begin(), moved.end());
  EXPECT_LT(moved[moved.size() * 99 / 100], 2e-3);
  EXPECT_LT(moved.back(), 0.02);  // where balls meet, Newton's steps are short
}

TEST(ParticleSurface, PointsThatGoAlongLinesStayOnThemAndOnesAlongTheSurfaceStayWhereTheyAre) {
  const Slab slab(7);
  const LevelSet surface = build_level_set(slab.points(), slab.volume(), nullptr, spacing_one());
  const ParticleSurface particles(surface);
  std::vector<Vec3> x, n, along;
  for (std::uint64_t i = 0; i < 200; ++i) {
    x.emplace_back(2 + 2 * random_uniform(1, 0, i), 2 + 2 * random_uniform(1, 1, i), 2.55);  // its top is at 2.6 or so
    n.push_back(Vec3::UnitZ());
    along.push_back(i % 4 == 0 ? Vec3::UnitX() : Vec3(Vec3(random_uniform(1, 2, i) - 0.5, random_uniform(1, 3, i) - 0.5, 1).normalized()));
  }
  const std::vector<Vec3> before = x;
  std::vector<Real> share(x.size());
  particles.project_along(x, n, along, share);
  std::vector<Vec3> again = x, normals = n;
  particles.project(again, normals);
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (i % 4 == 0) {
      EXPECT_EQ(x[i], before[i]);
      EXPECT_EQ(share[i], 0);
      continue;
    }
    EXPECT_EQ(share[i], 1);
    EXPECT_LT((x[i] - before[i]).cross(along[i]).norm(), 1e-6);
    EXPECT_LT((again[i] - x[i]).norm(), 1e-3);
    EXPECT_NEAR(n[i].norm(), 1, 1e-9);
  }
}

TEST(ParticleSurface, StaysWhereTheGroundCutsIt) {
  const Slab slab(7, 2);
  const geometry::Terrain ground = geometry::Terrain::from_height_field(geometry::HeightField(Vec2(-20, -20), Vec2(40, 40), 2, 2, std::vector<Real>(4, -0.5)));
  const LevelSet surface = build_level_set(slab.points(), slab.volume(), &ground, spacing_one());
  const TriMesh before = fine_mesh(surface, false), after = fine_mesh(surface, true);
  bool any = false;
  for (std::size_t v = 0; v < before.positions.size(); ++v) {
    if (before.positions[v].z() < 0) {
      EXPECT_EQ(before.positions[v], after.positions[v]);
    }
    any = any || before.positions[v] != after.positions[v];
  }
  EXPECT_TRUE(any);
}

TEST(ParticleSurface, NoTriangleTurnsOverOnFewParticles) {
  // Loose particles, pairs, threads: creases and necks.
  std::vector<Vec3> x;
  for (std::uint64_t i = 0; i < 150; ++i) x.emplace_back(7 * random_uniform(3, 0, i), 7 * random_uniform(3, 1, i), 3 * random_uniform(3, 2, i));
  const std::vector<Real> radius(x.size(), 0.5);
  geometry::Points points;
  points.position = x;
  points.radius = radius;
  const LevelSet surface = build_level_set(points, static_cast<Real>(x.size()), nullptr, spacing_one());
  const TriMesh before = fine_mesh(surface, false), after = fine_mesh(surface, true);
  for (const geometry::Triangle& t : before.triangles) {
    const auto normal = [&](const TriMesh& m) -> Vec3 { return (m.positions[t[1]] - m.positions[t[0]]).cross(m.positions[t[2]] - m.positions[t[0]]); };
    EXPECT_GT(normal(before).dot(normal(after)), 0);
  }
  for (const Vec3& n : after.normals) EXPECT_NEAR(n.norm(), 1, 1e-9);
}

TEST(ParticleSurface, TheSameBitsOnAnyNumberOfThreads) {
  const Slab slab(7);
  const LevelSet surface = build_level_set(slab.points(), slab.volume(), nullptr, spacing_one());
  TriMesh alone, together;
  {
    const ThreadLimit one(1);
    alone = fine_mesh(surface, true);
  }
  {
    const ThreadLimit four(4);
    together = fine_mesh(surface, true);
  }
  EXPECT_EQ(alone.positions, together.positions);
  EXPECT_EQ(alone.normals, together.normals);
}

TEST(ParticleSurface, EllipsoidsAndNothingAreLeftAlone) {
  const Slab slab(5);
  LevelSetOptions options = spacing_one();
  options.kernel = SurfaceKernel::kAnisotropic;
  options.smoothing = 0;
  const LevelSet surface = build_level_set(slab.points(), slab.volume(), nullptr, options);
  EXPECT_EQ(fine_mesh(surface, true).positions, fine_mesh(surface, false).positions);
  const LevelSet nothing;
  std::vector<Vec3> x = {Vec3::Zero()}, n = {Vec3::UnitZ()};
  ParticleSurface(nothing).project(x, n);
  EXPECT_EQ(x[0], Vec3(Vec3::Zero()));
}

}  // namespace
}  // namespace effuse::skin
