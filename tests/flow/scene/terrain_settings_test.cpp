#include "flow/scene/terrain_settings.h"

#include <gtest/gtest.h>

#include "geometry/base/error.h"

namespace effuse::flow {
namespace {

Node text(const std::string& value) {
  Node node;
  node.kind = Node::Kind::kText;
  node.text = value;
  return node;
}

/// A scene's root whose [terrain] holds file and one key more.
Node terrain_with(const std::string& key, Node value) {
  Node root;
  Node& terrain = root.set("terrain", Node{});
  terrain.set("file", text("a.tif"));
  terrain.set(key, std::move(value));
  return root;
}

std::string faults_of(const Node& root) {
  Parameters parameters(root);
  read_terrain_settings(parameters);
  try {
    parameters.finish();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(TerrainSettings, OneFileOrSeveral) {
  Node files;
  files.kind = Node::Kind::kArray;
  files.items = {text("a.hgt"), text("b.hgt")};
  const Node root = terrain_with("file", files);
  Parameters parameters(root);
  EXPECT_EQ(read_terrain_settings(parameters).files, (std::vector<std::string>{"a.hgt", "b.hgt"}));
  files.items.clear();
  EXPECT_NE(faults_of(terrain_with("file", files)).find("empty array"), std::string::npos);
  EXPECT_NE(faults_of(terrain_with("file", text(""))).find("wanted text"), std::string::npos);
}

TEST(TerrainSettings, AMisspeltKeyOrChoiceIsToldWithTheNearest) {
  for (const auto& [wrong, right] : {std::pair{"croop", "crop"}, {"vertical_units", "vertical_unit"}, {"file_crss", "file_crs"}, {"pit_deth", "pit_depth"}, {"spacng", "spacing"}})
    EXPECT_NE(faults_of(terrain_with(wrong, text("1"))).find(std::string("'") + right + "'"), std::string::npos) << faults_of(terrain_with(wrong, text("1")));
  EXPECT_NE(faults_of(terrain_with("holes", text("fil"))).find("'fill'"), std::string::npos) << faults_of(terrain_with("holes", text("fil")));
  EXPECT_NE(faults_of(terrain_with("resample", text("cubik"))).find("'cubic'"), std::string::npos);
  EXPECT_NE(faults_of(terrain_with("pits", text("breech"))).find("'breach'"), std::string::npos);
}

TEST(TerrainSettings, UnitsAreReadAndWhatMakesNoSenseIsRefused) {
  const Node root = terrain_with("spacing", text("20 cm"));
  Parameters parameters(root);
  EXPECT_EQ(read_terrain_settings(parameters).spacing, 0.2);
  EXPECT_FALSE(faults_of(terrain_with("spacing", text("-1 m"))).empty());
  EXPECT_FALSE(faults_of(terrain_with("spacing", text("1 kg"))).empty());
}

}  // namespace
}  // namespace effuse::flow
