#include "importers/scene/scene_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>

namespace effuse::importers {
namespace {

using flow::Node;
using Kind = flow::Node::Kind;

/// Equal up to places and to the order of keys (to_toml writes plain values before tables).
bool equal(const Node& a, const Node& b) {
  if (a.kind != b.kind || a.items.size() != b.items.size() || a.entries.size() != b.entries.size()) return false;
  for (std::size_t i = 0; i < a.items.size(); ++i)
    if (!equal(a.items[i], b.items[i])) return false;
  for (const auto& [key, node] : a.entries)
    if (!b.find(key) || !equal(node, *b.find(key))) return false;
  switch (a.kind) {
    case Kind::kText:
      return a.text == b.text;
    case Kind::kInteger:
      return a.integer == b.integer;
    case Kind::kReal:
      return a.real == b.real || (std::isnan(a.real) && std::isnan(b.real));
    case Kind::kFlag:
      return a.flag == b.flag;
    default:
      return true;
  }
}

std::string refusal(const std::string& text) {
  try {
    read_scene_text(text, "test.toml");
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST(SceneFile, EveryKindOfValueArrivesWithItsLineAndColumn) {
  const Node scene = read_scene_text(
      "name = \"flank\"\n"
      "[lava]\n"
      "rate = 30\n"
      "  hot = 1.5e3\n"
      "on = true\n"
      "[[lava.vents]]\n"
      "at = [1, 2.5]\n",
      "test.toml");
  EXPECT_EQ(scene.find("name")->text, "flank");
  EXPECT_EQ(scene.find("name")->place.column, 8);
  const Node& lava = *scene.find("lava");
  EXPECT_EQ(lava.find("rate")->integer, 30);
  EXPECT_EQ(lava.find("hot")->real, 1500);
  EXPECT_EQ(lava.find("hot")->place.line, 4);
  EXPECT_EQ(lava.find("hot")->place.column, 9);
  EXPECT_EQ(lava.key_places[1].column, 3);
  EXPECT_TRUE(lava.find("on")->flag);
  ASSERT_EQ(lava.find("vents")->items.size(), 1u);
  EXPECT_EQ(lava.find("vents")->items[0].place.line, 6);
  EXPECT_EQ(lava.find("vents")->items[0].find("at")->items[1].place.line, 7);
  EXPECT_EQ(to_string(lava.find("rate")->place), "test.toml:3:8");
}

TEST(SceneFile, KeysStandInTheOrderOfTheFile) {
  const Node scene = read_scene_text("zebra = 1\napple = 2\n[middle]\nz = 1\na = 2\n[early]\n", "test.toml");
  ASSERT_EQ(scene.entries.size(), 4u);
  EXPECT_EQ(scene.entries[0].first, "zebra");
  EXPECT_EQ(scene.entries[1].first, "apple");
  EXPECT_EQ(scene.entries[2].first, "middle");
  EXPECT_EQ(scene.entries[2].second.entries[0].first, "z");
  EXPECT_EQ(scene.entries[3].first, "early");
}

TEST(SceneFile, WindowsLineEndsAndAByteOrderMarkChangeNothing) {
  const std::string text = "a = 1\n[b]\nc = \"x\"\n";
  std::string windows = "\xEF\xBB\xBF";
  for (char c : text) windows += c == '\n' ? std::string("\r\n") : std::string(1, c);
  const Node scene = read_scene_text(windows, "test.toml");
  EXPECT_TRUE(equal(scene, read_scene_text(text, "test.toml")));
  EXPECT_EQ(scene.find("b")->find("c")->place.line, 3);
}

TEST(SceneFile, ASyntaxErrorHasItsLineAndColumn) {
  EXPECT_TRUE(contains(refusal("a = 1\nb = = 2\n"), "test.toml:2:")) << refusal("a = 1\nb = = 2\n");
  EXPECT_TRUE(contains(refusal("a = 1\na = 2\n"), "test.toml:2:")) << "a key twice: " << refusal("a = 1\na = 2\n");
  EXPECT_TRUE(contains(refusal("a = 'open\nb = 1"), "test.toml:1:")) << refusal("a = 'open\nb = 1");
}

TEST(SceneFile, WhatIsNotTextOrNotUtf8IsRefusedInPrintableWords) {
  for (const std::string& text : {std::string("a = \"\xff\xfe\"\n"),
                                  std::string("\x7f"
                                              "ELF\x00\x01\x02 = 3",
                                              11),
                                  std::string("a\x00=1", 4),
                                  std::string("\xff\xfe"
                                              "a\x00=\x00",
                                              6)}) {
    const std::string told = refusal(text);
    EXPECT_FALSE(told.empty());
    for (char c : told) EXPECT_TRUE(c >= ' ' && c <= '~') << told;
  }
}

TEST(SceneFile, ADateIsRefusedBecauseASceneHasNoUseForIt) {
  EXPECT_TRUE(contains(refusal("a = 1\nb = 1979-05-27\nc = 07:32:00"), "test.toml:3:"));
  EXPECT_TRUE(contains(refusal("b = 1979-05-27"), "date"));
}

TEST(SceneFile, DeepNestingIsRefusedHoweverItIsWritten) {
  const auto repeat = [](const std::string& piece, int n) {
    std::string all;
    for (int i = 0; i < n; ++i) all += piece;
    return all;
  };
  EXPECT_TRUE(contains(refusal("a = " + repeat("[", 100000)), "nested too deeply"));
  EXPECT_TRUE(contains(refusal("a = " + repeat("{a=", 100000)), "nested too deeply"));
  EXPECT_TRUE(contains(refusal(repeat("a.", 100000) + "a = 1"), "nested too deeply"));
  EXPECT_TRUE(contains(refusal("x = \"\"\"\n'\"\"\"\n[" + repeat("a.", 100000) + "a]"), "test.toml:3:"));
  EXPECT_EQ(refusal("a = \"" + repeat("[.", 1000) + "\" # " + repeat("[.", 1000)), "") << "strings and comments do not nest";
  EXPECT_EQ(refusal("a = '''\n" + repeat("[.", 1000) + "'''\nb = [" + repeat("1.5, ", 1000) + "]"), "");
}

TEST(SceneFile, AFileThatIsMissingAFolderEmptyOrEnormousIsRefusedByName) {
  const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "effuse_scene_file_test";
  std::filesystem::create_directories(folder);
  const auto told = [](const std::filesystem::path& file) -> std::string {
    try {
      read_scene_file(file);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_TRUE(contains(told(folder / "no.toml"), "no.toml: no such file"));
  EXPECT_TRUE(contains(told(folder), "is a folder"));
  std::ofstream(folder / "empty.toml");
  EXPECT_TRUE(contains(told(folder / "empty.toml"), "empty"));
  EXPECT_TRUE(contains(told("/dev/zero"), "not a regular file"));
  std::ofstream(folder / "huge.toml") << "a = 1";
  std::filesystem::resize_file(folder / "huge.toml", std::uintmax_t{1} << 40);  // sparse
  EXPECT_TRUE(contains(told(folder / "huge.toml"), "too large"));
  std::filesystem::remove_all(folder);
}

TEST(SceneFile, WrittenAsTomlATreeReadsBackEqual) {
  const Node scene = read_scene_text(
      "a = 1\nb = 1.0\nc = 1e300\nd = -0.1\ne = inf\nf = nan\ng = true\nh = \"q\\\"b\\\\n\\n\\t\\u0001 \xc3\xa9\"\n"
      "\"odd key.\" = 3\n\"\" = 4\nempty = []\nmixed = [1, \"x\", {a = 1}, [2.5, []], {}]\nsmall = 4.9e-324\nbig = -9223372036854775808\n"
      "long = [[100000.5, 200000.5, 300000.5], [100000.5, 200000.5, 300000.5], [100000.5, 200000.5, 300000.5], [100000.5, 2.5, 3.5]]\n"
      "[t]\nx = 1\n[t.u.\"v w\"]\ny = 2\n[[t.list]]\nz = 1\n[t.list.in]\nq = 1\n[[t.list]]\n[[t.list.deep]]\nk = 'l'\n[hollow]\n",
      "test.toml");
  const std::string written = to_toml(scene);
  EXPECT_TRUE(equal(scene, read_scene_text(written, "again.toml"))) << written;
  EXPECT_EQ(to_toml(read_scene_text(written, "again.toml")), written);
}

TEST(SceneOverride, ReplacesCreatesAndIndexes) {
  Node scene = read_scene_text("[lava]\nrate = 1\n[[lava.vents]]\nr = 1\n[[lava.vents]]\nr = 2\n", "test.toml");
  apply_override(scene, "lava.rate=30 m3/s");
  apply_override(scene, "lava.vents[1].r = 5");
  apply_override(scene, "lava.vents[2].r=6");
  apply_override(scene, "air.wind.speed=2.5");
  apply_override(scene, "list=[1, 2]");
  apply_override(scene, "list[1]=true");
  apply_override(scene, "new[0]=1");
  apply_override(scene, "title=a=b");
  apply_override(scene, "\"odd key.\"=\"quoted\"");
  EXPECT_EQ(scene.find("lava")->find("rate")->text, "30 m3/s");
  EXPECT_EQ(scene.find("lava")->find("rate")->place.file, "--set");
  EXPECT_EQ(scene.find("lava")->find("vents")->items[1].find("r")->integer, 5);
  EXPECT_EQ(scene.find("lava")->find("vents")->items[2].find("r")->integer, 6);
  EXPECT_EQ(scene.find("air")->find("wind")->find("speed")->real, 2.5);
  EXPECT_TRUE(scene.find("list")->items[1].flag);
  EXPECT_EQ(scene.find("new")->items[0].integer, 1);
  EXPECT_EQ(scene.find("title")->text, "a=b");
  EXPECT_EQ(scene.find("odd key.")->text, "quoted");
}

TEST(SceneOverride, AWrongAssignmentIsRefusedAndLeavesTheSceneAsItWas) {
  const Node before = read_scene_text("a = 1\nlist = [1]\n[t]\n", "test.toml");
  for (const char* wrong :
       {"a", "=1", "a=", "a.b=1", "a[0]=1", "list[3]=1", "list[x]=1", "list[-1]=1", "list[0=1", "t..x=1", ".a=1", "a.=1", "t[0]=1", "x y=1",
        "list[99999999999999999999]=1", "\"a=1", "new.b[1]=1", "a=\xff", "a=2001-01-01 x\xff"}) {
    Node scene = before;
    try {
      apply_override(scene, wrong);
      ADD_FAILURE() << wrong << " was taken";
    } catch (const InputError& error) {
      EXPECT_EQ(error.faults()[0].place.file, "--set") << wrong;
    }
    EXPECT_TRUE(equal(scene, before)) << wrong;
  }
}

}  // namespace
}  // namespace effuse::importers
