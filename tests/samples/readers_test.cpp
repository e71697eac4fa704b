#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "geometry/base/files.h"
#include "importers/mesh/ply_reader.h"

/// A run as other programs read it: Blender, ParaView, a USD parser, the glTF validator, each as Debian or npm has it (samples/packages.sh test).
/// Where one is not to be had its test says so and is skipped.
namespace effuse {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

struct Outcome {
  int code = -1;
  std::string text;
};

/// A shell's line; its paths hold no quotes.
Outcome call(const std::string& command) {
  Outcome outcome;
  FILE* pipe = ::popen(("{ " + command + "; } 2>&1").c_str(), "r");
  if (!pipe) return outcome;
  char buffer[4096];
  while (std::fgets(buffer, sizeof buffer, pipe)) outcome.text += buffer;
  const int status = ::pclose(pipe);
  outcome.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return outcome;
}

bool have(const std::string& program) { return call("command -v " + program).code == 0; }

constexpr int kFrames = 24;

/// One coarse run of Maunga Whau for all: a minute of lava, a film of a second.
class ReadersSlow : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new fs::path(fs::temp_directory_path() / fmt::format("effuse readers \xc3\xa9 {}", ::getpid()));
    fs::remove_all(*folder_);
    fs::create_directories(*folder_);
    const Outcome outcome = call(fmt::format("'{}' run '{}/samples/scenes/maunga-whau.toml' -o '{}' --frames {} --set 'lava.spacing=2.5 m' --set film.time_scale=60 --set preview.width=320 --set preview.height=180 "
                                             "--set 'output.formats=[\"ply\", \"obj\", \"glb\", \"vdb\", \"vtp\", \"usda\", \"bgeo\", \"glb-flipbook\"]' -q",
                                             EFFUSE_PROGRAM, EFFUSE_SOURCE_DIR, run().string(), kFrames));
    ASSERT_EQ(outcome.code, 0) << outcome.text;
  }
  static void TearDownTestSuite() {
    if (!std::getenv("EFFUSE_KEEP")) fs::remove_all(*folder_);
    else fmt::print("kept: {}\n", folder_->string());
    delete folder_;
    folder_ = nullptr;
  }
  static fs::path run() { return *folder_ / "run"; }
  static fs::path out() { return *folder_; }

  struct Skin {
    std::size_t vertices = 0, faces = 0;
    Box3 box;
    double coldest = 1e9, hottest = 0, fastest = 0;
  };
  /// The run's own file, read by our own parser.
  static Skin skin(int frame) {
    const fs::path file = run() / "frames" / fmt::format("skin.{:04}.ply", frame);
    const importers::PlyMesh ply = importers::parse_ply(read_file(file), file.string());
    Skin s{ply.positions.size(), ply.corners.size() / 3, {}, 1e9, 0, 0};
    for (const Vec3& x : ply.positions) s.box.extend(x);
    if (!ply.attributes.contains("temperature")) return s;
    for (const float t : ply.attributes.at("temperature").values) s.coldest = std::min<double>(s.coldest, t), s.hottest = std::max<double>(s.hottest, t);
    const std::vector<float>& v = ply.attributes.at("velocity").values;
    for (std::size_t i = 0; i + 2 < v.size(); i += 3) s.fastest = std::max(s.fastest, Vec3(v[i], v[i + 1], v[i + 2]).norm());
    return s;
  }
  static void expect_box(const json& about, const Box3& box, double tolerance, const std::string& what) {
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_NEAR(about.at("min").at(k).get<double>(), box.min()[static_cast<Eigen::Index>(k)], tolerance) << what << ", axis " << k;
      EXPECT_NEAR(about.at("max").at(k).get<double>(), box.max()[static_cast<Eigen::Index>(k)], tolerance) << what << ", axis " << k;
    }
  }

  static fs::path* folder_;
};
fs::path* ReadersSlow::folder_ = nullptr;

