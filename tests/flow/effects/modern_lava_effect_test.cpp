#include "flow/effects/modern_lava_effect.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>

#include "flow/effects/lava.h"
#include "flow/sph/enthalpy.h"
#include "flow/sph/lava_presets.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "tests/flow/effects/scene_lines.h"

/// The modern lava as a scene's effect, on a slope of a few metres.
namespace effuse::flow {
namespace {

/// 16 m by 16 m, falling towards +x; 15 degC.
geometry::Terrain slope(Real grade) {
  constexpr int kPosts = 9;
  std::vector<Real> z;
  for (int j = 0; j < kPosts; ++j)
    for (int i = 0; i < kPosts; ++i) z.push_back(grade * 2 * (kPosts - 1 - i));
  return geometry::Terrain::from_height_field(geometry::HeightField(Vec2::Zero(), Vec2(2, 2), kPosts, kPosts, z), {}, 288.15);
}

/// A vent near the upper end; what lines say goes before.
std::unique_ptr<Effect> build(const geometry::Terrain& terrain, Lines lines) {
  lines.insert(lines.begin(),
               {{"lava.spacing", "0.5 m"}, {"lava.vent[0].at", "[4, 8]"}, {"lava.vent[0].width", "2 m"}, {"lava.vent[0].rate", "5 m3/s"}});
  const Node root = scene_of(lines);
  Parameters all(root);
  Parameters lava = all.table("lava", "");
  const EffectPlan plan = read_lava(lava, 10);
  all.finish();
  return plan.build({&terrain, 7});
}

void run_to(Effect& effect, Real t) {
  while (effect.time() < t) effect.step(t);
}

std::map<std::string, double> figures(const Effect& effect) {
  std::map<std::string, double> all;
  for (const auto& [key, value] : effect.figures()) all[key] = value;
  return all;
}

std::string hash(const Effect& effect) {
  StateHash h;
  effect.add_to(h);
  return h.hex();
}

/// Heat the figures do not account for, as a share of what was lost.
double unaccounted(const std::map<std::string, double>& f) {
  const double lost = f.at("radiated_J") + f.at("convected_J") + f.at("ground_J");
  return std::abs(f.at("vent_J") + f.at("viscous_J") - f.at("stored_J") - lost - f.at("left_J")) / lost;
}

TEST(ModernLavaEffect, RemarksThatWhatComesOutIsCrustAlready) {
  const geometry::Terrain terrain = slope(0.1);
  EXPECT_TRUE(build(terrain, {{"lava.preset", "etna"}})->remarks().empty());
  EXPECT_TRUE(build(terrain, {{"lava.vent[0].temperature", "1300 K"}})->remarks().empty()) << "it has no crust";
  const auto remarks = build(terrain, {{"lava.preset", "etna"}, {"lava.vent[0].temperature", "1300 K"}})->remarks();
  ASSERT_EQ(remarks.size(), 1u);
  EXPECT_NE(remarks[0].find("comes out at 1300 K, not above heat.crust_temperature"), std::string::npos) << remarks[0];
}

TEST(ModernLavaEffect, GivesTheFiguresThatTheSeriesReads) {
  const geometry::Terrain terrain = slope(0.3);
  const auto effect = build(terrain, {{"lava.preset", "etna"}});
  run_to(*effect, 1);
  const auto f = figures(*effect);
  for (const char* name : {"particles",
                           "volume_m3",
                           "mass_emitted_kg",
                           "mass_present_kg",
                           "mass_left_kg",
                           "steps",
                           "smallest_step_s",
                           "retries",
                           "max_speed_m_s",
                           "awake",
                           "pressure_iterations",
                           "viscosity_iterations",
                           "density_error",
                           "min_temperature_K",
                           "mean_temperature_K",
                           "max_temperature_K",
                           "radiated_J",
                           "convected_J",
                           "ground_J",
                           "vent_J",
                           "stored_J",
                           "viscous_J",
                           "left_J"})
    ASSERT_TRUE(f.contains(name) && std::isfinite(f.at(name))) << name;
  EXPECT_NEAR(f.at("particles"), 40, 13) << "5 m3 of 0.125 m3, one each of 13 sites";
  EXPECT_EQ(f.at("volume_m3"), effect->volume());
  EXPECT_EQ(f.at("mass_present_kg"), f.at("mass_emitted_kg"));
  EXPECT_NEAR(f.at("mass_present_kg"), 2600 * effect->volume(), 1e-9 * f.at("mass_present_kg"));
  EXPECT_LE(f.at("max_temperature_K"), 1360 + 1);
  EXPECT_LT(f.at("min_temperature_K"), f.at("mean_temperature_K"));
  EXPECT_GE(f.at("viscosity_iterations"), 1);
  EXPECT_EQ(effect->points().size(), static_cast<std::size_t>(f.at("particles")));
  EXPECT_FALSE(effect->status().empty());
}

TEST(ModernLavaEffect, HeatBudgetClosesToRounding) {
  const geometry::Terrain terrain = slope(0.3);
  // Of two vents of different temperature; awake, and asleep after a while.
  const auto effect = build(terrain, {{"lava.preset", "etna"},
                                      {"lava.vent[0].stop", "2 s"},
                                      {"lava.vent[1].at", "[4, 11]"},
                                      {"lava.vent[1].width", "1 m"},
                                      {"lava.vent[1].rate", "1 m3/s"},
                                      {"lava.vent[1].stop", "3 s"},
                                      {"lava.vent[1].temperature", "1000 degC"},
                                      {"lava.sleep_pace", "30 s"},
                                      {"lava.sleep_delay", "1 s"}});
  for (const Real t : {1.0, 3.0, 6.0, 30.0}) {
    run_to(*effect, t);
    const auto f = figures(*effect);
    EXPECT_GT(f.at("radiated_J"), 0);
    EXPECT_GT(f.at("ground_J"), 0);
    EXPECT_LT(unaccounted(f), 1e-6) << "of what was lost, at " << t << " s";
    EXPECT_EQ(f.at("left_J"), 0);
  }
  EXPECT_LT(figures(*effect).at("awake"), figures(*effect).at("particles")) << "else sleep was not tried";

  // What the vents brought, by count of hot and of cooler particles.
  const sph::LavaPreset& etna = *sph::find_lava_preset("etna");
  const sph::EnthalpyCurve curve{etna.heat_capacity, etna.latent_heat_released(), etna.solidus, etna.eruption_temperature};
  const auto f = figures(*effect);
  const double least = f.at("mass_emitted_kg") * curve.enthalpy(1273.15), most = f.at("mass_emitted_kg") * curve.enthalpy(1360);
  EXPECT_GT(f.at("vent_J"), least);
  EXPECT_LT(f.at("vent_J"), most);
}

TEST(ModernLavaEffect, LavaThatLeavesTakesItsHeatAlong) {
  const geometry::Terrain terrain = slope(0.6);
  const auto effect = build(terrain, {{"lava.preset", "kilauea-mauna-ulu"}, {"lava.vent[0].at", "[12, 8]"}, {"lava.vent[0].stop", "3 s"}});
  run_to(*effect, 6);
  const auto f = figures(*effect);
  ASSERT_GT(f.at("mass_left_kg"), 0);
  EXPECT_LT(unaccounted(f), 1e-6);
  const sph::LavaPreset& lava = *sph::find_lava_preset("kilauea-mauna-ulu");
  const sph::EnthalpyCurve curve{lava.heat_capacity, lava.latent_heat_released(), lava.solidus, lava.eruption_temperature};
  const double each = f.at("left_J") / f.at("mass_left_kg");
  EXPECT_LT(each, curve.enthalpy(lava.eruption_temperature + 1));
  EXPECT_GT(each, curve.enthalpy(f.at("min_temperature_K") - 20)) << "lava that has run a few metres is about as warm as what is left";
}

TEST(ModernLavaEffect, WithoutHeatNothingOfItIsComputed) {
  const geometry::Terrain terrain = slope(0.3);
  const auto effect = build(terrain, {{"lava.preset", "etna"}, {"lava.heat.on", "false"}, {"lava.vent[0].temperature", "1300 K"}});
  run_to(*effect, 1);
  const auto f = figures(*effect);
  for (const char* name : {"radiated_J", "vent_J", "stored_J"}) EXPECT_FALSE(f.contains(name)) << name;
  EXPECT_EQ(f.at("min_temperature_K"), 1300);
  EXPECT_EQ(f.at("max_temperature_K"), 1300);
}

TEST(ModernLavaEffect, SavedAndLoadedGoesOnToTheSameBitsAndFigures) {
  const geometry::Terrain terrain = slope(0.3);
  const Lines lines = {{"lava.preset", "etna"}, {"lava.crust_viscosity", "1e7"}};
  const auto whole = build(terrain, lines), broken = build(terrain, lines);
  run_to(*whole, 0.7);
  StateWriter out;
  whole->save(out);
  StateReader in(out.bytes(), "state");
  broken->load(in);
  run_to(*whole, 1.5);
  run_to(*broken, 1.5);
  EXPECT_EQ(hash(*broken), hash(*whole));
  EXPECT_EQ(broken->figures(), whole->figures());
}

TEST(ModernLavaEffect, HasTheSameBitsOnAnyNumberOfThreads) {
  const geometry::Terrain terrain = slope(0.3);
  std::vector<std::string> hashes;
  std::vector<std::vector<std::pair<std::string, double>>> all;
  for (const int threads : {1, 4}) {
    const ThreadLimit limit(threads);
    const auto effect = build(terrain, {{"lava.preset", "kilauea-fissure8"}});
    run_to(*effect, 1);
    hashes.push_back(hash(*effect));
    all.push_back(effect->figures());
  }
  EXPECT_EQ(hashes[0], hashes[1]);
  EXPECT_EQ(all[0], all[1]);
}

TEST(ModernLavaEffect, AVentBesideTheTerrainIsAFault) {
  const geometry::Terrain terrain = slope(0.3);
  EXPECT_THROW(build(terrain, {{"lava.vent[0].at", "[40, 8]"}}), InputError);
  EXPECT_THROW(build(terrain, {{"lava.vent[0].at", "[0.5, 8]"}}), InputError) << "half of its sites are over the edge";
}

}  // namespace
}  // namespace effuse::flow
