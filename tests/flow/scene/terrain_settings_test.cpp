#include "flow/scene/terrain_settings.h"

#include <gtest/gtest.h>

#include <algorithm>

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
  for (const auto& [wrong, right] : {std::pair{"croop", "crop"}, {"vertical_units", "vertical_unit"}, {"file_crss", "file_crs"}, {"pit_deth", "pit_depth"}, {"spacng", "spacing"}, {"units", "unit"}, {"fill_hole", "fill_holes"}, {"max_eror", "max_error"}, {"repare", "repair"}})
    EXPECT_NE(faults_of(terrain_with(wrong, text("1"))).find(std::string("'") + right + "'"), std::string::npos) << faults_of(terrain_with(wrong, text("1")));
  EXPECT_NE(faults_of(terrain_with("holes", text("fil"))).find("'fill'"), std::string::npos) << faults_of(terrain_with("holes", text("fil")));
  EXPECT_NE(faults_of(terrain_with("resample", text("cubik"))).find("'cubic'"), std::string::npos);
  EXPECT_NE(faults_of(terrain_with("pits", text("breech"))).find("'breach'"), std::string::npos);
  EXPECT_NE(faults_of(terrain_with("up", text("Z"))).find("did you mean 'z'?"), std::string::npos) << faults_of(terrain_with("up", text("Z")));
  EXPECT_NE(faults_of(terrain_with("unit", text("mmm"))).find("'mm'"), std::string::npos) << faults_of(terrain_with("unit", text("mmm")));
  EXPECT_NE(faults_of(terrain_with("vertical_unit", text("us-fft"))).find("'us-ft'"), std::string::npos) << faults_of(terrain_with("vertical_unit", text("us-fft")));
}

TEST(TerrainSettings, UnitsAreReadAndWhatMakesNoSenseIsRefused) {
  const Node root = terrain_with("spacing", text("20 cm"));
  Parameters parameters(root);
  EXPECT_EQ(read_terrain_settings(parameters).spacing, 0.2);
  EXPECT_FALSE(faults_of(terrain_with("spacing", text("-1 m"))).empty());
  EXPECT_FALSE(faults_of(terrain_with("spacing", text("1 kg"))).empty());
}

TEST(TerrainSettings, WhatMeshesCanBeTold) {
  Node root;
  Node& terrain = root.set("terrain", Node{});
  for (const auto& [key, value] : {std::pair{"file", "scan.stl"}, {"up", "y"}, {"unit", "mm"}, {"stitch", "1 cm"}, {"fill_holes", "2 m"}, {"max_error", "5 cm"}}) terrain.set(key, text(value));
  Parameters parameters(root);
  const TerrainSettings s = read_terrain_settings(parameters);
  EXPECT_NO_THROW(parameters.finish());
  EXPECT_EQ(s.up, TerrainSettings::Up::kY);
  EXPECT_EQ(s.metres_per_unit, 1e-3);
  EXPECT_TRUE(s.repair);
  EXPECT_EQ(s.stitch, 0.01);
  EXPECT_EQ(s.fill_holes, 2);
  EXPECT_EQ(s.max_error, 0.05);
  EXPECT_EQ(s.edge, 0);
  terrain.set("edge", text("1 m"));
  EXPECT_NE(faults_of(root).find("terrain.edge: makes triangles of one size, and max_error few"), std::string::npos) << faults_of(root);
  Node no;
  no.kind = Node::Kind::kFlag;
  terrain.set("repair", no);
  EXPECT_NE(faults_of(root).find("terrain.fill_holes: is a repair"), std::string::npos) << faults_of(root);
  EXPECT_NE(faults_of(root).find("terrain.stitch: is a repair"), std::string::npos);
}

TEST(TerrainSettings, EachKeyIsOfGridsOrOfMeshesOrOfBoth) {
  Node root;
  root.set("terrain", Node{}).set("file", text("a.tif"));
  Parameters parameters(root);
  read_terrain_settings(parameters);
  const std::vector<std::string> both = {"file", "temperature", "crs", "crop"};
  for (const ParameterDoc& doc : parameters.docs()) {
    if (!doc.path.starts_with("terrain.") || doc.path.starts_with("terrain.plane")) continue;
    const std::string key = doc.path.substr(8);
    const auto among = [&](const auto& list) { return std::find(list.begin(), list.end(), key) != list.end(); };
    EXPECT_EQ(among(both) + among(kGridKeys) + among(kMeshKeys), 1) << key;
  }
  Node resolved = *parameters.resolved().find("terrain");
  EXPECT_TRUE(resolved.find("holes") && resolved.find("repair"));
  drop_misfits(resolved, true);
  EXPECT_TRUE(resolved.find("holes") && !resolved.find("repair"));
}

TEST(TerrainSettings, AKeyOfTheOtherKindOfGroundIsRefusedAtItsPlace) {
  Node up = text("y"), holes = text("fill");
  up.place = {"scene.toml", 7, 6};
  holes.place = {"scene.toml", 8, 9};
  Node terrain;
  terrain.set("up", up);
  terrain.set("holes", holes);
  const std::vector<Fault> grid = misfits(terrain, "terrain", true, "a.tif"), mesh = misfits(terrain, "", false, "a.obj");
  ASSERT_EQ(grid.size(), 1u);
  EXPECT_EQ(to_string(grid[0]), "scene.toml:7:6: terrain.up: is for meshes, and 'a.tif' is a grid of heights");
  ASSERT_EQ(mesh.size(), 1u);
  EXPECT_EQ(to_string(mesh[0]), "scene.toml:8:9: holes: is for grids, and 'a.obj' is a mesh");
}

}  // namespace
}  // namespace effuse::flow
