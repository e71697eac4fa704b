#include "flow/bodies/islands.h"

#include <gtest/gtest.h>

namespace effuse::flow::bodies {
namespace {

TEST(Islands, AreJoinedByContactsAndJointsOfBodiesThatMoveOnly) {
  constexpr Index kGround = ~Index{0};
  // Body 3 stands: it links nobody.
  const std::vector<unsigned char> moving{1, 1, 1, 0, 1, 1, 1};
  const std::vector<Link> contacts{{0, 3}, {3, 4}, {5, 2}, {6, kGround}, {3, kGround}};
  const std::vector<std::pair<JointId, Link>> joints{{7, {1, 5}}, {9, {3, 6}}};
  const std::vector<Island> islands = make_islands(moving, contacts, joints);
  ASSERT_EQ(islands.size(), 4u);
  EXPECT_EQ(islands[0].bodies, (std::vector<Index>{0}));
  EXPECT_EQ(islands[0].points, (std::vector<Index>{0}));
  EXPECT_EQ(islands[1].bodies, (std::vector<Index>{1, 2, 5}));
  EXPECT_EQ(islands[1].points, (std::vector<Index>{2}));
  EXPECT_EQ(islands[1].joints, (std::vector<JointId>{7}));
  EXPECT_EQ(islands[2].bodies, (std::vector<Index>{4}));
  EXPECT_EQ(islands[2].points, (std::vector<Index>{1}));
  EXPECT_EQ(islands[3].bodies, (std::vector<Index>{6}));
  EXPECT_EQ(islands[3].points, (std::vector<Index>{3}));
  EXPECT_EQ(islands[3].joints, (std::vector<JointId>{9}));
}

TEST(Islands, AChainOfContactsIsOneHoweverItIsListed) {
  const std::vector<unsigned char> moving(100, 1);
  std::vector<Link> contacts;
  for (Index k = 0; k < 99; ++k) contacts.push_back({(37 * k) % 99, (37 * k) % 99 + 1});
  const std::vector<Island> islands = make_islands(moving, contacts, {});
  ASSERT_EQ(islands.size(), 1u);
  EXPECT_EQ(islands[0].bodies.size(), 100u);
  EXPECT_EQ(islands[0].points.size(), 99u);
  EXPECT_TRUE(make_islands({}, {}, {}).empty());
}

}  // namespace
}  // namespace effuse::flow::bodies
