#include "flow/scene/accuracy.h"

#include <gtest/gtest.h>

#include "geometry/base/error.h"
#include "importers/scene/scene_file.h"

namespace effuse::flow {
namespace {

std::optional<AccuracyWish> read(const std::string& text) {
  const Node node = importers::read_scene_text(text, "scene");
  Parameters root(node);
  const auto wish = read_accuracy(root);
  root.finish();
  return wish;
}

std::string fault(const std::string& text) {
  try {
    read(text);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Accuracy, IsANumberOrAName) {
  EXPECT_FALSE(read("").has_value());
  EXPECT_NEAR(read("[accuracy]\nfront = \"2 %\"\n")->front, 0.02, 1e-12);
  EXPECT_NEAR(read("accuracy.front = 0.05\n")->front, 0.05, 1e-12);
  EXPECT_EQ(read("quality = \"draft\"\n")->front, quality_fronts()[0]);
  EXPECT_EQ(read("quality = \"fine\"\n")->front, quality_fronts()[2]);
  EXPECT_FALSE(read("quality = \"none\"\n").has_value());
  EXPECT_EQ(read("quality = \"normal\"\n")->quality, "normal");
  EXPECT_EQ(read("quality = \"normal\"\n")->place.line, 1);
}

TEST(Accuracy, TellsWhatIsWrongWithItsPlaceAndTheNearestName) {
  EXPECT_NE(fault("quality = \"fin\"\n").find("fine"), std::string::npos) << fault("quality = \"fin\"\n");
  EXPECT_NE(fault("qualty = \"fine\"\n").find("quality"), std::string::npos) << fault("qualty = \"fine\"\n");
  EXPECT_NE(fault("[accuracy]\nfrnt = \"2 %\"\n").find("front"), std::string::npos);
  EXPECT_NE(fault("acuracy.front = \"2 %\"\n").find("accuracy"), std::string::npos);
  EXPECT_NE(fault("quality = \"fine\"\naccuracy.front = 0.1\n").find("one of the two"), std::string::npos);
  EXPECT_NE(fault("[accuracy]\nfront = \"0.1 %\"\n"), "") << "nobody gets there";
  EXPECT_NE(fault("[accuracy]\nfront = \"90 %\"\n"), "");
  EXPECT_NE(fault("[accuracy]\nfront = \"2 m\"\n"), "");
}

TEST(Accuracy, NamesAreFromCoarseToFine) {
  EXPECT_GT(quality_fronts()[0], quality_fronts()[1]);
  EXPECT_GT(quality_fronts()[1], quality_fronts()[2]);
  EXPECT_GT(quality_fronts()[2], least_front_error());
}

}  // namespace
}  // namespace effuse::flow
