// `effuse import`: grids and meshes out, a report of every change, and refusals that write nothing.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "geometry/base/files.h"
#include "geometry/mesh/validate.h"
#include "geometry/terrain/triangulate.h"
#include "importers/mesh/import_mesh.h"
#include "importers/terrain/import_dem.h"
#include "importers/terrain/import_terrain.h"
#include "samples/effuse/commands.h"
#include "samples/effuse/load_scene.h"

namespace effuse {
namespace {

namespace fs = std::filesystem;

const fs::path kWhau = fs::path(EFFUSE_SOURCE_DIR) / "samples" / "scenes" / "maunga-whau.asc";

class ImportCommandTest : public testing::Test {
 protected:
  ImportCommandTest() {
    folder_ = fs::temp_directory_path() / fmt::format("effuse.import.{}.{}", testing::UnitTest::GetInstance()->current_test_info()->name(), ::getpid());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~ImportCommandTest() override { fs::remove_all(folder_); }

  /// The document that --json prints.
  static nlohmann::json run(const ImportCommand& command) {
    CommonOptions common;
    common.json = true;
    testing::internal::CaptureStdout();
    const ExitCode code = import_terrain_file(command, common);
    const std::string out = testing::internal::GetCapturedStdout();
    EXPECT_EQ(code, ExitCode::kDone);
    return nlohmann::json::parse(out);
  }
  /// What it is refused with; "" when it is not.
  static std::string refused(const ImportCommand& command) {
    try {
      CommonOptions quiet;
      quiet.quiet = true;
      import_terrain_file(command, quiet);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  ImportCommand command(const fs::path& in, const std::string& out) const {
    ImportCommand c;
    c.files = {in};
    c.output = folder_ / out;
    return c;
  }

  fs::path folder_;
};

TEST_F(ImportCommandTest, AGridSurvivesTheWayThroughBothGridFormats) {
  const importers::DemGrid before = importers::import_dem({kWhau});
  run(command(kWhau, "a.tif"));
  run(command(folder_ / "a.tif", "b.asc"));
  for (const char* name : {"a.tif", "b.asc"}) {
    const importers::DemGrid after = importers::import_dem({folder_ / name});
    EXPECT_EQ(after.z, before.z) << name;
    EXPECT_EQ(after.corner, before.corner) << name;
    EXPECT_EQ(after.spacing, before.spacing) << name;
    EXPECT_NE(after.crs.find("27200"), std::string::npos) << name << " " << after.crs;
  }
}

TEST_F(ImportCommandTest, AMeshOfEveryFormatKeepsTheErrorAskedFor) {
  const geometry::Terrain terrain = importers::import_terrain(kWhau).terrain;
  for (const char* name : {"a.ply", "a.obj", "a.stl", "a.glb"}) {
    ImportCommand c = command(kWhau, name);
    c.max_error = "1.5 m";
    const nlohmann::json told = run(c);
    EXPECT_LE(told["mesh"]["measured_error_m"].get<double>(), 1.5);
    EXPECT_EQ(told["mesh"]["uncovered_posts"], 0);
    // Read back and measured again, from the file.
    const geometry::TriMesh mesh = importers::import_mesh(folder_ / name).mesh;
    EXPECT_EQ(mesh.triangles.size(), told["mesh"]["triangles"].get<std::size_t>()) << name;
    const geometry::VerticalError error = geometry::vertical_error(*terrain.height_field(), mesh);
    EXPECT_LE(error.at_posts, 1.5) << name;
    EXPECT_EQ(error.uncovered, 0u) << name;
    EXPECT_LT(mesh.triangles.size(), 2000u) << "of 10,320";
  }
}

TEST_F(ImportCommandTest, TheOriginAndTheSystemTravelWithEveryFile) {
  for (const char* name : {"a.ply", "a.obj", "a.stl", "a.glb"}) {
    run(command(kWhau, name));
    EXPECT_NE(read_file(folder_ / name).find("2667405 6478705 0"), std::string::npos) << name;
    EXPECT_NE(read_file(folder_ / name).find(std::string(name) == "a.stl" ? "NZGD" : "New Zealand Map Grid"), std::string::npos) << name;
  }
  EXPECT_EQ(read_file(folder_ / "a.stl").find("solid"), std::string::npos) << "which readers would take for the text format";
}

TEST_F(ImportCommandTest, ReportsEachChange) {
  ImportCommand c = command(kWhau, "a.tif");
  c.crop = {2667500, 6478800, 2667900, 6479200};
  c.resample = "20 m,cubic";
  c.pits = "fill";
  const std::string report = run(c)["report"].dump();
  for (const char* part : {"EPSG:27200", "20 m apart (cubic)", "closed depressions, up to", "were filled", "m3 added", "20 x 20 posts"}) EXPECT_NE(report.find(part), std::string::npos) << part << " in " << report;
  c.pits = "fill:2 m";
  EXPECT_NE(run(c)["report"].dump().find("deeper ones kept"), std::string::npos) << "the crater is no error";
}

TEST_F(ImportCommandTest, WhatIsWrongIsToldInOneSentenceAndNothingIsWritten) {
  const auto with = [&](auto&& change) {
    ImportCommand c = command(kWhau, "a.tif");
    change(c);
    const std::string message = refused(c);
    EXPECT_FALSE(message.empty());
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    EXPECT_TRUE(fs::is_empty(folder_)) << message;
    return message;
  };
  EXPECT_NE(with([&](ImportCommand& c) { c.output = folder_ / "a.fbx"; }).find(".ply .obj .glb .stl"), std::string::npos);
  EXPECT_NE(with([](ImportCommand& c) { c.max_error = "1 m"; }).find("is a grid"), std::string::npos);
  EXPECT_NE(with([&](ImportCommand& c) { c.output = folder_ / "a.ply", c.max_error = "1 kg"; }).find("--max-error"), std::string::npos);
  EXPECT_NE(with([&](ImportCommand& c) { c.output = folder_ / "a.ply", c.max_error = "-1 m"; }).find("less than 0"), std::string::npos);
  EXPECT_NE(with([](ImportCommand& c) { c.resample = "20 m,cubik"; }).find("'cubic'"), std::string::npos);
  EXPECT_NE(with([](ImportCommand& c) { c.holes = "fil"; }).find("'fill'"), std::string::npos);
  EXPECT_NE(with([](ImportCommand& c) { c.pits = "fill:2 kg"; }).find("--pits"), std::string::npos);
  EXPECT_NE(with([](ImportCommand& c) { c.crs = "EPSG:4326"; }).find("degrees"), std::string::npos);
  EXPECT_NE(with([](ImportCommand& c) { c.crs = "EPSG:99999"; }).find("EPSG:99999"), std::string::npos);
  EXPECT_NE(with([](ImportCommand& c) { c.crs = "Mars"; }).find("'Mars'"), std::string::npos);
  EXPECT_NE(with([](ImportCommand& c) { c.crop = {0, 0, 1, 1}; }).find("it covers"), std::string::npos);
  EXPECT_NE(with([](ImportCommand& c) { c.size = {10, 10}; }).find("says where it lies"), std::string::npos);
  EXPECT_NE(with([&](ImportCommand& c) { c.files = {folder_ / "none.tif"}; }).find("no such file"), std::string::npos);
  ImportCommand onto = command(kWhau, "a.tif");
  onto.output = kWhau;
  EXPECT_NE(refused(onto).find("would be lost"), std::string::npos);
}

TEST_F(ImportCommandTest, AMeshGoesThroughInALocalFrame) {
  write_file(folder_ / "slope.obj", "v 500000.5 4000000.25 100\nv 500010.5 4000000.25 100\nv 500010.5 4000010.25 110\nv 500000.5 4000010.25 110\nf 1 4 3 2\n");
  ImportCommand c = command(folder_ / "slope.obj", "out.ply");
  const nlohmann::json told = run(c);
  EXPECT_NE(told["report"].dump().find("turned over"), std::string::npos) << told;
  const geometry::TriMesh mesh = importers::import_mesh(folder_ / "out.ply").mesh;
  EXPECT_EQ(mesh.positions[0], Vec3(0.5, 0.25, 100));
  c.max_error = "1 m";
  EXPECT_NE(refused(c).find("is for grids"), std::string::npos);
}

TEST_F(ImportCommandTest, ASceneTakesAMosaicAndItsOptions) {
  ImportCommand half = command(kWhau, "south.tif");
  half.crop = {2667400, 6478700, 2668010, 6479135};
  run(half);
  half = command(kWhau, "north.tif");
  half.crop = {2667400, 6479135, 2668010, 6479570};
  run(half);
  const std::string scene = "[film]\nframes = 2\n[terrain]\nfile = [\"south.tif\", \"north.tif\"]\npits = \"fill\"\ncrop = [2667500, 6478800, 2667900, 6479300]\n[lava]\nspacing = 4\n[[lava.vent]]\nat = [2667700, 6479200]\nwidth = 12\nrate = 30\n";
  write_file(folder_ / "scene.toml", scene);
  const std::unique_ptr<LoadedScene> loaded = load_scene(folder_ / "scene.toml", {}, 0);
  const geometry::HeightField& field = *loaded->terrain->height_field();
  EXPECT_EQ(field.nx(), 40);
  EXPECT_EQ(field.ny(), 50);
  EXPECT_EQ(loaded->terrain->georeference().origin, Vec3(2667505, 6478805, 0));
  EXPECT_EQ(field.height(2667675 - 2667505, 6478995 - 6478805), 168) << "the crater is filled to where it spills";
  // As resolved it is the same ground from elsewhere.
  fs::create_directories(folder_ / "elsewhere");
  write_file(folder_ / "elsewhere" / "scene.toml", loaded->resolved);
  EXPECT_EQ(load_scene(folder_ / "elsewhere" / "scene.toml", {}, 0)->key, loaded->key);
}

TEST_F(ImportCommandTest, TheProgramTakesItsOptions) {
  const std::string line = fmt::format("{} import {} -o {} --max-error 2m --crop=2667500,6478800,2667900,6479200 --quiet && {} import {} -o {} --crop 2667500 6478800 2667900 6479200 --resample 20m > /dev/null", EFFUSE_PROGRAM, kWhau.string(),
                                       (folder_ / "a.glb").string(), EFFUSE_PROGRAM, kWhau.string(), (folder_ / "a.tif").string());
  EXPECT_EQ(std::system(line.c_str()), 0);
  EXPECT_TRUE(fs::exists(folder_ / "a.glb"));
  EXPECT_EQ(importers::import_dem({folder_ / "a.tif"}).nx, 20) << "every second post of the file";
}

}  // namespace
}  // namespace effuse
