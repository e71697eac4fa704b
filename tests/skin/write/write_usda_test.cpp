#include "skin/write/write_usda.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/parallel.h"
#include "skin/color/lava_color.h"
#include "tests/skin/sample_lava.h"

namespace effuse::skin {
namespace {

namespace fs = std::filesystem;
using geometry::TriMesh;

class WriteUsda : public testing::Test {
 protected:
  WriteUsda() { fs::create_directories(folder_ / "frames"); }
  ~WriteUsda() override { fs::remove_all(folder_); }
  fs::path folder_ = fs::temp_directory_path() / fmt::format("effuse_usda_{}_{}", ::getpid(), testing::UnitTest::GetInstance()->current_test_info()->name());
};

TriMesh lava(int along = 40) {
  TriMesh mesh = testing_meshes::tube(60, 3, along, 12);
  color_lava(mesh);
  return mesh;
}

/// The numbers of an attribute's only time sample.
std::vector<float> sample(const std::string& text, const std::string& declaration, int frame) {
  const std::string begin = fmt::format("    {}.timeSamples = {{\n        {}: [", declaration, frame);
  const std::size_t at = text.find(begin);
  EXPECT_NE(at, std::string::npos) << declaration;
  std::vector<float> values;
  if (at == std::string::npos) return values;
  for (const char* c = text.data() + at + begin.size(); *c != ']';) {
    if (*c == '(' || *c == ')' || *c == ',' || *c == ' ') {
      ++c;
      continue;
    }
    char* end = nullptr;
    values.push_back(std::strtof(c, &end));
    if (end == c) break;
    c = end;
  }
  return values;
}

/// Brackets outside strings and asset names close in order.
void expect_balanced(const std::string& text) {
  std::string open;
  char quote = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quote) {
      if (c == '\\') ++i;
      else if (c == quote) quote = 0;
    } else if (c == '"' || c == '@') {
      quote = c;
    } else if (c == '(' || c == '[' || c == '{') {
      open += c;
    } else if (c == ')' || c == ']' || c == '}') {
      ASSERT_FALSE(open.empty()) << text.substr(i > 80 ? i - 80 : 0, 100);
      ASSERT_EQ(open.back(), c == ')' ? '(' : c == ']' ? '[' : '{');
      open.pop_back();
    }
  }
  EXPECT_TRUE(open.empty());
  EXPECT_EQ(quote, 0);
}

TEST_F(WriteUsda, AFrameHoldsTopologyAndEveryAttributeAtItsTimeCode) {
  const TriMesh mesh = lava();
  write_usda_frame(folder_ / "a.usda", mesh, "skin", {12, 25, 30}, {{"crs", "PROJCS[\"x\"]"}, {"a key", "b\\c"}});
  const std::string text = read_file(folder_ / "a.usda");
  expect_balanced(text);
  for (const char* line : {"#usda 1.0\n", "upAxis = \"Z\"", "metersPerUnit = 1\n", "timeCodesPerSecond = 25\n", "defaultPrim = \"skin\"", "def Mesh \"skin\"", "string crs = \"PROJCS[\\\"x\\\"]\"", "string a_key = \"b\\\\c\"",
                           "uniform token subdivisionScheme = \"none\"", "color3f[] primvars:displayColor (interpolation = \"vertex\")"})
    EXPECT_NE(text.find(line), std::string::npos) << line;
  const std::size_t n = mesh.positions.size();
  const auto points = sample(text, "point3f[] points", 12), normals = sample(text, "normal3f[] normals", 12), velocities = sample(text, "vector3f[] velocities", 12);
  ASSERT_EQ(points.size(), 3 * n);
  ASSERT_EQ(normals.size(), 3 * n);
  ASSERT_EQ(velocities.size(), 3 * n);
  for (std::size_t i = 0; i < 3 * n; ++i) {
    ASSERT_EQ(points[i], static_cast<float>(mesh.positions[i / 3][static_cast<Eigen::Index>(i % 3)])) << "every digit";
    ASSERT_EQ(velocities[i], 30 * mesh.attributes.at("velocity").values[i]) << "of film";
  }
  EXPECT_EQ(sample(text, "float[] primvars:temperature", 12), mesh.attributes.at("temperature").values);
  EXPECT_EQ(sample(text, "color3f[] primvars:displayColor", 12), mesh.attributes.at("color").values) << "linear";
  EXPECT_EQ(sample(text, "color3f[] primvars:glow", 12), mesh.attributes.at("glow").values);
  EXPECT_EQ(sample(text, "int[] faceVertexCounts", 12), std::vector<float>(mesh.triangles.size(), 3));
  const auto corners = sample(text, "int[] faceVertexIndices", 12);
  ASSERT_EQ(corners.size(), 3 * mesh.triangles.size());
  for (std::size_t i = 0; i < corners.size(); ++i) ASSERT_EQ(corners[i], static_cast<float>(mesh.triangles[i / 3][i % 3]));
  const auto extent = sample(text, "float3[] extent", 12);
  ASSERT_EQ(extent.size(), 6u);
  Box3 box;
  for (const Vec3& x : mesh.positions) box.extend(x);
  EXPECT_EQ(extent[0], static_cast<float>(box.min().x()));
  EXPECT_EQ(extent[5], static_cast<float>(box.max().z()));
}