TEST_F(ReadersSlow, BlenderShowsTheRunAsItWas) {
  if (!have("blender")) GTEST_SKIP() << "blender is not here: apt-get install blender";
  const Outcome outcome = call(fmt::format("ACCEPT_RUN='{0}' ACCEPT_OUT='{1}' ACCEPT_FRAMES=8,16,{2} blender -b --factory-startup -noaudio --python-exit-code 1 --python '{0}/open_in_blender.py' --python '{3}/tests/tools/blender_accept.py'",
                                           run().string(), out().string(), kFrames, EFFUSE_SOURCE_DIR));
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  const json report = json::parse(read_file(out() / "blender.json"));
  EXPECT_EQ(report.at("end"), kFrames);
  EXPECT_EQ(report.at("fps"), 24);
  EXPECT_TRUE(report.at("motion_blur").get<bool>());
  EXPECT_EQ(report.at("objects"), json({"camera", "lava volume", "skin", "sun", "terrain"}));

  std::size_t before = 0;
  for (const int frame : {8, 16, kFrames}) {
    SCOPED_TRACE(frame);
    const json& about = report.at("frames").at(std::to_string(frame));
    const Skin wanted = skin(frame);
    EXPECT_EQ(about.at("vertices"), wanted.vertices);
    EXPECT_EQ(about.at("faces"), wanted.faces);
    EXPECT_GT(wanted.faces, before) << "the frame handler moves on";
    before = wanted.faces;
    expect_box(about, wanted.box, 1e-3, "skin");
    const json& attributes = about.at("attributes");
    EXPECT_NEAR(attributes.at("temperature").at("max").at(0).get<double>(), wanted.hottest, 0.01);
    EXPECT_NEAR(attributes.at("temperature").at("min").at(0).get<double>(), wanted.coldest, 0.01);
    EXPECT_NEAR(attributes.at("velocity").at("length").get<double>(), 60 * wanted.fastest, 60 * 1e-4 * wanted.fastest) << "metres a second of film";
    EXPECT_GT(attributes.at("glow").at("max").at(0).get<double>(), 1);
    for (const char* color : {"Col", "albedo"}) EXPECT_GT(attributes.at(color).at("max").at(0).get<double>(), 0.01) << color;
    // What glows in the picture is where the lava is seen, and all of it at the fissure's picture, not the ground.
    EXPECT_GT(about.at("glowing").get<int>(), 20);
    for (std::size_t k = 0; k < 2; ++k) {
      EXPECT_GT(about.at("glow_at").at(k).get<double>(), about.at("seen_from").at(k).get<double>());
      EXPECT_LT(about.at("glow_at").at(k).get<double>(), about.at("seen_to").at(k).get<double>());
    }
    const json& shown = report.at("flipbook").at(std::to_string(frame));
    ASSERT_EQ(shown.size(), 1u) << "one frame of film.glb at a time";
    EXPECT_EQ(shown.at(0).at(1), wanted.vertices);
  }

  // Blender's own importers, of the last frame: the same count where the format shares vertices, the same place everywhere.
  const Skin last = skin(kFrames);
  for (const char* format : {"ply", "obj", "glb"}) {
    const json& about = report.at("imports").at(format);
    EXPECT_EQ(about.at("faces"), last.faces) << format;
    EXPECT_EQ(about.at("vertices"), last.vertices) << format;
    expect_box(about, last.box, 2e-3, format);
    bool colored = false;
    for (const auto& [name, values] : about.at("attributes").items()) colored |= (name == "Col" || name == "Color") && values.at("max").at(0) > 0.3;
    EXPECT_TRUE(colored) << format << about.dump();
  }
  // VDB: Blender's box of a volume is that of its leaves, of 8 voxels of half a particle spacing each.
  const json& volume = report.at("imports").at("vdb");
  for (const char* grid : {"surface", "density", "temperature", "velocity"}) EXPECT_TRUE(volume.at("grids").contains(grid)) << grid;
  constexpr double kLeaf = 8 * 0.5 * 2.5;
  for (std::size_t k = 0; k < 3; ++k) {
    const double low = last.box.min()[static_cast<Eigen::Index>(k)] - volume.at("min").at(k).get<double>(), high = volume.at("max").at(k).get<double>() - last.box.max()[static_cast<Eigen::Index>(k)];
    for (const double beyond : {low, high}) {
      EXPECT_GT(beyond, -1) << "the skin's bumps at most; axis " << k;
      EXPECT_LT(beyond, kLeaf + 2.5) << k;
    }
  }

  // Its camera is the preview's.
  const json key = json::parse(read_file(run() / "manifest.json")).at("camera").at("keys").at(kFrames - 1);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(report.at("camera").at("eye").at(k).get<double>(), key.at("eye").at(k).get<double>(), 1e-2);
  EXPECT_NEAR(report.at("camera").at("fov").get<double>(), key.at("fov").get<double>(), 1e-4);
}

