#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "geometry/base/files.h"
#include "tests/samples/named_by_scene.h"

/// Only what is called for: of every scene in samples/scenes, what is built, allocated, entered and written is what its text names; and
/// effects that a program has beside lava cost a lava scene nothing.
namespace effuse {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const fs::path kScenes = fs::path(EFFUSE_SOURCE_DIR) / "samples" / "scenes";
constexpr int kFrames = 2;

std::vector<fs::path> scenes() {
  std::vector<fs::path> all;
  for (const fs::directory_entry& entry : fs::directory_iterator(kScenes))
    if (entry.path().extension() == ".toml") all.push_back(entry.path());
  std::sort(all.begin(), all.end());
  return all;
}

/// A folder with the scenes' own files, where copies of scenes find them.
class Beside {
 public:
  Beside() : folder_(fs::temp_directory_path() / fmt::format("effuse.only_named.{}.{}", testing::UnitTest::GetInstance()->current_test_info()->name(), ::getpid())) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    for (const fs::directory_entry& entry : fs::directory_iterator(kScenes))
      if (entry.path().extension() != ".toml" && entry.path().extension() != ".jpg") fs::create_symlink(entry.path(), folder_ / entry.path().filename());
  }
  ~Beside() { fs::remove_all(folder_); }
  const fs::path& folder() const { return folder_; }

 private:
  fs::path folder_;
};

/// What a program says on stdout, none where it failed.
json said_by(const std::string& command) {
  std::string text;
  FILE* pipe = ::popen(command.c_str(), "r");
  if (!pipe) return {};
  char part[4096];
  for (std::size_t n = 0; (n = std::fread(part, 1, sizeof part, pipe)) > 0;) text.append(part, n);
  return ::pclose(pipe) == 0 ? json::parse(text, nullptr, false) : json();
}

std::set<std::string> keys_of(const json& object) {
  std::set<std::string> keys;
  for (const auto& [key, value] : object.items()) keys.insert(key);
  return keys;
}

std::set<std::string> files_below(const fs::path& folder) {
  std::set<std::string> files;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder))
    if (!entry.is_directory()) files.insert(fs::relative(entry.path(), folder).string());
  return files;
}

/// One line for each thing too many or too few.
void compare(const std::string& of, const std::set<std::string>& wanted, const std::set<std::string>& found, std::vector<std::string>& differences) {
  for (const std::string& one : wanted)
    if (!found.contains(one)) differences.push_back(fmt::format("{}: '{}' is called for and missing", of, one));
  for (const std::string& one : found)
    if (!wanted.contains(one)) differences.push_back(fmt::format("{}: '{}' is not called for", of, one));
}

/// Runs `scene` for two frames, and tells where that is not what `text` calls for.
std::vector<std::string> differences(const std::string& text, const std::string& scene, const fs::path& folder) {
  const CalledFor wanted = called_for(text, kFrames);
  std::vector<std::string> all;
  write_file(folder / "scene.toml", scene);
  const fs::path out = folder / "out";
  fs::remove_all(out);
  const json run = said_by(fmt::format("'{}' run '{}' -o '{}' --frames {} --json 2>'{}'", EFFUSE_PROGRAM, (folder / "scene.toml").string(), out.string(), kFrames, (folder / "log").string()));
  if (!run.is_object() || run.value("outcome", "") != "done") return {"it does not run: " + read_file(folder / "log")};
  compare("effects", wanted.effects, keys_of(run.at("effects")), all);
  compare("files", wanted.files, files_below(out), all);
  const std::set<std::string> entered = keys_of(run.at("zones"));
  const auto fits = [](const std::string& zone, const std::set<std::string>& patterns) {
    return std::any_of(patterns.begin(), patterns.end(), [&](const std::string& pattern) { return std::regex_match(zone, std::regex(pattern)); });
  };
  for (const std::string& zone : entered)
    if (!fits(zone, wanted.zones)) all.push_back(fmt::format("zones: '{}' is not called for", zone));
  for (const std::string& pattern : wanted.worked)
    if (std::none_of(entered.begin(), entered.end(), [&](const std::string& zone) { return fits(zone, {pattern}); })) all.push_back(fmt::format("zones: '{}' is called for, and none like it was entered", pattern));

#ifdef EFFUSE_COUNTED_RUN_ALL
  const json counted = said_by(fmt::format("'{}' '{}' {}", EFFUSE_COUNTED_RUN_ALL, (folder / "scene.toml").string(), kFrames));
  if (!counted.is_object()) return {"it does not run, counted"};
  std::set<std::string> took;
  for (const auto& [name, heap] : counted.at("effects").items())
    if (heap.at("calls") > 0) took.insert(name);
  compare("allocations", wanted.effects, took, all);
  // Between the effects only a list of them, one for each of the others, and their accounts' names are allocated.
  if (const auto others = counted.at("calls_of_no_effect").get<std::size_t>(); others > 2 * wanted.effects.size() + 1) all.push_back(fmt::format("allocations: {} of no effect", others));
#endif
  return all;
}

