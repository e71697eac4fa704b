#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <bit>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>

#include "geometry/base/files.h"
#include "importers/points/import_points.h"
#include "importers/terrain/import_terrain.h"
#include "skin/color/lava_color.h"
#include "skin/write/raster.h"
#include "skin/write/write_mesh.h"
#include "skin/write/write_points.h"
#include "tests/skin/sample_lava.h"

/// `effuse export` as its users meet it: what it makes of whole runs and of what is left of others, and what it leaves when it is ended.
namespace effuse {
namespace {

namespace fs = std::filesystem;
using Arguments = std::vector<std::string>;

class ExportCommand : public testing::Test {
 protected:
  ExportCommand() {
    const testing::TestInfo* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::temp_directory_path() / fmt::format("effuse.{}.{}", info->name(), ::getpid());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~ExportCommand() override { fs::remove_all(folder_); }

  struct Outcome {
    int code = -1;
    std::string out, err;
  };

  pid_t start(const Arguments& arguments, rlim_t largest_file = RLIM_INFINITY, bool as_nobody = false) {
    std::vector<std::string> words = {EFFUSE_PROGRAM};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    const std::string out = folder_ / "stdout.txt", err = folder_ / "stderr.txt";
    const pid_t pid = ::fork();
    if (pid == 0) {
      if (!::freopen(out.c_str(), "w", stdout) || !::freopen(err.c_str(), "w", stderr)) ::_exit(99);
      const rlimit limit{largest_file, largest_file};
      if (largest_file != RLIM_INFINITY) ::setrlimit(RLIMIT_FSIZE, &limit);
      if (as_nobody && (::setgid(65534) != 0 || ::setuid(65534) != 0)) ::_exit(97);
      ::execv(argv[0], argv.data());
      ::_exit(98);
    }
    return pid;
  }
  Outcome wait(pid_t pid) {
    int status = 0;
    ::waitpid(pid, &status, 0);
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status), read_file(folder_ / "stdout.txt"), read_file(folder_ / "stderr.txt")};
  }
  Outcome effuse(const Arguments& arguments) { return wait(start(arguments)); }

  static geometry::TriMesh lava(int along) {
    geometry::TriMesh mesh = skin::testing_meshes::tube(60, 3, along, 12);
    skin::color_lava(mesh);
    return mesh;
  }

  /// A run's folder as a run leaves it: a first frame without lava, then more and more.
  fs::path make_run(const std::string& name, int frames, int along = 10) {
    const fs::path run = folder_ / name;
    nlohmann::ordered_json m{{"format", 1}, {"name", "Test"}, {"frames", frames}, {"fps", 24}, {"time_scale", 12}, {"origin", {1000, 2000, 0}}, {"crs", "EPSG:27200"}};
    m["camera"] = {{"width", 160}, {"height", 90}, {"keys", {{{"frame", 1}, {"eye", {0, -50, 30}}, {"target", {30, 0, 0}}, {"fov", 0.7}, {"sun_direction", {0, 0, 1}}, {"sun", {3, 3, 3}}, {"sky", {0.1, 0.1, 0.2}}, {"exposure", 1}}}}};
    write_file(run / "manifest.json", m.dump());
    write_file(run / "scene.toml", "name = \"Test\"\n[film]\nframes = 3\nfps = 24\ntime_scale = 12\n");
    geometry::TriMesh ground;
    ground.positions = {Vec3(0, -20, -2), Vec3(60, -20, -2), Vec3(60, 20, -2), Vec3(0, 20, -2)};
    ground.triangles = {{0, 1, 2}, {0, 2, 3}};
    const skin::Metadata about = {{"origin", "1000 2000 0"}, {"crs", "EPSG:27200"}};
    skin::write_ply(run / "terrain.ply", ground, about);
    for (int frame = 1; frame <= frames; ++frame) skin::write_ply(run / "frames" / fmt::format("skin.{:04}.ply", frame), frame == 1 ? geometry::TriMesh{} : lava(along * frame), about);
    return run;
  }

