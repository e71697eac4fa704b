#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/samples/budget/run_program.h"

/// [accuracy] and quality as the program's users meet them.
namespace effuse::budget {
namespace {

const std::string kScene =
    "format = 1\n"
    "[film]\nframes = 4\nfps = 1\ntime_scale = 2\n"
    "[terrain.plane]\nsize = [\"80 m\", \"80 m\"]\nslope = \"8 deg\"\n"
    "[lava]\npreset = \"etna\"\nSPACING"
    "[[lava.vent]]\nat = [-20, 0]\nwidth = \"8 m\"\nrate = \"20 m3/s\"\n"
    "[output]\nformats = [\"ply\"]\n[preview]\npictures = false\n";

/// head comes before the tables; spacing a line of [lava].
std::string scene(const std::string& head, const std::string& spacing) {
  std::string text = kScene;
  return head + text.replace(text.find("SPACING"), 7, spacing);
}

TEST(ProgramBudget, CheckSaysWhatItChoosesAndWhatThatComesTo) {
  const TestFolder folder;
  const std::string file = folder.write("scene.toml", scene("quality = \"draft\"\n", "spacing = \"1.6 m\"\n"));
  const ProgramRun told = folder.effuse("check " + file);
  ASSERT_EQ(told.code, 0) << told.err;
  for (const char* part : {"front within 8 % wanted", "chosen", "lava.viscosity_tolerance", "kept", "lava.spacing = 1.6 m: the scene says so", "memory", "disk", "time", "built-in figures", "--calibrate"})
    EXPECT_NE(told.out.find(part), std::string::npos) << part << "\n" << told.out;
  const auto j = nlohmann::json::parse(folder.effuse("check --json " + file).out);
  const auto& predicted = j.at("accuracy").at("predicted");
  for (const char* figure : {"front_error", "front_m", "particles", "steps", "seconds", "processor_seconds", "memory_bytes", "disk_bytes"}) EXPECT_GT(predicted.at(figure).get<double>(), 0) << figure;
  EXPECT_EQ(j.at("accuracy").at("kept").at("lava.spacing"), "1.6 m");
  EXPECT_NEAR(j.at("accuracy").at("wanted").get<double>(), 0.08, 1e-12);
}

TEST(ProgramBudgetSlow, ARunReportsPredictionBesideOutcomeAndItsResolvedSceneIsTheSameRun) {
  const TestFolder folder;
  const std::string file = folder.write("scene.toml", scene("accuracy.front = \"5 %\"\n", "spacing = \"1.6 m\"\n"));
  const ProgramRun ran = folder.effuse(fmt::format("run {} -o {}/one", file, folder.path().string()));
  ASSERT_EQ(ran.code, 0) << ran.err;
  EXPECT_NE(ran.err.find("predicted, and come to"), std::string::npos) << ran.err;
  const auto j = nlohmann::json::parse(read_file(folder.path() / "one" / "run.json"));
  for (const auto& [figure, value] : j.at("accuracy").at("came_to").items()) {
    EXPECT_GT(value.get<double>(), 0) << figure;
    EXPECT_GT(j.at("accuracy").at("predicted").at(figure).get<double>(), 0) << figure;
  }
  // What was chosen stands in the resolved scene, which asks for nothing any more.
  const std::string resolved = read_file(folder.path() / "one" / "scene.toml");
  EXPECT_EQ(resolved.find("accuracy"), std::string::npos);
  const ProgramRun again = folder.effuse(fmt::format("run {0}/one/scene.toml -o {0}/two", folder.path().string()));
  ASSERT_EQ(again.code, 0) << again.err;
  const auto k = nlohmann::json::parse(read_file(folder.path() / "two" / "run.json"));
  EXPECT_EQ(k.at("frames").back().at("state"), j.at("frames").back().at("state"));
  EXPECT_EQ(k.at("scene_key"), j.at("scene_key"));
  EXPECT_FALSE(k.contains("accuracy"));
}

TEST(ProgramBudgetSlow, ASpacingLeftOpenIsChosen) {
  const TestFolder folder;
  // Few frames of a wide error: rehearsals of some thousand particles, and a coarse run.
  const std::string absent = folder.write("absent.toml", scene("accuracy.front = \"40 %\"\n", "")), open = folder.write("open.toml", scene("accuracy.front = \"40 %\"\n", "spacing = \"auto\"\n"));
  const auto one = nlohmann::json::parse(folder.effuse("check --json " + absent + " --set film.frames=2").out), other = nlohmann::json::parse(folder.effuse("check --json " + open + " --set film.frames=2").out);
  ASSERT_TRUE(one.contains("accuracy"));
  EXPECT_TRUE(one.at("accuracy").at("chosen").contains("lava.spacing"));
  EXPECT_EQ(one.at("accuracy").at("chosen"), other.at("accuracy").at("chosen"));
  EXPECT_EQ(one.at("accuracy").at("predicted").at("front_error"), other.at("accuracy").at("predicted").at("front_error"));
}

TEST(ProgramBudget, TellsWhatIsWrongWithTheWish) {
  const TestFolder folder;
  const auto refused = [&](const std::string& head, const std::string& spacing, const std::string& part) {
    const ProgramRun told = folder.effuse("check " + folder.write("scene.toml", scene(head, spacing)));
    EXPECT_EQ(told.code, 2) << head;
    EXPECT_NE(told.err.find(part), std::string::npos) << part << "\n" << told.err;
  };
  refused("qualty = \"draft\"\n", "spacing = 1.6\n", "quality");
  refused("accuracy.frnt = \"2 %\"\n", "spacing = 1.6\n", "front");
  refused("quality = \"drft\"\n", "", "draft");
  refused("quality = \"draft\"\naccuracy.front = 0.1\n", "", "one of the two");
  refused("quality = \"draft\"\n", "spacingg = 1\n", "spacing");
  refused("", "spacing = \"auto\"\n", "auto");
  const ProgramRun no_lava = folder.effuse("check " + folder.write("none.toml", "format = 1\nquality = \"draft\"\n[film]\nframes = 1\n[terrain.plane]\nsize = [9, 9]\n[[body]]\nball = 1\nposition = [0, 0, 2]\ndensity = 1000\n"));
  EXPECT_EQ(no_lava.code, 2);
  EXPECT_NE(no_lava.err.find("no [lava]"), std::string::npos) << no_lava.err;
}

TEST(ProgramBudget, PrintsTheCheapestOfAStudysFolderAndSaysWhereThereIsNone) {
  const TestFolder folder;
  const ProgramRun none = folder.effuse("study --cheapest -o " + folder.path().string());
  EXPECT_EQ(none.code, 2);
  EXPECT_NE(none.err.find("holds no costs"), std::string::npos) << none.err;
  folder.write("lava-costs.csv", "case,curve,setting,parameter,error,seconds,spread,repeats,steps,memory_bytes,hash,version\nlava-x,a,4 layers,0.25,0.05,2,0,1,1,1,00ff,1\n");
  const ProgramRun told = folder.effuse("study lava --cheapest -o " + folder.path().string());
  EXPECT_EQ(told.code, 0) << told.err;
  EXPECT_NE(told.out.find("| lava-x | 4 layers: 2 s | - | - | - |"), std::string::npos) << told.out;
}

}  // namespace
}  // namespace effuse::budget
