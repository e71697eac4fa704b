#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "geometry/base/files.h"

/// The program as its users meet it: exit codes, messages, folders, resumed runs.
namespace effuse {
namespace {

namespace fs = std::filesystem;
using Arguments = std::vector<std::string>;

const fs::path kScenes = fs::path(EFFUSE_SOURCE_DIR) / "samples" / "scenes";

/// A folder of the test's own, removed at its end.
class ProgramTest : public testing::Test {
 protected:
  ProgramTest() {
    const testing::TestInfo* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::temp_directory_path() / fmt::format("effuse.{}.{}.{}", info->test_suite_name(), info->name(), ::getpid());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~ProgramTest() override { fs::remove_all(folder_); }

  struct Outcome {
    int code = -1;
    std::string out, err;
  };

  pid_t start(const Arguments& arguments, rlim_t largest_file = RLIM_INFINITY) {
    std::vector<std::string> words = {EFFUSE_PROGRAM};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    const std::string out = folder_ / "stdout.txt", err = folder_ / "stderr.txt";
    const pid_t pid = ::fork();
    if (pid == 0) {
      if (!::freopen(out.c_str(), "w", stdout) || !::freopen(err.c_str(), "w", stderr)) ::_exit(99);
      if (largest_file != RLIM_INFINITY) {
        const rlimit limit{largest_file, largest_file};
        ::setrlimit(RLIMIT_FSIZE, &limit);
      }
      ::signal(SIGHUP, SIG_DFL);  // also where the tests run under nohup
      ::execv(argv[0], argv.data());
      ::_exit(98);
    }
    return pid;
  }

  Outcome wait(pid_t pid) {
    int status = 0;
    ::waitpid(pid, &status, 0);
    Outcome outcome{WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status), read_file(folder_ / "stdout.txt"), read_file(folder_ / "stderr.txt")};
    return outcome;
  }

  Outcome effuse(const Arguments& arguments) { return wait(start(arguments)); }

  fs::path write(const std::string& name, const std::string& text) {
    write_file(folder_ / name, text);
    return folder_ / name;
  }

  /// The gully scene, made short and coarse.
  static Arguments run_gully(const fs::path& out, int frames, const Arguments& more = {}) {
    Arguments arguments = {"run", kScenes / "lava.toml", "-o", out, "--frames", std::to_string(frames), "--set", "lava.spacing=1.2 m", "--set", "preview.pictures=false",
                           "--set", "output.checkpoint_every=3"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }

  fs::path folder_;
};
class ProgramTestSlow : public ProgramTest {};

nlohmann::json run_json(const fs::path& folder) { return nlohmann::json::parse(read_file(folder / "run.json")); }

/// Paths below folder/frames (and preview) and what they hold.
std::map<std::string, std::string> frame_files(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const char* part : {"frames", "preview"})
    if (fs::exists(folder / part))
      for (const fs::directory_entry& entry : fs::directory_iterator(folder / part)) files[part + ("/" + entry.path().filename().string())] = read_file(entry.path());
  return files;
}

void expect_same_files(const fs::path& a, const fs::path& b, std::size_t at_least) {
  const auto x = frame_files(a), y = frame_files(b);
  EXPECT_GE(x.size(), at_least);
  ASSERT_EQ(x.size(), y.size());
  for (const auto& [name, bytes] : x) {
    ASSERT_TRUE(y.contains(name)) << name;
    EXPECT_TRUE(bytes == y.at(name)) << name << " differs: " << bytes.size() << " and " << y.at(name).size() << " bytes";
  }
}

std::size_t count(const std::string& text, const std::string& what) {
  std::size_t n = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + what.size())) ++n;
  return n;
}