  static std::map<std::string, std::string> files_below(const fs::path& folder) {
    std::map<std::string, std::string> files;
    if (fs::exists(folder))
      for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder))
        if (entry.is_regular_file()) files[fs::relative(entry.path(), folder).string()] = read_file(entry.path());
    return files;
  }

  /// How many there are, while somebody writes them.
  static std::size_t count_below(const fs::path& folder) {
    std::size_t count = 0;
    std::error_code error;
    for (fs::recursive_directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) count += at->path().extension() == ".vtp" || at->path().extension() == ".usda";
    return count;
  }

  /// No file of below is half there.
  static void expect_whole(const std::map<std::string, std::string>& files, bool leftover = false) {
    int parts = 0;
    for (const auto& [name, bytes] : files) {
      if (name.find(".part") != std::string::npos) {
        ++parts;
        continue;
      }
      if (name.ends_with(".vtp")) {
        EXPECT_TRUE(bytes.ends_with("</VTKFile>\n")) << name;
      } else if (name.ends_with(".usda")) {
        EXPECT_TRUE(bytes.starts_with("#usda 1.0") && bytes.ends_with("}\n")) << name;
      }
    }
    EXPECT_LE(parts, leftover ? 1 : 0);
  }

  fs::path folder_;
};

class ExportCommandSlow : public ExportCommand {};