TEST_F(ReadersSlow, ASavedBlendGoesOnFollowingTheFrames) {
  if (!have("blender")) GTEST_SKIP() << "blender is not here: apt-get install blender";
  const std::string blender = "blender -b --factory-startup -noaudio --python-exit-code 1", blend = (out() / "saved.blend").string();
  Outcome outcome = call(fmt::format("{} --python '{}/open_in_blender.py' --python-expr 'import bpy; bpy.ops.wm.save_as_mainfile(filepath=\"{}\")'", blender, run().string(), blend));
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  outcome = call(fmt::format("{} --enable-autoexec '{}' --python-expr 'import bpy; bpy.context.scene.frame_set({}); print(\"has\", len(bpy.data.objects[\"skin\"].data.vertices))'", blender, blend, kFrames));
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_NE(outcome.text.find(fmt::format("has {}\n", skin(kFrames).vertices)), std::string::npos) << outcome.text;
}

TEST_F(ReadersSlow, BlenderReadsARunOfGlbAloneWithoutAManifest) {
  if (!have("blender")) GTEST_SKIP() << "blender is not here: apt-get install blender";
  const fs::path bare = out() / "bare";
  fs::create_directories(bare / "frames");
  for (int frame = 20; frame <= kFrames; ++frame) fs::copy(run() / "frames" / fmt::format("skin.{:04}.glb", frame), bare / "frames");
  for (const char* file : {"terrain.glb", "open_in_blender.py"}) fs::copy(run() / file, bare);
  const Outcome outcome = call(fmt::format("blender -b --factory-startup -noaudio --python-exit-code 1 --python '{}/open_in_blender.py' --python-expr 'import bpy; bpy.context.scene.frame_set({}); m = bpy.data.objects[\"skin\"].data; "
                                           "print(\"has\", len(m.vertices), \"temperature\" in m.attributes, \"velocity\" in m.attributes, round(bpy.data.objects[\"skin\"].dimensions.z))'",
                                           bare.string(), kFrames));
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  const Skin last = skin(kFrames);
  EXPECT_NE(outcome.text.find(fmt::format("has {} True True {}\n", last.vertices, std::lround(last.box.sizes().z()))), std::string::npos) << outcome.text;
}

