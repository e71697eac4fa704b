#include "geometry/procedural/l_system.h"

#include <gtest/gtest.h>

#include "geometry/base/error.h"
#include "geometry/procedural/formula.h"

namespace effuse::geometry {
namespace {

std::string after(const LSystem& system, int generations, std::uint64_t seed = 1) { return to_string(derive(system, generations, seed)); }

TEST(LSystem, AlgaeGrowAsFibonaccisNumbers) {
  const LSystem algae{"A", {{"A", "", "AB"}, {"B", "", "A"}}, {}};
  EXPECT_EQ(after(algae, 0), "A");
  EXPECT_EQ(after(algae, 1), "AB");
  EXPECT_EQ(after(algae, 4), "ABAABABA");
  EXPECT_EQ(after(algae, 5), "ABAABABAABAAB");
  EXPECT_EQ(after(algae, 20).size(), 17711u);
}

TEST(LSystem, TheDragonAndThePlantAreTheirs) {
  const LSystem dragon{"FX", {{"X", "", "X+YF+"}, {"Y", "", "-FX-Y"}}, {}};
  EXPECT_EQ(after(dragon, 1), "FX+YF+");
  EXPECT_EQ(after(dragon, 2), "FX+YF++-FX-YF+");
  const LSystem plant{"X", {{"X", "", "F+[[X]-X]-F[-FX]+X"}, {"F", "", "FF"}}, {}};
  EXPECT_EQ(after(plant, 1), "F+[[X]-X]-F[-FX]+X");
  EXPECT_EQ(after(plant, 2), "FF+[[F+[[X]-X]-F[-FX]+X]-F+[[X]-X]-F[-FX]+X]-FF[-FFF+[[X]-X]-F[-FX]+X]+F+[[X]-X]-F[-FX]+X");
}

TEST(LSystem, ParametersFollowTheirFormulasAndConditions) {
  // Chapter 1.10's example of the book: B(x) with conditions on both values.
  const LSystem system{"B(2)A(4,4)",
                       {{"A(x,y)", "y <= 3", "A(x*2,x+y)"}, {"A(x,y)", "y > 3", "B(x)A(x/y,0)"}, {"B(x)", "x < 1", "C"}, {"B(x)", "x >= 1", "B(x-1)"}},
                       {}};
  EXPECT_EQ(after(system, 1), "B(1)B(4)A(1,0)");
  EXPECT_EQ(after(system, 2), "B(0)B(3)A(2,1)");
  EXPECT_EQ(after(system, 3), "CB(2)A(4,3)");
  EXPECT_EQ(after(system, 4), "CB(1)A(8,7)");
  EXPECT_EQ(after({"F(l0)", {{"F(l)", "", "F(l*r)[+(a)F(l*r^2)]"}}, {{"l0", 8}, {"r", 0.5}, {"a", 30}}}, 1), "F(4)[+(30)F(2)]");
}

TEST(LSystem, ChancesFollowTheirWeightsAndTheSeed) {
  const LSystem system{"X", {{"X", "", "XX"}}, {}};
  const LSystem coin{to_string(derive(system, 13, 1)), {{"X", "", "H", 3}, {"X", "", "T", 1}}, {}};
  const std::string one = after(coin, 1, 5);
  EXPECT_EQ(one, after(coin, 1, 5));
  EXPECT_NE(one, after(coin, 1, 6));
  const auto heads = static_cast<double>(std::count(one.begin(), one.end(), 'H'));
  EXPECT_NEAR(heads / 8192, 0.75, 4 * std::sqrt(0.75 * 0.25 / 8192));
}

TEST(LSystem, SaysWhatCannotBeRead) {
  const auto said = [](const LSystem& system, int generations = 1) {
    try {
      derive(system, generations, 1, 1000);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(said({"F[+F", {}, {}}).find("'[' without its ']'"), std::string::npos);
  EXPECT_NE(said({"F]", {}, {}}).find("']' without its '['"), std::string::npos);
  EXPECT_NE(said({"F(1", {}, {}}).find("never closed"), std::string::npos);
  EXPECT_NE(said({"F", {{"AB", "", "F"}}, {}}).find("one letter"), std::string::npos);
  EXPECT_NE(said({"F(1)", {{"F(length)", "lenght > 1", "F"}}, {}}).find("did you mean length?"), std::string::npos);
  EXPECT_NE(said({"F(1)", {{"F(l)", "", "F(l/0)"}}, {}}).find("not finite"), std::string::npos);
  EXPECT_NE(said({"F", {{"F", "", "FF"}}, {}}, 20).find("more than 1000 letters in generation 10"), std::string::npos);
  EXPECT_NE(said({"F", {{"F", "", "F", -1}}, {}}).find("weight of -1"), std::string::npos);
}

TEST(Formula, BindsAsUsual) {
  const std::vector<std::string> names = {"x", "y2"};
  const std::vector<Real> values = {3, 10};
  const auto value = [&](const char* text) { return Formula(text, names).evaluate(values); };
  EXPECT_EQ(value("1 + 2 * x"), 7);
  EXPECT_EQ(value("(1 + 2) * x"), 9);
  EXPECT_EQ(value("2 ^ 3 ^ 2"), 512);
  EXPECT_EQ(value("-x ^ 2"), -9);
  EXPECT_EQ(value("2 ^ -1"), 0.5);
  EXPECT_EQ(value("10 - 4 - 3"), 3);
  EXPECT_EQ(value("y2 / 2 / 5"), 1);
  EXPECT_EQ(value("x < 4 && y2 >= 10"), 1);
  EXPECT_EQ(value("x == 4 || !(y2 != 10)"), 1);
  EXPECT_EQ(value("1.5e2"), 150);
  for (const char* bad : {"", "1 +", "(1", "x y2", "1 2", "z", "* 2", "1 = 2"}) EXPECT_THROW(value(bad), InputError) << bad;
  EXPECT_THROW(Formula(std::string(100000, '('), names), InputError);
}

}  // namespace
}  // namespace effuse::geometry
