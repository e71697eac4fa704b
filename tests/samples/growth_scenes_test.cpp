#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/parallel.h"
#include "samples/effuse/frame_writer.h"
#include "samples/effuse/load_scene.h"

/// Scenes of elastic solids, plants and figures, as the program loads and writes them.
namespace effuse {
namespace {

namespace fs = std::filesystem;

const fs::path kScenes = fs::path(EFFUSE_SOURCE_DIR) / "samples" / "scenes";

class GrowthScenes : public testing::Test {
 protected:
  GrowthScenes() : folder_(fs::temp_directory_path() / fmt::format("effuse.growth.{}.{}", testing::UnitTest::GetInstance()->current_test_info()->name(), ::getpid())) {
    fs::create_directories(folder_);
  }
  ~GrowthScenes() override { fs::remove_all(folder_); }
  fs::path write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  std::string fault(const std::string& text) {
    try {
      load_scene(write("bad.toml", text), {}, 0);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  fs::path folder_;
};

void go(LoadedScene& loaded, int frames) {
  for (int k = 0; k < frames; ++k) loaded.simulation->advance([] { return true; });
}

class GrowthScenesSlow : public GrowthScenes {};

TEST_F(GrowthScenesSlow, BuildWhatTheyNameAndGoOnFromACheckpointToTheSameBitsOnOneThread) {
  const std::vector<std::pair<const char*, std::vector<std::string>>> scenes = {{"elastic.toml", {"ball", "arm", "beam"}}, {"grove.toml", {"lava", "trees", "bushes"}}, {"figure.toml", {"lava"}}};
  for (const auto& [name, effects] : scenes) {
    const auto loaded = load_scene(kScenes / name, {}, 0), again = load_scene(kScenes / name, {}, 0);
    std::vector<std::string> built;
    for (const auto& effect : loaded->simulation->effects()) built.emplace_back(effect->name());
    EXPECT_EQ(built, effects) << name;
    EXPECT_EQ(loaded->key, again->key);
    go(*loaded, 2);
    again->simulation->restore(loaded->simulation->checkpoint(loaded->key), again->key, "checkpoint");
    go(*loaded, 1);
    {
      const ThreadLimit one(1);
      go(*again, 1);
    }
    EXPECT_EQ(loaded->simulation->state_hash(), again->simulation->state_hash()) << name;
  }
}

TEST_F(GrowthScenes, AFiguresBonesAreObstaclesAndNothingElseIs) {
  const auto loaded = load_scene(kScenes / "figure.toml", {}, 0);
  ASSERT_GE(loaded->solids.obstacles.size(), 15u);
  for (const flow::PlacedObstacle& bone : loaded->solids.obstacles) {
    EXPECT_TRUE(bone.name.starts_with("walker.")) << bone.name;
    EXPECT_GT(bone.track.keys().size(), 100u);
  }
  bool told = false;
  for (const std::string& note : loaded->notes) told |= note.find("feet slide by") != std::string::npos;
  EXPECT_TRUE(told);
  EXPECT_TRUE(load_scene(kScenes / "elastic.toml", {}, 0)->solids.obstacles.size() == 2) << "its own two";
}

TEST_F(GrowthScenes, WhatHasNotChangedIsTheFileThatWas) {
  const fs::path scene = write("still.toml", "[film]\nframes = 3\n[terrain.plane]\nsize = [20, 20]\n[[plants]]\nkind = \"grass\"\nheight = 1\nplaces = [[0, 0]]\n[output]\nformats = [\"ply\"]\n[preview]\npictures = false\n");
  const auto loaded = load_scene(scene, {}, 0);
  const auto file = [&](const char* folder, int frame) { return folder_ / folder / "frames" / fmt::format("plants.{:04}.ply", frame); };
  FrameWriter writer(loaded->scene, loaded->skin, *loaded->terrain, loaded->solids, folder_ / "whole");
  for (int frame = 1; frame <= 3; ++frame) {
    go(*loaded, 1);
    writer.write_frame(*loaded->simulation);
  }
  EXPECT_EQ(fs::hard_link_count(file("whole", 3)), 3u);
  // One that has lost the first writes the same bytes.
  FrameWriter resumed(loaded->scene, loaded->skin, *loaded->terrain, loaded->solids, folder_ / "resumed");
  resumed.write_frame(*loaded->simulation);
  EXPECT_EQ(read_file(file("whole", 3)), read_file(file("resumed", 3)));
  EXPECT_NE(read_file(file("whole", 3)).find("comment frame: 1\n"), std::string::npos) << read_file(file("whole", 3)).substr(0, 300);
}

TEST_F(GrowthScenes, AFigureThatCannotWalkIsAFaultOfItsLine) {
  const std::string head = "[film]\nframes = 3\n[terrain.plane]\nsize = [20, 20]\n";
  const auto tells = [&](const std::string& text, const char* part) {
    const std::string faults = fault(head + text);
    EXPECT_NE(faults.find(part), std::string::npos) << faults;
    EXPECT_NE(faults.find("bad.toml:"), std::string::npos) << faults;
  };
  const std::string clip = "file = \"" + (kScenes / "walk.bvh").string() + "\"\n";
  tells("[[figure]]\nfile = \"none.bvh\"\npath = [[0, 0], [1, 0]]\n", "none.bvh");
  tells("[[figure]]\n" + clip + "path = [[0, 0]]\n", "at least two");
  tells("[[figure]]\n" + clip + "path = [[0, 0], [300, 0]]\n", "no ground at 300, 0");
  tells("[[figure]]\n" + clip + "path = [[0, 0], [1, 0]]\npce = 2\n", "pace");
  tells("[[figure]]\n" + clip + "path = [[0, 0], [3, 0]]\nscale = 1e-5\n", "goes nowhere");
  // A figure alone is a scene.
  EXPECT_EQ(fault(head + "[[figure]]\n" + clip + "path = [[0, 0], [1, 0]]\n"), "");
}

}  // namespace
}  // namespace effuse
