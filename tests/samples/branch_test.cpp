#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "geometry/base/files.h"

/// A run that goes on differently from one of its frames (`--from-frame`).
namespace effuse {
namespace {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;

class Branch : public testing::Test {
 protected:
  Branch() {
    folder_ = fs::temp_directory_path() / fmt::format("effuse.Branch.{}.{}", testing::UnitTest::GetInstance()->current_test_info()->name(), ::getpid());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~Branch() override { fs::remove_all(folder_); }

  struct Outcome {
    int code = -1;
    std::string err;
  };
  /// Six coarse frames of the gully, checkpoints after the third and the sixth.
  Outcome run(const Words& words) const {
    std::string line = fmt::format("'{}' run '{}/samples/scenes/lava.toml' -o '{}' --quiet --set lava.spacing=1.2 --set film.time_scale=12 --set preview.pictures=false --set 'output.formats=[\"ply\"]' --set output.checkpoint_every=3",
                                   EFFUSE_PROGRAM, EFFUSE_SOURCE_DIR, out().string());
    for (const std::string& word : words) line += " '" + word + "'";
    const int status = std::system((line + " >/dev/null 2>'" + (folder_ / "err").string() + "'").c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_file(folder_ / "err")};
  }
  fs::path out() const { return folder_ / "run"; }

  /// Of a file: its bytes, its inode and when it was last written.
  struct Facts {
    std::string bytes;
    ino_t inode = 0;
    std::int64_t written = 0;
    bool operator==(const Facts&) const = default;
  };
  std::map<int, Facts> frames() const {
    std::map<int, Facts> all;
    for (int frame = 1; frame <= 12; ++frame) {
      const fs::path file = out() / fmt::format("frames/skin.{:04}.ply", frame);
      struct stat status {};
      if (::stat(file.c_str(), &status) == 0) all[frame] = {read_file(file), status.st_ino, status.st_mtim.tv_sec * 1'000'000'000 + status.st_mtim.tv_nsec};
    }
    return all;
  }
  nlohmann::json record() const { return nlohmann::json::parse(read_file(out() / "run.json")); }

  fs::path folder_;
};

const Words kStiffer = {"--set", "lava.viscosity.hot=2", "--set", "lava.viscosity.cold=6", "--set", "lava.viscosity.max=6"};

Words with(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

class BranchSlow : public Branch {};

TEST_F(BranchSlow, KeepsTheFramesBeforeAndMakesTheOthersAnew) {
  ASSERT_EQ(run({"--frames", "6"}).code, 0);
  const auto before = frames();
  const nlohmann::json old = record();
  ASSERT_EQ(before.size(), 6u);
  const std::string series = read_file(out() / "flow.csv");

  write_file(out() / "frames" / "mine.0005.ply", "not the program's");
  const Outcome branched = run(with({"--from-frame", "4", "--frames", "8"}, kStiffer));
  ASSERT_EQ(branched.code, 0) << branched.err;
  const auto after = frames();
  ASSERT_EQ(after.size(), 8u);
  for (int frame = 1; frame <= 3; ++frame) EXPECT_EQ(after.at(frame), before.at(frame)) << frame;
  for (int frame = 4; frame <= 6; ++frame) EXPECT_NE(after.at(frame).bytes, before.at(frame).bytes) << frame;
  const nlohmann::json now = record();
  ASSERT_EQ(now["frames"].size(), 8u);
  for (int k = 0; k < 6; ++k) EXPECT_EQ(now["frames"][k]["state"] == old["frames"][k]["state"], k < 3) << k;
  EXPECT_EQ(now["branches"][0]["from_frame"], 4);
  EXPECT_NE(now["branches"][0]["changes"].dump().find("lava.viscosity.hot: \\\"0.3 m2/s\\\" -> \\\"2 m2/s\\\""), std::string::npos) << now["branches"].dump();
  EXPECT_NE(read_file(out() / "scene.until-0003.toml").find("hot = \"0.3 m2/s\""), std::string::npos);
  EXPECT_NE(read_file(out() / "scene.toml").find("hot = \"2 m2/s\""), std::string::npos);
  // Lines of the frames before stand, the others are new: eight and the head.
  const std::string series_now = read_file(out() / "flow.csv");
  std::size_t third = 0;
  for (int line = 0; line < 4; ++line) third = series.find('\n', third) + 1;
  EXPECT_EQ(series_now.substr(0, third), series.substr(0, third));
  EXPECT_EQ(std::count(series_now.begin(), series_now.end(), '\n'), 9);

  // It can be gone on with like any run, and branched again.
  ASSERT_EQ(run(with({"--resume", "--frames", "9"}, kStiffer)).code, 0);
  const auto resumed = frames();
  for (const auto& [frame, facts] : after) EXPECT_EQ(resumed.at(frame), facts) << frame;
  EXPECT_EQ(record()["branches"].size(), 1u);
  EXPECT_EQ(read_file(out() / "frames" / "mine.0005.ply"), "not the program's");
}

TEST_F(Branch, WithTheSameSceneComesToTheSameBytes) {
  ASSERT_EQ(run({"--frames", "6"}).code, 0);
  const auto before = frames();
  ASSERT_EQ(run({"--frames", "6", "--from-frame", "4"}).code, 0);
  for (const auto& [frame, facts] : frames()) EXPECT_EQ(facts.bytes, before.at(frame).bytes) << frame;
}

TEST_F(BranchSlow, RefusesWhatTheStateCannotFollowAndTouchesNothing) {
  ASSERT_EQ(run({"--frames", "6"}).code, 0);
  const auto before = frames();
  const std::string scene = read_file(out() / "scene.toml"), json = read_file(out() / "run.json");
  const std::vector<std::pair<Words, std::string>> refused = {
      {{"--from-frame", "4", "--set", "lava.spacing=1"}, "lava.spacing: \"1.2 m\" -> \"1 m\" cannot come in the midst of a run"},
      {{"--from-frame", "4", "--set", "film.fps=12"}, "film.fps"},
      {{"--from-frame", "4", "--set", "seed=3"}, "seed: 1 -> 3"},
      {{"--from-frame", "5"}, "no checkpoint stands after frame 4: with those there are it may be 4, 7"},
      {{"--from-frame", "100"}, "no checkpoint stands after frame 99"},
      {{"--from-frame", "4", "--frames", "3"}, "the film has 3 frames"},
      {{"--from-frame", "4", "--resume"}, "excludes"},
  };
  for (const auto& [words, message] : refused) {
    Words all = words;
    if (std::find(words.begin(), words.end(), "--frames") == words.end()) all = with(all, {"--frames", "200"});
    const Outcome outcome = run(all);
    EXPECT_EQ(outcome.code, 2) << message;
    EXPECT_NE(outcome.err.find(message), std::string::npos) << outcome.err;
  }
  EXPECT_EQ(frames(), before);
  EXPECT_EQ(read_file(out() / "scene.toml"), scene);
  EXPECT_EQ(read_file(out() / "run.json"), json);
  fs::remove_all(out());
  EXPECT_EQ(run({"--from-frame", "4"}).code, 2);
  EXPECT_FALSE(fs::exists(out()));
}

}  // namespace
}  // namespace effuse
