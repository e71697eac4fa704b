#include "skin/write/write_flipbook.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <nlohmann/json.hpp>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "importers/mesh/glb_attributes.h"
#include "skin/color/lava_color.h"
#include "tests/skin/sample_lava.h"

namespace effuse::skin {
namespace {

namespace fs = std::filesystem;
using geometry::TriMesh;
using nlohmann::json;

class WriteFlipbook : public testing::Test {
 protected:
  WriteFlipbook() { fs::create_directories(folder_); }
  ~WriteFlipbook() override { fs::remove_all(folder_); }
  fs::path folder_ = fs::temp_directory_path() / fmt::format("effuse_book_{}_{}", ::getpid(), testing::UnitTest::GetInstance()->current_test_info()->name());
};

TriMesh lava(int along) {
  TriMesh mesh = testing_meshes::tube(60, 3, along, 12);
  color_lava(mesh);
  return mesh;
}

struct Glb {
  json j;
  std::string bin;
  std::vector<float> floats(int accessor) const {
    const json& a = j.at("accessors").at(static_cast<std::size_t>(accessor));
    const json& view = j.at("bufferViews").at(a.at("bufferView").get<std::size_t>());
    std::vector<float> values(view.at("byteLength").get<std::size_t>() / 4);
    std::memcpy(values.data(), bin.data() + view.at("byteOffset").get<std::size_t>(), 4 * values.size());
    return values;
  }
};

Glb parse(const fs::path& file) {
  const std::string bytes = read_file(file);
  std::uint32_t total = 0, length = 0;
  std::memcpy(&total, bytes.data() + 8, 4);
  std::memcpy(&length, bytes.data() + 12, 4);
  EXPECT_EQ(total, bytes.size());
  return {json::parse(bytes.substr(20, length)), bytes.size() > 28 + length ? bytes.substr(28 + length) : ""};
}

/// What a node's scale is at a time, by STEP; 1 where it has no channel.
float scale_at(const Glb& glb, std::size_t node, float time) {
  float scale = 1;
  for (const json& channel : glb.j.at("animations").at(0).at("channels")) {
    if (channel.at("target").at("node") != node) continue;
    EXPECT_EQ(channel.at("target").at("path"), "scale");
    const json& sampler = glb.j.at("animations").at(0).at("samplers").at(channel.at("sampler").get<std::size_t>());
    EXPECT_EQ(sampler.at("interpolation"), "STEP");
    const auto times = glb.floats(sampler.at("input")), scales = glb.floats(sampler.at("output"));
    EXPECT_EQ(scales.size(), 3 * times.size());
    scale = scales[0];
    for (std::size_t k = 0; k < times.size(); ++k)
      if (times[k] <= time) scale = scales[3 * k];
  }
  return scale;
}

TEST_F(WriteFlipbook, ShowsOneFrameAtATimeAndTheGroundAlways) {
  Flipbook book("film");
  TriMesh ground = testing_meshes::tube(10, 1, 4, 6);
  ground.attributes.clear();
  book.add_still("terrain", ground);
  book.add_frame("skin", 0, TriMesh{});  // before the lava comes
  const TriMesh first = lava(10), second = lava(20), third = lava(30);
  book.add_frame("skin", 0.25, first);
  book.add_frame("skin", 0.5, second);
  book.add_frame("skin", 0.75, third);
  book.finish(folder_ / "film.glb", 1, {{"crs", "x"}});
  const Glb glb = parse(folder_ / "film.glb");
  ASSERT_EQ(glb.j.at("nodes").size(), 4u) << "none for the empty one";
  EXPECT_EQ(glb.j.at("nodes").at(1).at("name"), "skin.0002") << "as the frame's number";
  for (const float time : {0.f, 0.1f, 0.25f, 0.3f, 0.5f, 0.6f, 0.75f, 0.9f, 1.f}) {
    const int shown = time < 0.25f ? -1 : time < 0.5f ? 0 : time < 0.75f ? 1 : 2;
    EXPECT_EQ(scale_at(glb, 0, time), 1) << "terrain";
    for (int k = 0; k < 3; ++k) EXPECT_EQ(scale_at(glb, static_cast<std::size_t>(k + 1), time), k == shown ? 1 : 0) << k << " at " << time;
  }
  // Without its animation: the last frame.
  EXPECT_EQ(glb.j.at("nodes").at(1).at("scale").at(0), 0);
  EXPECT_FALSE(glb.j.at("nodes").at(3).contains("scale"));
  EXPECT_EQ(glb.j.at("materials").size(), 3u);
  EXPECT_TRUE(glb.j.at("materials").at(2).contains("emissiveTexture"));
  EXPECT_FALSE(glb.j.at("materials").at(1).contains("emissiveTexture")) << "of what is coloured and does not glow, which has no place in the ramp";
  EXPECT_EQ(glb.j.at("images").size(), 1u) << "one ramp for all";

  std::vector<std::string> notes;
  const auto primitives = importers::read_glb_primitives(read_file(folder_ / "film.glb"), "film.glb", notes);
  ASSERT_EQ(primitives.size(), 4u);
  EXPECT_EQ(primitives[2].vertices, second.positions.size());
  EXPECT_EQ(primitives[2].attributes.at("temperature").values, second.attributes.at("temperature").values);
  EXPECT_EQ(primitives[2].attributes.at("velocity").values[0], second.attributes.at("velocity").values[0]);
}

TEST_F(WriteFlipbook, AFilmOfNothingIsAFileAndABrokenMeshNamesItsFrame) {
  Flipbook none("film");
  none.add_frame("skin", 0, TriMesh{});
  none.finish(folder_ / "none.glb", 1);
  EXPECT_FALSE(parse(folder_ / "none.glb").j.contains("nodes"));

  Flipbook book("film");
  TriMesh broken = lava(5);
  broken.triangles[3][1] = 99999;
  try {
    book.add_frame("skin", 0, broken);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("skin.0001"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace effuse::skin