TEST_F(ExportCommand, WritesEveryFormatItNames) {
  const fs::path run = make_run("run", 3), out = folder_ / "out";
  skin::write_ply(run / "obstacles.ply", lava(3));
  const Outcome outcome = effuse({"export", run, "--to", "vtp,usda,glb-flipbook,obj,glb", "--to", "ply", "-o", out, "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto j = nlohmann::json::parse(outcome.out);
  EXPECT_TRUE(j.at("ok").get<bool>());
  for (const char* format : {"vtp", "usda", "ply", "obj", "glb"}) EXPECT_EQ(j.at("files").at(format), 3) << format;
  const auto files = files_below(out);
  for (const char* name : {"frames/skin.0001.vtp", "frames/skin.0003.usda", "frames/skin.0002.obj", "frames/skin.0002.glb", "frames/skin.0002.ply", "skin.pvd", "frames/skin.vtp.series", "terrain.vtp", "terrain.usda", "film.usda",
                           "frames/skin.clips.usda", "film.glb"})
    EXPECT_TRUE(files.contains(name)) << name;
  expect_whole(files);
  // Times of lava: 12 s a second of film.
  EXPECT_NE(files.at("skin.pvd").find("timestep=\"1.5\" part=\"0\" file=\"frames/skin.0003.vtp\""), std::string::npos) << files.at("skin.pvd");
  EXPECT_NE(files.at("film.usda").find("def Camera"), std::string::npos);
  EXPECT_NE(files.at("film.usda").find("@./obstacles.usda@"), std::string::npos) << "what stands still";
  EXPECT_TRUE(files.contains("obstacles.vtp"));
  // What came in goes out again, to the digit that PLY has.
  const importers::PointCloud cloud = importers::import_points(out / "frames" / "skin.0003.vtp", {false}), source = importers::import_points(run / "frames" / "skin.0003.ply", {false});
  EXPECT_EQ(cloud.position, source.position);
  EXPECT_EQ(cloud.temperature, source.temperature);
  EXPECT_EQ(cloud.velocity, source.velocity);
  EXPECT_TRUE(files.at("frames/skin.0003.ply").substr(files.at("frames/skin.0003.ply").find("element vertex")) ==
              read_file(run / "frames" / "skin.0003.ply").substr(read_file(run / "frames" / "skin.0003.ply").find("element vertex")))
      << "all but the comments";
}

TEST_F(ExportCommand, GoesIntoTheRunItselfWithoutTouchingItsOwnFiles) {
  const fs::path run = make_run("run", 3);
  const auto before = files_below(run);
  ASSERT_EQ(effuse({"export", run, "--to", "vtp,ply", "--frames", "2-3"}).code, 0);
  const auto after = files_below(run);
  for (const auto& [name, bytes] : before) EXPECT_TRUE(after.at(name) == bytes) << name;
  EXPECT_FALSE(after.contains("frames/skin.0001.vtp"));
  EXPECT_TRUE(after.contains("frames/skin.0003.vtp"));
  EXPECT_EQ(after.at("skin.pvd").find("0001"), std::string::npos);
}

TEST_F(ExportCommand, RunsOfGlbAloneGlowAsThoseOfPlyDo) {
  const fs::path run = make_run("run", 2), out = folder_ / "out";
  geometry::TriMesh mesh = lava(20);
  for (int frame = 1; frame <= 2; ++frame) {
    fs::remove(run / "frames" / fmt::format("skin.{:04}.ply", frame));
    skin::write_glb(run / "frames" / fmt::format("skin.{:04}.glb", frame), frame == 1 ? geometry::TriMesh{} : mesh);
  }
  ASSERT_EQ(effuse({"export", run, "--to", "vtp", "-o", out}).code, 0);
  const importers::PointCloud cloud = importers::import_points(out / "frames" / "skin.0002.vtp", {false});
  ASSERT_EQ(cloud.size(), mesh.positions.size());
  Box3 read, wanted;
  for (const Vec3& x : cloud.position) read.extend(x);
  for (const Vec3& x : mesh.positions) wanted.extend(x);
  EXPECT_LT((read.min() - wanted.min()).norm() + (read.max() - wanted.max()).norm(), 1e-4) << "z up again";
  EXPECT_NE(read_file(out / "frames" / "skin.0002.vtp").find("Name=\"glow\""), std::string::npos);
}

/// BGEO, read by these lines alone: big-endian words.
TEST_F(ExportCommand, BgeoHoldsParticlesWithVelocitiesOfFilm) {
  const fs::path run = make_run("run", 1), out = folder_ / "out";
  const std::vector<Vec3> x = {Vec3(1, 2, 3), Vec3(4, 5, 6)}, v = {Vec3(1, 0, -2), Vec3(0.5, 0, 0)};
  const std::vector<Real> radius = {0.5, 0.25}, temperature = {1400, 900};
  geometry::Points points;
  points.position = x, points.velocity = v, points.radius = radius, points.temperature = temperature;
  skin::write_points_ply(run / "frames" / "sparks.0001.ply", points);
  const Outcome outcome = effuse({"export", run, "--to", "bgeo,vtp,usda", "-o", out});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_FALSE(fs::exists(out / "frames" / "skin.0001.bgeo")) << "a mesh";
  const std::string bytes = read_file(out / "frames" / "sparks.0001.bgeo");
  std::size_t at = 0;
  const auto word = [&](std::size_t size = 4) {
    std::uint32_t value = 0;
    for (std::size_t k = 0; k < size; ++k) value = value << 8 | static_cast<unsigned char>(bytes.at(at++));
    return value;
  };
  const auto number = [&] { return std::bit_cast<float>(word()); };
  ASSERT_EQ(bytes.substr(0, 5), "BgeoV");
  at = 5;
  EXPECT_EQ(word(), 5u);
  EXPECT_EQ(word(), 2u) << "points";
  for (int k = 0; k < 3; ++k) EXPECT_EQ(word(), 0u);
  const std::uint32_t attributes = word();
  for (int k = 0; k < 3; ++k) EXPECT_EQ(word(), 0u);
  std::vector<std::pair<std::string, std::uint32_t>> layout;
  for (std::uint32_t k = 0; k < attributes; ++k) {
    const std::uint32_t length = word(2);
    const std::string name = bytes.substr(at, length);
    at += length;
    const std::uint32_t width = word(2);
    word();
    at += 4 * width;
    layout.emplace_back(name, width);
  }
  for (std::size_t i = 0; i < 2; ++i) {
    std::map<std::string, std::vector<float>> row;
    for (int k = 0; k < 4; ++k) row["P"].push_back(number());
    for (const auto& [name, width] : layout)
      for (std::uint32_t k = 0; k < width; ++k) row[name].push_back(number());
    EXPECT_EQ(row.at("P"), (std::vector<float>{static_cast<float>(x[i].x()), static_cast<float>(x[i].y()), static_cast<float>(x[i].z()), 1}));
    EXPECT_EQ(row.at("v").at(0), 12 * static_cast<float>(v[i].x())) << "a second of film is 12 s of lava";
    EXPECT_EQ(row.at("pscale").at(0), static_cast<float>(radius[i]));
    EXPECT_EQ(row.at("temperature").at(0), static_cast<float>(temperature[i]));
  }
  EXPECT_EQ(at + 2, bytes.size());
  EXPECT_NE(read_file(out / "film.usda").find("def Points \"sparks\""), std::string::npos);
}

TEST_F(ExportCommand, MapsBecomeGeoTiffs) {
  const fs::path run = make_run("run", 1), out = folder_ / "out";
  EXPECT_EQ(effuse({"export", run, "--to", "geotiff", "-o", out}).code, 2) << "none there";
  EXPECT_FALSE(fs::exists(out));
  skin::Raster raster;
  raster.corner = Vec2(1000, 2000);
  raster.cell = Vec2(10, 10);
  raster.nx = 4, raster.ny = 3;
  for (int k = 0; k < 12; ++k) raster.values.push_back(static_cast<float>(k));
  raster.crs = "EPSG:27200";
  skin::write_esri_ascii(run / "maps" / "deposit.asc", raster);
  skin::write_geotiff(run / "maps" / "max_thickness.tif", raster);
  ASSERT_EQ(effuse({"export", run, "--to", "geotiff", "-o", out}).code, 0);
  EXPECT_TRUE(read_file(out / "maps" / "max_thickness.tif") == read_file(run / "maps" / "max_thickness.tif"));
  EXPECT_TRUE(read_file(out / "maps" / "deposit.tif") == read_file(run / "maps" / "max_thickness.tif")) << "the same map, from its text";
}

TEST_F(ExportCommandSlow, WhatIsAskedWronglyIsToldBeforeAnythingIsWritten) {
  const fs::path run = make_run("run", 3), out = folder_ / "out";
  struct Case {
    Arguments arguments;
    const char* says;
  };
  write_file(folder_ / "file", "x");
  for (const Case& c : std::vector<Case>{{{run, "--to", "usd"}, "did you mean 'usda'?"},
                                         {{run, "--to", "flipbok,vpt"}, "did you mean 'vtp'?"},
                                         {{run, "--to", "alembic"}, "there are vtp, usda"},
                                         {{run, "--to", "vtp", "--frames", "3-2"}, "wanted two frame numbers"},
                                         {{run, "--to", "vtp", "--frames", "x"}, "wanted two frame numbers"},
                                         {{run, "--to", "vtp", "--frames", "9-12"}, "the run's last frame is 3"},
                                         {{run, "--to", "bgeo"}, "holds no frames of particles"},
                                         {{folder_ / "none", "--to", "vtp"}, "no such folder"},
                                         {{folder_ / "file", "--to", "vtp"}, "wanted the folder of a run"},
                                         {{folder_, "--to", "vtp"}, "holds no run"}}) {
    Arguments arguments = {"export"};
    arguments.insert(arguments.end(), c.arguments.begin(), c.arguments.end());
    arguments.insert(arguments.end(), {"-o", out});
    const Outcome outcome = effuse(arguments);
    EXPECT_EQ(outcome.code, 2) << c.says << outcome.err;
    EXPECT_NE(outcome.err.find(c.says), std::string::npos) << outcome.err;
    EXPECT_FALSE(fs::exists(out)) << c.says;
  }
}

TEST_F(ExportCommand, PathsMayHoldBlanksAccentsAndQuotes) {
  const fs::path run = make_run("Mt Etna \xe2\x80\x93 \xc3\xa9t\xc3\xa9 'un'", 2), out = folder_ / "out p\xc3\xbbt 2" / "deeper";
  const Outcome outcome = effuse({"export", run, "--to", "vtp,usda,glb-flipbook", "-o", out});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(fs::exists(out / "film.usda"));
  EXPECT_TRUE(fs::exists(out / "frames" / "skin.0002.vtp"));
}

TEST_F(ExportCommandSlow, ARunThatLostFilesIsReadAsFarAsItGoes) {
  const fs::path run = make_run("run", 5), out = folder_ / "out";
  fs::remove(run / "frames" / "skin.0005.ply");
  fs::remove(run / "frames" / "skin.0003.ply");
  write_file(run / "frames" / "skin.0005.part.ply", "half");
  Outcome outcome = effuse({"export", run, "--to", "vtp,usda", "-o", out});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("skin: no file of frames 3, 5, left out"), std::string::npos) << outcome.err;
  EXPECT_NE(read_file(out / "film.usda").find("[(1, 0), (2, 1), (4, 2)]"), std::string::npos);

  // Without its manifest: film and time from scene.toml, place from the frames' comments.
  fs::remove(run / "manifest.json");
  outcome = effuse({"export", run, "--to", "vtp", "-o", out});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("manifest.json: missing or damaged"), std::string::npos) << outcome.err;
  EXPECT_NE(read_file(out / "skin.pvd").find("timestep=\"2\""), std::string::npos) << "frame 4 of 24 a second, 12 s each";
  std::string origin;
  for (const char c : std::string("1000 2000 0")) origin += fmt::format("{} ", static_cast<int>(c));
  EXPECT_NE(read_file(out / "frames" / "skin.0004.vtp").find(origin), std::string::npos);
  write_file(run / "manifest.json", "{\"frames\": 5, \"fps\"");
  EXPECT_EQ(effuse({"export", run, "--to", "vtp", "-o", out}).code, 0);
  write_file(run / "manifest.json", R"({"name":"x","frames":5,"fps":0,"time_scale":1,"origin":[0,0,0],"crs":""})");
  EXPECT_EQ(effuse({"export", run, "--to", "vtp", "-o", out}).code, 0);
  write_file(run / "manifest.json", R"({"name":"x","frames":5,"fps":24,"time_scale":1,"origin":[0,0,0],"crs":"","camera":{"width":16,"height":9,"keys":[{"frame":1}]}})");
  EXPECT_EQ(effuse({"export", run, "--to", "usda", "-o", out}).code, 0);
  fs::remove(run / "scene.toml");
  EXPECT_EQ(effuse({"export", run, "--to", "vtp", "-o", out}).code, 0);

  // A frame cut short is named, and nothing made of it.
  const std::string bytes = read_file(run / "frames" / "skin.0004.ply");
  write_file(run / "frames" / "skin.0004.ply", bytes.substr(0, bytes.size() / 2));
  fs::remove_all(out);
  outcome = effuse({"export", run, "--to", "vtp", "-o", out});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_NE(outcome.err.find("skin.0004.ply"), std::string::npos) << outcome.err;
  EXPECT_FALSE(fs::exists(out / "frames" / "skin.0004.vtp"));
  expect_whole(files_below(out));
}

