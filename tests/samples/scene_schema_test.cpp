#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <functional>

#include "flow/effects/registry.h"
#include "flow/scene/scene.h"
#include "geometry/base/files.h"
#include "importers/scene/scene_file.h"
#include "samples/effuse/scene_keys.h"
#include "skin/scene/skin_settings.h"
#include "tests/samples/json_schema.h"

/// The schema of scene files that `effuse effects --schema` prints, against the scenes there are and the program's own reading of them.
namespace effuse {
namespace {

namespace fs = std::filesystem;

const fs::path kScenes = fs::path(EFFUSE_SOURCE_DIR) / "samples" / "scenes";

Json to_json(const flow::Node& node) {
  switch (node.kind) {
    case flow::Node::Kind::kTable: {
      Json j = Json::object();
      for (const auto& [key, value] : node.entries) j[key] = to_json(value);
      return j;
    }
    case flow::Node::Kind::kArray: {
      Json j = Json::array();
      for (const flow::Node& item : node.items) j.push_back(to_json(item));
      return j;
    }
    case flow::Node::Kind::kText:
      return node.text;
    case flow::Node::Kind::kInteger:
      return node.integer;
    case flow::Node::Kind::kReal:
      return node.real;
    case flow::Node::Kind::kFlag:
      return node.flag;
  }
  return nullptr;
}

class SceneSchema : public testing::Test {
 protected:
  static const std::vector<flow::KeyDoc>& keys() {
    static const std::vector<flow::KeyDoc> all = scene_keys();
    return all;
  }
  static const Json& schema() {
    static const Json made = Json::parse(scene_schema(keys()));
    return made;
  }
  static std::string faults(const flow::Node& scene) { return fmt::format("{}", fmt::join(schema_faults(schema(), to_json(scene)), "\n")); }
  static std::string faults(const std::string& text) { return faults(importers::read_scene_text(text, "text")); }
  template <class Do>
  static void for_each_scene(Do&& what) {
    std::size_t count = 0;
    for (const fs::directory_entry& entry : fs::directory_iterator(kScenes)) {
      if (entry.path().extension() != ".toml") continue;
      SCOPED_TRACE(entry.path().filename().string());
      what(importers::read_scene_file(entry.path()));
      ++count;
    }
    EXPECT_GT(count, 25u);
  }
};

TEST_F(SceneSchema, TheReferenceInTheRepositoryIsWhatTheProgramPrints) {
  EXPECT_TRUE(read_file(fs::path(EFFUSE_SOURCE_DIR) / "samples" / "scene-reference.md") == scene_reference(keys())) << "effuse effects --markdown > samples/scene-reference.md";
}

TEST_F(SceneSchema, IsASchema) {
  EXPECT_EQ(fmt::format("{}", fmt::join(faults_of_schema(schema()), "\n")), "");
  EXPECT_EQ(schema().at("$schema"), "https://json-schema.org/draft/2020-12/schema");
  // Whether a schema is looked at at all.
  EXPECT_NE(faults_of_schema(Json::parse(R"({"properties": {"a": {"minItems": -1}}})")), std::vector<std::string>());
  EXPECT_NE(faults_of_schema(Json::parse(R"({"required": ["b"], "properties": {}})")), std::vector<std::string>());
}

TEST_F(SceneSchema, AllowsEveryScene) {
  for_each_scene([](const flow::Node& scene) { EXPECT_EQ(faults(scene), ""); });
}

TEST_F(SceneSchema, KnowsEveryKeyThatTheReadersOfTheScenesRead) {
  for_each_scene([](const flow::Node& scene) {
    flow::Parameters root(scene);
    flow::read_scene(root, flow::effect_kinds());
    skin::read_skin_settings(root);
    EXPECT_EQ(faults(root.resolved()), "");
  });
}

TEST_F(SceneSchema, RefusesEveryKeyThatIsMisspelt) {
  std::size_t misspelt = 0;
  for_each_scene([&](const flow::Node& scene) {
    const std::function<void(flow::Node&, flow::Node&)> each = [&](flow::Node& root, flow::Node& node) {
      for (std::size_t k = 0; k < node.entries.size(); ++k) {
        node.entries[k].first += "x";
        EXPECT_NE(faults(root), "") << node.entries[k].first;
        ++misspelt;
        node.entries[k].first.pop_back();
        each(root, node.entries[k].second);
      }
      for (flow::Node& item : node.items) each(root, item);
    };
    flow::Node copy = scene;
    each(copy, copy);
  });
  EXPECT_GT(misspelt, 500u);
}

TEST_F(SceneSchema, RefusesWhatIsOutOfRangeOfTheWrongKindOrMissing) {
  const std::string film = "[film]\nframes = 2\n", ground = "[terrain.plane]\nsize = [10, 10]\n";
  EXPECT_EQ(faults(film + ground), "");
  for (const std::string& bad : {std::string("[film]\nframes = 0\n") + ground, std::string("[film]\nframes = 2.5\n") + ground, "[film]\n" + ground, film + "[terrain.plane]\nsize = [10]\n", film + "[terrain.plane]\nsize = 10\n",
                                 film + ground + "[lava]\nspacing = 0\n", film + ground + "[lava]\nspacing = \"wide\"\n", film + ground + "[lava]\nmodel = \"modren\"\n", film + ground + "[skin]\nmatch_volume = 1\n",
                                 film + ground + "[output]\nformats = [\"ply\", \"ply\"]\n", film + ground + "[[lava.vent]]\nwidth = 2\nrate = [[0], [1, 2]]\n", film + ground + "[[joint]]\nbodies = [\"a\"]\npoint = [0, 0, 0]\n"})
    EXPECT_NE(faults(bad), "") << bad;
}

TEST_F(SceneSchema, LetsSpacingBeChosen) {
  const std::string scene = "quality = \"draft\"\n[film]\nframes = 2\n[terrain]\nfile = \"a.tif\"\n[lava]\npreset = \"etna\"\n";
  EXPECT_EQ(faults(scene), "");
  EXPECT_EQ(faults(scene + "spacing = \"auto\"\n"), "");
  EXPECT_NE(faults(scene + "spacing = \"autos\"\n"), "");
}

TEST_F(SceneSchema, SaysUnitsDefaultsRangesAndChoices) {
  const Json& lava = schema().at("properties").at("lava").at("properties");
  EXPECT_EQ(lava.at("spacing").at("x-unit"), "m");
  EXPECT_EQ(lava.at("vent").at("items").at("properties").at("rate").at("x-unit"), "m3/s");
  EXPECT_EQ(lava.at("model").at("enum"), Json::array({"modern", "classic"}));
  const Json& film = schema().at("properties").at("film");
  EXPECT_EQ(film.at("required"), Json::array({"frames"}));
  EXPECT_EQ(film.at("properties").at("fps").at("default"), "24 1/s");
  EXPECT_EQ(film.at("properties").at("frames").at("maximum"), 9999);
  // Of a hinge an angle, of a slider a length.
  EXPECT_EQ(schema().at("properties").at("joint").at("items").at("properties").at("limits").at("x-unit"), "rad or m");
}

TEST_F(SceneSchema, HasTheKeysOfTablesWithinTablesThatEachWantAnother) {
  const auto known = [&](const char* path) { return std::any_of(keys().begin(), keys().end(), [&](const flow::KeyDoc& key) { return key.path == path; }); };
  for (const char* path : {"particles[].emitter[].full_area", "particles[].attractor[].strength", "waves[].source[].period", "smoke[].source[].density", "plants[].rule[].from", "ocean.wave[].amplitude", "joint[].motor.torque", "joint[].motor.force",
                           "joint[].cone", "body[].cell_flatness", "lava.viscosity.hot", "lava.crust_blocks.strain", "lava.rheology.yield.start", "springs[].bend_stiffness", "preview.key[].position", "terrain.plane.slope", "bodies.penalty_frequency", "figure[].pace",
                           "obstacle[].key[].time"})
    EXPECT_TRUE(known(path)) << path;
}

}  // namespace
}  // namespace effuse
