#include "samples/study/cost/cost.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <ostream>
#include <set>

#include "samples/study/outcome.h"

namespace effuse::study {

void PrintTo(const Case& c, std::ostream* out);  // in study_test.cpp

namespace {

constexpr Real kInfinity = std::numeric_limits<Real>::infinity();

/// A scheme of this order: error = parameter^order, seconds = 1 / parameter.
std::vector<CostPoint> scheme(const std::string& name, Real order, Real cost = 1) {
  std::vector<CostPoint> points;
  for (const Real h : {0.4, 0.2, 0.1, 0.05}) points.push_back({name, std::to_string(h), h, h > 0.3 ? kInfinity : std::pow(h, order), cost / h, 0, 1, 0, 0, 0});
  return points;
}

TEST(Cost, TakesTheMedianAndTheRange) {
  Real next = 0;
  const CostPoint point = cost_of("curve", "setting", 3, [&] { return CostRun{++next, 0.1, 7, 8, 9}; }, 3, 100);
  EXPECT_EQ(point.seconds, 2);
  EXPECT_EQ(point.spread, 1);
  EXPECT_EQ(point.repeats, 3);
  EXPECT_EQ(point.steps, 7u);
  EXPECT_EQ(point.hash, 9u);
  next = 0;
  EXPECT_EQ(cost_of("", "", 0, [&] { return CostRun{++next, 0, 0, 0, 0}; }, 5, 3).repeats, 2) << "enough after 1 + 2 seconds";
  EXPECT_EQ(cost_of("", "", 0, [&] { return CostRun{50, 0, 0, 0, 0}; }, 5, 3).repeats, 1);
  EXPECT_THROW(cost_of("", "", 0, [&] { return CostRun{++next, 0, 0, 0, static_cast<std::uint64_t>(next)}; }, 2, 100), std::runtime_error) << "other bits";
}

TEST(Cost, OrdersAreFittedToTheFinestThatAreNotRounding) {
  std::vector<CostPoint> points = scheme("a", 2);
  EXPECT_NEAR(order_of(points, "a"), 2, 1e-12);
  points.push_back({"a", "", 0.025, 1e-3, 40, 0, 1, 0, 0, 0});
  EXPECT_GT(std::abs(order_of(points, "a") - 2), 0.1);
  EXPECT_NEAR(order_of(points, "a", 0.002), 2, 1e-12);
  EXPECT_TRUE(std::isnan(order_of(points, "b")));
}

TEST(Cost, TellsTheCheapestForAnError) {
  std::vector<CostPoint> points = scheme("low", 1);
  for (const CostPoint& p : scheme("high", 4, 10)) points.push_back(p);
  EXPECT_EQ(cheapest(points, 0.1).curve, "low");
  EXPECT_EQ(cheapest(points, 0.051).curve, "low");
  EXPECT_EQ(cheapest(points, 1e-5).curve, "high");
  EXPECT_EQ(cheapest(points, 1e-9).curve, "");
  EXPECT_EQ(cheapest(points, 0.1).setting, std::to_string(0.1));
  EXPECT_EQ(told(points, 1e-9), "none gets to 1e-09");
  EXPECT_NE(told(points, 1e-3).find("high takes least for 0.1 %"), std::string::npos) << told(points, 1e-3);
  EXPECT_NE(told(points, 1e-3).find("low does not get there"), std::string::npos) << told(points, 1e-3);
}

TEST(Cost, PlotsHaveACurveEachAndTheirSlopes) {
  const std::vector<CostPoint> points = scheme("a", 2);
  const Plot plot = convergence_plot("file", "title", "step [s]", "error", points, std::vector<Slope>{{"a", 2}});
  ASSERT_EQ(plot.curves.size(), 2u);
  EXPECT_EQ(plot.curves[1].name, "slope 2");
  EXPECT_TRUE(plot.curves[1].reference);
  EXPECT_NEAR(plot.curves[1].y[1] / plot.curves[1].y[0], 16, 1e-9);
  EXPECT_EQ(cost_plot("file", "title", "error", points).curves[0].x[3], 20);
}

TEST(Cost, ResultsReadBackBitForBit) {
  Outcome outcome;
  outcome.name = "case";
  outcome.version = "1";
  outcome.result.costs = scheme("a", 2);
  outcome.result.costs[1].hash = 0xfedcba9876543210;
  const Outcome again = read_outcome(outcome_json(outcome), "file");
  ASSERT_EQ(again.result.costs.size(), 4u);
  EXPECT_EQ(again.result.costs[0].error, kInfinity);
  EXPECT_EQ(again.result.costs[1].error, outcome.result.costs[1].error);
  EXPECT_EQ(again.result.costs[1].hash, outcome.result.costs[1].hash);
  const std::string csv = costs_csv({outcome});
  EXPECT_NE(csv.find("case,a,"), std::string::npos);
  EXPECT_NE(csv.find("fedcba9876543210"), std::string::npos) << csv;
  EXPECT_EQ(costs_csv({Outcome{}}), "");
}

// ---- Every short version holds its bars, measured orders among them. ----

std::vector<Case> all_cases() {
  std::vector<Case> all;
  for (const auto& cases : {integrator_cases(), lava_cases(), heat_cases(), terrain_cases(), solver_cases()}) all.insert(all.end(), cases.begin(), cases.end());
  return all;
}

TEST(AccuracyStudy, CasesHaveNamesOfTheirOwnThatFilesCanHave) {
  std::set<std::string> names;
  for (const Case& c : all_cases()) {
    EXPECT_TRUE(names.insert(c.name).second) << c.name;
    EXPECT_EQ(c.name.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_-"), std::string::npos) << c.name;
    EXPECT_TRUE(c.quick && c.run) << c.name;
  }
}

class AccuracyStudySlow : public testing::TestWithParam<Case> {};
TEST_P(AccuracyStudySlow, HoldsItsBars) {
  Outcome outcome;
  outcome.name = GetParam().name;
  outcome.result = GetParam().run();
  EXPECT_FALSE(outcome.result.measures.empty());
  EXPECT_FALSE(outcome.result.plots.empty());
  for (const Measure& m : outcome.result.measures) EXPECT_TRUE(m.passed()) << m.what << "\n" << table_text({outcome}) << outcome.result.note;
}
INSTANTIATE_TEST_SUITE_P(, AccuracyStudySlow, testing::ValuesIn(all_cases()), [](const auto& each) {
  std::string name = each.param.name;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

}  // namespace
}  // namespace effuse::study
