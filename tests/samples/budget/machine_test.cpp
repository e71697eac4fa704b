#include "samples/budget/machine.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>

#include "geometry/base/error.h"
#include "geometry/base/files.h"

namespace effuse::budget {
namespace {

namespace fs = std::filesystem;

/// A cache folder of the test's own.
class MachineFile : public testing::Test {
 protected:
  MachineFile() : folder_(fs::temp_directory_path() / fmt::format("effuse.machine.{}", ::getpid())) {
    if (const char* old = std::getenv("XDG_CACHE_HOME")) old_ = old;
    fs::remove_all(folder_);
    ::setenv("XDG_CACHE_HOME", folder_.c_str(), 1);
  }
  ~MachineFile() override {
    if (old_.empty()) ::unsetenv("XDG_CACHE_HOME");
    else ::setenv("XDG_CACHE_HOME", old_.c_str(), 1);
    fs::remove_all(folder_);
  }
  fs::path folder_;
  std::string old_;
};

Machine mine() {
  Machine machine;
  machine.name = name_of_this_machine();
  machine.when = "2026-01-02 03:04 UTC";
  machine.particle_step = 1.25e-6;
  return machine;
}

TEST(Machine, FiguresReadBackBitForBit) {
  Machine machine = mine();
  machine.pair_step = 1.0 / 3e8;
  machine.threads = 7;
  const Machine again = read_machine(machine_json(machine), "file");
  EXPECT_EQ(machine_json(again), machine_json(machine));
  EXPECT_EQ(again.pair_step, machine.pair_step);
  EXPECT_EQ(again.threads, 7);
}

TEST(Machine, RefusesWhatIsNoMachine) {
  const std::string sound = machine_json(mine());
  EXPECT_NO_THROW(read_machine(sound, "file"));
  for (const std::string& bad : {std::string(), std::string("{"), std::string("[]"), std::string("{\"effuse_machine\": 1}"), sound.substr(0, sound.size() / 2)})
    EXPECT_THROW(read_machine(bad, "file"), InputError) << bad;
  const auto with = [&](const std::string& old, const std::string& now) {
    std::string text = sound;
    return text.replace(text.find(old), old.size(), now);
  };
  EXPECT_THROW(read_machine(with("\"effuse_machine\": 1", "\"effuse_machine\": 2"), "file"), InputError);
  EXPECT_THROW(read_machine(with("\"threads\": 2", "\"threads\": 0"), "file"), InputError);
  EXPECT_THROW(read_machine(with("1.25e-06", "-1"), "file"), InputError);
  EXPECT_THROW(read_machine(with("1.25e-06", "\"fast\""), "file"), InputError);
}

TEST_F(MachineFile, WithoutOneTheUsualFiguresAreTaken) {
  std::string why;
  EXPECT_FALSE(known_machine(why).measured());
  EXPECT_NE(why.find("--calibrate"), std::string::npos) << why;
}

TEST_F(MachineFile, IsKeptAndFoundAgain) {
  keep(mine());
  EXPECT_EQ(machine_file(), folder_ / "effuse" / "machine.json");
  std::string why;
  const Machine machine = known_machine(why);
  EXPECT_TRUE(machine.measured());
  EXPECT_EQ(machine.particle_step, 1.25e-6);
  EXPECT_NE(why.find("2026-01-02"), std::string::npos) << why;
  std::size_t files = 0;
  for (const auto& file : fs::recursive_directory_iterator(folder_)) files += file.is_regular_file();
  EXPECT_EQ(files, 1u) << "nothing left beside it";
}

TEST_F(MachineFile, OfAnotherMachineOrBrokenItIsToldAndNotTaken) {
  Machine other = mine();
  other.name = "elsewhere, another processor, 2 threads";
  keep(other);
  std::string why;
  EXPECT_FALSE(known_machine(why).measured());
  EXPECT_NE(why.find("elsewhere"), std::string::npos) << why;
  write_file(machine_file(), "{ not json");
  EXPECT_FALSE(known_machine(why).measured());
  EXPECT_NE(why.find("machine.json"), std::string::npos) << why;
}

TEST_F(MachineFile, ThatCannotBeWrittenIsSaidInOneSentence) {
  write_file(folder_, "a file where the folder should be");
  EXPECT_THROW(keep(mine()), InputError);
  ::setenv("XDG_CACHE_HOME", "relative", 1);  // counts as none
  const char* home = std::getenv("HOME");
  const std::string old = home ? home : "";
  ::unsetenv("HOME");
  EXPECT_TRUE(machine_file().empty());
  EXPECT_THROW(keep(mine()), InputError);
  if (home) ::setenv("HOME", old.c_str(), 1);
}

TEST(Machine, ThreadsShareWhatIsParallel) {
  Machine machine = mine();
  machine.threads = 2;
  machine.speedup = 1.6;  // 1 / (1 - s + s / 2): s = 0.75
  EXPECT_NEAR(machine.on_threads(16, 1), 16, 1e-12);
  EXPECT_NEAR(machine.on_threads(16, 2), 10, 1e-12);
  EXPECT_NEAR(machine.on_threads(16, 4), 16 * (0.25 + 0.75 / 4), 1e-12);
  machine.speedup = 1;
  EXPECT_NEAR(machine.on_threads(16, 8), 16, 1e-12);
}

TEST(Machine, SecondsAreSumsOfWhatWasDone) {
  const Machine machine = mine();
  const Counts nothing;
  EXPECT_EQ(machine.seconds(nothing, false), 0);
  Counts twice{2, 200, 6000, 2000, 60000, 400, 12000};
  const Counts once = Counts::each(twice, nothing, [](Real a, Real) { return a / 2; });
  EXPECT_NEAR(machine.seconds(twice, false), 2 * machine.seconds(once, false), 1e-15);
  twice.pressure_pairs *= 10;
  EXPECT_GT(machine.seconds(twice, false), 2 * machine.seconds(once, false));
  EXPECT_NEAR(machine.seconds(twice, true), 2 * machine.seconds(once, true), 1e-15) << "the classic lava solves nothing";
}

}  // namespace
}  // namespace effuse::budget