TEST_F(ExportCommand, AFullDiskIsCodeFiveAndLeavesWholeFilesOnly) {
  const fs::path run = make_run("run", 6, 40), out = folder_ / "out";
  const Outcome outcome = wait(start({"export", run, "--to", "vtp,usda", "-o", out}, 100'000));
  EXPECT_EQ(outcome.code, 5) << outcome.err;
  EXPECT_NE(outcome.err.find("too large"), std::string::npos) << outcome.err;
  const auto files = files_below(out);
  EXPECT_GE(files.size(), 2u);
  expect_whole(files);
}

TEST_F(ExportCommand, AFolderThatCannotBeWrittenIsCodeTwo) {
  const fs::path run = make_run("run", 2), out = folder_ / "out";
  write_file(folder_ / "file", "x");
  Outcome outcome = effuse({"export", run, "--to", "vtp", "-o", folder_ / "file" / "below"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_NE(outcome.err.find("cannot make this folder"), std::string::npos) << outcome.err;
  if (::geteuid() == 0) {  // whom permissions do not hold
    fs::create_directories(out);
    ::chmod(folder_.c_str(), 0777);
    outcome = wait(start({"export", run, "--to", "vtp", "-o", out}, RLIM_INFINITY, true));
  } else {
    fs::create_directories(out);
    ::chmod(out.c_str(), 0555);
    outcome = effuse({"export", run, "--to", "vtp", "-o", out});
  }
  if (outcome.code == -1 || outcome.code == 98) GTEST_SKIP() << "nobody may not run the program here";
  EXPECT_EQ(outcome.code, 2) << outcome.err;
  EXPECT_NE(outcome.err.find("cannot be written to"), std::string::npos) << outcome.err;
  EXPECT_TRUE(fs::is_empty(out));
}

TEST_F(ExportCommandSlow, KilledAtAnyMomentItLeavesWholeFilesAndTheSameCommandDoesTheRest) {
  const fs::path run = make_run("run", 8, 40), out = folder_ / "out", whole = folder_ / "whole";
  const Arguments command = {"export", run, "--to", "vtp,usda", "-o"};
  const auto with = [&](const fs::path& to) {
    Arguments all = command;
    all.push_back(to);
    return all;
  };
  ASSERT_EQ(effuse(with(whole)).code, 0);
  for (const std::size_t after : {1u, 9u}) {
    const pid_t pid = start(with(out));
    for (int k = 0; k < 2000 && count_below(out) < after; ++k) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    ::kill(pid, SIGKILL);
    const Outcome outcome = wait(pid);
    EXPECT_TRUE(outcome.code == -SIGKILL || outcome.code == 0);
    expect_whole(files_below(out), true);
    ASSERT_EQ(effuse(with(out)).code, 0);
    EXPECT_TRUE(files_below(out) == files_below(whole)) << "nothing left over, nothing missing";
    fs::remove_all(out);
  }
}

TEST_F(ExportCommand, CtrlCEndsItAfterTheFrameInHandAndASecondOneAtOnce) {
  const fs::path run = make_run("run", 30, 40), out = folder_ / "out";
  for (const bool twice : {false, true}) {
    const pid_t pid = start({"export", run, "--to", "vtp,usda", "-o", out});
    for (int k = 0; k < 2000 && count_below(out) < 5; ++k) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    ::kill(pid, SIGINT);
    if (twice) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      ::kill(pid, SIGINT);
    }
    const Outcome outcome = wait(pid);
    // The second may come when the first has already done its work.
    EXPECT_TRUE(outcome.code == 130 || (twice && outcome.code == -SIGINT)) << outcome.code << outcome.err;
    if (outcome.code == 130) {
      EXPECT_NE(outcome.err.find("interrupted"), std::string::npos) << outcome.err;
    }
    const auto files = files_below(out);
    expect_whole(files, twice);
    EXPECT_FALSE(files.contains("film.usda"));
    EXPECT_LT(files.size(), 50u);
    fs::remove_all(out);
  }
}

TEST_F(ExportCommand, TwoDoNotWriteToOneFolder) {
  const fs::path run = make_run("run", 12, 40), out = folder_ / "out";
  const pid_t first = start({"export", run, "--to", "vtp,usda", "-o", out});
  for (int k = 0; k < 2000 && count_below(out) < 2; ++k) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  ::kill(first, SIGSTOP);  // it does not get done before the other has begun
  const Outcome second = effuse({"export", run, "--to", "vtp", "-o", out});
  ::kill(first, SIGCONT);
  EXPECT_EQ(wait(first).code, 0);
  EXPECT_EQ(second.code, 2);
  EXPECT_NE(second.err.find("another effuse is writing"), std::string::npos) << second.err;
}

TEST_F(ExportCommandSlow, ARunWritesTheSameFormatsAsItGoesAndAfterACrash) {
  const fs::path scenes = fs::path(EFFUSE_SOURCE_DIR) / "samples" / "scenes";
  const auto run = [&](const fs::path& out, int frames, bool resume) {
    Arguments all = {"run", scenes / "lava.toml", "-o", out, "--frames", std::to_string(frames), "--set", "lava.spacing=1.4 m", "--set", "preview.pictures=false", "--set", "output.checkpoint_every=1",
                     "--set", R"(output.formats=["ply", "vtp", "usda", "bgeo", "glb-flipbook"])"};
    if (resume) all.push_back("--resume");
    return effuse(all);
  };
  const fs::path whole = folder_ / "whole", parts = folder_ / "parts";
  ASSERT_EQ(run(whole, 4, false).code, 0);
  ASSERT_EQ(run(parts, 2, false).code, 0);
  const Outcome resumed = run(parts, 4, true);
  ASSERT_EQ(resumed.code, 0) << resumed.err;
  auto a = files_below(whole), b = files_below(parts);
  for (const char* name : {"frames/skin.0004.vtp", "frames/skin.0004.usda", "frames/lava.0004.bgeo", "film.usda", "film.glb", "skin.pvd", "frames/skin.vtp.series", "terrain.usda", "terrain.vtp", "manifest.json", "open_in_blender.py",
                           "open_in_houdini.py", "open_in_paraview.py"}) {
    ASSERT_TRUE(a.contains(name)) << name;
    EXPECT_TRUE(a.at(name) == b.at(name)) << name;
  }
  // Particles: as many as run.json counts; what export makes of the PLY has the same points as what the run wrote.
  const auto cloud = importers::import_points(whole / "frames" / "lava.0004.bgeo");
  EXPECT_GT(cloud.size(), 1u);
  EXPECT_EQ(cloud.temperature.size(), cloud.size());
  ASSERT_EQ(effuse({"export", whole, "--to", "vtp", "-o", folder_ / "out"}).code, 0);
  const auto own = importers::import_points(whole / "frames" / "skin.0004.vtp", {false}), later = importers::import_points(folder_ / "out" / "frames" / "skin.0004.vtp", {false});
  EXPECT_EQ(own.position, later.position);
  EXPECT_EQ(own.temperature, later.temperature);
  EXPECT_EQ(a.at("frames/skin.vtp.series"), read_file(folder_ / "out" / "frames" / "skin.vtp.series"));

  // Started anew with fewer formats, the folder has nothing of before.
  ASSERT_EQ(effuse({"run", scenes / "lava.toml", "-o", parts, "--frames", "1", "--force", "--set", "lava.spacing=1.4 m", "--set", "preview.pictures=false", "--set", R"(output.formats=["glb"])"}).code, 0);
  for (const auto& [name, bytes] : files_below(parts))
    for (const char* ending : {".vtp", ".usda", ".bgeo", ".pvd", ".series", "film.glb", "skin.0001.ply"}) EXPECT_FALSE(name.ends_with(ending)) << name;

  // A flipbook needs something to be made of.
  const Outcome refused = effuse({"check", scenes / "lava.toml", "--set", R"(output.formats=["glb-flipbook"])"});
  EXPECT_EQ(refused.code, 2);
  EXPECT_NE(refused.err.find("made of the frames' ply or glb"), std::string::npos) << refused.err;
  const Outcome misspelt = effuse({"check", scenes / "lava.toml", "--set", R"(output.formats=["usd"])"});
  EXPECT_NE(misspelt.err.find("usda"), std::string::npos) << misspelt.err;
}

}  // namespace
}  // namespace effuse
