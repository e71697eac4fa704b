#include "flow/sph/column_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "geometry/base/parallel.h"
#include "geometry/base/random.h"

namespace effuse::flow::sph {
namespace {

constexpr Real kRadius = 2;

struct Cloud {
  const char* name;
  std::function<Vec3(std::uint64_t)> point;
};
void PrintTo(const Cloud& cloud, std::ostream* out) { *out << cloud.name; }

Vec3 uniform(std::uint64_t i, std::uint64_t stream = 0) {
  return {random_uniform(7, 3 * stream, i), random_uniform(7, 3 * stream + 1, i), random_uniform(7, 3 * stream + 2, i)};
}

const Cloud kClouds[] = {
    {"random", [](std::uint64_t i) { return Vec3(20 * uniform(i)); }},
    {"clustered", [](std::uint64_t i) { return Vec3(50 * uniform(i % 7, 1) + 1.5 * uniform(i)); }},
    {"stacked", [](std::uint64_t i) { return Vec3(3 * uniform(i).x(), 3 * uniform(i).y(), 700 * uniform(i).z()); }},
    {"far from the origin", [](std::uint64_t i) { return Vec3(Vec3(2667400.123, 6478700.456, -5000) + 18 * uniform(i)); }},
    {"two clouds a million metres apart", [](std::uint64_t i) { return Vec3(8 * uniform(i) + (i % 2 ? 1e6 : 0) * Vec3(1, -1, 1)); }},
    {"on a lattice of exactly the radius", [](std::uint64_t i) { return Vec3(kRadius * static_cast<Real>(i % 12), kRadius * static_cast<Real>(i / 12 % 12), kRadius * static_cast<Real>(i / 144)); }},
    {"all in one place", [](std::uint64_t i) { return Vec3(1e-3 * uniform(i)); }},
};

class ColumnGridTest : public testing::TestWithParam<Cloud> {};

TEST_P(ColumnGridTest, FindsTheNeighboursThatBruteForceFinds) {
  const std::size_t n = GetParam().name == std::string("all in one place") ? 300 : 1500;
  std::vector<Vec3> x(n);
  for (std::size_t i = 0; i < n; ++i) x[i] = GetParam().point(i);
  ColumnGrid grid;
  Neighbors neighbors;
  grid.build(x, kRadius);
  neighbors.find(grid, kRadius);
  std::size_t pairs = 0;
  for (std::size_t i = 0; i < n; ++i) {
    std::vector<Index> expected, found(neighbors[i].begin(), neighbors[i].end());
    for (std::size_t j = 0; j < n; ++j)
      if (j != i && (x[i] - x[j]).squaredNorm() < kRadius * kRadius) expected.push_back(static_cast<Index>(j));
    std::sort(found.begin(), found.end());
    ASSERT_EQ(found, expected) << "particle " << i << " at " << x[i].transpose();
    pairs += expected.size();
  }
  EXPECT_EQ(neighbors.pairs(), pairs);
}

TEST_P(ColumnGridTest, GivesTheSameListsOnAnyNumberOfThreads) {
  const std::size_t n = 5000;
  std::vector<Vec3> x(n);
  for (std::size_t i = 0; i < n; ++i) x[i] = GetParam().point(i % (GetParam().name == std::string("all in one place") ? 100 : n));
  const auto lists = [&](int threads) {
    const ThreadLimit limit(threads);
    ColumnGrid grid;
    Neighbors neighbors;
    grid.build(x, kRadius);
    neighbors.find(grid, kRadius);
    std::vector<std::vector<Index>> all;
    for (std::size_t i = 0; i < n; ++i) all.emplace_back(neighbors[i].begin(), neighbors[i].end());
    return all;
  };
  const auto one = lists(1);
  EXPECT_EQ(lists(2), one);
  EXPECT_EQ(lists(4), one);
}
INSTANTIATE_TEST_SUITE_P(Clouds, ColumnGridTest, testing::ValuesIn(kClouds));

TEST(ColumnGrid, CostsMemoryForTheFlowNotForTheLand) {
  // 10,000 particles as one patch, and the same number strewn over a million cells of land.
  const std::size_t n = 10000;
  const auto memory = [&](Real spread) {
    std::vector<Vec3> x(n);
    for (std::size_t i = 0; i < n; ++i) x[i] = spread * Vec3(uniform(i).x(), uniform(i).y(), 0) + Vec3(0, 0, 4 * uniform(i).z());
    ColumnGrid grid;
    grid.build(x, kRadius);
    return grid.memory();
  };
  const std::size_t patch = memory(60), land = memory(1000 * kRadius);
  RecordProperty("patch_bytes", static_cast<int>(patch));
  RecordProperty("land_bytes", static_cast<int>(land));
  EXPECT_LT(patch, 120 * n);
  EXPECT_LT(land, 160 * n) << "a dense grid of the land would take 4 MB an array";
}

TEST(ColumnGrid, TakesNoParticlesAndOne) {
  ColumnGrid grid;
  Neighbors neighbors;
  grid.build({}, 1);
  neighbors.find(grid, 1);
  EXPECT_EQ(neighbors.size(), 0u);
  const std::vector<Vec3> one{Vec3(1, 2, 3)};
  grid.build(one, 1);
  neighbors.find(grid, 1);
  ASSERT_EQ(neighbors.size(), 1u);
  EXPECT_TRUE(neighbors[0].empty());
}

TEST(ColumnGridDeathTest, StopsAtPositionsThatAreNotFinite) {
  const std::vector<Vec3> bad{Vec3(0, 0, 0), Vec3(0, std::nan(""), 0)};
  ColumnGrid grid;
  EXPECT_DEATH(grid.build(bad, 1), "CHECK failed");
}

}  // namespace
}  // namespace effuse::flow::sph
