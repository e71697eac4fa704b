#include <gtest/gtest.h>

#include <cmath>

#include "flow/effects/lava_in_water.h"
#include "geometry/mesh/measure.h"
#include "tests/flow/effects/effect_scene.h"

namespace effuse::flow {
namespace {

constexpr Real kSlope = 0.05;  // the plane falls towards +x: water lies there
const std::string kWaves = "[[waves]]\nlevel = 0\ncell = 0.5\n";
const std::string kStone = "[[waves.source]]\nat = [10, 0]\nradius = 1\nvolume = 0.5\n";
// Comes out under 0.8 m of water.
constexpr const char* kLava = "[lava]\nspacing = 0.5\npreset = \"etna\"\n[[lava.vent]]\nat = [16, 0]\nwidth = 3\nrate = 3\n";

TEST(WavesEffect, AStoneMakesARingThatGrowsAsShallowWaterSays) {
  EffectScene scene(kWaves + "border = \"mirror\"\ndeepest = 0.5\n" + kStone, kSlope);
  scene.frames(24);
  EXPECT_NEAR(scene.figure("waves", "volume_m3"), 0.5, 1e-9);
  // c = sqrt(g 0.5 m) = 2.2 m/s: the crest is 2 to 3 m out after a second.
  const geometry::TriMesh mesh = scene.effect("waves").meshes()[0].mesh;
  Real highest = 0, at = 0;
  for (const Vec3& p : mesh.positions)
    if (p.z() > highest) highest = p.z(), at = (p.head<2>() - Vec2(10, 0)).norm();
  EXPECT_NEAR(at, 2.2, 0.8);
  EXPECT_GT(highest, 0.01);
}

TEST(WavesEffect, ItsMeshEndsInTheGround) {
  EffectScene scene(kWaves, kSlope);
  const geometry::TriMesh mesh = scene.effect("waves").meshes()[0].mesh;
  const Box3 box = geometry::bounds(mesh);
  EXPECT_LT(box.min().x(), 0);  // the shore: beyond it by two cells at most
  EXPECT_GT(box.min().x(), -1.26);
  EXPECT_NEAR(box.min().z(), 0, 1e-12);
  EXPECT_NEAR(box.max().z(), 0, 1e-12);
  for (const char* name : {"velocity", "color", "water"}) EXPECT_TRUE(mesh.attributes.contains(name)) << name;
}

TEST(WavesEffect, BeyondCourantOneItSwitchesOrRefuses) {
  EffectScene own(kWaves, kSlope), longer(kWaves + "step = 0.5\n" + kStone, kSlope);
  EXPECT_EQ(own.figure("waves", "implicit"), 0);
  EXPECT_TRUE(contains(own.effect("waves").remarks().at(0), "the explicit scheme"));
  EXPECT_EQ(longer.figure("waves", "implicit"), 1);
  EXPECT_TRUE(contains(longer.effect("waves").remarks().at(0), "the implicit scheme"));
  longer.frames(24);
  EXPECT_LT(longer.figure("waves", "highest_m"), 0.5);
  EXPECT_TRUE(contains(fault_of(kWaves + "scheme = \"explicit\"\nstep = 0.5\n", kSlope), "explicit scheme stands at most 1"));
  EXPECT_EQ(fault_of(kWaves + "scheme = \"explicit\"\nstep = 0.05\n", kSlope), "");
}

TEST(WavesEffect, LavaLiftsTheWaterByWhatGoesUnder) {
  EffectScene scene(kWaves + "border = \"mirror\"\n" + kLava, kSlope);
  scene.frames(24);
  const double displaced = scene.figure("waves", "displaced_m3");
  EXPECT_GT(displaced, 0.5);
  EXPECT_NEAR(scene.figure("waves", "volume_m3"), displaced, 1e-9 * displaced);
  EXPECT_LE(displaced, scene.figure("lava", "volume_m3") + 1e-9);
  EXPECT_GT(scene.figure("waves", "energy_m4_s2"), 0);
}

TEST(WavesEffect, LavaUnderThemIsQuenched) {
  EffectScene wet(kWaves + kLava, kSlope), dry(kLava, kSlope), still(kWaves + "boiling = 0\n" + kLava, kSlope);
  for (EffectScene* each : {&wet, &dry, &still}) each->frames(72);
  EXPECT_GT(wet.figure("lava", "quenched_J"), 0);
  const auto lost = [](const EffectScene& s) { return s.figure("lava", "radiated_J") + s.figure("lava", "convected_J"); };
  EXPECT_GT(lost(wet), 1.2 * lost(dry)) << wet.figure("lava", "quenched_J");
  EXPECT_NEAR(lost(still), lost(dry), 1e-9 * lost(dry));
  EXPECT_LE(wet.figure("lava", "quenched_J"), lost(wet));
  // The budget closes as without water.
  const auto gap = [](const EffectScene& s) { return s.figure("lava", "vent_J") + s.figure("lava", "viscous_J") - s.figure("lava", "stored_J") - s.figure("lava", "radiated_J") - s.figure("lava", "convected_J") - s.figure("lava", "ground_J") - s.figure("lava", "left_J"); };
  EXPECT_LT(std::abs(gap(wet)), 1e-9 * wet.figure("lava", "vent_J"));
}

TEST(WavesEffect, SteamComesWhereLavaMeetsThem) {
  const std::string steam = "[[particles]]\npreset = \"steam\"\n[[particles.emitter]]\nfrom = \"water\"\nrate = 100\nspeed = 0\nspread = 0\n";
  EffectScene scene(kWaves + kLava + steam, kSlope);
  scene.frames(16);
  EXPECT_GT(scene.figure("steam", "born"), 20);
  // The same lava, and water that it does not reach.
  EffectScene apart("[[waves]]\nlevel = -0.9\ncell = 0.5\n" + std::string(kLava) + steam, kSlope);
  apart.frames(16);
  EXPECT_EQ(apart.figure("steam", "born"), 0);
}

TEST(WavesEffect, GoesOnToTheSameBits) {
  EXPECT_TRUE(resumes(kWaves + kStone + "[[waves.source]]\nat = [15, 5]\nradius = 1\nvolume = 0.2\nperiod = 0.7\n", 9, 9, kSlope));
  EXPECT_TRUE(resumes(kWaves + kLava + "[[particles]]\npreset = \"steam\"\n[[particles.emitter]]\nfrom = \"water\"\nrate = 100\n", 9, 9, kSlope));
}

TEST(WavesEffect, SaysWhatDoesNotFit) {
  EXPECT_TRUE(contains(fault_of("[[waves]]\nlevel = -9\ncell = 0.5\n", kSlope), "there is no water"));
  EXPECT_TRUE(contains(fault_of("[[waves]]\ncell = 0.5\n", kSlope), "level"));
  EXPECT_TRUE(contains(fault_of("[[waves]]\nlevel = 0\ncell = 0.001\n", kSlope), "at most 2e+07"));
  EXPECT_TRUE(contains(fault_of("[[waves]]\nlevel = 0\ncell = 30\n", kSlope), "at least 3 x 3"));
  EXPECT_TRUE(contains(fault_of("[[waves]]\nlevel = 0\ncell = 0.5\nregion = [5, 5, 0, 0]\n", kSlope), "second corner above the first"));
  EXPECT_TRUE(contains(fault_of("[[waves]]\nlevel = 0\ncell = 0.5\nborders = \"mirror\"\n", kSlope), "border"));
  EXPECT_TRUE(contains(fault_of("[[waves]]\nlevel = 0\ncell = 0.5\nborder = \"miror\"\n", kSlope), "mirror"));
}

TEST(LavaInWater, PutsAllOfWhatIsUnderOnWaterCells) {
  const std::vector<Vec3> x = {Vec3(2.5, 2.5, -1), Vec3(2.5, 2.5, 0), Vec3(2.5, 2.5, 5), Vec3(9.5, 2.5, -1), Vec3(-3, 0, -1)};
  FlowView lava;
  lava.x = x;
  lava.spacing = 0.5;
  const PlanCells cells{Vec2::Zero(), 1, 10, 5};
  std::vector<Real> level(50, 0);
  for (std::size_t c = 0; c < 50; ++c)
    if (c % 10 >= 8) level[c] = std::nan("");  // land
  const std::vector<Real> volume = lava_under(lava, cells, level);
  Real sum = 0;
  for (std::size_t c = 0; c < 50; ++c) {
    sum += volume[c];
    if (c % 10 >= 8) {
      EXPECT_EQ(volume[c], 0);
    }
  }
  // One whole, one half; one above, one on land, one beside.
  EXPECT_NEAR(sum, 1.5 * 0.125, 1e-12);
}

TEST(OceanEffect, ItsMeshIsTheSeaOfTheMoment) {
  EffectScene scene("[ocean]\nlevel = 0\ncell = 1\nhorizon = false\n[[ocean.wave]]\namplitude = 0.3\nwavelength = 10\n", kSlope);
  scene.frames(6);
  const geometry::TriMesh mesh = scene.effect("ocean").meshes()[0].mesh;
  // omega^2 = g k; a point at rest at x stands where Gerstner says.
  const Real k = 2 * kPi / 10, omega = std::sqrt(kGravity * k);
  Real worst = 0;
  for (const Vec3& p : mesh.positions) {
    const Real z = p.z() / 0.3;
    worst = std::max(worst, std::abs(z) - 1);
  }
  EXPECT_LE(worst, 1e-9);
  EXPECT_GT(omega, 0);
  EXPECT_NEAR(scene.figure("ocean", "highest_m"), 0.3, 0.02);
  const Water* water = scene.effect("ocean").water();
  ASSERT_NE(water, nullptr);
  EXPECT_NEAR(*water->surface(Vec2(15, 3)), *water->surface(Vec2(15, -9)), 1e-9);  // long-crested along y
  std::vector<Vec3> x = {Vec3(15, 3, -0.31), Vec3(15, 3, 0.31)};
  std::vector<std::uint8_t> wet(2, 0);
  water->wet(x, wet);
  EXPECT_EQ(wet[0], 1);
  EXPECT_EQ(wet[1], 0);
  EXPECT_FALSE(water->surface(Vec2(100, 0)).has_value());
}

TEST(OceanEffect, TheHorizonIsFarAndCalm) {
  EffectScene scene("[ocean]\nlevel = 0\ncell = 2\nwind = 5\n", kSlope);
  scene.frames(3);
  const geometry::TriMesh mesh = scene.effect("ocean").meshes()[0].mesh;
  EXPECT_GT(geometry::bounds(mesh).sizes().x(), 60 * 40);
  for (const Vec3& p : mesh.positions)
    if (p.head<2>().norm() > 1000) {
      EXPECT_NEAR(p.z(), 0, 1e-9);
    }
  EXPECT_GT(geometry::surface_area(mesh), 0);
}

TEST(OceanEffect, QuenchesLavaAndSteams) {
  EffectScene scene(std::string("[ocean]\nlevel = 0\ncell = 1\nwind = 2\n") + kLava + "[[particles]]\npreset = \"steam\"\n[[particles.emitter]]\nfrom = \"water\"\nwater = \"ocean\"\nrate = 100\n", kSlope);
  scene.frames(60);
  EXPECT_GT(scene.figure("lava", "quenched_J"), 0);
  EXPECT_GT(scene.figure("steam", "born"), 0);
}

TEST(OceanEffect, SaysWhatDoesNotFit) {
  EXPECT_TRUE(contains(fault_of("[ocean]\ncell = 1\n"), "level"));
  EXPECT_TRUE(contains(fault_of("[ocean]\nlevel = 0\ncell = 0.001\n"), "at most 4e+06"));
  EXPECT_TRUE(contains(fault_of("[ocean]\nlevel = 0\ncell = 1\nwnid = 3\n"), "wind"));
  EXPECT_TRUE(contains(fault_of("[ocean]\nlevel = 0\ncell = 1\n[[ocean.wave]]\namplitude = 1\n"), "wavelength"));
}

TEST(SmokeEffectSlow, RisesOverItsSourceAndOverHotLava) {
  const std::string smoke = "[[smoke]]\nbox = [-4, -4, -1, 4, 4, 7]\ncell = 0.5\nstep = 0.1\n";
  EffectScene scene(smoke + "[[smoke.source]]\nat = [0, 0, 1]\nradius = 1\n");
  scene.frames(24);
  const geometry::GridVolume v = scene.effect("smoke").volumes().at(0);
  EXPECT_EQ(v.n, (std::array<int, 3>{16, 16, 16}));
  EXPECT_EQ(scene.figure("smoke", "solid_cells"), 16 * 16 * 2);
  EXPECT_GT(v.density[v.index(8, 8, 5)], 0.1f);
  EXPECT_GT(v.velocity[3 * v.index(8, 8, 5) + 2], 0.2f);
  EXPECT_GT(v.temperature[v.index(8, 8, 4)], 320.0f);
  EXPECT_LT(scene.figure("smoke", "divergence_1_s"), 1e-2);
  EffectScene lava(std::string("[lava]\nspacing = 0.5\npreset = \"etna\"\n[[lava.vent]]\nat = [0, 0]\nwidth = 2\nrate = 4\n") + smoke + "lava_smoke = 0.5\nlava_convection = 75\n");
  lava.frames(24);
  EXPECT_GT(lava.figure("smoke", "mass"), 0.5);
  EXPECT_GT(lava.figure("smoke", "fastest_m_s"), 0.05);
  EffectScene vent(std::string("[lava]\nspacing = 0.5\npreset = \"etna\"\n[[lava.vent]]\nat = [0, 0]\nwidth = 2\nrate = 4\n") + smoke + "[[smoke.source]]\nfrom = \"vent\"\n");
  vent.frames(12);
  EXPECT_GT(vent.figure("smoke", "mass"), 0.1);
}

TEST(SmokeEffect, GoesOnToTheSameBits) {
  EXPECT_TRUE(resumes("[[smoke]]\nbox = [-4, -4, 0, 4, 4, 6]\ncell = 0.5\nwarm_up = 0.2\nwind = [1, 0, 0]\n[[smoke.source]]\nat = [0, 0, 1]\nradius = 1\n", 4, 4));
}

TEST(SmokeEffect, SaysWhatDoesNotFit) {
  const std::string source = "[[smoke.source]]\nat = [0, 0, 1]\nradius = 1\n";
  EXPECT_TRUE(contains(fault_of("[[smoke]]\nbox = [-4, -4, 0, 4, 4, 6]\ncell = 0.5\n"), "smoke[0].source: is missing"));
  EXPECT_TRUE(contains(fault_of("[[smoke]]\nbox = [-4, -4, 0, 4, -4, 6]\ncell = 0.5\n" + source), "high corner above the low one"));
  EXPECT_TRUE(contains(fault_of("[[smoke]]\nbox = [-4, -4, 0, 4, 4, 6]\ncell = 0.001\n" + source), "at most 2e+07"));
  EXPECT_TRUE(contains(fault_of("[[smoke]]\nbox = [-4, -4, -6, 4, 4, -1]\ncell = 0.5\n" + source), "wholly in the ground"));
  EXPECT_TRUE(contains(fault_of("[[smoke]]\nbox = [-4, -4, 0, 4, 4, 6]\ncell = 0.5\nlava_smoke = 1\n"), "the scene has no [lava]"));
  EXPECT_TRUE(contains(fault_of("[[smoke]]\nbox = [-4, -4, 0, 4, 4, 6]\ncell = 0.5\nswirll = 1\n" + source), "swirl"));
  EXPECT_TRUE(contains(fault_of("[[smoke]]\nbox = [-4, -4, 0, 4, 4, 6]\ncell = 0.5\n[[smoke.source]]\nfrom = \"vent\"\n"), "the scene has no [lava]"));
}

TEST(OtherEffects, OnlyWhatIsNamedIsBuilt) {
  for (const std::string& text : {std::string(kLava), "[[springs]]\npoints = 3\nposition = [0, 0, 2]\nmass = 1\nstiffness = 100\n" + kWaves}) {
    EffectScene scene(text, kSlope);
    std::size_t named = 0;
    for (const EffectPlan& plan : scene.scene.effects) named += contains(text, "[" + plan.kind + "]");
    EXPECT_EQ(named, scene.scene.effects.size());
    EXPECT_EQ(scene.simulation->effects().size(), named);
  }
  EffectScene lava(kLava, kSlope);
  lava.frames(2);
  EXPECT_TRUE(lava.effect("lava").clouds().empty());
  EXPECT_TRUE(lava.effect("lava").volumes().empty());
}

}  // namespace
}  // namespace effuse::flow
