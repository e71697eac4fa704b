#include "flow/sph/awake.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/random.h"

namespace effuse::flow::sph {
namespace {

struct Cloud {
  const char* name;
  Vec3 origin;
  Real width;      // [m]
  Real awake;      // share of it
};
void PrintTo(const Cloud& c, std::ostream* out) { *out << c.name; }

class AwakeSetTest : public testing::TestWithParam<Cloud> {
 protected:
  static constexpr Real kCell = 0.7;
  std::vector<Vec3> x;
  std::vector<std::uint8_t> asleep;
  AwakeSet set;

  void SetUp() override {
    const Cloud& c = GetParam();
    for (std::uint64_t i = 0; i < 3000; ++i) {
      const Vec3 at(random_uniform(1, 0, i), random_uniform(1, 1, i), 0.2 * random_uniform(1, 2, i));
      x.push_back(c.origin + c.width * at);
      // Those awake stand together, as a lobe does.
      asleep.push_back(at.x() > c.awake);
    }
    set.find(x, asleep, kCell);
  }
  Real nearest(std::size_t i, std::size_t first, std::size_t last) const {
    Real d2 = std::numeric_limits<Real>::infinity();
    for (std::size_t k = first; k < last; ++k) d2 = std::min(d2, (x[i] - x[set.particles[k]]).squaredNorm());
    return std::sqrt(d2);
  }
};

TEST_P(AwakeSetTest, HoldsThoseAwakeThenThoseNearThemThenThoseNearThese) {
  std::vector<int> seen(x.size());
  for (std::size_t k = 0; k < set.particles.size(); ++k) {
    ++seen[set.particles[k]];
    EXPECT_EQ(asleep[set.particles[k]] == 0, k < set.awake);
    if (k > 0 && k != set.awake && k != set.awake + set.drowsy) {
      EXPECT_LT(set.particles[k - 1], set.particles[k]) << "rising within each";
    }
  }
  EXPECT_EQ(*std::max_element(seen.begin(), seen.end()), 1) << "nobody twice";
  EXPECT_EQ(set.awake, static_cast<std::size_t>(std::count(asleep.begin(), asleep.end(), 0)));
}

TEST_P(AwakeSetTest, NobodyWithinACellOfTheAwakeOrTheDrowsyIsLeftOut) {
  std::vector<int> part(x.size(), 3);  // 0 awake, 1 drowsy, 2 still, 3 not in it
  for (std::size_t k = 0; k < set.particles.size(); ++k) part[set.particles[k]] = k < set.awake ? 0 : k < set.awake + set.drowsy ? 1 : 2;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (part[i] <= 1) continue;
    EXPECT_GE(nearest(i, 0, set.awake), kCell) << "a sleeper within reach of one awake is drowsy";
    if (part[i] == 3) {
      EXPECT_GE(nearest(i, 0, set.awake + set.drowsy), kCell) << "and what is within reach of the drowsy is in the set";
    }
  }
}

TEST_P(AwakeSetTest, WhatIsFarIsLeftOut) {
  for (std::size_t k = set.awake; k < set.particles.size(); ++k)
    EXPECT_LT(nearest(set.particles[k], 0, set.awake), (k < set.awake + set.drowsy ? 2 : 3) * std::sqrt(3) * kCell);
  EXPECT_LT(set.particles.size(), x.size());
}

INSTANTIATE_TEST_SUITE_P(Clouds, AwakeSetTest,
                         testing::Values(Cloud{"on both sides of zero", Vec3(-5, -5, -1), 10, 0.3}, Cloud{"few awake", Vec3(100, -300, 1200), 20, 0.01},
                                         Cloud{"far from the origin", Vec3(2667400, 6478700, -500), 12, 0.2}));

TEST(AwakeSet, WithoutSleepersIsEverybodyInOrder) {
  AwakeSet set;
  const std::vector<Vec3> x(5, Vec3::Zero());
  set.find(x, std::vector<std::uint8_t>(5, 0), 1);
  EXPECT_EQ(set.particles, (std::vector<Index>{0, 1, 2, 3, 4}));
  EXPECT_EQ(set.awake, 5u);
  EXPECT_EQ(set.drowsy, 0u);
}

TEST(AwakeSet, IsEmptyWhenAllSleepAndWithoutParticles) {
  AwakeSet set;
  set.find(std::vector<Vec3>(5, Vec3::Zero()), std::vector<std::uint8_t>(5, 1), 1);
  EXPECT_TRUE(set.particles.empty());
  EXPECT_EQ(set.awake + set.drowsy, 0u);
  set.find({}, {}, 1);
  EXPECT_TRUE(set.particles.empty());
}

}  // namespace
}  // namespace effuse::flow::sph
