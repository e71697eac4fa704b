#include "flow/effects/lava.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "flow/sph/lava_presets.h"
#include "geometry/base/error.h"
#include "geometry/base/units.h"
#include "geometry/procedural/primitives.h"
#include "geometry/terrain/plane.h"
#include "tests/flow/effects/scene_lines.h"

/// What the table [lava] says, and what it must not say.
namespace effuse::flow {
namespace {

struct Read {
  EffectPlan plan;
  std::string faults;  ///< of the whole scene, unread keys among them
  Node resolved;
};

Read read(const Node& root) {
  Parameters all(root);
  Parameters lava = all.table("lava", "");
  Read r;
  r.plan = read_lava(lava, 60);
  r.resolved = all.resolved();
  try {
    all.finish();
  } catch (const InputError& error) {
    r.faults = error.what();
  }
  return r;
}

/// A vent and a spacing, and what the test is about: that goes before.
Read read(Lines lines) {
  lines.insert(lines.begin(),
               {{"lava.spacing", "1 m"}, {"lava.vent[0].at", "[5, 5]"}, {"lava.vent[0].width", "3 m"}, {"lava.vent[0].rate", "2 m3/s"}});
  return read(scene_of(lines));
}

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

void expect_same(const Node& a, const Node& b, const std::string& path) {
  ASSERT_EQ(a.kind, b.kind) << path;
  EXPECT_EQ(a.text, b.text) << path;
  EXPECT_EQ(a.flag, b.flag) << path;
  EXPECT_EQ(a.integer, b.integer) << path;
  EXPECT_EQ(a.real, b.real) << path;
  ASSERT_EQ(a.items.size(), b.items.size()) << path;
  for (std::size_t i = 0; i < a.items.size(); ++i) expect_same(a.items[i], b.items[i], path + "[]");
  ASSERT_EQ(a.entries.size(), b.entries.size()) << path;
  for (std::size_t i = 0; i < a.entries.size(); ++i) {
    EXPECT_EQ(a.entries[i].first, b.entries[i].first) << path;
    expect_same(a.entries[i].second, b.entries[i].second, path + "." + a.entries[i].first);
  }
}

TEST(ReadLava, IsModernUnlessClassicIsAskedFor) {
  const Read modern = read(Lines{});
  EXPECT_EQ(modern.faults, "");
  EXPECT_EQ(resolved_text(modern.resolved, "lava.model"), "modern");
  EXPECT_NE(resolved_text(modern.resolved, "lava.viscosity_tolerance"), "");
  const Read classic = read({{"lava.model", "classic"}, {"lava.stiffness", "900 m2/s2"}});
  EXPECT_EQ(classic.faults, "");
  EXPECT_EQ(resolved_text(classic.resolved, "lava.stiffness"), "900 m2/s2");
  EXPECT_EQ(resolved_text(classic.resolved, "lava.heat.on"), "");
}

TEST(ReadLava, RefusesVentsThatAreOpenAtOneTimeInOnePlace) {
  const auto second = [](const char* at, const char* start) {
    return read({{"lava.vent[1].at", at}, {"lava.vent[1].width", "1 m"}, {"lava.vent[1].rate", "2 m3/s"}, {"lava.vent[1].start", start}, {"lava.vent[0].stop", "60 s"}}).faults;
  };
  EXPECT_TRUE(contains(second("[6.5, 5]", "0 s"), "vents 1 and 2 are open at one time and 1.5 m apart, wanted 2 m")) << second("[6.5, 5]", "0 s");
  EXPECT_EQ(second("[7.1, 5]", "0 s"), "");
  EXPECT_EQ(second("[6.5, 5]", "60 s"), "") << "one after the other";
  // Fissures that cross.
  const std::string crossing = read({{"lava.vent[1].from", "[4, 0]"}, {"lava.vent[1].to", "[4, 20]"}, {"lava.vent[1].width", "1 m"}, {"lava.vent[1].rate", "1 m3/s"},
                                     {"lava.vent[2].from", "[-9, 15]"}, {"lava.vent[2].to", "[9, 15]"}, {"lava.vent[2].width", "1 m"}, {"lava.vent[2].rate", "1 m3/s"}})
                                   .faults;
  EXPECT_TRUE(contains(crossing, "vents 2 and 3 are open at one time and 0 m apart")) << crossing;
}

TEST(ReadLava, APresetBringsDensityHeatRheologyAndTheVentsTemperature) {
  for (const sph::LavaPreset& preset : sph::lava_presets()) {
    const Read r = read({{"lava.preset", std::string(preset.name)}});
    EXPECT_EQ(r.faults, "") << preset.name;
    const auto value = [&](const std::string& path, const char* unit) { return parse_quantity(resolved_text(r.resolved, path), unit); };
    EXPECT_EQ(value("lava.density", "kg/m3"), preset.density);
    EXPECT_EQ(resolved_text(r.resolved, "lava.heat.on"), "true");
    EXPECT_EQ(value("lava.heat.heat_capacity", "J/(kg K)"), preset.heat_capacity);
    EXPECT_EQ(value("lava.heat.latent_heat", "J/kg"), preset.latent_heat_released());
    EXPECT_EQ(value("lava.heat.solidus", "K"), preset.solidus);
    EXPECT_EQ(value("lava.heat.liquidus", "K"), preset.eruption_temperature);
    EXPECT_EQ(value("lava.heat.conductivity", "W/(m K)"), preset.conductivity);
    EXPECT_EQ(value("lava.heat.convection", "W/(m2 K)"), preset.convection);
    EXPECT_EQ(value("lava.rheology.b", "K"), preset.melt.B);
    const Node& vent = r.resolved.find("lava")->find("vent")->items.at(0);
    EXPECT_EQ(parse_quantity(vent.find("temperature")->text, "K"), preset.eruption_temperature);
  }
}

TEST(ReadLava, WhatStandsInTheSceneGoesBeforeThePreset) {
  const Read r =
      read({{"lava.preset", "etna"}, {"lava.density", "2000"}, {"lava.heat.convection", "70"}, {"lava.vent[0].temperature", "1050 degC"}});
  EXPECT_EQ(r.faults, "");
  EXPECT_EQ(resolved_text(r.resolved, "lava.density"), "2000 kg/m3");
  EXPECT_EQ(resolved_text(r.resolved, "lava.heat.convection"), "70 W/(m2 K)");
  EXPECT_EQ(parse_quantity(r.resolved.find("lava")->find("vent")->items.at(0).find("temperature")->text, "K"), 1323.15);
}

TEST(ReadLava, ComputesHeatForAPresetOrAHeatTableOnly) {
  EXPECT_EQ(resolved_text(read(Lines{}).resolved, "lava.heat.on"), "false");
  EXPECT_EQ(resolved_text(read({{"lava.rheology.viscosity", "500"}}).resolved, "lava.heat.on"), "false");
  EXPECT_EQ(resolved_text(read({{"lava.heat.emissivity", "0.9"}}).resolved, "lava.heat.on"), "true");
  EXPECT_EQ(resolved_text(read({{"lava.preset", "etna"}, {"lava.heat.on", "false"}}).resolved, "lava.heat.on"), "false");
}

TEST(ReadLava, WhatIsResolvedReadsTheSame) {
  for (const char* preset : {"none", "etna", "kilauea-fissure8"}) {
    const Read first = read({{"lava.preset", preset}, {"lava.crust_viscosity", "1e8"}, {"lava.heat.emissivity_law", "thompson_ramsey"}});
    ASSERT_EQ(first.faults, "");
    const Read again = read(first.resolved);
    EXPECT_EQ(again.faults, "");
    expect_same(again.resolved, first.resolved, "");
    EXPECT_EQ(again.plan.estimate.steps, first.plan.estimate.steps);
  }
}

TEST(ReadLava, EstimatesAreFiniteAndGrowWithResolution) {
  const auto estimate = [](const char* preset, const char* spacing) {
    Lines lines = {{"lava.preset", preset},
                   {"lava.spacing", spacing},
                   {"lava.vent[0].at", "[5, 5]"},
                   {"lava.vent[0].width", "3 m"},
                   {"lava.vent[0].rate", "2 m3/s"}};
    return read(scene_of(lines)).plan.estimate;
  };
  for (const char* preset : {"none", "etna", "kilauea-mauna-ulu"}) {
    const Estimate coarse = estimate(preset, "1 m"), fine = estimate(preset, "0.5 m");
    EXPECT_NEAR(coarse.particles, 120, 1e-9);
    EXPECT_NEAR(fine.particles, 8 * coarse.particles, 1e-6);
    for (const Estimate& e : {coarse, fine})
      EXPECT_TRUE(e.steps > 0 && e.seconds > 0 && e.bytes > 0 && std::isfinite(e.steps + e.seconds + e.bytes)) << preset;
    EXPECT_GT(fine.seconds, 8 * coarse.seconds);
  }
}

struct Wrong {
  const char* name;
  Lines lines;
  const char* told;
};
void PrintTo(const Wrong& w, std::ostream* out) { *out << w.name; }
class ReadLavaFaults : public testing::TestWithParam<Wrong> {};

TEST_P(ReadLavaFaults, AreTold) {
  const Read r = read(GetParam().lines);
  EXPECT_TRUE(contains(r.faults, GetParam().told)) << r.faults;
}

INSTANTIATE_TEST_SUITE_P(
    , ReadLavaFaults,
    testing::Values(
        Wrong{"model", {{"lava.model", "clasic"}}, "did you mean 'classic'?"},
        Wrong{"preset", {{"lava.preset", "etnna"}}, "did you mean 'etna'?"},
        Wrong{"classic_parameter", {{"lava.stiffness", "900"}}, "lava.stiffness: is of the classic model"},
        Wrong{"modern_parameter", {{"lava.model", "classic"}, {"lava.preset", "etna"}}, "model = \"modern\" would do"},
        Wrong{"unknown_in_heat", {{"lava.heat.conductivty", "2"}}, "did you mean 'conductivity'?"},
        Wrong{"melting_range",
              {{"lava.heat.solidus", "1200 degC"}, {"lava.heat.liquidus", "1100 degC"}},
              "lava.heat.liquidus: the liquidus, 1373.15 K, is below"},
        Wrong{"emissivity", {{"lava.heat.emissivity", "2"}}, "lava.heat.emissivity: 2 is out of range"},
        Wrong{"dimension", {{"lava.heat.ground_conductivity", "2 m2/s"}}, "lava.heat.ground_conductivity: "},
        Wrong{"tolerance", {{"lava.viscosity_tolerance", "0"}}, "lava.viscosity_tolerance: 0 is out of range"},
        Wrong{"coupling", {{"lava.coupling", "0"}}, "lava.coupling: 0 is out of range"},
        Wrong{"diffusion",
              {{"lava.heat.conductivity", "1e4"}, {"lava.density", "1"}, {"lava.heat.heat_capacity", "1"}, {"lava.max_step", "1e4 s"}},
              "heat would cross"},
        Wrong{"particles",
              {{"lava.vent[0].start", "0 s"}, {"lava.vent[1].at", "[5, 5]"}, {"lava.vent[1].width", "3"}, {"lava.vent[1].rate", "1e12"}},
              "particles of this size"},
        Wrong{"rest_period", {{"lava.rest_period", "1e-9 s"}}, "lava.rest_period: must be 0 s"}),
    [](const testing::TestParamInfo<Wrong>& i) { return std::string(i.param.name); });

TEST(ReadLava, RefusesParticlesTooLargeForTheGroundOrForAVent) {
  const geometry::Terrain ground = geometry::Terrain::from_height_field(geometry::make_plane(Vec2(40, 40), 0, 0, 8), {}, 288);
  World world;
  world.terrain = &ground;
  const auto faults_of = [&](const char* spacing, const char* width) {
    Read r = read(scene_of({{"lava.spacing", spacing}, {"lava.vent[0].at", "[5, 5]"}, {"lava.vent[0].width", width}, {"lava.vent[0].rate", "2 m3/s"}}));
    EXPECT_EQ(r.faults, "");
    return r.plan.misfits(world);
  };
  for (const char* spacing : {"1.8e9", "1e300", "11 m"}) {
    const std::vector<Fault> faults = faults_of(spacing, "3 m");
    ASSERT_EQ(faults.size(), 1u) << spacing;
    EXPECT_TRUE(contains(faults[0].message, "on a terrain 40 m across, wanted at least 4 side by side: 10 m or less")) << faults[0].message;
    EXPECT_GT(faults[0].place.line, 0);
  }
  EXPECT_EQ(faults_of("9 m", "3 m").size(), 0u);
  const std::vector<Fault> faults = faults_of("9 m", "1 m");
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_TRUE(contains(faults[0].message, "from a vent 1 m across")) << faults[0].message;
}

TEST(ReadLava, RefusesAVentWithSomethingOverIt) {
  const geometry::Terrain ground = geometry::Terrain::from_height_field(geometry::make_plane(Vec2(40, 40), 0, 0, 8), {}, 288);
  const geometry::TriMesh box = geometry::make_box(Vec3::Constant(-1), Vec3::Constant(1));
  const auto told = [&](const Vec3& at, bool moves, const char* start) {
    std::vector<PlacedObstacle> obstacles;
    std::vector<PlacedBody> bodies(moves ? 1 : 0);
    geometry::PoseKey key;
    key.pose.position = at;
    if (!moves) obstacles.push_back({"box", geometry::CollisionMesh(box), geometry::PoseTrack(std::vector<geometry::PoseKey>{key})});
    for (PlacedBody& body : bodies) body.name = "box", body.mesh = box, body.pose.position = at;
    std::string text;
    for (const Fault& fault : read({{"lava.vent[0].start", start}}).plan.misfits({.terrain = &ground, .obstacles = &obstacles, .bodies = &bodies})) text += fault.message + "\n";
    return text;
  };
  // The vent is 3 m across about (5, 5), particles are 1 m apart: the outermost of its sites lie 1 m off its middle.
  for (const bool moves : {false, true}) {
    const std::string kind = moves ? "body" : "obstacle";
    EXPECT_TRUE(contains(told(Vec3(5, 5, 0.5), moves, "0 s"), kind + " 'box' is over the vent when it opens")) << told(Vec3(5, 5, 0.5), moves, "0 s");
    EXPECT_TRUE(contains(told(Vec3(7.5, 5, 0.5), moves, "0 s"), kind + " 'box' is 0.5 m from the vent when it opens")) << told(Vec3(7.5, 5, 0.5), moves, "0 s");
    EXPECT_EQ(told(Vec3(9.5, 5, 0.5), moves, "0 s"), "");
    EXPECT_EQ(told(Vec3(5, 5, 0.5), moves, "10 s") == "", moves) << "where a body will be by then nobody knows";
  }
}

TEST(ReadLava, RefusesBodiesAHundredTimesSmallerThanAParticle) {
  const geometry::Terrain ground = geometry::Terrain::from_height_field(geometry::make_plane(Vec2(40, 40), 0, 0, 8), {}, 288);
  for (const Real edge : {0.005, 0.02}) {
    std::vector<PlacedBody> bodies(1);
    bodies[0].name = "speck";
    bodies[0].mesh = geometry::make_box(Vec3::Zero(), Vec3::Constant(edge));
    bodies[0].pose.position = Vec3(-15, 0, 1);
    const std::vector<Fault> faults = read(Lines{}).plan.misfits({.terrain = &ground, .bodies = &bodies});
    ASSERT_EQ(faults.size(), edge < 0.01 ? 1u : 0u);
    if (!faults.empty()) {
      EXPECT_TRUE(contains(faults[0].message, "particles of 1 m beside body 'speck', 0.00866 m across")) << faults[0].message;
    }
  }
}

TEST(ReadLava, ToldFaultsAreAllOfThemAtOnce) {
  const Read r =
      read({{"lava.support", "9"}, {"lava.heat.convection", "-1"}, {"lava.rheology.law", "vtf"}, {"lava.vent[0].start", "-2 s"}});
  for (const char* key : {"lava.support", "lava.heat.convection", "lava.rheology.law", "lava.vent[0].start"})
    EXPECT_TRUE(contains(r.faults, key)) << key << "\n" << r.faults;
}

TEST(ReadLava, DocumentsEveryParameterItReads) {
  const Node root = scene_of({{"lava.vent[0].rate", "1"}});
  Parameters all(root);
  Parameters lava = all.table("lava", "");
  read_lava(lava, 1);
  std::string documented;
  for (const ParameterDoc& doc : all.docs()) documented += doc.path + " ";
  for (const char* path : {"lava.model", "lava.preset", "lava.spacing", "lava.heat.on", "lava.heat.latent_heat",
                           "lava.heat.ground_conductance", "lava.rheology.law", "lava.crust_viscosity", "lava.crust_strength",
                           "lava.slip_length", "lava.sleep_pace", "lava.sleep_delay", "lava.viscosity_tolerance", "lava.vent[].rate"})
    EXPECT_TRUE(contains(documented, std::string(path) + " ")) << path;
}

}  // namespace
}  // namespace effuse::flow