TEST_F(WriteUsda, ParticlesArePointsWithWidthsAndIds) {
  TriMesh mesh;
  mesh.positions = {Vec3(1, 2, 3), Vec3(4, 5, 6)};
  mesh.attributes["radius"].values = {0.5f, 0.25f};
  mesh.attributes["id"].values = {7, 9};
  write_usda_frame(folder_ / "p.usda", mesh, "2 sparks", {3, 24, 1});
  const std::string text = read_file(folder_ / "p.usda");
  expect_balanced(text);
  EXPECT_NE(text.find("def Points \"_2_sparks\""), std::string::npos) << "a name that USD takes";
  EXPECT_EQ(sample(text, "float[] widths", 3), (std::vector<float>{1, 0.5f}));
  EXPECT_EQ(sample(text, "int64[] ids", 3), (std::vector<float>{7, 9}));
  EXPECT_EQ(text.find("faceVertex"), std::string::npos);
}

TEST_F(WriteUsda, AnEmptyMeshIsAFileAndABrokenOneNone) {
  write_usda_frame(folder_ / "e.usda", TriMesh{}, "skin", {});
  const std::string text = read_file(folder_ / "e.usda");
  expect_balanced(text);
  EXPECT_NE(text.find("points.timeSamples = {\n        1: [],"), std::string::npos);
  TriMesh broken = lava();
  broken.triangles[0][0] = 99999;
  EXPECT_THROW(write_usda_frame(folder_ / "b.usda", broken, "skin", {}), InputError);
  broken = lava();
  broken.attributes["wide"] = {5, std::vector<float>(5 * broken.positions.size())};
  EXPECT_THROW(write_usda_frame(folder_ / "b.usda", broken, "skin", {}), InputError);
  EXPECT_FALSE(fs::exists(folder_ / "b.usda"));
}

TEST_F(WriteUsda, TheSameBytesOnAnyNumberOfThreads) {
  const TriMesh mesh = lava(2000);
  write_usda_frame(folder_ / "many.usda", mesh, "skin", {});
  const ThreadLimit one(1);
  write_usda_frame(folder_ / "one.usda", mesh, "skin", {});
  EXPECT_TRUE(read_file(folder_ / "many.usda") == read_file(folder_ / "one.usda"));
}

TEST_F(WriteUsda, AStageShowsFramesByClipsAndLooksAsTheRunDid) {
  const TriMesh mesh = lava();
  UsdaStage stage;
  stage.fps = 24;
  stage.last_frame = 5;
  stage.stills = {{"terrain", "terrain.usda"}, {"obstacles", "obstacles.usda"}};
  stage.sequences.push_back({"skin", false, usda_attributes(mesh), {{2, "frames/skin.0002.usda"}, {4, "frames/skin.0004.usda"}}});
  UsdaView view;
  view.camera = {Vec3(10, 0, 0), Vec3(0, 0, 0), 2 * std::atan(0.5)};
  view.sun_direction = Vec3(0, 0, 1);
  view.light = {Vec3(3, 2, 1), Vec3(0.1, 0.2, 0.3)};
  stage.views = {view};
  write_usda_stage(folder_ / "film.usda", stage);
  const std::string text = read_file(folder_ / "film.usda");
  expect_balanced(text);
  for (const char* part :
       {"prepend references = @./terrain.usda@", "def \"obstacles\" (", "asset[] assetPaths = [@./frames/skin.0002.usda@, @./frames/skin.0004.usda@]", "double2[] active = [(2, 0), (4, 1)]", "double2[] times = [(2, 2), (4, 4)]",
        "asset manifestAssetPath = @./frames/skin.clips.usda@", "string primPath = \"/skin\"", "endTimeCode = 5", "rel material:binding = </film/lava>", "float focalLength = 24\n", "float verticalAperture = 24\n",
        "color3f inputs:color = (3, 2, 1)", "color3f inputs:color = (0.1, 0.2, 0.3)"})
    EXPECT_NE(text.find(part), std::string::npos) << part << "\n" << text;
  // At (10, 0, 0), looking along -x, z up: its right is y, its back x.
  EXPECT_NE(text.find("matrix4d xformOp:transform = ( (0, 1, 0, 0), (0, 0, 1, 0), (1, 0, 0, 0), (10, 0, 0, 1) )"), std::string::npos) << text.substr(text.find("def Camera"));
  const std::string clips = read_file(folder_ / "frames" / "skin.clips.usda");
  expect_balanced(clips);
  for (const char* part : {"over \"skin\"", "point3f[] points\n", "vector3f[] velocities\n", "float[] primvars:temperature\n", "int[] faceVertexCounts\n"}) EXPECT_NE(clips.find(part), std::string::npos) << part;

  // A camera that moves has time samples.
  stage.views.push_back(view);
  stage.views[1].frame = 3;
  stage.views[1].camera.eye = Vec3(0, 10, 0);
  write_usda_stage(folder_ / "film.usda", stage);
  const std::string moving = read_file(folder_ / "film.usda");
  EXPECT_NE(moving.find("matrix4d xformOp:transform.timeSamples = {\n            1: "), std::string::npos);
  EXPECT_NE(moving.find("float focalLength = 24\n"), std::string::npos) << "what stands still has none";
}

}  // namespace
}  // namespace effuse::skin
