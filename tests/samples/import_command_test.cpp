// `effuse import`: grids and meshes out, a report of every change, and refusals that write nothing.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>

#include "geometry/base/files.h"
#include "geometry/mesh/validate.h"
#include "geometry/remesh/surface_distance.h"
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
  c.resample = "1 m";
  EXPECT_NE(refused(c).find("--resample: is for grids"), std::string::npos);
}

class ImportCommandTestSlow : public ImportCommandTest {};

TEST_F(ImportCommandTestSlow, ASceneTakesAMosaicAndItsOptions) {
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

TEST_F(ImportCommandTest, ASceneTakesAMeshAsImportDoes) {
  // Hills in millimetres with y up, wound the wrong way, with a hole: what the options make of them, the scene's keys make, too.
  std::string text;
  constexpr int kSide = 21;
  for (int j = 0; j < kSide; ++j)
    for (int i = 0; i < kSide; ++i) text += fmt::format("v {} {:.3f} {}\n", 2000 * i, 300 * std::sin(0.3 * i) * std::cos(0.2 * j), -2000 * j);
  for (int j = 0; j + 1 < kSide; ++j)
    for (int i = 0; i + 1 < kSide; ++i) {
      const int a = 1 + j * kSide + i, b = a + kSide;
      if (i != 9 || j != 9) text += fmt::format("f {} {} {}\nf {} {} {}\n", a, b, a + 1, a + 1, b, b + 1);
    }
  write_file(folder_ / "hills.obj", text);
  ImportCommand c = command(folder_ / "hills.obj", "hills.ply");
  c.unit = "mm";
  c.up = "y";
  c.fill_holes = "3 m";
  c.max_error = "5 cm";
  c.crop = {4, 4, 36, 36};
  c.on_map = true;
  run(c);
  const std::string keys = "file = \"hills.obj\"\nunit = \"mm\"\nup = \"y\"\nfill_holes = \"3 m\"\nmax_error = \"5 cm\"\ncrop = [4, 4, 36, 36]\n";
  const std::string rest = "[lava]\nspacing = 1\n[[lava.vent]]\nat = [20, 20]\nwidth = 4\nrate = 1\n";
  const auto scene = [&](const std::string& terrain, const fs::path& where) {
    write_file(where, "[film]\nframes = 2\n[terrain]\n" + terrain + rest);
    return load_scene(where, {}, 0);
  };
  const std::unique_ptr<LoadedScene> loaded = scene(keys, folder_ / "scene.toml");
  const geometry::TriMesh imported = importers::import_mesh(folder_ / "hills.ply").mesh;
  const Vec3 origin = loaded->terrain->georeference().origin;
  ASSERT_EQ(loaded->terrain->mesh().triangles.size(), imported.triangles.size());
  EXPECT_EQ(loaded->terrain->mesh().positions.front() + origin, imported.positions.front()) << "to the bit: on the map the file holds doubles";
  EXPECT_LT(imported.triangles.size(), 300u) << "of 800";
  std::string told;
  for (const std::string& note : loaded->notes) told += note + "\n";
  for (const char* part : {"turned from y up", "of 0.001 m to metres, as asked", "1 hole", "faced down", "cropped", "simplified to 0.05 m", "proven: nowhere more than"}) EXPECT_NE(told.find(part), std::string::npos) << part << " in " << told;
  EXPECT_EQ(told.find("warning"), std::string::npos) << told;
  // As resolved it is the same ground, without the keys of grids.
  EXPECT_EQ(loaded->resolved.find("pit_depth"), std::string::npos) << loaded->resolved;
  fs::create_directories(folder_ / "elsewhere");
  write_file(folder_ / "elsewhere" / "scene.toml", loaded->resolved);
  EXPECT_EQ(load_scene(folder_ / "elsewhere" / "scene.toml", {}, 0)->key, loaded->key);
  // Without them the guesses are told; keys that do not fit are refused where they stand.
  write_file(folder_ / "flat.obj", "v 0 0 0\nv 40 0 0\nv 40 40 0\nv 0 40 0\nf 1 2 3 4\n");
  told.clear();
  const std::unique_ptr<LoadedScene> guessed = scene("file = \"flat.obj\"\n", folder_ / "guess.toml");
  for (const std::string& note : guessed->notes) told += note + "\n";
  EXPECT_NE(told.find("warning: the file names no unit: metres are assumed, 40 m across; in millimetres it would be 0.04 m"), std::string::npos) << told;
  EXPECT_NE(told.find("warning: the file does not say which axis is up: z is assumed"), std::string::npos) << told;
  const auto refusal_of = [&](const std::string& terrain) -> std::string {
    try {
      scene(terrain, folder_ / "wrong.toml");
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(refusal_of(keys + "pits = \"fill\"\n").find("wrong.toml:10:8: terrain.pits: is for grids, and 'hills.obj' is a mesh"), std::string::npos) << refusal_of(keys + "pits = \"fill\"\n");
  const std::string grid = refusal_of("file = \"" + kWhau.string() + "\"\nmax_error = \"1 m\"\nup = \"z\"\n");
  EXPECT_NE(grid.find("wrong.toml:5:13: terrain.max_error: is for meshes"), std::string::npos) << grid;
  EXPECT_NE(grid.find("wrong.toml:6:6: terrain.up: is for meshes"), std::string::npos) << grid;
}

TEST_F(ImportCommandTest, TheProgramTakesItsOptions) {
  const std::string line = fmt::format("{} import {} -o {} --max-error 2m --crop=2667500,6478800,2667900,6479200 --quiet && {} import {} -o {} --crop 2667500 6478800 2667900 6479200 --resample 20m > /dev/null", EFFUSE_PROGRAM, kWhau.string(),
                                       (folder_ / "a.glb").string(), EFFUSE_PROGRAM, kWhau.string(), (folder_ / "a.tif").string());
  EXPECT_EQ(std::system(line.c_str()), 0);
  EXPECT_TRUE(fs::exists(folder_ / "a.glb"));
  EXPECT_EQ(importers::import_dem({folder_ / "a.tif"}).nx, 20) << "every second post of the file";
}

/// A cliff 8 m high that hangs over by 3 m, between flats, at map coordinates; the sheet is 20 m wide.
std::string overhang_obj() {
  std::string text;
  const double profile[][2] = {{0, 0}, {12, 0}, {9, 4}, {9, 8}, {22, 8}};
  for (const auto& [x, z] : profile)
    for (const double y : {0.0, 20.0}) text += fmt::format("v {} {} {}\n", 2667400 + x, 6478700 + y, 100 + z);
  for (int k = 1; k <= 7; k += 2) text += fmt::format("f {} {} {} {}\n", k, k + 2, k + 3, k + 1);
  return text;
}

TEST_F(ImportCommandTest, AMeshIsRepairedUnlessItIsToBeKept) {
  // A box without its lid, in millimetres, one side wound the other way, one face twice.
  write_file(folder_ / "box.obj",
             "v 0 0 0\nv 1000 0 0\nv 1000 1000 0\nv 0 1000 0\nv 0 0 1000\nv 1000 0 1000\nv 1000 1000 1000\nv 0 1000 1000\n"
             "f 4 3 2 1\nf 1 2 6 5\nf 3 2 6 7\nf 3 4 8 7\nf 4 1 5 8\nf 4 1 5 8\n");
  ImportCommand c = command(folder_ / "box.obj", "out.ply");
  c.unit = "mm";
  c.fill_holes = "all";
  nlohmann::json told = run(c);
  EXPECT_TRUE(told["mesh"]["closed"].get<bool>()) << told.dump(1);
  EXPECT_EQ(told["repair"]["duplicate_triangles"], 2);
  EXPECT_EQ(told["repair"]["turned_triangles"], 2);
  EXPECT_EQ(told["repair"]["filled_holes"], 1);
  EXPECT_EQ(told["mesh"]["high"][2], 1.0);
  c.fill_holes = "1.2 m";
  told = run(c);
  EXPECT_EQ(told["repair"]["open_holes"], 1) << "its border is 1.41 m across";
  c.fill_holes = "";
  c.keep = true;
  told = run(c);
  EXPECT_FALSE(told.contains("repair"));
  EXPECT_FALSE(told["mesh"]["oriented"].get<bool>());
  EXPECT_NE(told["report"].dump().find("which axis is up"), std::string::npos);
  c.unit = "";
  EXPECT_NE(run(c)["report"].dump().find("names no unit: metres are assumed, 1000 m across; in millimetres it would be 1 m"), std::string::npos);
}

TEST_F(ImportCommandTest, MillimetresAtMapCoordinatesSurviveEveryFormatThatHoldsThem) {
  // Three of the mesh's own vertices, as far out as Auckland, to a tenth of a millimetre.
  const Vec3 at[] = {{2667400.1234, 6479491.2207, 100.0005}, {2667409.8765, 6479491.2212, 101.5}, {2667401.0001, 6479500.9999, 99.9998}};
  const auto text = [&](const char* format) {
    std::string out;
    for (const Vec3& p : at) out += fmt::format(fmt::runtime(format), p.x(), p.y(), p.z());
    return out;
  };
  const std::string ply_head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
  write_file(folder_ / "in.obj", text("v {} {} {}\n") + "f 1 2 3\n");
  write_file(folder_ / "in.off", "OFF\n3 1 0\n" + text("{} {} {}\n") + "3 0 1 2\n");
  write_file(folder_ / "in.ply", ply_head + text("{} {} {}\n") + "3 0 1 2\n");
  write_file(folder_ / "in.stl", "solid a\nfacet normal 0 0 1\nouter loop\n" + text("vertex {} {} {}\n") + "endloop\nendfacet\nendsolid a\n");
  const auto check = [&](const fs::path& file, const std::string& what) {
    const importers::MeshImport read = importers::import_mesh(file);
    ASSERT_EQ(read.mesh.positions.size(), 3u) << what;
    for (const Vec3& p : at) {
      double nearest = 1e9;
      for (const Vec3& q : read.mesh.positions) nearest = std::min(nearest, (q + read.frame.origin - p).norm());
      EXPECT_LT(nearest, 1e-3) << what << ": of a vertex";
    }
    const geometry::Terrain ground = importers::import_terrain(file).terrain;
    EXPECT_EQ(ground.georeference().origin.head<2>(), Vec2(2667400, 6479491)) << what;
  };
  for (const char* in : {"in.obj", "in.off", "in.ply", "in.stl"}) {
    check(folder_ / in, in);
    for (const char* out : {"out.ply", "out.obj", "out.glb", "out.stl", "out.off"}) {
      run(command(folder_ / in, out));
      check(folder_ / out, fmt::format("{} as {}, relative to its origin", in, out));
    }
    for (const char* out : {"map.ply", "map.obj", "map.off"}) {
      ImportCommand c = command(folder_ / in, out);
      c.on_map = true;
      run(c);
      check(folder_ / out, fmt::format("{} as {}, on the map", in, out));
      EXPECT_EQ(importers::import_mesh(folder_ / out).frame.origin, Vec3(0, 0, 0));
    }
  }
}

using ImportCommandSlow = ImportCommandTest;

TEST_F(ImportCommandSlow, AMeshIsSimplifiedToTheErrorAskedForAndMeasured) {
  run(command(kWhau, "full.ply"));
  const geometry::TriMesh full = importers::import_mesh(folder_ / "full.ply").mesh;
  for (const char* out : {"few.ply", "few.off"}) {
    ImportCommand c = command(folder_ / "full.ply", out);
    c.max_error = "2 m";
    const nlohmann::json told = run(c);
    EXPECT_LE(told["measured_error_m"].get<double>(), 2.0);
    const geometry::TriMesh few = importers::import_mesh(folder_ / out).mesh;
    EXPECT_LT(few.triangles.size(), full.triangles.size() / 10) << told.dump(1);
    EXPECT_LE(geometry::hausdorff_distance(full, few, 1.5).largest, 2.0) << "measured again, in the file";
    EXPECT_EQ(told["origin"][0], 2667405) << "its place on the map went along";
  }
}

TEST_F(ImportCommandTest, AMeshWithAnOverhangBecomesAGridThatSaysWhatItLost) {
  write_file(folder_ / "cliff.obj", overhang_obj());
  ImportCommand c = command(folder_ / "cliff.obj", "cliff.asc");
  c.cell = "1 m";
  const nlohmann::json told = run(c);
  EXPECT_EQ(told["grid"]["nx"], 23);
  EXPECT_EQ(told["grid"]["ny"], 21);
  EXPECT_EQ(told["grid"]["holes"], 0);
  EXPECT_EQ(told["grid"]["roofed"], 4 * 21) << "x from 9 to 12: ground below the edge";
  EXPECT_EQ(told["grid"]["south_west_post"][0], 2667400.0);
  const importers::DemGrid grid = importers::import_dem({folder_ / "cliff.asc"});
  for (int i = 0; i < 23; ++i) EXPECT_EQ(grid.z[static_cast<std::size_t>(5 * 23 + i)], i < 9 ? 100 : 108) << i;
}

TEST_F(ImportCommandTest, AMeshIsCroppedOnTheMapAndRemeshed) {
  run(command(kWhau, "full.ply"));
  ImportCommand c = command(folder_ / "full.ply", "part.glb");
  c.crop = {2667500.5, 6478800, 2667800, 6479100.25};
  c.edge = "15 m";
  const nlohmann::json told = run(c);
  EXPECT_TRUE(told["mesh"]["manifold"].get<bool>());
  const double west = told["origin"][0].get<double>() + told["mesh"]["low"][0].get<double>(), north = told["origin"][1].get<double>() + told["mesh"]["high"][1].get<double>();
  EXPECT_NEAR(west, 2667500.5, 1e-6);
  EXPECT_NEAR(north, 6479100.25, 1e-6);
  c.crop = {0, 0, 10, 10};
  EXPECT_NE(refused(c).find("nothing of it is in the crop: it lies from 2667405"), std::string::npos) << refused(c);
}

TEST_F(ImportCommandTest, FilesAreReadWithinLimitsThatCanBeRaised) {
  for (const fs::path& file : {kWhau, fs::path(EFFUSE_SOURCE_DIR) / "samples" / "scenes" / "house.obj"}) {
    CommonOptions common;
    common.quiet = true;
    common.read_limit = "0.0001s";
    const ImportCommand c = command(file, "out.ply");
    try {
      import_terrain_file(c, common);
      ADD_FAILURE() << file;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find("is not read after 0.0001 s"), std::string::npos) << error.what();
    }
    EXPECT_FALSE(fs::exists(c.output));
    common.read_limit = "60s,2GB";
    EXPECT_EQ(import_terrain_file(c, common), ExitCode::kDone);
    common.read_limit = "60";
    EXPECT_THROW(import_terrain_file(c, common), InputError);
    fs::remove(c.output);
  }
}

TEST_F(ImportCommandTest, OptionsThatDoNotFitAreRefusedAndNothingIsWritten) {
  write_file(folder_ / "cliff.obj", overhang_obj());
  const auto with = [&](auto&& change) {
    ImportCommand c = command(folder_ / "cliff.obj", "never.ply");
    change(c);
    const std::string message = refused(c);
    EXPECT_FALSE(fs::exists(c.output)) << message;
    return message;
  };
  const std::pair<std::function<void(ImportCommand&)>, const char*> cases[] = {
      {[](ImportCommand& c) { c.unit = "mmm"; }, "--unit: no unit of length 'mmm', did you mean 'mm'?"},
      {[](ImportCommand& c) { c.keep = true, c.stitch = "1 m"; }, "--stitch: is a repair"},
      {[&](ImportCommand& c) { c.files = {kWhau}, c.keep = true; }, "--keep: is for meshes, and"},
      {[](ImportCommand& c) { c.crop = {3, 0, 1, 1}; }, "--crop: wanted west < east"},
      {[](ImportCommand& c) { c.keep = true, c.fill_holes = "all"; }, "--fill-holes: is a repair"},
      {[](ImportCommand& c) { c.edge = "1 m", c.max_error = "1 m"; }, "wanted one of them"},
      {[](ImportCommand& c) { c.edge = "0 m"; }, "--edge: 0 m, wanted more"},
      {[](ImportCommand& c) { c.edge = "1 mm"; }, "would make about"},
      {[](ImportCommand& c) { c.max_error = "1 um"; }, "--max-error: 1e-06 m is less"},
      {[](ImportCommand& c) { c.fill_holes = "big"; }, "--fill-holes: 'big'"},
      {[](ImportCommand& c) { c.cell = "1 m"; }, "--cell is of a grid"},
      {[&](ImportCommand& c) { c.output = folder_ / "never.asc"; }, "--cell says how far apart"},
      {[](ImportCommand& c) { c.resample = "1m"; }, "--resample: is for grids, and"},
      {[&](ImportCommand& c) { c.output = folder_ / "never.glb", c.on_map = true; }, "--on-map: .glb has no room"},
      {[](ImportCommand& c) { c.files = {kWhau}, c.up = "y"; }, "--up: is for meshes, and"},
      {[](ImportCommand& c) { c.files = {kWhau}, c.cell = "5m"; }, "--resample says how far apart posts are"},
  };
  for (const auto& [change, wanted] : cases) {
    const std::string message = with(change);
    EXPECT_NE(message.find(wanted), std::string::npos) << message << " wanted " << wanted;
  }
}

TEST_F(ImportCommandTest, WhatIsNoFileIsToldSoBeforeItsKindIsGuessed) {
  const fs::path pipe = folder_ / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  for (const auto& [file, words] : {std::pair<fs::path, const char*>{folder_, "is a folder"}, {"/dev/zero", "not a regular file"}, {pipe, "not a regular file"}, {folder_ / "none", "no such file"}})
    for (const char* out : {"a.tif", "a.ply"}) EXPECT_NE(refused(command(file, out)).find(words), std::string::npos) << refused(command(file, out));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
}

TEST_F(ImportCommandTest, OptionsThatSayTwoThingsOrNothingAreRefused) {
  for (const auto& [resample, words] : {std::pair{"10m,cubic,nearest", "second method"}, {"10m,20m", "second distance"}, {"-1m", "less than 0"}, {"0m,cubic", "0 m apart"}, {".5m,foo", "foo"}}) {
    ImportCommand c = command(kWhau, "a.tif");
    c.resample = resample;
    EXPECT_NE(refused(c).find(words), std::string::npos) << resample << ": " << refused(c);
  }
  ImportCommand c = command(kWhau, "a.tif");
  c.pits = "keep:3m";
  EXPECT_NE(refused(c).find("no depth"), std::string::npos) << refused(c);
  c = command(kWhau, "a.tif");
  c.crs = "   ";
  EXPECT_NE(refused(c).find("crs"), std::string::npos) << refused(c);
  EXPECT_TRUE(fs::is_empty(folder_));
}

}  // namespace
}  // namespace effuse
