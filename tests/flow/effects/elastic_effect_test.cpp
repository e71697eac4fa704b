#include "flow/effects/elastic_effect.h"

#include <gtest/gtest.h>

#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "tests/flow/effects/small_scene.h"

namespace effuse::flow {
namespace {

constexpr const char* kBall = "[[elastic]]\nball = 0.5\nspacing = 0.3\nstep = 0.02\nposition = [0, 0, 0.8]\nyoungs_modulus = \"40 kPa\"\ndensity = 500\n";

TEST(ElasticEffectSlow, ABallFallsAndComesToRestOnTheGround) {
  SmallScene scene(std::string(kBall) + "damping = 0.05\n");
  // 1,280 triangles of the sphere hold 99.3 % of its volume, and weigh it.
  EXPECT_NEAR(scene.figure("mass_kg"), 500 * 0.5236, 3);
  scene.frames(24 * 3);
  const Box3 box = geometry::bounds(scene.mesh());
  EXPECT_NEAR(box.min().z(), 0, 0.05);
  EXPECT_GT(box.sizes().z(), 0.7);
  EXPECT_LT(box.sizes().z(), 0.99) << "it sags";
  // It bounces no more; a ball of a lattice has flat sides and may roll from one to another.
  EXPECT_LT(scene.figure("kinetic_energy_j"), 262 * 0.3 * 0.3 / 2) << "0.3 m/s";
  const geometry::TriMesh mesh = scene.mesh();
  const std::vector<float>& v = mesh.attributes.at("velocity").values;
  Real up = 0;
  for (std::size_t k = 2; k < v.size(); k += 3) up += v[k] / static_cast<Real>(mesh.positions.size());
  EXPECT_LT(std::abs(up), 0.05);
  EXPECT_EQ(scene.figure("pieces"), 1);
}

TEST(ElasticEffectSlow, NearlyIncompressibleItKeepsItsVolumeThroughAFall) {
  SmallScene scene("[[elastic]]\nbox = [0.6, 0.6, 0.6]\nspacing = 0.15\nstep = 0.01\nposition = [0, 0, 1]\nyoungs_modulus = \"50 kPa\"\npoisson_ratio = 0.45\ndensity = 1000\ndamping = 0.02\n");
  double worst = 0;
  for (int frame = 0; frame < 60; ++frame) {
    scene.frames(1);
    worst = std::max(worst, std::abs(scene.figure("volume_change")));
  }
  // K = E / (3 (1 - 2 nu)) = 167 kPa. At rest its weight, 6 kPa on its base, takes 2 %. It lands at v = 3.7 m/s; a plane wave of the
  // speed c = sqrt(M / rho), M = 190 kPa, has the pressure rho c v = 51 kPa: 31 % of K is the most, and 17 % is what it comes to.
  EXPECT_LT(worst, 0.2);
  EXPECT_GT(worst, 0.02);
  EXPECT_LT(std::abs(scene.figure("volume_change")), 0.02) << "at rest";
}

TEST(ElasticEffectSlow, BreakingKeepsItsMassAndComesBackFromACheckpoint) {
  // A brittle beam falls across a bar.
  const std::string text = "[[elastic]]\nname = \"beam\"\nbox = [3, 0.3, 0.3]\nspacing = 0.15\nposition = [0, 0, 0.9]\nyoungs_modulus = \"3 MPa\"\ndensity = 2000\nstrength = \"30 kPa\"\nvelocity = [0, 0, -3]\n"
                           "[[obstacle]]\nbox = [0.2, 1, 0.4]\nposition = [0, 0, 0.2]\non_ground = false\n";
  SmallScene scene(text);
  EXPECT_NEAR(scene.figure("mass_kg"), 540, 1e-6);
  scene.frames(4);
  const std::string bytes = scene.simulation->checkpoint("key");
  SmallScene again(text);
  again.simulation->restore(bytes, "key", "checkpoint");
  {
    const ThreadLimit one(1);
    again.frames(8);
  }
  scene.frames(8);
  EXPECT_EQ(scene.simulation->state_hash(), again.simulation->state_hash());
  EXPECT_GE(scene.figure("pieces"), 2) << scene.figure("nodes_split");
  EXPECT_NEAR(scene.figure("mass_kg"), 540, 1e-6);
  EXPECT_NEAR(scene.figure("tetrahedra"), again.figure("tetrahedra"), 0);
  const geometry::TriMesh mesh = scene.mesh();
  const std::vector<float>& inner = mesh.attributes.at("inner").values;
  EXPECT_GT(std::count(inner.begin(), inner.end(), 1.0f), 0);
  EXPECT_EQ(mesh.attributes.at("velocity").values.size(), 3 * mesh.positions.size());
}

TEST(ElasticEffectSlow, PinsHoldAndAnObstacleCarriesThem) {
  const std::string beam = "[[elastic]]\nbox = [1, 0.2, 0.2]\nspacing = 0.1\nposition = [0, 0, 2]\nyoungs_modulus = \"1 MPa\"\ndensity = 1000\nstep = 0.02\npins = [[-0.5, 0, 2, 0.2]]\n";
  SmallScene still(beam);
  still.frames(24);
  const Box3 box = geometry::bounds(still.mesh());
  EXPECT_NEAR(box.min().x(), -0.5, 1e-9);
  EXPECT_LT(box.min().z(), 1.88) << "its free end hangs";
  SmallScene carried(beam + "pinned_to = \"crane\"\n[[obstacle]]\nname = \"crane\"\nbox = [0.1, 0.1, 0.1]\non_ground = false\nmotion = \"linear\"\n[[obstacle.key]]\ntime = 0\nposition = [0, 0, 5]\n[[obstacle.key]]\ntime = 1\nposition = [0, 0, 6]\n");
  carried.frames(24);
  EXPECT_NEAR(geometry::bounds(carried.mesh()).max().z(), 3.1, 0.15);
}

TEST(ElasticEffect, StandsWhereTheMapSays) {
  const Vec3 origin(2667000, 6478000, 50);
  SmallScene scene("[[elastic]]\nbox = [1, 1, 1]\nspacing = 0.5\nyoungs_modulus = 1e6\ndensity = 1000\ngravity = [0, 0, 0]\nposition = [2667001, 6478002, 53]\npins = [[2667001, 6478002, 53, 2]]\n", origin);
  scene.frames(2);
  EXPECT_NEAR((geometry::bounds(scene.mesh()).center() - Vec3(1, 2, 3)).norm(), 0, 1e-9);
}

TEST(ElasticEffect, ATableWithoutAShapeIsToldOnceAndNothingIsMade) {
  for (const char* table : {"[[elastic]]\nspacing = 0.2\n", "[[elastic]]\nbox = [0, 1, 1]\n", "[[springs]]\nshape = \"cloth\"\n", "[[springs]]\nshape = \"solid\"\nbox = [1, 1]\n"}) {
    const Node node = importers::read_scene_text("[film]\nframes = 9\n[terrain]\nplane = { size = [100, 100] }\n" + std::string(table), "test.toml");
    const geometry::Terrain terrain = geometry::Terrain::from_height_field(geometry::make_plane(Vec2(100, 100)));
    Parameters root(node);
    const Scene scene = read_scene(root, effect_kinds());
    EXPECT_THROW(root.finish(), InputError) << table;
    for (const EffectPlan& plan : scene.effects) EXPECT_TRUE(plan.misfits(World{&terrain, 1}).empty()) << table;
  }
}

TEST(ElasticEffect, SaysWhatDoesNotFit) {
  const auto tells = [](const std::string& text, const char* part) {
    const std::string faults = fault_of(text);
    EXPECT_NE(faults.find(part), std::string::npos) << text << "\n" << faults;
  };
  tells("[[elastic]]\nball = 1\n", "spacing: is missing");
  tells("[[elastic]]\nball = 1\nspacing = 0.2\nyoungs_modulus = 1000\ndensity = 1000\nyoung_modulus = 3\n", "youngs_modulus");
  tells("[[elastic]]\nball = 1\nspacing = 0.2\nyoungs_modulus = 1000\ndensity = 1000\npoisson_ratio = 0.5\n", "out of range");
  tells("[[elastic]]\nball = 1\nspacing = 1e-3\nyoungs_modulus = 1000\ndensity = 1000\n", "take a wider one");
  tells("[[elastic]]\nbox = [1, 1, 1]\nspacing = 1e-3\nyoungs_modulus = 1000\ndensity = 1000\n", "take a wider one");
  tells("[[elastic]]\nball = 1\nspacing = 0.2\nyoungs_modulus = 1000\ndensity = 1000\npinned_to = \"crane\"\n", "no obstacle of the scene");
  const std::string box = "[[elastic]]\nbox = [1, 1, 1]\nspacing = 0.5\nyoungs_modulus = 1000\ndensity = 1000\n";
  tells(box + "position = [0, 0, 2]\npins = [[0, 0, 9, 1]]\n", "pins[0] holds no point, the nearest starts 6.5 m from it");
  tells(box + "position = [0, 0, -1]\n", "starts up to 1.5 m under the ground");
  EXPECT_EQ(fault_of(box + "position = [0, 0, -1]\nmeets_ground = false\n"), "");
  EXPECT_EQ(fault_of(box + "position = [0, 0, 0]\npins = [[0, 0, -0.5, 0.8]]\n"), "") << "what is held may stand in it";
  tells("[[elastic]]\nfile = \"x.obj\"\nspacing = 0.2\nyoungs_modulus = 1000\ndensity = 1000\n", "not closed");
}

}  // namespace
}  // namespace effuse::flow
