#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>

#include "skin/color/lava_color.h"
#include "skin/write/write_animation.h"
#include "skin/write/write_flipbook.h"
#include "skin/write/write_mesh.h"
#include "tests/skin/sample_lava.h"

namespace effuse::skin {
namespace {

namespace fs = std::filesystem;

struct Outcome {
  int code = -1;
  std::string text;  // stdout and stderr
};

/// tests/tools/gltf_validate.sh on files. Paths here hold no quotes.
Outcome validate_gltf(const std::vector<fs::path>& files) {
  std::string command = fmt::format("sh '{}/tests/tools/gltf_validate.sh' '{}'", EFFUSE_SOURCE_DIR, EFFUSE_BINARY_DIR);
  for (const fs::path& file : files) command += fmt::format(" '{}'", file.string());
  command += " 2>&1";
  Outcome outcome;
  FILE* pipe = ::popen(command.c_str(), "r");
  if (!pipe) return outcome;
  char buffer[4096];
  while (std::fgets(buffer, sizeof buffer, pipe)) outcome.text += buffer;
  const int status = ::pclose(pipe);
  outcome.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return outcome;
}

class GltfValidatorSlow : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / fmt::format("effuse_gltf_{}", ::getpid());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path folder_;
};

TEST_F(GltfValidatorSlow, AFlipbookHasNoErrorsAndNoWarnings) {
  Flipbook book("film"), one("film"), none("film");
  geometry::TriMesh ground = testing_meshes::tube(10, 1, 4, 6);
  ground.attributes.clear();
  book.add_still("terrain", ground);
  book.add_frame("skin", 0, geometry::TriMesh{});
  for (int k = 1; k < 5; ++k) {
    geometry::TriMesh mesh = testing_meshes::tube(60, 3, 10 * k, 12);
    color_lava(mesh);
    book.add_frame("skin", 0.25 * k, mesh);
    if (k == 1) one.add_frame("skin", 0, mesh);
  }
  book.finish(folder_ / "film.glb", 1.25);
  one.finish(folder_ / "one.glb", 0.25);
  none.finish(folder_ / "none.glb", 1);
  const Outcome outcome = validate_gltf({folder_ / "film.glb", folder_ / "one.glb", folder_ / "none.glb"});
  EXPECT_EQ(outcome.code, 0) << outcome.text;
}

TEST_F(GltfValidatorSlow, ThingsThatMoveHaveNoErrorsAndNoWarnings) {
  geometry::TriMesh ring = testing_meshes::tube(60, 3, 10, 12);
  color_lava(ring);
  const geometry::RigidPose here{Vec3(1, 2, 3), Quat::Identity()}, there{Vec3(4, 2, 3), Quat(0.6, 0, 0.8, 0)};
  const std::vector<Real> times = {0, 0.5, 1};
  write_animated_glb(folder_ / "moving.glb", std::vector<MovingMesh>{{"a", &ring, {here, there, here}}, {"b", &ring, {there, there, there}}}, times);
  write_animated_glb(folder_ / "still.glb", std::vector<MovingMesh>{{"b", &ring, {there}}}, std::vector<Real>{0});
  write_animated_glb(folder_ / "none.glb", {}, times);
  const Outcome outcome = validate_gltf({folder_ / "moving.glb", folder_ / "still.glb", folder_ / "none.glb"});
  EXPECT_EQ(outcome.code, 0) << outcome.text;
}

TEST_F(GltfValidatorSlow, LavaTerrainAndEmptyFramesHaveNoErrorsAndNoWarnings) {
  geometry::TriMesh lava = testing_meshes::tube(60, 3, 40, 12);
  color_lava(lava);
  write_glb(folder_ / "lava.glb", lava, {{"crs", "EPSG:27200"}, {"origin", "2667400 6478700 0"}});

  geometry::TriMesh terrain = testing_meshes::tube(60, 3, 4, 5);
  terrain.attributes.clear();
  write_glb(folder_ / "terrain.glb", terrain);

  geometry::TriMesh dim = testing_meshes::tube(60, 3, 4, 5);  // glows below 1: no extension
  for (float& T : dim.attributes.at("temperature").values) T = 950;
  color_lava(dim);
  write_glb(folder_ / "dim.glb", dim);

  geometry::TriMesh empty;
  color_lava(empty);
  write_glb(folder_ / "empty.glb", empty, {{"crs", "EPSG:27200"}});

  const Outcome outcome = validate_gltf({folder_ / "lava.glb", folder_ / "terrain.glb", folder_ / "dim.glb", folder_ / "empty.glb"});
  std::cout << outcome.text;
  EXPECT_EQ(outcome.code, 0) << outcome.text;
}

TEST_F(GltfValidatorSlow, TheValidatorIsAwake) {
  std::ofstream(folder_ / "bad.glb") << "glTF but not really";
  const Outcome outcome = validate_gltf({folder_ / "bad.glb"});
  EXPECT_EQ(outcome.code, 1) << outcome.text;
}

}  // namespace
}  // namespace effuse::skin