class OnlyWhatIsNamedSlow : public testing::TestWithParam<fs::path> {};

TEST_P(OnlyWhatIsNamedSlow, IsBuiltAllocatedEnteredAndWritten) {
  const Beside beside;
  const std::string text = read_file(GetParam());
  const std::vector<std::string> found = differences(text, made_small(text), beside.folder());
  EXPECT_TRUE(found.empty()) << fmt::format("{}", fmt::join(found, "\n"));
}
INSTANTIATE_TEST_SUITE_P(Scenes, OnlyWhatIsNamedSlow, testing::ValuesIn(scenes()), [](const testing::TestParamInfo<fs::path>& scene) {
  std::string name = scene.param.stem().string();
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

TEST(OnlyWhatIsNamedTestSlow, FailsInEachOfFourWaysWhenTheProgramDoesMoreThanTheTextSays) {
  const Beside beside;
  const std::string text = made_small(read_file(kScenes / "lava.toml"));
  const std::string more = text + "\n[[smoke]]\nbox = [10, 10, 20, 20, 20, 30]\ncell = \"2 m\"\nlava_smoke = \"0.2 1/s\"\n";
  const std::vector<std::string> found = differences(text, more, beside.folder());
  for (const char* way : {"effects: 'smoke' is not called for", "files: 'frames/smoke.0001.vdb' is not called for", "zones: 'smoke.pressure' is not called for", "allocations: 'smoke' is not called for"})
    EXPECT_NE(std::find(found.begin(), found.end(), way), found.end()) << way << "\namong\n" << fmt::format("{}", fmt::join(found, "\n"));
  // And too little.
  const std::vector<std::string> lacking = differences(more, text, beside.folder());
  EXPECT_NE(std::find(lacking.begin(), lacking.end(), "effects: 'smoke' is called for and missing"), lacking.end());
}

#ifdef EFFUSE_COUNTED_RUN_LAVA
/// What the program with all effects and the one with lava alone take for the same lava scene, up to where a hundredth shows.
std::string lava_scene() { return fmt::format("'{}' 36 'lava.spacing=0.6 m' preview.pictures=false", (kScenes / "gully-modern.toml").string()); }
json taken_by(const char* program) { return said_by(fmt::format("'{}' {}", program, lava_scene())); }

// What is the same in every run, to the call.
TEST(EffectsThatAreNotNamedSlow, DoNothingToALavaSceneAndAllocateNothing) {
  const json all = taken_by(EFFUSE_COUNTED_RUN_ALL), lava = taken_by(EFFUSE_COUNTED_RUN_LAVA);
  ASSERT_TRUE(all.is_object() && lava.is_object());
  EXPECT_EQ(lava.at("kinds"), json::array({"lava"})) << "the other program is not what it is said to be";
  EXPECT_GT(all.at("kinds").size(), 8u);
  EXPECT_EQ(all.at("state"), lava.at("state"));
  EXPECT_EQ(all.at("effects").at("lava").at("calls"), lava.at("effects").at("lava").at("calls"));
  EXPECT_EQ(all.at("calls_of_no_effect"), lava.at("calls_of_no_effect"));
}

TEST(EffectsThatAreNotNamedSlow, TakeNoMemoryOfALavaScene) {
  const json all = taken_by(EFFUSE_COUNTED_RUN_ALL), lava = taken_by(EFFUSE_COUNTED_RUN_LAVA);
  ASSERT_TRUE(all.is_object() && lava.is_object());
  // All that a process has of its own but for its stack: the heap and the program's variables.
  const auto own = [](const json& run) { return run.at("whole").at("largest").get<double>() + run.at("variables").get<double>(); };
  EXPECT_GT(all.at("variables"), lava.at("variables"));
  EXPECT_NEAR(own(all) / own(lava), 1, 0.01);
  EXPECT_NEAR(all.at("whole").at("bytes").get<double>() / lava.at("whole").at("bytes").get<double>(), 1, 0.01) << "all that was ever allocated";
  std::printf("own memory %+.3f %% of %.2f MB\n", 100 * (own(all) / own(lava) - 1), own(lava) / 1e6);
}

double median(std::vector<double> v) {
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
  return v[v.size() / 2];
}

// What a machine that others share can bend: time, and which pages are resident.
TEST(EffectsThatAreNotNamedBench, CostALavaSceneWithinAPercentNoTimeAndNoResidentMemory) {
  struct Made {
    std::vector<double> seconds, rss, anonymous;
  } all, lava;
  // In turns, so that what the machine does beside hits both; the first turn warms up. Where a function lies costs per cents, and is the
  // same in both (samples/counted_run/CMakeLists.txt).
  std::vector<double> ratios;
  double difference = 0, error = 1;
  for (int turn = 0; turn < 81 && (turn < 25 || error > 0.003); ++turn) {
    const auto one = [&](const char* program, Made& made) {
      const json run = taken_by(program);
      ASSERT_TRUE(run.is_object());
      if (turn == 0) return;
      made.seconds.push_back(run.at("effects_cpu_s"));
      made.rss.push_back(run.at("peak_rss"));
      made.anonymous.push_back(run.at("anonymous"));
    };
    if (turn % 2) one(EFFUSE_COUNTED_RUN_LAVA, lava), one(EFFUSE_COUNTED_RUN_ALL, all);
    else one(EFFUSE_COUNTED_RUN_ALL, all), one(EFFUSE_COUNTED_RUN_LAVA, lava);
    if (HasFatalFailure()) return;
    if (turn == 0) continue;
    ratios.push_back(all.seconds.back() / lava.seconds.back());
    // The median and its standard error, 1.25 s / sqrt(n), s by the median distance from it: a run that the machine disturbed does not count.
    const double m = median(ratios);
    std::vector<double> off;
    for (double ratio : ratios) off.push_back(std::abs(ratio - m));
    difference = m - 1;
    error = 1.25 * 1.4826 * median(off) / std::sqrt(static_cast<double>(ratios.size()));
  }
  // Time is judged beside its own scatter: a difference of a hundredth and no more, as sure as two standard errors.
  EXPECT_LT(std::abs(difference) - 2 * error, 0.01);
  const double memory = median(all.anonymous) / median(lava.anonymous);
  EXPECT_NEAR(memory, 1, 0.01) << "resident memory without the pages of the program's file";
  std::printf("time %+.2f %% +- %.2f %%, resident %+.2f %%, pages of the program %+.2f MB of %.1f MB, %.0f runs each\n", 100 * difference, 100 * error, 100 * (memory - 1),
              (median(all.rss) - median(lava.rss)) / 1e6, median(lava.rss) / 1e6, static_cast<double>(all.seconds.size()));
}
#endif

}  // namespace
}  // namespace effuse
