#include "flow/scene/parameters.h"

#include <gtest/gtest.h>

#include <cmath>

namespace effuse::flow {
namespace {

// Trees written by hand: parameters know nothing of TOML. Each value gets the next line.
class Scene {
 public:
  Scene() { root.place = {"test.toml"}; }
  Node root;
  Scene& add(Node& table, const std::string& key, Node node) {
    node.place = {"test.toml", ++line_, 8};
    for (Node& item : node.items) item.place = node.place;
    table.entries.emplace_back(key, std::move(node));
    table.key_places.push_back({"test.toml", line_, 1});
    return *this;
  }
  Scene& add(const std::string& key, Node node) { return add(root, key, std::move(node)); }

 private:
  int line_ = 0;
};

Node text(std::string value) {
  Node node;
  node.kind = Node::Kind::kText;
  node.text = std::move(value);
  return node;
}
Node real(double value) {
  Node node;
  node.kind = Node::Kind::kReal;
  node.real = value;
  return node;
}
Node integer(std::int64_t value) {
  Node node;
  node.kind = Node::Kind::kInteger;
  node.integer = value;
  return node;
}
Node flag(bool value) {
  Node node;
  node.kind = Node::Kind::kFlag;
  node.flag = value;
  return node;
}
Node array(std::vector<Node> items) {
  Node node;
  node.kind = Node::Kind::kArray;
  node.items = std::move(items);
  return node;
}
Node table(std::vector<std::pair<std::string, Node>> entries = {}) {
  Node node;
  for (auto& [key, value] : entries) node.set(key, value);
  return node;
}

std::string words(const Parameters& parameters) {
  std::string all;
  for (const Fault& fault : parameters.faults()) all += to_string(fault) + "\n";
  return all;
}

std::string finish_words(Parameters& parameters) {
  try {
    parameters.finish();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST(Parameters, NumbersAreReadInSiWithOrWithoutTheirUnit) {
  Scene scene;
  scene.add("rate", text("30 m3/s")).add("bare", integer(30)).add("hot", text("1150 degC")).add("share", text("2 %"));
  Parameters p(scene.root);
  EXPECT_DOUBLE_EQ(p.number("rate", "m3/s", std::nullopt, Parameters::positive(), "flow rate"), 30);
  EXPECT_DOUBLE_EQ(p.number("bare", "m3/s", std::nullopt, Parameters::positive(), "flow rate"), 30);
  EXPECT_DOUBLE_EQ(p.number("hot", "K", std::nullopt, Parameters::positive(), "temperature"), 1150 + kZeroCelsius);
  EXPECT_DOUBLE_EQ(p.number("share", "", 0, {0, 1}, "share"), 0.02);
  EXPECT_DOUBLE_EQ(p.number("absent", "m", 2.5, {}, "length"), 2.5);
  EXPECT_NO_THROW(p.finish());
}

TEST(Parameters, AWrongDimensionIsAFaultAtTheValueThatNamesTheKey) {
  Scene scene;
  scene.add("rate", text("30 m3"));
  Parameters p(scene.root);
  EXPECT_EQ(p.number("rate", "m3/s", 7, {}, "flow rate"), 7) << "after a fault the default";
  ASSERT_EQ(p.faults().size(), 1u);
  EXPECT_EQ(p.faults()[0].place.line, 1);
  EXPECT_EQ(p.faults()[0].place.column, 8);
  EXPECT_TRUE(contains(words(p), "rate")) << words(p);
  EXPECT_TRUE(contains(words(p), "m3/s")) << words(p);
}

TEST(Parameters, EveryKindOfWrongValueIsOneFault) {
  Scene scene;
  scene
      .add("a", flag(true))                     // not a number
      .add("b", real(-1))                       // below the range
      .add("c", real(0))                        // the open end itself
      .add("d", real(std::nan("")))             // not finite
      .add("e", real(INFINITY))                 // not finite
      .add("f", text("fast"))                   // no number at all
      .add("g", real(2.5))                      // not whole
      .add("h", integer(11))                    // out of range
      .add("i", text("yes"))                    // not a flag
      .add("j", integer(3))                     // not text
      .add("k", text("modren"))                 // no such choice
      .add("l", array({text("x"), text("x")}))  // twice
      .add("m", array({real(1), real(2)}))      // two for three
      .add("n", real(5));                       // a number for a table
  Parameters p(scene.root);
  p.number("a", "m", 1, {}, "");
  p.number("b", "m", 1, Parameters::not_negative(), "");
  p.number("c", "m", 1, Parameters::positive(), "");
  p.number("d", "m", 1, {}, "");
  p.number("e", "m", 1, {}, "");
  p.number("f", "m", 1, {}, "");
  p.integer("g", 1, 0, 10, "");
  p.integer("h", 1, 0, 10, "");
  p.flag("i", false, "");
  p.text("j", "", "");
  p.choice("k", {"classic", "modern"}, 0, "");
  p.choices("l", {"x", "y"}, {}, "");
  p.numbers("m", "m", 3, true, "");
  p.table("n", "");
  ASSERT_EQ(p.faults().size(), 14u) << words(p);
  for (int i = 0; i < 14; ++i) EXPECT_EQ(p.faults()[static_cast<std::size_t>(i)].place.line, i + 1) << words(p);
  EXPECT_TRUE(contains(words(p), "did you mean 'modern'?")) << words(p);
}

TEST(Parameters, ARequiredValueThatIsMissingIsAFaultAtItsTable) {
  Scene scene;
  scene.add("lava", table());
  Parameters p(scene.root);
  Parameters lava = p.table("lava", "the lava");
  EXPECT_EQ(lava.number("rate", "m3/s", std::nullopt, {}, "how much flows"), 0);
  EXPECT_EQ(lava.numbers("at", "m", 2, true, "where").size(), 2u) << "as many zeros as asked for";
  ASSERT_EQ(p.faults().size(), 2u);
  EXPECT_EQ(p.faults()[0].place.line, 1);
  EXPECT_TRUE(contains(words(p), "lava.rate: is missing (how much flows)")) << words(p);
}

TEST(Parameters, AnUnreadKeyIsAFaultAtTheKeyWithTheNearestName) {
  Scene scene;
  scene.add("viscocity", real(3)).add("rate", real(1)).add("zzzzzz", real(1));
  Parameters p(scene.root);
  p.number("viscosity", "Pa s", 3, {}, "");
  p.table("vent", "").number("rate", "m3/s", 1, {}, "");
  const std::string told = finish_words(p);
  EXPECT_TRUE(contains(told, "test.toml:1:1: viscocity: unknown key; did you mean 'viscosity'?")) << told;
  EXPECT_TRUE(contains(told, "there is 'vent.rate'")) << "the right name in the wrong table: " << told;
  EXPECT_TRUE(contains(told, "known here: viscosity, vent")) << told;
}

TEST(Parameters, FinishTellsAllFaultsInTheOrderOfTheFile) {
  Scene scene;
  scene.add("typo", real(1)).add("a", real(-1)).add("b", text("?"));
  Parameters p(scene.root);
  p.number("b", "m", 1, {}, "");
  p.number("a", "m", 1, Parameters::positive(), "");
  p.fault("", "and something that has no line");
  try {
    p.finish();
    FAIL() << "no error";
  } catch (const InputError& error) {
    ASSERT_EQ(error.faults().size(), 4u) << error.what();
    EXPECT_EQ(error.faults()[0].place.line, 1);
    EXPECT_EQ(error.faults()[1].place.line, 2);
    EXPECT_EQ(error.faults()[2].place.line, 3);
    EXPECT_EQ(error.faults()[3].place.line, 0);
  }
}

TEST(Parameters, TablesInArraysHaveTheirIndexInEveryMessage) {
  Scene scene;
  scene.add("lava", table({{"vents", array({table({{"rate", real(1)}}), table({{"rate", real(-1)}, {"rade", real(1)}})})}}));
  Parameters p(scene.root);
  std::vector<Parameters> vents = p.table("lava", "").tables("vents", "");
  ASSERT_EQ(vents.size(), 2u);
  for (Parameters& vent : vents) vent.number("rate", "m3/s", std::nullopt, Parameters::positive(), "");
  const std::string told = finish_words(p);
  EXPECT_TRUE(contains(told, "lava.vents[1].rate: -1 is out of range, must be > 0 m3/s")) << told;
  EXPECT_TRUE(contains(told, "lava.vents[1].rade: unknown key; did you mean 'rate'?")) << told;
  EXPECT_FALSE(contains(told, "vents[0]")) << told;
}

TEST(Parameters, TheSameTableReadTwiceCountsTheKeysOfBothReaders) {
  Scene scene;
  scene.add("air", table({{"wind", real(1)}, {"temperature", real(290)}}));
  Parameters p(scene.root);
  p.table("air", "").number("wind", "m/s", 0, {}, "");
  p.table("air", "").number("temperature", "K", 288, {}, "");
  EXPECT_EQ(finish_words(p), "");
}

TEST(Parameters, ResolvedHoldsWhatWasReadWithDefaultsAndUnitsInTheOrderOfReading) {
  Scene scene;
  scene.add("rate", integer(30)).add("mode", text("modern")).add("at", array({real(1), text("2 km")}));
  Parameters p(scene.root);
  p.choice("mode", {"classic", "modern"}, 0, "");
  p.number("rate", "m3/s", std::nullopt, {}, "");
  p.number("share", "", 0.5, {}, "");
  p.numbers("at", "m", 2, true, "");
  p.table("air", "").number("temperature", "K", 288.15, {}, "");
  p.table("nothing", "");
  const Node resolved = p.resolved();
  ASSERT_EQ(resolved.entries.size(), 5u) << "an absent table with nothing in it stays absent";
  EXPECT_EQ(resolved.entries[0].first, "mode");
  EXPECT_EQ(resolved.find("mode")->text, "modern");
  EXPECT_EQ(resolved.find("rate")->text, "30 m3/s");
  EXPECT_EQ(resolved.find("share")->real, 0.5);
  EXPECT_EQ(resolved.find("at")->items[1].text, "2000 m");
  EXPECT_EQ(resolved.find("air")->find("temperature")->text, "288.15 K");
}

TEST(Parameters, AResolvedSceneReadsBackToTheSameValuesBitForBit) {
  Scene scene;
  scene.add("hot", text("1149.7 degC")).add("tilt", text("12.3 deg")).add("third", real(1.0 / 3));
  const auto read = [](const Node& root) {
    Parameters p(root);
    std::vector<Real> values = {p.number("hot", "K", std::nullopt, {}, ""), p.number("tilt", "rad", std::nullopt, {}, ""),
                                p.number("third", "m", std::nullopt, {}, "")};
    p.finish();
    return std::pair(values, p.resolved());
  };
  const auto [first, resolved] = read(scene.root);
  const auto [second, again] = read(resolved);
  EXPECT_EQ(first, second);
  EXPECT_EQ(resolved.find("tilt")->text, again.find("tilt")->text);
}

TEST(Parameters, DocsTellPathUnitDefaultAndMeaningOnceForEveryTableOfAnArray) {
  Scene scene;
  scene.add("vents", array({table(), table()}));
  Parameters p(scene.root);
  for (Parameters& vent : p.tables("vents", "where lava comes out")) {
    vent.number("rate", "m3/s", 30, {}, "flow rate");
    vent.text("name", std::nullopt, "for messages");
    vent.choice("kind", {"disc", "fissure"}, 1, "its shape");
  }
  const std::vector<ParameterDoc> docs = p.docs();
  ASSERT_EQ(docs.size(), 4u);
  EXPECT_EQ(docs[0].path, "vents[]");
  EXPECT_EQ(docs[1].path, "vents[].rate");
  EXPECT_EQ(docs[1].unit, "m3/s");
  EXPECT_EQ(docs[1].default_value, "30 m3/s");
  EXPECT_EQ(docs[1].what, "flow rate");
  EXPECT_EQ(docs[2].default_value, "") << "required";
  EXPECT_EQ(docs[3].unit, "choice: disc | fissure");
  EXPECT_EQ(docs[3].default_value, "fissure");
}

TEST(Parameters, NumberListsKeepTheirOrderAndTellTheWrongItem) {
  Scene scene;
  scene.add("path", array({array({real(1), real(2)}), array({text("3 km"), real(4)})})).add("bad", array({array({real(1)}), real(2)}));
  Parameters p(scene.root);
  const auto path = p.number_lists("path", "m", 2, true, "");
  ASSERT_EQ(path.size(), 2u);
  EXPECT_EQ(path[1], (std::vector<Real>{3000, 4}));
  EXPECT_TRUE(p.number_lists("bad", "m", 2, true, "").empty());
  EXPECT_EQ(p.faults().size(), 2u) << words(p);
  EXPECT_TRUE(contains(words(p), "bad[0]")) << words(p);
}

TEST(Parameters, ARootThatIsNoTableIsAFaultNotACrash) {
  const Node root = real(1);
  Parameters p(root);
  EXPECT_EQ(p.number("a", "m", 3, {}, ""), 3);
  EXPECT_FALSE(p.has("a"));
  EXPECT_THROW(p.finish(), InputError);
}

}  // namespace
}  // namespace effuse::flow
