#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>

#include "tests/samples/stability/hard_case.h"

namespace effuse::stability {
namespace {

std::vector<HardCase> all_cases() {
  std::vector<HardCase> all;
  for (const auto& cases : {lava_cases(), ground_cases(), solver_cases()}) all.insert(all.end(), cases.begin(), cases.end());
  return all;
}

class StabilitySlow : public testing::TestWithParam<HardCase> {};

TEST_P(StabilitySlow, HoldsItsBounds) { EXPECT_EQ(GetParam().run(true), ""); }

INSTANTIATE_TEST_SUITE_P(, StabilitySlow, testing::ValuesIn(all_cases()), [](const auto& each) {
  std::string name = each.param.name;
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  return name;
});

// The set can tell: without its guard most of it breaks.
TEST(StabilityGuardsSlow, TwoThirdsOfTheCasesBreakWithoutTheirGuard) {
  std::size_t cases = 0, broken = 0;
  std::string held;
  for (const HardCase& c : all_cases()) {
    ++cases;
    const std::string why = c.guard.empty() ? "" : c.run(false);
    if (!why.empty()) ++broken;
    else held += "\n  " + c.name + (c.guard.empty() ? " (no guard of its own)" : " without " + c.guard);
    std::printf("%-28s without %-28s %s\n", c.name.c_str(), c.guard.empty() ? "-" : c.guard.c_str(), why.empty() ? "held" : why.c_str());
  }
  EXPECT_GE(3 * broken, 2 * cases) << broken << " of " << cases << " broke; these held:" << held;
}

}  // namespace
}  // namespace effuse::stability