TEST_F(ProgramTest, ChecksASceneAndSaysWhatItWouldCost) {
  const Outcome outcome = effuse({"check", kScenes / "maunga-whau.toml", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto j = nlohmann::json::parse(outcome.out);
  EXPECT_TRUE(j.at("ok").get<bool>());
  EXPECT_GT(j.at("effects").at(0).at("particles").get<double>(), 8000);
  EXPECT_GT(j.at("seconds").get<double>(), 0);
}

TEST_F(ProgramTest, ReportsAllFiveFaultsOfASceneWithLineAndColumn) {
  const fs::path scene = write("five.toml", R"(name = "Five faults"
[film]
frames = "ten"
[terrain]
file = "nowhere.asc"
[lava]
spacing = "2 kg"
crust_viscsity = "1e8 Pa s"
[[lava.vent]]
at = [10, 10]
width = "4 m"
rate = "-3 m3/s"
)");
  const Outcome outcome = effuse({"check", scene});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_TRUE(outcome.out.empty()) << outcome.out;
  EXPECT_EQ(count(outcome.err, "error: "), 5u) << outcome.err;
  for (const char* where : {"five.toml:3:", "five.toml:5:", "five.toml:7:", "five.toml:8:", "five.toml:12:"}) EXPECT_EQ(count(outcome.err, where), 1u) << where << "\n" << outcome.err;
  EXPECT_NE(outcome.err.find("did you mean"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("viscosity"), std::string::npos) << outcome.err;

  const Outcome json = effuse({"check", scene, "--json"});
  EXPECT_EQ(json.code, 2);
  const auto j = nlohmann::json::parse(json.out);
  ASSERT_EQ(j.at("errors").size(), 5u);
  for (const auto& error : j.at("errors")) {
    EXPECT_GT(error.at("line").get<int>(), 0);
    EXPECT_GT(error.at("column").get<int>(), 0);
  }
}

TEST_F(ProgramTestSlow, TellsAMisspeltKeyThatIsRequiredOnceAndWithTheNameItMeant) {
  const std::string sound = read_file(kScenes / "lava.toml");
  struct Case {
    std::string name, slip, says;
  };
  for (const Case& c : std::vector<Case>{{"spacing =", "spacng =", "lava.spacng: unknown key; did you mean 'spacing'?"},
                                         {"width = \"5 m\"", "widht = \"5 m\"", "lava.vent[0].widht: unknown key; did you mean 'width'?"},
                                         {"file =", "fiel =", "terrain.fiel: unknown key; did you mean 'file'?"},
                                         {"[terrain]", "[terain]", "terain: unknown key; did you mean 'terrain'?"},
                                         {"[[lava.vent]]", "[[lava.vnet]]", "lava.vnet: unknown key; did you mean 'vent'?"}}) {
    std::string text = sound;
    text.replace(text.find(c.name), c.name.size(), c.slip);
    const Outcome outcome = effuse({"check", write("slip.toml", text)});
    EXPECT_EQ(outcome.code, 2);
    EXPECT_NE(outcome.err.find(c.says), std::string::npos) << outcome.err;
    if (c.slip != "fiel =" && c.slip != "[terain]") fs::copy_file(kScenes / "gully.asc", folder_ / "gully.asc", fs::copy_options::skip_existing);
    EXPECT_EQ(count(effuse({"check", write("slip.toml", text)}).err, "error: "), 1u) << outcome.err;
  }
  // The effect itself, and a key that is missing without a slip.
  std::string text = sound;
  for (const char* table : {"[lava]", "[lava.viscosity]", "[[lava.vent]]"}) text.replace(text.find(table), std::string(table).size(), std::string(table).replace(std::string(table).find("lava"), 4, "lvaa"));
  const Outcome effect = effuse({"check", write("slip.toml", text)});
  EXPECT_EQ(count(effect.err, "error: "), 1u) << effect.err;
  EXPECT_NE(effect.err.find("lvaa: unknown key; did you mean 'lava'?"), std::string::npos) << effect.err;
  text = sound;
  text.replace(text.find("spacing ="), 9, "colour =");
  EXPECT_EQ(count(effuse({"check", write("slip.toml", text)}).err, "error: "), 2u) << "one that is missing, one that nobody knows";
}

TEST_F(ProgramTest, ASettingIsAKeyAndAValueInOneWord) {
  for (const char* verb : {"run", "check"}) {
    const Outcome outcome = effuse({verb, kScenes / "lava.toml", "--set", "lava.spacing", "2"});
    EXPECT_EQ(outcome.code, 2);
    EXPECT_NE(outcome.err.find("wanted KEY=VALUE"), std::string::npos) << outcome.err;
    EXPECT_NE(effuse({verb, "--help"}).out.find("--set KEY=VALUE"), std::string::npos);
  }
}

TEST_F(ProgramTest, ACameraLooksAtAPointOfTheGround) {
  const Arguments close = {"--set", "preview.target=[18, 46]", "--set", "preview.distance=12 m", "--set", "preview.fov=50 deg", "--set", "preview.elevation=40 deg", "--set", "preview.width=160", "--set", "preview.height=90"};
  Arguments arguments = {"run", kScenes / "lava.toml", "-o", folder_ / "out", "--frames", "2", "--set", "lava.spacing=1.2 m", "--set", "output.formats=[]"};
  arguments.insert(arguments.end(), close.begin(), close.end());
  const Outcome outcome = effuse(arguments);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(fs::exists(folder_ / "out" / "preview" / "preview.0002.png"));
  EXPECT_EQ(effuse({"check", folder_ / "out" / "scene.toml"}).code, 0) << "as resolved";
  const Outcome buried = effuse({"check", kScenes / "lava.toml", "--set", "preview.target=[18, 46, 0]", "--set", "preview.distance=0.1"});
  EXPECT_EQ(buried.code, 2);
  EXPECT_NE(buried.err.find("in the ground"), std::string::npos) << buried.err;
  const Outcome two = effuse({"check", kScenes / "lava.toml", "--set", "preview.target=[18, 46]", "--set", "preview.distance=9", "--set", "preview.view=[18, 46, 9]"});
  EXPECT_EQ(two.code, 2);
  EXPECT_EQ(count(two.err, "error: "), 1u) << two.err;
}

TEST_F(ProgramTest, TheReadmesCameraIsOneOfTheMountain) {
  const std::string readme = read_file(fs::path(EFFUSE_SOURCE_DIR) / "README.md"), fence = "```toml\n[preview]\n";
  const std::size_t begin = readme.find(fence) + fence.size() - std::string("[preview]\n").size();
  ASSERT_LT(begin, readme.size());
  std::string scene = read_file(kScenes / "maunga-whau.toml");
  scene.resize(scene.find("[preview]"));
  fs::copy_file(kScenes / "maunga-whau.asc", folder_ / "maunga-whau.asc");
  const Outcome outcome = effuse({"check", write("close.toml", scene + readme.substr(begin, readme.find("```", begin) - begin))});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
}

TEST_F(ProgramTest, AVentInDegreesIsToldHowTheyBecomeMetresOfTheMap) {
  const Outcome checked = effuse({"check", kScenes / "maunga-whau-modern.toml", "--set", "lava.vent=[{at=[174.764, -36.876], width=5, rate=5}]"});
  EXPECT_EQ(checked.code, 2);
  EXPECT_NE(checked.err.find("effuse info TERRAIN --at 174.764,-36.876"), std::string::npos) << checked.err;
  const Outcome place = effuse({"info", kScenes / "maunga-whau.asc", "--at", "174.764,-36.876", "--json"});
  ASSERT_EQ(place.code, 0) << place.err;
  const nlohmann::json at = nlohmann::json::parse(place.out).at(0).at("values").at("at");
  EXPECT_NEAR(at.at("degrees").at(0).get<double>(), 174.764, 1e-7);
  const Outcome metres = effuse({"check", kScenes / "maunga-whau-modern.toml", "--set", fmt::format("lava.vent=[{{at=[{}, {}], width=5, rate=5}}]", at.at("map").at(0).get<double>(), at.at("map").at(1).get<double>())});
  EXPECT_EQ(metres.code, 0) << metres.err;
}

TEST_F(ProgramTestSlow, SaysWhereTheTimeWentInALineAndAllOfItWhenAsked) {
  const Outcome brief = effuse(run_gully(folder_ / "out", 2));
  ASSERT_EQ(brief.code, 0) << brief.err;
  EXPECT_EQ(count(brief.err, "took "), 1u) << brief.err;
  EXPECT_EQ(count(brief.err, " of processor time: "), 1u) << brief.err;
  EXPECT_GT(run_json(folder_ / "out").at("processor_seconds").get<double>(), 0.01);
  EXPECT_EQ(count(brief.err, " %"), 3u) << "three parts\n" << brief.err;
  EXPECT_LE(count(brief.err, "\n"), 4u) << "two frames, that line, and where they are\n" << brief.err;
  const Outcome all = effuse(run_gully(folder_ / "out", 2, {"--force", "--stats"}));
  EXPECT_NE(all.err.find("sph.forces"), std::string::npos) << all.err;
  EXPECT_NE(all.err.find("skin.triangles"), std::string::npos) << all.err;
}

TEST_F(ProgramTest, ThereIsNothingToGoOnWithWhereNoRunIs) {
  const Outcome absent = effuse(run_gully(folder_ / "absent", 2, {"--resume"}));
  EXPECT_EQ(absent.code, 2);
  EXPECT_NE(absent.err.find("does not exist, so there is nothing to go on with"), std::string::npos) << absent.err;
  EXPECT_FALSE(fs::exists(folder_ / "absent"));
  fs::create_directories(folder_ / "empty");
  const Outcome empty = effuse(run_gully(folder_ / "empty", 2, {"--resume"}));
  EXPECT_EQ(empty.code, 2);
  EXPECT_NE(empty.err.find("holds no run"), std::string::npos) << empty.err;
  EXPECT_TRUE(fs::is_empty(folder_ / "empty"));
}

TEST_F(ProgramTest, TellsTheSkinsMemoryToo) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer's shadow is several times what it watches";
#endif
  // The program alone; and a skin of fine voxels, which takes half as much again.
  for (const Arguments& settings : {Arguments{"output.formats=[]", "lava.spacing=1.2 m"}, Arguments{"output.formats=[\"ply\", \"glb\"]", "skin.voxel=0.2", "lava.spacing=0.5 m"}}) {
    Arguments check = {"check", kScenes / "lava.toml", "--json"}, run = {"run", kScenes / "lava.toml", "-o", folder_ / "out", "--force", "--json", "--quiet"};
    for (Arguments* verb : {&check, &run}) {
      for (const std::string& setting : settings) verb->insert(verb->end(), {"--set", setting});
      verb->insert(verb->end(), {"--set", "film.frames=2", "--set", "film.time_scale=40", "--set", "preview.pictures=false"});
    }
    const Outcome told = effuse(check), made = effuse(run);
    ASSERT_EQ(told.code + made.code, 0) << told.err << made.err;
    const double expected = nlohmann::json::parse(told.out).at("memory_bytes").get<double>(), taken = nlohmann::json::parse(made.out).at("peak_memory_bytes").get<double>();
    EXPECT_NEAR(expected / taken, 1, 0.25) << expected << " told, taken " << taken;
  }
}

TEST_F(ProgramTest, RefusesBrokenTerrainInOneSentenceAndLeavesNoFolder) {
  const std::string header = "ncols 3\nnrows 3\nxllcorner 0\nyllcorner 0\ncellsize 10\n";
  write("empty.asc", "");
  write("truncated.asc", header + "1 2 3\n4 5 6\n7");
  write("nan.asc", header + "nan nan nan\nnan nan nan\nnan nan nan\n");
  write("one.asc", "ncols 1\nnrows 1\nxllcorner 0\nyllcorner 0\ncellsize 10\n5\n");
  for (const char* terrain : {"missing.asc", "empty.asc", "truncated.asc", "nan.asc", "one.asc"}) {
    const fs::path scene = write("scene.toml", fmt::format("[film]\nframes = 2\n[terrain]\nfile = \"{}\"\n[lava]\nspacing = 1\n[[lava.vent]]\nat = [15, 15]\nwidth = 4\nrate = 1\n", terrain));
    const Outcome outcome = effuse({"run", scene, "-o", folder_ / "out"});
    EXPECT_EQ(outcome.code, 2) << terrain;
    EXPECT_EQ(count(outcome.err, "\n"), 1u) << terrain << ": " << outcome.err;
    EXPECT_NE(outcome.err.find(terrain), std::string::npos) << outcome.err;
    EXPECT_FALSE(fs::exists(folder_ / "out")) << terrain;
  }
}

TEST_F(ProgramTest, RefusesAVentBesideTheTerrain) {
  const Outcome outcome = effuse({"check", kScenes / "lava.toml", "--set", "lava.vent[0].at=[500, 500]"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_NE(outcome.err.find("not on the terrain"), std::string::npos) << outcome.err;
}

TEST_F(ProgramTestSlow, RefusesAtOnceWhatWouldNeverEndOrFitInMemory) {
  for (const char* slip : {"lava.spacing=1 mm", "lava.vent[0].width=1e9", "lava.vent[0].rate=1e30", "lava.max_step=1e-30", "lava.stiffness=1e30", "film.time_scale=1e308",
                           "lava.air_exchange=1e300", "lava.diffusivity=1e300", "lava.rest_period=1e-300"}) {
    const Outcome outcome = effuse({"check", kScenes / "lava.toml", "--set", slip});
    EXPECT_EQ(outcome.code, 2) << slip << ": " << outcome.out << outcome.err;
    EXPECT_EQ(count(outcome.err, "error: "), 1u) << slip << ": " << outcome.err;
  }
  // With bodies that a vent must keep off.
  for (const char* slip : {"lava.spacing=0.01 mm", "lava.vent[0].width=1e9"}) EXPECT_EQ(effuse({"check", kScenes / "boulder.toml", "--set", slip}).code, 2) << slip;
  // A fissure a million kilometres long and a hair wide.
  EXPECT_EQ(effuse({"check", kScenes / "lava.toml", "--set", "lava.vent[0]={from=[18,46],to=[1e9,46],width=1e-9,rate=1}"}).code, 2);
}

TEST_F(ProgramTest, TellsOfAVentAtAPointAndAlongALineOnce) {
  const Outcome outcome = effuse({"check", kScenes / "lava.toml", "--set", "lava.vent[0].from=[18, 46]", "--set", "lava.vent[0].to=[20, 46]"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_EQ(count(outcome.err, "error: "), 1u) << outcome.err;
}

TEST_F(ProgramTest, TellsAVentBesideTheTerrainTogetherWithOtherFaults) {
  const Outcome outcome = effuse({"check", kScenes / "lava.toml", "--set", "lava.vent[0].at=[500, 500]", "--set", "lava.spacing=2 kg"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_NE(outcome.err.find("not on the terrain"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("kg"), std::string::npos) << outcome.err;
}

TEST_F(ProgramTest, RunsLavaRoundAHouseAndWritesItBesideTheTerrain) {
  const fs::path out = folder_ / "house";
  const auto arguments = [&](const char* frames, const Arguments& more) {
    Arguments all = {"run", kScenes / "house.toml", "-o", out, "--frames", frames, "--set", "lava.spacing=1 m", "--set", "preview.pictures=false", "--set", "output.formats=[\"ply\"]"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  };
  ASSERT_EQ(effuse(arguments("3", {})).code, 0);
  EXPECT_TRUE(fs::exists(out / "obstacles.ply"));
  EXPECT_TRUE(fs::exists(out / "obstacles.glb"));
  EXPECT_FALSE(fs::exists(out / "frames" / "obstacles.0001.ply")) << "it stands";
  EXPECT_NE(read_file(out / "manifest.json").find("obstacles.ply"), std::string::npos);
  // The resolved scene finds the mesh from elsewhere; a run goes on among the same obstacles only.
  EXPECT_EQ(effuse({"check", out / "scene.toml"}).code, 0);
  EXPECT_EQ(effuse(arguments("5", {"--resume"})).code, 0);
  EXPECT_EQ(effuse(arguments("6", {"--resume", "--set", "obstacle[0].scale=2"})).code, 2);
}

TEST_F(ProgramTest, WhatIsShownBesideTheLavaIsWrittenWhateverTheFormats) {
  const fs::path scene = write("soft.toml", "format = 1\n[film]\nframes = 2\n[terrain.plane]\nsize = [\"20 m\", \"20 m\"]\n[preview]\npictures = false\n"
                                            "[[elastic]]\nname = \"block\"\nbox = [1, 1, 1]\nspacing = 0.5\nposition = [0, 0, 1]\nyoungs_modulus = 1e5\ndensity = 1000\n");
  for (const auto& [formats, written] : {std::pair("[\"glb\"]", "ply"), {"[\"ply\", \"vtp\"]", "ply"}, {"[\"vtp\"]", "vtp"}, {"[\"obj\", \"usda\"]", "usda"}}) {
    const fs::path out = folder_ / "soft";
    ASSERT_EQ(effuse({"run", scene, "-o", out, "--force", "--set", std::string("output.formats=") + formats}).code, 0) << formats;
    for (const char* kind : {"ply", "vtp", "usda"})
      EXPECT_EQ(fs::exists(out / "frames" / (std::string("block.0002.") + kind)), kind == std::string(written) || std::string(formats).find(kind) != std::string::npos) << formats << " " << kind;
  }
}

TEST_F(ProgramTest, WritesObstaclesThatMoveFrameByFrame) {
  std::string text = read_file(kScenes / "house.toml");
  const auto put = [&](const std::string& from, const std::string& to) { text.replace(text.find(from), from.size(), to); };
  put("gully.asc", (kScenes / "gully.asc").string());
  put("house.obj", (kScenes / "house.obj").string());
  put("position = [18, 24, 0]", "motion = \"linear\"");
  put("[skin]", "[[obstacle.key]]\ntime = 0\nposition = [18, 34, 0]\n[[obstacle.key]]\ntime = 1\nposition = [18, 30, 0]\nrotation = [\"0 deg\", \"0 deg\", \"40 deg\"]\n\n[skin]");
  const fs::path out = folder_ / "moving";
  const Outcome run = effuse({"run", write("scene.toml", text), "-o", out, "--frames", "3", "--set", "lava.spacing=1 m", "--set", "preview.pictures=false", "--set", "output.formats=[\"ply\"]"});
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_NE(read_file(out / "frames" / "obstacles.0001.ply"), read_file(out / "frames" / "obstacles.0003.ply"));
}

TEST_F(ProgramTest, TellsWhatIsWrongWithAnObstacleAtItsLine) {
  const std::string scene = read_file(kScenes / "house.toml");
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = scene;
    text.replace(text.find("gully.asc"), 9, (kScenes / "gully.asc").string());
    text.replace(text.find(from), from.size(), to);
    return write("scene.toml", text);
  };
  const Outcome missing = effuse({"check", with("house.obj", "hut.obj")});
  EXPECT_EQ(missing.code, 2);
  EXPECT_NE(missing.err.find("scene.toml:25"), std::string::npos) << missing.err;
  EXPECT_NE(missing.err.find("hut.obj"), std::string::npos) << missing.err;
  write_file(folder_ / "house.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
  const Outcome flat = effuse({"check", with("[18, 24, 0]", "[18, 24, 0]")});
  EXPECT_EQ(flat.code, 2) << "no triangle has an area";
  fs::copy_file(kScenes / "house.obj", folder_ / "house.obj", fs::copy_options::overwrite_existing);
  const Outcome beside = effuse({"check", with("[18, 24, 0]", "[1800, 24, 0]")});
  EXPECT_EQ(beside.code, 2);
  EXPECT_NE(beside.err.find("is not on the terrain"), std::string::npos) << beside.err;
  const Outcome classic = effuse({"check", with("model = \"modern\"\npreset = \"etna\"", "model = \"classic\"")});
  EXPECT_EQ(classic.code, 2);
  EXPECT_NE(classic.err.find("obstacle"), std::string::npos) << classic.err;
  EXPECT_EQ(effuse({"check", with("[18, 24, 0]", "[18, 24, 0]")}).code, 0);
}

TEST_F(ProgramTestSlow, RunsBodiesWithoutLavaAndGoesOnToTheSameBytes) {
  const auto arguments = [&](const fs::path& out, const char* frames, const Arguments& more) {
    Arguments all = {"run", kScenes / "wrecking-arm.toml", "-o", out, "--frames", frames, "--set", "preview.width=160", "--set", "preview.height=90", "--set", "preview.samples=1", "--set",
                     "output.formats=[\"ply\", \"glb\"]", "--set", "output.checkpoint_every=3"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  };
  const fs::path whole = folder_ / "whole", parts = folder_ / "parts";
  const Outcome run = effuse(arguments(whole, "8", {}));
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_EQ(run.err.find("not one particle"), std::string::npos) << run.err;
  EXPECT_FALSE(fs::exists(whole / "frames" / "skin.0001.ply")) << "there is no lava to skin";
  EXPECT_NE(read_file(whole / "frames" / "obstacles.0001.ply"), read_file(whole / "frames" / "obstacles.0008.ply"));
  EXPECT_EQ(count(read_file(whole / "bodies.csv"), "\n"), 1u + 8 * 30) << "a line a frame and thing: 2 obstacles, 12 links, the ball, 15 blocks";
  EXPECT_NE(read_file(whole / "bodies.glb").find("\"animations\""), std::string::npos);
  EXPECT_NE(read_file(whole / "manifest.json").find("bodies.glb"), std::string::npos);
  EXPECT_EQ(run_json(whole)["effects"]["bodies"]["bodies"], 28);
  EXPECT_LT(run_json(whole)["effects"]["bodies"]["largest_joint_error"], 1e-4);

  ASSERT_EQ(effuse(arguments(parts, "5", {"--threads", "1"})).code, 0);
  ASSERT_EQ(effuse(arguments(parts, "8", {"--resume", "--threads", "2"})).code, 0);
  expect_same_files(whole, parts, 16);
  EXPECT_EQ(read_file(parts / "bodies.csv"), read_file(whole / "bodies.csv"));
  EXPECT_EQ(read_file(parts / "bodies.glb"), read_file(whole / "bodies.glb"));
  EXPECT_EQ(effuse({"check", whole / "scene.toml"}).code, 0) << "the resolved scene is one";
  fs::remove(parts / "bodies.csv");
  EXPECT_EQ(effuse(arguments(parts, "9", {"--resume"})).code, 2);
  ASSERT_EQ(effuse(arguments(parts, "1", {"--force"})).code, 0);
}

/// The real scene at full resolution, for 40 of its frames.
class ProgramSlow : public ProgramTest {
 protected:
  static Arguments run_mountain(const fs::path& out, const Arguments& more = {}) {
    Arguments arguments = {"run", kScenes / "maunga-whau.toml", "-o", out, "--frames", "40", "--set", "output.checkpoint_every=20", "--set", "preview.width=320", "--set",
                           "preview.height=180", "--stats"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
};

TEST_F(ProgramSlow, WhatBreaksIsWrittenInPiecesAndGoesOnToTheSameBytes) {
  const auto run = [&](const fs::path& out, const char* frames, const Arguments& more = {}) {
    Arguments all = {"run", kScenes / "fracture.toml", "-o", out, "--frames", frames, "--quiet", "--set", "preview.pictures=false", "--set", "film.time_scale=1"};
    all.insert(all.end(), more.begin(), more.end());
    const Outcome outcome = effuse(all);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
  };
  const fs::path whole = folder_ / "whole", parts = folder_ / "parts";
  run(whole, "18");
  const std::string frame = read_file(whole / "frames" / "obstacles.0018.ply");
  EXPECT_NE(frame.find("property float piece"), std::string::npos);
  EXPECT_NE(frame.find("property float inner"), std::string::npos);
  EXPECT_GT(run_json(whole)["effects"]["bodies"]["pieces"], 5);
  EXPECT_NE(read_file(whole / "manifest.json").find("\"inner\""), std::string::npos);
  // Broken off while it breaks.
  run(parts, "14", {"--threads", "1"});
  run(parts, "18", {"--resume"});
  EXPECT_EQ(read_file(parts / "frames" / "obstacles.0018.ply"), frame);
}

TEST_F(ProgramTest, BlocksOfCrustAreWrittenFromTheFirstFrameOn) {
  const fs::path out = folder_ / "blocks";
  const Outcome run = effuse({"run", kScenes / "crust-blocks.toml", "-o", out, "--frames", "2", "--set", "preview.pictures=false", "--set", "lava.spacing=0.8 m", "--set", "lava.crust_blocks.size=3 m"});
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_TRUE(fs::exists(out / "frames" / "obstacles.0001.ply"));
  const Outcome misspelt = effuse({"check", kScenes / "crust-blocks.toml", "--set", "lava.crust_blocks.thicknes=1 cm"});
  EXPECT_EQ(misspelt.code, 2);
  EXPECT_NE(misspelt.err.find("thickness"), std::string::npos) << misspelt.err;
}

TEST_F(ProgramTest, TellsBodiesAndJointsOfAScene) {
  const Outcome check = effuse({"check", kScenes / "chain.toml"});
  EXPECT_EQ(check.code, 0) << check.err;
  EXPECT_NE(check.out.find("13 bodies of"), std::string::npos) << check.out;
  EXPECT_NE(check.out.find("12 joints"), std::string::npos) << check.out;
  EXPECT_NE(effuse({"info", kScenes / "chain.toml"}).out.find("13 bodies, 12 joints"), std::string::npos);
  std::string text = read_file(kScenes / "chain.toml");
  text.replace(text.find("\"world\", \"link.1\""), 17, "\"world\", \"lnk.1\"");
  const Outcome wrong = effuse({"check", write("chain.toml", text)});
  EXPECT_EQ(wrong.code, 2);
  EXPECT_NE(wrong.err.find("chain.toml:22:"), std::string::npos) << wrong.err;
  EXPECT_NE(wrong.err.find("did you mean 'link.1'?"), std::string::npos) << wrong.err;
  EXPECT_EQ(count(wrong.err, "error: "), 1u) << wrong.err;
}

TEST_F(ProgramTest, TheReadmesChainIsAScene) {
  const std::string readme = read_file(kScenes.parent_path().parent_path() / "README.md");
  const std::size_t from = readme.find("[terrain.plane]"), to = readme.find("```", from);
  ASSERT_NE(to, std::string::npos);
  std::string text = readme.substr(from, to - from);
  const Outcome plain = effuse({"check", write("readme.toml", "[film]\nframes = 24\n" + text)});
  EXPECT_EQ(plain.code, 0) << plain.err;
  EXPECT_NE(plain.out.find("10 bodies"), std::string::npos) << plain.out;
  // What it says in comments does, too.
  text.replace(text.find("# spring"), 2, "");
  text.replace(text.find("kind = \"ball\""), 13, "kind = \"ball\"\ncone = \"40 deg\"\naxis = [1, 0, 0]");
  const Outcome more = effuse({"check", write("readme.toml", "[film]\nframes = 24\n[bodies]\ncontact = \"penalty\"\npenalty_frequency = 50\n" + text)});
  EXPECT_EQ(more.code, 0) << more.err;
}

TEST_F(ProgramTestSlow, NamesWhatBlocksAVentWhenItCannotGoOn) {
  std::string text = read_file(kScenes / "house.toml");
  const auto put = [&](const std::string& from, const std::string& to) { text.replace(text.find(from), from.size(), to); };
  put("gully.asc", (kScenes / "gully.asc").string());
  put("file = \"house.obj\"\nposition = [18, 24, 0]", "name = \"ram\"\nbox = [3, 3, 3]\nmotion = \"linear\"");
  put("[skin]", "[[obstacle.key]]\ntime = 0\nposition = [18, 20, 0]\n[[obstacle.key]]\ntime = 0.3\nposition = [18, 43, 0]\n[[obstacle.key]]\ntime = 0.6\nposition = [18, 48, 0]\n\n[skin]");
  const fs::path out = folder_ / "ram";
  const Arguments base = {"run", write("scene.toml", text), "-o", out, "--frames", "24", "--set", "film.time_scale=1", "--set", "lava.spacing=0.8 m", "--set", "preview.pictures=false", "--set", "output.formats=[\"ply\"]"};
  Arguments coarse = base;
  coarse.insert(coarse.end(), {"--set", "lava.min_step=0.02"});
  const Outcome run = effuse(coarse);
  EXPECT_EQ(run.code, 4) << run.err;
  EXPECT_NE(run.err.find("obstacle 'ram', "), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("the open vent at 18, 43"), std::string::npos) << run.err;
  // Where it happened, as particles, as a picture, and the lines to change.
  EXPECT_NE(run.err.find("scene.toml:"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("lava.max_step: is"), std::string::npos) << run.err;
  EXPECT_NE(read_file(out / "trouble" / "particles.ply").find("property float velocity_x"), std::string::npos);
  EXPECT_TRUE(fs::exists(out / "trouble" / "picture.png"));
  // With steps as short as it takes it goes on, and says what became of the particles.
  Arguments again = base;
  again.push_back("--force");
  EXPECT_EQ(effuse(again).code, 0);
  EXPECT_FALSE(fs::exists(out / "trouble"));
  EXPECT_NE(read_file(out / "flow.csv").find(",left_J,crushed,stopped\n"), std::string::npos) << read_file(out / "flow.csv").substr(0, 400);
  EXPECT_TRUE(run_json(out)["effects"]["lava"].contains("crushed"));
}

TEST_F(ProgramTest, NamesTheNearestVerbAndRefusesAnUnknownFlag) {
  const Outcome verb = effuse({"chekc", "x.toml"});
  EXPECT_EQ(verb.code, 2);
  EXPECT_NE(verb.err.find("did you mean 'check'"), std::string::npos) << verb.err;
  EXPECT_EQ(effuse({"run", kScenes / "lava.toml", "--framse", "3"}).code, 2);
  // --json is kept when nothing else is right.
  for (const Arguments& wrong : {Arguments{"chekc", "x.toml", "--json"}, Arguments{"run", "--json", "--framse", "3"}, Arguments{"run", "--frames", "0", "--json", "x.toml"}}) {
    const Outcome outcome = effuse(wrong);
    EXPECT_EQ(outcome.code, 2);
    EXPECT_EQ(nlohmann::json::parse(outcome.out).at("exit_code"), 2) << outcome.out;
  }
  EXPECT_EQ(effuse({"--help"}).code, 0);
}

TEST_F(ProgramTest, GivesTheSameFramesOnOneTwoAndFourThreads) {
  std::vector<nlohmann::json> frames;
  for (const char* threads : {"1", "2", "4"}) {
    const fs::path out = folder_ / threads;
    const Outcome outcome = effuse(run_gully(out, 8, {"--threads", threads}));
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    frames.push_back(run_json(out).at("frames"));
  }
  EXPECT_EQ(frames[0].size(), 8u);
  EXPECT_EQ(frames[1], frames[0]);
  EXPECT_EQ(frames[2], frames[0]);
  expect_same_files(folder_ / "1", folder_ / "2", 8 * 4);
  expect_same_files(folder_ / "1", folder_ / "4", 8 * 4);
}

TEST_F(ProgramTestSlow, KilledInTheMidstOfAFrameItGoesOnToTheSameBytes) {
  const fs::path whole = folder_ / "whole", broken = folder_ / "broken";
  ASSERT_EQ(effuse(run_gully(whole, 12)).code, 0);
  const pid_t pid = start(run_gully(broken, 12));
  // Past the checkpoint of frame 3: wait for frame 5, then kill.
  while (!fs::exists(broken / "frames" / "lava.0005.vdb")) {
    ASSERT_EQ(::waitpid(pid, nullptr, WNOHANG), 0) << "it ended by itself";
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  ::kill(pid, SIGKILL);
  EXPECT_EQ(wait(pid).code, -SIGKILL);
  const Outcome resumed = effuse(run_gully(broken, 12, {"--resume"}));
  ASSERT_EQ(resumed.code, 0) << resumed.err;
  EXPECT_NE(resumed.err.find("going on after frame"), std::string::npos) << resumed.err;
  expect_same_files(whole, broken, 12 * 4);
  EXPECT_EQ(run_json(whole).at("frames"), run_json(broken).at("frames"));
  // The figures are the whole run's, not those of the part after the checkpoint.
  for (const char* figure : {"particles", "mass_emitted_kg", "steps", "smallest_step_s", "retries", "max_speed_m_s"})
    EXPECT_EQ(run_json(whole).at("effects").at("lava").at(figure), run_json(broken).at("effects").at("lava").at(figure)) << figure;
}

TEST_F(ProgramTestSlow, InterruptedItCheckpointsAndSaysHowToGoOn) {
  const fs::path whole = folder_ / "whole", broken = folder_ / "broken";
  ASSERT_EQ(effuse(run_gully(whole, 10)).code, 0);
  const pid_t pid = start(run_gully(broken, 10));
  while (!fs::exists(broken / "frames" / "lava.0005.vdb")) {
    ASSERT_EQ(::waitpid(pid, nullptr, WNOHANG), 0) << "it ended by itself";
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  ::kill(pid, SIGINT);
  const Outcome outcome = wait(pid);
  EXPECT_EQ(outcome.code, 130) << outcome.err;
  EXPECT_NE(outcome.err.find("--resume"), std::string::npos) << outcome.err;
  // The line it prints is the one that works: with the frames and the overrides of the run.
  const std::string call = fmt::format("{} run ", EFFUSE_PROGRAM);  // as it was called
  const std::size_t at = outcome.err.find(call);
  ASSERT_NE(at, std::string::npos) << outcome.err;
  const std::string line = outcome.err.substr(at, outcome.err.find('\n', at) - at);
  ASSERT_EQ(std::system((line + " --quiet").c_str()), 0) << line;
  expect_same_files(whole, broken, 10 * 4);
}

TEST_F(ProgramTestSlow, KeepsARunUnlessForcedAndARunOfAnotherSceneFromBeingResumed) {
  const fs::path out = folder_ / "out";
  ASSERT_EQ(effuse(run_gully(out, 3)).code, 0);
  const Outcome again = effuse(run_gully(out, 3));
  EXPECT_EQ(again.code, 2);
  EXPECT_NE(again.err.find("--resume"), std::string::npos) << again.err;
  const Outcome other = effuse(run_gully(out, 3, {"--resume", "--set", "lava.density=2500"}));
  EXPECT_EQ(other.code, 2);
  EXPECT_NE(other.err.find("scene has changed"), std::string::npos) << other.err;
  EXPECT_EQ(effuse(run_gully(out, 5, {"--resume"})).code, 0) << "more frames are no other scene";
  EXPECT_EQ(run_json(out).at("frames").size(), 5u);
  const fs::path mine = out / "frames" / "notes.txt", cut = out / "frames" / "skin.0009.part.ply";
  std::ofstream(mine) << "of the user\n";
  std::ofstream(cut) << "half\n";
  EXPECT_EQ(effuse(run_gully(out, 2, {"--force"})).code, 0);
  EXPECT_TRUE(fs::exists(mine)) << "a file of somebody else";
  EXPECT_FALSE(fs::exists(cut));
  fs::remove(mine);
  EXPECT_EQ(frame_files(out).size(), 2u * 4);
}

TEST_F(ProgramTest, AFullDiskEndsTheRunWithCodeFiveAndNoBrokenFile) {
  const fs::path out = folder_ / "out";
  const Outcome outcome = wait(start(run_gully(out, 12), 30'000));
  EXPECT_EQ(outcome.code, 5) << outcome.err;
  for (const auto& [name, bytes] : frame_files(out)) {
    EXPECT_EQ(name.find(".part"), std::string::npos) << name;
    EXPECT_LE(bytes.size(), 30'000u) << name;
  }
}

TEST_F(ProgramTest, DescribesItsOwnFiles) {
  const fs::path out = folder_ / "out";
  ASSERT_EQ(effuse(run_gully(out, 4)).code, 0);
  const Outcome outcome = effuse({"info", out, out / "frames" / "skin.0004.ply", out / "frames" / "skin.0004.glb", out / "frames" / "lava.0004.vdb", out / "terrain.ply",
                                  out / "scene.toml", kScenes / "gully.asc"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("surface"), std::string::npos) << outcome.out;
  EXPECT_EQ(effuse({"effects"}).code, 0);
  // The run, by its folder, a folder in it, or its reports: the same words.
  const auto facts = [&](const fs::path& file) { return nlohmann::json::parse(effuse({"info", file, "--json"}).out).at(0).at("facts"); };
  const nlohmann::json run = facts(out);
  EXPECT_EQ(run.at(0), "run of 'Lava in a gully': 4 frames at 24 a second, 0.17 s of film, 1.66667 s of lava");
  EXPECT_NE(run.dump().find("done, "), std::string::npos) << run;
  EXPECT_NE(run.dump().find("lava: "), std::string::npos) << run;
  EXPECT_NE(run.dump().find("time went to "), std::string::npos) << run;
  for (const char* name : {"run.json", "manifest.json", "frames", "frames/", "checkpoints"}) EXPECT_EQ(facts(out / name).at(0), run.at(0)) << name;
  const Outcome none = effuse({"info", folder_});
  EXPECT_EQ(none.code, 2);
  EXPECT_NE(none.err.find("holds no run"), std::string::npos) << none.err;
  write("out/run.json", "{\"outcome\": ");
  EXPECT_NE(effuse({"info", out}).err.find("run.json: is damaged"), std::string::npos);
  // The resolved scene is a scene: it checks, and says the same again.
  EXPECT_EQ(effuse({"check", out / "scene.toml"}).code, 0);
}

TEST_F(ProgramTestSlow, FallsBackOnTheCheckpointBeforeADamagedOne) {
  const fs::path whole = folder_ / "whole", broken = folder_ / "broken";
  ASSERT_EQ(effuse(run_gully(whole, 9)).code, 0);
  ASSERT_EQ(effuse(run_gully(broken, 7)).code, 0);
  const fs::path newest = broken / "checkpoints" / "checkpoint.0007.state", before = broken / "checkpoints" / "checkpoint.0006.state";
  std::string bytes = read_file(newest);
  bytes[bytes.size() / 2] ^= 1;
  write_file(newest, bytes);
  write_file(broken / "checkpoints" / "checkpoint.old.state", "not one of ours");
  const Outcome resumed = effuse(run_gully(broken, 9, {"--resume"}));
  ASSERT_EQ(resumed.code, 0) << resumed.err;
  EXPECT_NE(resumed.err.find("checkpoint.0007.state is damaged"), std::string::npos) << resumed.err;
  EXPECT_NE(resumed.err.find("going on after frame 6"), std::string::npos) << resumed.err;
  expect_same_files(whole, broken, 9 * 4);
  EXPECT_EQ(run_json(whole).at("frames"), run_json(broken).at("frames"));

  for (const fs::directory_entry& entry : fs::directory_iterator(broken / "checkpoints")) write_file(entry.path(), "");
  const Outcome none = effuse(run_gully(broken, 12, {"--resume"}));
  EXPECT_EQ(none.code, 2);
  EXPECT_NE(none.err.find("every checkpoint is damaged"), std::string::npos) << none.err;
  expect_same_files(whole, broken, 9 * 4);
}

TEST_F(ProgramTest, TwoRunsDoNotWriteIntoOneFolder) {
  const fs::path out = folder_ / "out";
  const pid_t pid = start(run_gully(out, 200));
  while (!fs::exists(out / "frames" / "lava.0001.vdb")) {
    ASSERT_EQ(::waitpid(pid, nullptr, WNOHANG), 0) << "it ended by itself";
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  ::kill(pid, SIGSTOP);  // however long the others take, it is still writing
  for (const char* how : {"--resume", "--force"}) {
    const Outcome second = effuse(run_gully(out, 200, {how}));
    EXPECT_EQ(second.code, 2);
    EXPECT_NE(second.err.find("another effuse is writing"), std::string::npos) << second.err;
  }
  EXPECT_TRUE(fs::exists(out / "frames" / "lava.0001.vdb"));
  ::kill(pid, SIGHUP);  // the terminal closes: as Ctrl-C
  ::kill(pid, SIGCONT);
  EXPECT_EQ(wait(pid).code, 130);
}

TEST_F(ProgramTest, TheLineThatResumesIsAWholeCommand) {
  const fs::path out = folder_ / "it's here";
  const pid_t pid = start(run_gully(out, 200));
  while (!fs::exists(out / "frames" / "lava.0002.vdb")) {
    ASSERT_EQ(::waitpid(pid, nullptr, WNOHANG), 0) << "it ended by itself";
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  ::kill(pid, SIGTERM);
  const Outcome outcome = wait(pid);
  ASSERT_EQ(outcome.code, 130);
  EXPECT_NE(outcome.err.find(R"(it'\''s here' --frames 200 --set 'lava.spacing=1.2 m')"), std::string::npos) << outcome.err;
}

TEST_F(ProgramTestSlow, RefusesNumbersThatWouldNeverEndOrBreakTheFiles) {
  const fs::path out = folder_ / "out";
  for (const char* set : {"lava.spacing=1e-9", "lava.spacing=1e-300", "lava.vent[0].rate=1e300", "lava.vent[0].width=1e9", "lava.vent[0].width=100", "lava.vent[0].at=[2,50]", "lava.vent[0].at=[1e300,1]",
                          "film.time_scale=1e300", "film.fps=1e-300", "lava.max_step=1e-12", "lava.courant=1e-300", "lava.ground_exchange=1e300", "lava.diffusivity=1e9", "lava.air_temperature=1e6",
                          "terrain.temperature=1e300", "skin.glow=1e300", "skin.amplitude=1e300", "preview.view=[1e300,0,1]", "preview.view=[0,0,1e300]", "terrain.file=\"\"", "terrain.file=\"a\\u0000b\""}) {
    const Outcome outcome = effuse(run_gully(out, 2, {"--set", set}));
    EXPECT_EQ(outcome.code, 2) << set << "\n" << outcome.err;
    EXPECT_LT(outcome.err.size(), 600u) << set;
    EXPECT_FALSE(fs::exists(out)) << set;
  }
  // Nothing comes out: allowed, and said.
  const Outcome dry = effuse(run_gully(out, 2, {"--set", "lava.vent[0].rate=0"}));
  EXPECT_EQ(dry.code, 0) << dry.err;
  EXPECT_NE(dry.err.find("not one particle"), std::string::npos) << dry.err;
}

TEST_F(ProgramTest, RefusesAnOutputThatIsNoFolder) {
  write("file", "x");
  fs::create_symlink("nowhere", folder_ / "dangling");
  fs::create_symlink("loop", folder_ / "loop");
  for (const fs::path& out : {folder_ / "file", folder_ / "file" / "below", folder_ / "dangling", folder_ / "loop", folder_ / std::string(300, 'a'), fs::path("/proc/effuse")}) {
    const Outcome outcome = effuse(run_gully(out, 2));
    EXPECT_EQ(outcome.code, 2) << out << outcome.err;
    EXPECT_EQ(count(outcome.err, "error: "), 1u) << outcome.err;
  }
  EXPECT_EQ(read_file(folder_ / "file"), "x");
  EXPECT_EQ(effuse({"info", folder_ / "loop"}).code, 2);
}

TEST_F(ProgramTestSlow, GoesOnWithoutAnybodyWhoListens) {
  const auto shell = [&](const Arguments& arguments, const std::string& redirection) {
    std::string line = EFFUSE_PROGRAM;
    for (const std::string& word : arguments) line += " '" + word + "'";
    const int status = std::system((line + " " + redirection).c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  };
  const fs::path whole = folder_ / "whole";
  ASSERT_EQ(effuse(run_gully(whole, 4)).code, 0);
  int n = 0;
  for (const char* redirection : {"2>/dev/full", "2>&-", "<&- >&- 2>&-", "2>&1 | head -n 1 >/dev/null"}) {
    const fs::path out = folder_ / std::to_string(n++);
    EXPECT_EQ(shell(run_gully(out, 4), redirection), 0) << redirection;
    expect_same_files(whole, out, 4 * 4);
    EXPECT_EQ(read_file(out / "scene.toml"), read_file(whole / "scene.toml"));
  }
  EXPECT_EQ(shell({"check", kScenes / "lava.toml"}, ">/dev/full 2>/dev/null"), 5);
  EXPECT_EQ(shell({"effects", "--json"}, ">/dev/full 2>/dev/null"), 5);
}

TEST_F(ProgramTestSlow, TakesNamesThatAreNotUtf8) {
  fs::copy_file(kScenes / "gully.asc", folder_ / "gully.asc");
  write("gully.prj",
        "PROJCS[\"R\xe9union\",GEOGCS[\"x\",DATUM[\"y\",SPHEROID[\"z\",6378137,298.257223563]],PRIMEM[\"Greenwich\",0],UNIT[\"Degree\",0.0174532925199433]],PROJECTION[\"Transverse_Mercator\"],"
        "PARAMETER[\"False_Easting\",160000],PARAMETER[\"False_Northing\",50000],PARAMETER[\"Central_Meridian\",55.5],PARAMETER[\"Scale_Factor\",1],PARAMETER[\"Latitude_Of_Origin\",-21],UNIT[\"Meter\",1]]");
  const fs::path scene = write("sc\xe8ne.toml", "name = \"\xf0\x9f\x8c\x8b \\n \\u0000\"\n" + read_file(kScenes / "lava.toml").substr(read_file(kScenes / "lava.toml").find("\n[film]")));
  const fs::path out = folder_ / "\xe9t\xe9";
  const Outcome outcome = effuse({"run", scene, "-o", out, "--frames", "2", "--set", "lava.spacing=1.2 m", "--set", "preview.pictures=false", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(nlohmann::json::parse(outcome.out).at("outcome"), "done");
  EXPECT_NE(nlohmann::json::parse(read_file(out / "manifest.json")).at("crs").get<std::string>().find("R\xc3\xa9union"), std::string::npos);
  for (const Arguments& more : {Arguments{}, Arguments{"--json"}}) {
    Arguments arguments = {"info", out, scene, out / "terrain.ply", out / "frames" / "skin.0002.glb", folder_ / "gully.asc"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    EXPECT_EQ(effuse(arguments).code, 0);
  }
}

TEST_F(ProgramSlow, MaungaWhauKilledAfterFrameTwentyGoesOnToTheSameFortyFrames) {
  const fs::path whole = folder_ / "whole", broken = folder_ / "broken";
  const Outcome outcome = effuse(run_mountain(whole));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const pid_t pid = start(run_mountain(broken));
  while (!fs::exists(broken / "preview" / "preview.0027.png")) {
    ASSERT_EQ(::waitpid(pid, nullptr, WNOHANG), 0) << "it ended by itself";
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  ::kill(pid, SIGKILL);
  EXPECT_EQ(wait(pid).code, -SIGKILL);
  const Outcome resumed = effuse(run_mountain(broken, {"--resume"}));
  ASSERT_EQ(resumed.code, 0) << resumed.err;
  EXPECT_NE(resumed.err.find("going on after frame 20"), std::string::npos) << resumed.err;
  expect_same_files(whole, broken, 40 * 5);
  EXPECT_EQ(run_json(whole).at("frames"), run_json(broken).at("frames"));

  // The run says where its time went: neither the largest zone nor much of the whole is input, output or logging.
  // Pictures (preview.) are rays through the skin's room, not output: writing their files is (write.png).
  std::string largest;
  double most = 0, all = 0, files = 0;
  const auto handles_files = [](const std::string& zone) {
    return zone.starts_with("write.") || zone.starts_with("import.") || zone == "skin.write_vdb" || zone == "checkpoint" || zone == "load";
  };
  const nlohmann::json report = run_json(whole), &zones = report.at("zones");
  for (const auto& [name, zone] : zones.items()) {
    const double self = zone.at("self_s").get<double>();
    all += self;
    if (handles_files(name)) files += self;
    if (self <= most) continue;
    most = self;
    largest = name;
  }
  EXPECT_FALSE(handles_files(largest)) << largest << " took " << most << " s";
  EXPECT_LT(files, 0.3 * all);
  EXPECT_NE(outcome.err.find("sph.forces"), std::string::npos) << "no table of zones";
}

TEST_F(ProgramTest, AnErrorIsOneLineAndLeavesTheTerminalAloneWhateverAFileIsCalled) {
  const fs::path file = write("new\nline \x1b[31mred\x7f.tif", "no raster");
  for (const Arguments& arguments : {Arguments{"info", file}, Arguments{"import", file, "-o", folder_ / "a.tif"}}) {
    const Outcome outcome = effuse(arguments);
    EXPECT_EQ(outcome.code, 2);
    EXPECT_EQ(std::count_if(outcome.err.begin(), outcome.err.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }), 1) << outcome.err;
    EXPECT_TRUE(outcome.err.ends_with("\n"));
  }
  const Outcome json = effuse({"info", file, "--json"});
  EXPECT_EQ(nlohmann::json::parse(json.out).at("errors").at(0).at("file"), file.string());
}

}  // namespace
}  // namespace effuse
