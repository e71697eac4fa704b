#include <gtest/gtest.h>

#include "flow/effects/lava_vents.h"
#include "flow/scene/parameters.h"
#include "geometry/base/error.h"
#include "importers/scene/scene_file.h"

/// Numbers of a scene that change by keys.
namespace effuse::flow {
namespace {

struct Read {
  geometry::Curve<Real> curve;
  std::string faults, resolved;
};

Read read(const std::string& text) {
  const Node node = importers::read_scene_text(text, "test.toml");
  Parameters root(node);
  Read r{root.curve("rate", "m3/s", std::nullopt, Parameters::not_negative(), "volume"), "", ""};
  try {
    root.finish();
  } catch (const InputError& error) {
    r.faults = error.what();
  }
  r.resolved = importers::to_toml(root.resolved());
  return r;
}

TEST(CurveParameter, OneNumberIsACurveThatHolds) {
  const Read r = read("rate = \"3 m3/s\"");
  EXPECT_EQ(r.faults, "");
  EXPECT_EQ(r.curve.at(-5), 3);
  EXPECT_EQ(r.curve.keys().size(), 1u);
}

TEST(CurveParameter, KeysHaveUnitsAndTheirOwnWayOrTheTables) {
  const Read r = read("rate = [[\"0 s\", \"1 m3/s\"], [\"1 min\", \"3 m3/s\", \"hold\"], [70, 5, \"bezier\", 0, -2], [80, 0]]\nmotion = \"smooth\"");
  ASSERT_EQ(r.faults, "");
  // Leaves at 1/30, arrives at the three times of that it may: 2 + 60 s (1/30 - 1/10) / 8.
  EXPECT_NEAR(r.curve.at(30), 1.5, 1e-12);
  EXPECT_EQ(r.curve.at(69), 3);
  EXPECT_NEAR(r.curve.slope(70), 0, 1e-12);
  EXPECT_NEAR(r.curve.slope(80 - 1e-9), -2, 1e-6);
  // What was read is read again from the resolved scene, bit for bit.
  const Read again = read(r.resolved);
  ASSERT_EQ(again.faults, "") << r.resolved;
  for (Real t = -1; t < 90; t += 0.37) EXPECT_EQ(again.curve.at(t), r.curve.at(t)) << t;
}

TEST(CurveParameter, SaysWhatIsWrongAndWhere) {
  const auto tells = [](const std::string& text, const char* part) {
    const std::string faults = read(text).faults;
    EXPECT_NE(faults.find(part), std::string::npos) << text << "\n" << faults;
  };
  tells("rate = []", "empty array");
  tells("rate = [1, 2]", "rate[0]: found 1, wanted keys");
  tells("rate = [[0]]", "an array of 1");
  tells("rate = [[0, 1], [0, 2]]", "does not come after");
  tells("rate = [[0, 1], [\"2 m\", 2]]", "wanted a time");
  tells("rate = [[0, -1]]", "out of range");
  tells("rate = [[0, 1, \"smoth\"], [1, 2]]", "did you mean 'smooth'");
  tells("rate = [[0, 1, \"linear\", 3], [1, 2]]", "found 4 entries");
  tells("rate = [[0, 1, \"bezier\"], [1, 2]]", "slope leaving, slope arriving");
  tells("rate = [[0, 1, \"bezier\", -9, 0], [1, 2]]", "between its keys");
  tells("rate = [[0, 4], [1, 0], [2, 0], [3, 4]]\nmotion = \"catmull_rom\"", "\"smooth\" stays between them");
  tells("rate = [[0, 1], [1, 2]]\nmotion = \"bezir\"", "no such choice");
  tells("rate = 3\nmotion = \"smooth\"", "motion");
}

TEST(CurveParameter, AVentLetsOutTheAreaUnderItsRate) {
  const Node node = importers::read_scene_text("[[vent]]\nat = [0, 0]\nwidth = 1\nrate = [[0, 0], [10, 5], [20, 5, \"hold\"], [30, 0]]\nstart = 2\nstop = 25\n", "test.toml");
  Parameters root(node);
  const std::vector<PlannedVent> vents = read_vents(root, 1400);
  root.finish();
  EXPECT_EQ(vents[0].vent.rate, 5);
  EXPECT_EQ(vents[0].vent.volume(2), 0);
  EXPECT_NEAR(vents[0].vent.volume(10), 25 - 1, 1e-12);
  EXPECT_NEAR(vents[0].vent.volume(99), 24 + 75, 1e-12);
  const Node ramped = importers::read_scene_text("[[vent]]\nat = [0, 0]\nwidth = 1\nrate = [[0, 0], [10, 5]]\nramp = 2\n", "test.toml");
  Parameters bad(ramped);
  read_vents(bad, 1400);
  EXPECT_THROW(bad.finish(), InputError);
}

}  // namespace
}  // namespace effuse::flow