TEST_F(ReadersSlow, ParaViewReadsTimesAndTemperatures) {
  if (!have("pvbatch") || !have("Xvfb")) GTEST_SKIP() << "pvbatch or Xvfb is not here: apt-get install paraview python3-paraview xvfb";
  const std::string tools = fmt::format("{}/tests/tools", EFFUSE_SOURCE_DIR), screen = fmt::format("sh '{}/with_display.sh' pvbatch", tools);
  Outcome outcome = call(fmt::format("{} '{}/paraview_accept.py' '{}' '{}'", screen, tools, run().string(), (out() / "paraview.json").string()));
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  const json report = json::parse(read_file(out() / "paraview.json"));
  for (const char* source : {"pvd", "series", "ply"}) {
    SCOPED_TRACE(source);
    const json& about = report.at(source);
    ASSERT_EQ(about.at("times").size(), static_cast<std::size_t>(kFrames));
    for (int frame = 1; frame <= kFrames; ++frame) {
      const json& shown = about.at("frames").at(static_cast<std::size_t>(frame - 1));
      const Skin wanted = skin(frame);
      EXPECT_NEAR(about.at("times").at(static_cast<std::size_t>(frame - 1)).get<double>(), frame * 60 / 24.0, 1e-9);
      ASSERT_EQ(shown.at("points"), wanted.vertices) << frame;
      if (wanted.vertices == 0) continue;
      EXPECT_EQ(shown.at("cells"), wanted.faces);
      EXPECT_NEAR(shown.at("temperature").at(0).get<double>(), wanted.coldest, 1e-3);
      EXPECT_NEAR(shown.at("temperature").at(1).get<double>(), wanted.hottest, 1e-3);
      EXPECT_NEAR(shown.at("bounds").at(0).get<double>(), wanted.box.min().x(), 1e-3);
      EXPECT_NEAR(shown.at("bounds").at(5).get<double>(), wanted.box.max().z(), 1e-3);
    }
    for (const char* array : {"color", "crust", "glow", "velocity"}) EXPECT_NE(about.at("frames").back().at("arrays").dump().find(fmt::format("\"{}\"", array)), std::string::npos) << array;
  }
  outcome = call(fmt::format("{} '{}/open_in_paraview.py' '{}'", screen, run().string(), (out() / "paraview.png").string()));
  EXPECT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_GT(fs::file_size(out() / "paraview.png"), 10'000u);
}

TEST_F(ReadersSlow, AUsdParserReadsEveryFrameAndTheStage) {
  std::string files = fmt::format("'{0}/film.usda' '{0}/terrain.usda' '{0}/frames/skin.clips.usda'", run().string());
  for (int frame = 1; frame <= kFrames; ++frame) files += fmt::format(" '{}/frames/skin.{:04}.usda'", run().string(), frame);
  const Outcome outcome = call(fmt::format("sh '{}/tests/tools/usda_read.sh' '{}' {}", EFFUSE_SOURCE_DIR, EFFUSE_BINARY_DIR, files));
  if (outcome.code == 3) GTEST_SKIP() << outcome.text;
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  std::istringstream lines(outcome.text);
  std::vector<json> layers;
  for (std::string line; std::getline(lines, line);)
    if (line.starts_with("{")) layers.push_back(json::parse(line));
  ASSERT_EQ(layers.size(), kFrames + 3u) << outcome.text;
  for (const json& layer : layers) EXPECT_TRUE(layer.at("ok").get<bool>()) << layer.at("file") << layer.at("error");
  const std::string stage = layers[0].at("text");
  for (const char* part : {"upAxis = \"Z\"", "metersPerUnit = 1", "timeCodesPerSecond = 24", "endTimeCode = 24", "def Camera \"camera\"", "def DistantLight \"sun\"", "def Material \"lava\"", "primPath", "manifestAssetPath",
                           "prepend references = @./terrain.usda@"})
    EXPECT_NE(stage.find(part), std::string::npos) << part;
  for (int frame = 1; frame <= kFrames; ++frame) {
    const json& counts = layers[static_cast<std::size_t>(frame + 2)].at("counts");
    const Skin wanted = skin(frame);
    EXPECT_EQ(counts.at("point3f[] points"), wanted.vertices) << frame;
    EXPECT_EQ(counts.at("int[] faceVertexIndices"), 3 * wanted.faces);
    if (wanted.vertices == 0) continue;
    for (const char* name : {"float[] primvars:temperature", "color3f[] primvars:displayColor", "vector3f[] velocities", "normal3f[] normals", "color3f[] primvars:glow"}) EXPECT_EQ(counts.at(name), wanted.vertices) << name;
  }
}

TEST_F(ReadersSlow, TheGltfValidatorFindsNothing) {
  const Outcome outcome = call(fmt::format("sh '{0}/tests/tools/gltf_validate.sh' '{1}' '{2}/film.glb' '{2}/terrain.glb' '{2}/frames/skin.{3:04}.glb' '{2}/frames/skin.0001.glb'", EFFUSE_SOURCE_DIR, EFFUSE_BINARY_DIR, run().string(), kFrames));
  if (outcome.code == 3) GTEST_SKIP() << outcome.text;
  EXPECT_EQ(outcome.code, 0) << outcome.text;
}

/// Houdini itself is not to be had: its script's reading of the frames is what can be tried.
TEST_F(ReadersSlow, TheHoudiniScriptReadsTheFrames) {
  if (call("/usr/bin/python3 -c 'import numpy'").code != 0) GTEST_SKIP() << "python3-numpy is not here";
  const Outcome outcome = call(fmt::format("/usr/bin/python3 '{}/open_in_houdini.py'", run().string()));
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  const Skin last = skin(kFrames);
  EXPECT_NE(outcome.text.find(fmt::format("skin: {} frames; frame {}: {} points, {} triangles, Cd ", kFrames, kFrames, last.vertices, last.faces)), std::string::npos) << outcome.text;
  for (const char* name : {" v\n", " temperature ", " emitcolor ", " rest "}) EXPECT_NE(outcome.text.find(name), std::string::npos) << name << outcome.text;
}

}  // namespace
}  // namespace effuse
