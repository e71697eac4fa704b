#include "samples/study/cost/cheapest_table.h"

#include <gtest/gtest.h>

#include <limits>

#include "geometry/base/error.h"
#include "samples/study/outcome.h"

namespace effuse::study {
namespace {

CostPoint point(const std::string& curve, const std::string& setting, double error, double seconds, std::uint64_t hash) {
  CostPoint p;
  p.curve = curve;
  p.setting = setting;
  p.error = error;
  p.seconds = seconds;
  p.hash = hash;
  return p;
}

/// As a study writes it: schemes that compete, one of which blew up, and two errors of the same runs.
std::string csv() {
  Outcome schemes, film;
  schemes.name = "oscillator";
  schemes.result.costs = {point("euler", "dt = 1", std::numeric_limits<double>::infinity(), 1e-5, 1), point("euler", "dt = 0.1", 0.05, 1e-4, 2), point("rk4", "dt = 1, \"long\"", 0.02, 5e-4, 3),
                          point("rk4", "dt = 0.1", 1e-6, 5e-3, 0xfedcba9876543210)};
  film.name = "film";
  film.result.costs = {point("profile", "4 layers", 0.05, 2, 5), point("profile", "8 layers", 0.008, 20, 6), point("flux", "4 layers", 0.009, 2, 5), point("flux", "8 layers", 0.001, 20, 6)};
  return costs_csv({schemes, film});
}

TEST(CheapestTable, ReadsWhatTheStudyWrote) {
  const std::vector<CaseCosts> cases = read_costs(csv(), "file");
  ASSERT_EQ(cases.size(), 2u);
  ASSERT_EQ(cases[0].points.size(), 4u);
  EXPECT_EQ(cases[0].points[2].setting, "dt = 1, \"long\"");
  EXPECT_EQ(cases[0].points[3].hash, 0xfedcba9876543210);
  EXPECT_EQ(cases[0].points[0].error, std::numeric_limits<double>::infinity());
}

TEST(CheapestTable, NamesTheCheapestThatIsGoodEnough) {
  const std::vector<double> errors = {0.1, 0.01, 1e-4, 1e-9};
  EXPECT_EQ(cheapest_table(read_costs(csv(), "file"), errors),
            "| case | 10 % | 1 % | 0.01 % | 1e-09 |\n|---|---|---|---|---|\n"
            "| oscillator | euler, dt = 0.1: 100 us | rk4, dt = 0.1: 5 ms | rk4, dt = 0.1: 5 ms | - |\n"
            "| film, profile | 4 layers: 2 s | 8 layers: 20 s | - | - |\n"
            "| film, flux | 4 layers: 2 s | 4 layers: 2 s | - | - |\n");
}

TEST(CheapestTable, RefusesWhatIsNoStudysCosts) {
  const std::string sound = csv();
  EXPECT_THROW(read_costs("", "file"), InputError);
  EXPECT_THROW(read_costs("a,b,c\n1,2,3\n", "file"), InputError);
  EXPECT_THROW(read_costs(sound.substr(0, sound.find('\n') + 1) + "case,curve\n", "file"), InputError);
  std::string bad = sound;
  bad.replace(bad.find("0.05"), 4, "five");
  try {
    read_costs(bad, "file");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_EQ(error.faults().front().place.line, 3);
    EXPECT_NE(std::string(error.what()).find("five"), std::string::npos);
  }
}

}  // namespace
}  // namespace effuse::study
