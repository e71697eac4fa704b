#include "flow/effects/lava_rheology.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>

#include "geometry/base/error.h"

namespace effuse::flow {
namespace {

using sph::CrystalKind;
using sph::Rheology;
using sph::YieldKind;

/// The root of a scene from "lava.rheology.law = vft" lines; what reads as a number is one. Each has its line.
Node scene(const std::vector<std::pair<std::string, std::string>>& lines) {
  Node root;
  root.place = {"test.toml"};
  int line = 0;
  for (const auto& [path, value] : lines) {
    const Place place{"test.toml", ++line, 8};
    Node* table = &root;
    std::string rest = path;
    for (std::size_t dot = rest.find('.'); dot != std::string::npos; dot = rest.find('.')) {
      const std::string key = rest.substr(0, dot);
      bool present = false;
      for (auto& [name, node] : table->entries)
        if (name == key) {
          table = &node;
          present = true;
          break;
        }
      if (!present) {
        table = &table->set(key, Node{});
        table->place = place;
      }
      rest = rest.substr(dot + 1);
    }
    Node leaf;
    leaf.place = place;
    char* end = nullptr;
    leaf.real = std::strtod(value.c_str(), &end);
    leaf.kind = *end == '\0' ? Node::Kind::kReal : Node::Kind::kText;
    leaf.text = value;
    table->set(rest, leaf);
  }
  return root;
}

struct Read {
  Rheology rheology;
  std::string faults;  ///< of the whole scene, unread keys among them
  Node resolved;
};

Read read(const Node& root, const char* preset = nullptr) {
  Parameters all(root);
  Parameters lava = all.table("lava", "");
  Read r;
  r.rheology = read_rheology(lava, preset ? sph::find_lava_preset(preset) : nullptr);
  r.resolved = all.resolved();
  try {
    all.finish();
  } catch (const InputError& error) {
    r.faults = error.what();
  }
  return r;
}
Read read(const std::vector<std::pair<std::string, std::string>>& lines, const char* preset = nullptr) {
  return read(scene(lines), preset);
}

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// Same viscosities and strengths, bit for bit, over what lava meets.
void expect_same(const Rheology& a, const Rheology& b) {
  for (Real T = 300; T < 1700; T += 50)
    for (const Real g : {0.0, 1e-4, 1.0}) EXPECT_EQ(a.viscosity(T, g), b.viscosity(T, g)) << T << " K, " << g << "/s";
}

TEST(ReadRheology, WithoutATableIsThePresetOrAThousandPascalSeconds) {
  const Read plain = read(std::vector<std::pair<std::string, std::string>>{});
  EXPECT_EQ(plain.faults, "");
  EXPECT_NEAR(plain.rheology.viscosity(1400, 0), 1000, 1e-9);
  EXPECT_FALSE(plain.rheology.needs_strain_rate());
  for (const sph::LavaPreset& preset : sph::lava_presets()) {
    const Read r = read(std::vector<std::pair<std::string, std::string>>{}, preset.name.data());
    EXPECT_EQ(r.faults, "") << preset.name;
    expect_same(r.rheology, preset.rheology);
  }
}

TEST(ReadRheology, WhatIsResolvedReadsTheSameWithoutThePreset) {
  for (const sph::LavaPreset& preset : sph::lava_presets()) {
    const Read first = read(std::vector<std::pair<std::string, std::string>>{}, preset.name.data());
    const Read again = read(first.resolved);
    EXPECT_EQ(again.faults, "") << preset.name;
    expect_same(again.rheology, first.rheology);
  }
}

TEST(ReadRheology, EveryMeltLawIsReadWithItsUnits) {
  const auto at = [](const Read& r, Real T) {
    EXPECT_EQ(r.faults, "");
    return r.rheology.viscosity(T, 0);
  };
  EXPECT_NEAR(at(read({{"lava.rheology.viscosity", "2 kPa s"}}), 1400), 2000, 1e-9);
  EXPECT_NEAR(at(read({{"lava.rheology.law", "exponential"},
                       {"lava.rheology.hot", "100 Pa s"},
                       {"lava.rheology.hot_temperature", "1200 degC"},
                       {"lava.rheology.cold", "1e6 Pa s"},
                       {"lava.rheology.cold_temperature", "900 degC"}}),
                 1323.15),
              1e4, 1e-7);
  EXPECT_NEAR(at(read({{"lava.rheology.law", "arrhenius"},
                       {"lava.rheology.viscosity", "100"},
                       {"lava.rheology.temperature", "1400 K"},
                       {"lava.rheology.activation_energy", "250 kJ"}}),
                 1300),
              std::exp(sph::arrhenius_melt(100, 1400, 250e3).log_viscosity(1300)), 1e-9);
  EXPECT_NEAR(
      at(read({{"lava.rheology.law", "vft"}, {"lava.rheology.a", "-4.7"}, {"lava.rheology.b", "5429.7 K"}, {"lava.rheology.c", "595.5 K"}}),
         1423.15),
      72.507, 1e-3);
  EXPECT_NEAR(at(read({{"lava.rheology.law", "dragoni"}, {"lava.rheology.viscosity", "1000"}, {"lava.rheology.temperature", "1137 degC"}}),
                 1423.15),
              594.52, 0.01);
  EXPECT_NEAR(at(read({{"lava.rheology.law", "grd08"},
                       {"lava.rheology.oxides.sio2", "51.22"},
                       {"lava.rheology.oxides.tio2", "3.03"},
                       {"lava.rheology.oxides.al2o3", "13.10"},
                       {"lava.rheology.oxides.feo", "11.89"},
                       {"lava.rheology.oxides.mno", "0.17"},
                       {"lava.rheology.oxides.mgo", "5.96"},
                       {"lava.rheology.oxides.cao", "9.99"},
                       {"lava.rheology.oxides.na2o", "2.58"},
                       {"lava.rheology.oxides.k2o", "0.57"},
                       {"lava.rheology.oxides.p2o5", "0.30"}}),
                 1423.15),
              500.2, 0.1);
}

TEST(ReadRheology, Fissure8BringsItsGlassForGrd08) {
  const Read r = read({{"lava.rheology.law", "grd08"}, {"lava.rheology.crystals.law", "none"}, {"lava.rheology.yield.law", "none"}},
                      "kilauea-fissure8");
  EXPECT_EQ(r.faults, "");
  EXPECT_NEAR(r.rheology.viscosity(1423.15, 0), 500.2, 0.1);
  expect_same(read(r.resolved).rheology, r.rheology);
}

TEST(ReadRheology, CrystalsBubblesYieldAndFlowLawAreRead) {
  const Read r = read({{"lava.rheology.exponent", "0.7"},
                       {"lava.rheology.min", "1 Pa s"},
                       {"lava.rheology.max", "1e8 Pa s"},
                       {"lava.rheology.crystals.law", "krieger_dougherty"},
                       {"lava.rheology.crystals.erupted", "10 %"},
                       {"lava.rheology.crystals.grown", "0.5"},
                       {"lava.rheology.crystals.start", "1165 degC"},
                       {"lava.rheology.crystals.end", "995 degC"},
                       {"lava.rheology.crystals.max", "0.6"},
                       {"lava.rheology.crystals.intrinsic", "3"},
                       {"lava.rheology.bubbles.law", "rigid"},
                       {"lava.rheology.bubbles.fraction", "40 %"},
                       {"lava.rheology.yield.law", "constant"},
                       {"lava.rheology.yield.strength", "2 kPa"},
                       {"lava.rheology.yield.regularisation", "50 s"}});
  EXPECT_EQ(r.faults, "");
  const Rheology& x = r.rheology;
  EXPECT_EQ(x.exponent, 0.7);
  EXPECT_EQ(x.mu_min, 1);
  EXPECT_EQ(x.mu_max, 1e8);
  EXPECT_EQ(x.crystals.kind, CrystalKind::kKriegerDougherty);
  EXPECT_NEAR(x.crystallinity(1353.15), 0.35, 1e-12);
  EXPECT_EQ(x.crystals.max, 0.6);
  EXPECT_EQ(x.crystals.intrinsic, 3);
  EXPECT_EQ(x.bubbles.kind, sph::BubbleKind::kRigid);
  EXPECT_EQ(x.bubbles.fraction, 0.4);
  EXPECT_EQ(x.yield_strength(1400), 2000);
  EXPECT_EQ(x.regularisation, 50);
}

TEST(ReadRheology, AnotherCrystalLawThanThePresetsHasItsUsualPacking) {
  EXPECT_EQ(read({{"lava.rheology.crystals.law", "maron_pierce"}}, "kilauea-fissure8").rheology.crystals.max, 0.633);
  EXPECT_EQ(read({{"lava.rheology.crystals.law", "krieger_dougherty"}}, "kilauea-fissure8").rheology.crystals.max, 0.56);
  EXPECT_EQ(read({{"lava.rheology.crystals.law", "krieger_dougherty"}}, "etna").rheology.crystals.max, 0.641);
}

struct Wrong {
  const char* name;
  std::vector<std::pair<std::string, std::string>> lines;
  const char* preset;
  const char* told;
};
void PrintTo(const Wrong& w, std::ostream* out) { *out << w.name; }
class ReadRheologyFaults : public testing::TestWithParam<Wrong> {};

TEST_P(ReadRheologyFaults, AreToldAndLeaveASoundRheology) {
  const Wrong& w = GetParam();
  const Read r = read(w.lines, w.preset);
  EXPECT_TRUE(contains(r.faults, w.told)) << r.faults;
  r.rheology.check();
  EXPECT_TRUE(std::isfinite(r.rheology.viscosity(1400, 1)));
}

INSTANTIATE_TEST_SUITE_P(
    , ReadRheologyFaults,
    testing::Values(
        Wrong{"law", {{"lava.rheology.law", "vtf"}}, nullptr, "did you mean 'vft'?"},
        Wrong{"missing", {{"lava.rheology.law", "vft"}}, nullptr, "lava.rheology.b: is missing"},
        Wrong{"missing_arrhenius", {{"lava.rheology.law", "arrhenius"}}, nullptr, "lava.rheology.activation_energy: is missing"},
        Wrong{"missing_exponential", {{"lava.rheology.law", "exponential"}}, nullptr, "lava.rheology.cold: is missing"},
        Wrong{"missing_dragoni", {{"lava.rheology.law", "dragoni"}}, nullptr, "lava.rheology.viscosity: is missing"},
        Wrong{"kinematic", {{"lava.rheology.viscosity", "3 m2/s"}}, nullptr, "wanted a dynamic viscosity [Pa s]"},
        Wrong{"of_another_law",
              {{"lava.rheology.law", "constant"}, {"lava.rheology.viscosity", "5"}, {"lava.rheology.rate", "5"}},
              nullptr,
              "lava.rheology.rate: unknown key"},
        Wrong{"thins_when_cold",
              {{"lava.rheology.law", "exponential"},
               {"lava.rheology.hot", "10"},
               {"lava.rheology.hot_temperature", "1400"},
               {"lava.rheology.cold", "5"},
               {"lava.rheology.cold_temperature", "1300"}},
              nullptr,
              "lava thickens as it cools"},
        Wrong{"upside_down",
              {{"lava.rheology.law", "exponential"},
               {"lava.rheology.hot", "10"},
               {"lava.rheology.hot_temperature", "1300"},
               {"lava.rheology.cold", "50"},
               {"lava.rheology.cold_temperature", "1400"}},
              nullptr,
              "is not below hot_temperature"},
        Wrong{"oxides_as_shares",
              {{"lava.rheology.law", "grd08"}, {"lava.rheology.oxides.sio2", "51 %"}, {"lava.rheology.oxides.mgo", "49 %"}},
              nullptr,
              "the oxides add up to 1, wanted about 100"},
        Wrong{"no_melt", {{"lava.rheology.law", "grd08"}, {"lava.rheology.oxides.al2o3", "100"}}, nullptr, "no melt grd08 knows"},
        Wrong{"no_glass_known", {{"lava.rheology.law", "grd08"}}, "etna", "the oxides add up to 0"},
        Wrong{"too_many_crystals",
              {{"lava.rheology.crystals.erupted", "0.6"}, {"lava.rheology.crystals.grown", "0.6"}},
              "etna",
              "1.2 of the lava would be crystals"},
        Wrong{"grow_on_heating", {{"lava.rheology.crystals.end", "1500 K"}}, "etna", "wanted an end below the start"},
        Wrong{"all_bubbles", {{"lava.rheology.bubbles.fraction", "1"}}, nullptr, "out of range"},
        Wrong{"no_strength", {{"lava.rheology.yield.law", "constant"}}, nullptr, "lava.rheology.yield.strength: is missing"},
        Wrong{"max_below_min", {{"lava.rheology.min", "100"}, {"lava.rheology.max", "10"}}, nullptr, "is below min"},
        Wrong{"exponent", {{"lava.rheology.exponent", "0"}}, nullptr, "lava.rheology.exponent: "}),
    [](const testing::TestParamInfo<Wrong>& i) { return std::string(i.param.name); });

}  // namespace
}  // namespace effuse::flow
