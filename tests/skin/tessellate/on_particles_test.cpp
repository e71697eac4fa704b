#include "skin/tessellate/on_particles.h"

#include <gtest/gtest.h>

#include "geometry/base/random.h"
#include "geometry/query/mesh_tree.h"
#include "skin/tessellate/make_skin.h"
#include "tests/skin/surface/shapes.h"

namespace effuse::skin {
namespace {

using geometry::TriMesh;
using testing_shapes::Cloud;

Vec3 random_place(std::uint64_t i, std::uint64_t k) { return Vec3(random_uniform(i, 3 * k, 1), random_uniform(i, 3 * k + 1, 1), random_uniform(i, 3 * k + 2, 1)); }

TEST(LineBetween, ItsPointsAreAsFarFromAll) {
  int known = 0;
  for (std::uint64_t i = 0; i < 50; ++i) {
    const Vec3 a = random_place(i, 0), b = random_place(i, 1), c = random_place(i, 2), d = random_place(i, 3), up = random_place(i, 4) - Vec3::Constant(0.5);
    const Line three = line_between(a, b, c, up), pairs = line_between(a, b, c, d, up);
    for (const Real s : {-2.0, 0.0, 3.0}) {
      if (three.along != Vec3::Zero()) {
        const Vec3 x = three.at + s * three.along;
        EXPECT_NEAR((x - a).norm(), (x - b).norm(), 1e-9);
        EXPECT_NEAR((x - a).norm(), (x - c).norm(), 1e-9);
        EXPECT_GE(three.along.dot(up), 0);
        ++known;
      }
      if (pairs.along != Vec3::Zero()) {
        const Vec3 x = pairs.at + s * pairs.along;
        EXPECT_NEAR((x - a).norm(), (x - b).norm(), 1e-9);
        EXPECT_NEAR((x - c).norm(), (x - d).norm(), 1e-9);
      }
    }
  }
  EXPECT_GT(known, 120);
  EXPECT_EQ(line_between(Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(2, 0.01, 0), Vec3::UnitZ()).along, Vec3(Vec3::Zero()));
}

// Item 3a of the skin: what is made anew after the lava moved as a whole is the same skin, moved.

struct Moved {
  Quat turn{Eigen::AngleAxisd(0.8, Vec3::UnitZ())};
  Vec3 shift{313.7, -94.1, 12.2};
  Vec3 operator()(const Vec3& x) const { return turn * x + shift; }
};

/// Nine spacings by nine by three, in the disorder of a liquid: pushed apart until none are in rows.
Cloud slab() {
  const Box3 box(Vec3::Zero(), Vec3(9, 9, 3)), inside(Vec3::Constant(0.45), Vec3(8.55, 8.55, 2.55));
  std::vector<Vec3> x = testing_shapes::fill(box, 1, [](const Vec3&) { return true; }, 0.35, 7).x;
  for (int round = 0; round < 60; ++round) {
    const std::vector<Vec3> before = x;
    for (std::size_t i = 0; i < x.size(); ++i) {
      for (const Vec3& other : before) {
        const Vec3 apart = before[i] - other;
        const Real distance = apart.norm();
        if (distance > 0 && distance < 1.25) x[i] += 0.25 * (1.25 - distance) / distance * apart;
      }
      x[i] = x[i].cwiseMax(inside.min()).cwiseMin(inside.max());
    }
  }
  Cloud cloud;
  for (const Vec3& p : x) cloud.add(p, 1);
  return cloud;
}

/// Mean distance between the moved skin and the skin of what was moved, over the height from valleys to crests; edges as long as ever.
Real remade(SkinKind kind, TessellationKind tessellation) {
  Cloud cloud = slab();
  std::vector<std::uint64_t> id;
  for (std::size_t i = 0; i < cloud.x.size(); ++i) id.push_back(7 + i);
  std::fill(cloud.temperature.begin(), cloud.temperature.end(), 900);
  std::fill(cloud.crust.begin(), cloud.crust.end(), 1);
  SkinOptions options;
  options.level_set.spacing = 1;
  options.tessellation = tessellation;
  options.detail.emplace();
  options.detail->kind = kind;
  options.detail->edge = 0.25;
  const auto skin = [&] {
    geometry::Points points = cloud.points();
    points.id = id;
    return make_skin(points, cloud.volume(), nullptr, options).mesh;
  };
  const TriMesh here = skin();
  const Moved moved;
  for (Vec3& x : cloud.x) x = moved(x);
  for (Vec3& v : cloud.velocity) v = moved.turn * v;
  const TriMesh there = skin();
  const geometry::MeshTree tree(there.positions, there.triangles);
  Real sum = 0;
  for (const Vec3& x : here.positions) sum += tree.nearest(moved(x))->distance;
  return sum / static_cast<Real>(here.positions.size()) / (2 * options.detail->amplitude);
}

TEST(OnParticles, AVoronoiSkinMadeAnewMovesRigidlyWithItsParticles) {
  const Real voronoi = remade(SkinKind::kAa, TessellationKind::kVoronoi);
  EXPECT_LT(voronoi, 0.01);
  // Chords between the voxels' vertices are not those of the lava.
  EXPECT_GT(remade(SkinKind::kAa, TessellationKind::kLevelSet), 3 * voronoi);
}

TEST(OnParticlesSlow, SoItDoesWithEveryKindOfSkin) {
  for (const SkinKind kind : {SkinKind::kPahoehoe, SkinKind::kBlock, SkinKind::kObsidian}) EXPECT_LT(remade(kind, TessellationKind::kVoronoi), 0.01) << static_cast<int>(kind);
}

}  // namespace
}  // namespace effuse::skin
