#include "geometry/collide/broad_phase.h"

#include <gtest/gtest.h>

#include "geometry/base/random.h"

namespace effuse::geometry {
namespace {

Box3 random_box(std::uint64_t seed, std::uint64_t k) {
  const Vec3 low(10 * random_uniform(seed, 0, k), 10 * random_uniform(seed, 1, k), 10 * random_uniform(seed, 2, k));
  return Box3(low, low + Vec3(random_uniform(seed, 3, k), random_uniform(seed, 4, k), 2 * random_uniform(seed, 5, k)));
}

using Pairs = std::vector<std::array<Index, 2>>;

Pairs by_brute_force(const std::vector<Box3>& boxes, const std::vector<unsigned char>& active = {}) {
  Pairs out;
  for (Index i = 0; i < boxes.size(); ++i)
    for (Index j = i + 1; j < boxes.size(); ++j)
      if (!boxes[i].isEmpty() && !boxes[j].isEmpty() && boxes[i].intersects(boxes[j]) && (active.empty() || active[i] || active[j])) out.push_back({i, j});
  return out;
}

TEST(BroadPhase, FindsThePairsBruteForceFindsWhileBoxesMoveComeAndGo) {
  BroadPhase broad(0.1);
  std::vector<Box3> boxes;
  for (std::uint64_t k = 0; k < 400; ++k) {
    boxes.push_back(random_box(1, k));
    broad.update(static_cast<Index>(k), boxes.back());
  }
  Pairs found;
  for (std::uint64_t round = 0; round < 20; ++round) {
    for (std::uint64_t k = 0; k < boxes.size(); ++k) {
      if (random_uniform(2, round, k) < 0.1) {
        broad.remove(static_cast<Index>(k));
        boxes[k].setEmpty();
      } else if (random_uniform(3, round, k) < 0.5) {
        const Vec3 step = 0.3 * Vec3(random_uniform(4, round, k) - 0.5, random_uniform(5, round, k) - 0.5, random_uniform(6, round, k) - 0.5);
        if (boxes[k].isEmpty()) boxes[k] = random_box(7 + round, k);
        boxes[k].translate(step);
        broad.update(static_cast<Index>(k), boxes[k]);
      }
    }
    broad.pairs(found);
    ASSERT_EQ(found, by_brute_force(boxes)) << "round " << round;
    ASSERT_GT(found.size(), 20u) << "the test sees next to nothing";
    std::vector<unsigned char> active(boxes.size());
    for (std::size_t k = 0; k < active.size(); ++k) active[k] = random_uniform(8, round, k) < 0.3;
    broad.pairs(found, active);
    ASSERT_EQ(found, by_brute_force(boxes, active)) << "round " << round;
  }
}

TEST(BroadPhase, AnswersWithAllBoxesThatMeetOne) {
  BroadPhase broad;
  std::vector<Box3> boxes;
  for (std::uint64_t k = 0; k < 300; ++k) {
    boxes.push_back(random_box(11, k));
    broad.update(static_cast<Index>(k), boxes.back());
  }
  std::vector<Index> found;
  for (std::uint64_t k = 0; k < 50; ++k) {
    const Box3 asked = random_box(12, k);
    std::vector<Index> expected;
    for (Index i = 0; i < boxes.size(); ++i)
      if (boxes[i].intersects(asked)) expected.push_back(i);
    broad.query(asked, found);
    EXPECT_EQ(found, expected);
  }
  broad.query(Box3(), found);
  EXPECT_TRUE(found.empty());
}

TEST(BroadPhase, TouchingBoxesMeetAndAnEmptyOneHasNoPairs) {
  BroadPhase broad;
  Pairs found{{1, 2}};
  broad.pairs(found);
  EXPECT_TRUE(found.empty());
  broad.update(0, Box3(Vec3(0, 0, 0), Vec3(1, 1, 1)));
  broad.update(1, Box3(Vec3(1, 0, 0), Vec3(2, 1, 1)));
  broad.update(2, Box3(Vec3(2.0001, 0, 0), Vec3(3, 1, 1)));
  broad.pairs(found);
  EXPECT_EQ(found, (Pairs{{0, 1}}));
}

}  // namespace
}  // namespace effuse::geometry
