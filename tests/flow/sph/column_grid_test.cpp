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
    {"apart by the radius and a hair", [](std::uint64_t i) { return Vec3(kRadius * (Vec3(static_cast<Real>(i % 12), static_cast<Real>(i / 12 % 12), static_cast<Real>(i / 144)) + 1e-7 * uniform(i))); }},
    {"two clouds a thousand million metres apart", [](std::uint64_t i) { return Vec3(8 * uniform(i) + (i % 2 ? 1e9 : 0) * Vec3(1, -1, 1)); }},
    {"all in one place", [](std::uint64_t i) { return Vec3(1e-3 * uniform(i)); }},
};

/// What this processor can run.
std::vector<Simd> simds() {
  std::vector<Simd> all;
  for (const Simd simd : {Simd::kScalar, Simd::kAvx2, Simd::kAvx512})
    if (simd <= best_simd()) all.push_back(simd);
  return all;
}

std::vector<std::vector<Index>> lists_of(const Neighbors& neighbors) {
  std::vector<std::vector<Index>> all;
  for (std::size_t i = 0; i < neighbors.size(); ++i) all.emplace_back(neighbors[i].begin(), neighbors[i].end());
  return all;
}

class ColumnGridTest : public testing::TestWithParam<Cloud> {};

std::vector<Vec3> cloud_of(const Cloud& cloud, std::size_t n, std::size_t n_in_one_place) {
  if (cloud.name == std::string("all in one place")) n = n_in_one_place;
  std::vector<Vec3> x(n);
  for (std::size_t i = 0; i < n; ++i) x[i] = cloud.point(i);
  return x;
}

TEST_P(ColumnGridTest, FindsTheNeighboursThatBruteForceFinds) {
  const std::vector<Vec3> x = cloud_of(GetParam(), 1500, 300);
  std::vector<std::vector<Index>> expected(x.size());
  std::size_t pairs = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    for (std::size_t j = 0; j < x.size(); ++j)
      if (j != i && (x[i] - x[j]).squaredNorm() < kRadius * kRadius) expected[i].push_back(static_cast<Index>(j));
    pairs += expected[i].size();
  }
  ColumnGrid grid;
  Neighbors neighbors;
  grid.build(x, kRadius);
  for (const Simd simd : simds()) {
    neighbors.find(grid, kRadius, simd);
    std::vector<std::vector<Index>> found = lists_of(neighbors);
    for (std::size_t i = 0; i < x.size(); ++i) {
      const Index* behind = neighbors[i].data() + neighbors[i].size();
      for (std::size_t k = neighbors[i].size(); k % Neighbors::kGroup; ++k) ASSERT_EQ(*behind++, i) << "a group of a list is filled up with the particle itself";
      std::sort(found[i].begin(), found[i].end());
      ASSERT_EQ(found[i], expected[i]) << "particle " << i << " at " << x[i].transpose() << ", simd " << static_cast<int>(simd);
    }
    EXPECT_EQ(neighbors.pairs(), pairs);
  }
}

TEST_P(ColumnGridTest, GivesTheSameListsOnAnyNumberOfThreadsAndInstructionSet) {
  std::vector<Vec3> x = cloud_of(GetParam(), 5000, 5000);
  if (GetParam().name == std::string("all in one place"))
    for (std::size_t i = 100; i < x.size(); ++i) x[i] = x[i % 100];
  const Real radius = GetParam().name == std::string("all in one place") ? 1e-4 : 0.9 * kRadius;
  const auto lists = [&](int threads, Simd simd) {
    const ThreadLimit limit(threads);
    ColumnGrid grid;
    Neighbors neighbors;
    grid.build(x, kRadius);
    neighbors.find(grid, radius, simd);
    return lists_of(neighbors);
  };
  const auto one = lists(1, Simd::kScalar);
  for (const Simd simd : simds()) {
    EXPECT_TRUE(lists(2, simd) == one) << static_cast<int>(simd);
    EXPECT_TRUE(lists(4, simd) == one) << static_cast<int>(simd);
  }
}

TEST_P(ColumnGridTest, KeepsPositionsInFixedPoint) {
  const std::vector<Vec3> x = cloud_of(GetParam(), 1500, 300);
  ColumnGrid grid;
  Neighbors neighbors;
  grid.build(x, kRadius);
  neighbors.find(grid, kRadius);
  std::vector<Index> place(x.size());
  for (Index k = 0; k < x.size(); ++k) place[grid.order()[k]] = k;
  const ColumnGrid::Fixed fixed = grid.fixed();
  const auto minus = [](std::int32_t a, std::int32_t b) { return static_cast<std::int32_t>(static_cast<std::uint32_t>(a) - static_cast<std::uint32_t>(b)); };
  Real worst = 0;
  for (Index i = 0; i < x.size(); ++i) {
    ASSERT_EQ(grid.sorted_positions()[place[i]], x[i]);
    for (const Index j : neighbors[i]) {
      const Index a = place[i], b = place[j];
      const Vec3 apart(minus(fixed.x[a], fixed.x[b]), minus(fixed.y[a], fixed.y[b]), minus(fixed.z[a], fixed.z[b]));
      worst = std::max(worst, (apart - grid.units_per_metre() * (x[i] - x[j])).norm());
    }
  }
  EXPECT_LT(worst, ColumnGrid::kFixedError);
}
INSTANTIATE_TEST_SUITE_P(Clouds, ColumnGridTest, testing::ValuesIn(kClouds));

TEST(ColumnGrid, SortsStablyByRowColumnAndLevelOnAnyNumberOfThreads) {
  // 70,000 keys are three chunks of the sort.
  std::vector<Vec3> x(70000);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = 60 * uniform(i);
  ColumnGrid grid;
  const auto order = [&](int threads) {
    const ThreadLimit limit(threads);
    grid.build(x, kRadius);
    return std::vector<Index>(grid.order().begin(), grid.order().end());
  };
  const std::vector<Index> one = order(1);
  EXPECT_TRUE(order(2) == one);
  EXPECT_TRUE(order(3) == one);
  std::size_t expected_begin = 0;
  for (std::size_t c = 0; c < grid.columns().size(); ++c) {
    const ColumnGrid::Column column = grid.columns()[c];
    ASSERT_EQ(column.begin, expected_begin);
    expected_begin = column.end;
    if (c > 0) {
      const ColumnGrid::Column before = grid.columns()[c - 1];
      ASSERT_TRUE(before.iy < column.iy || (before.iy == column.iy && before.ix < column.ix));
    }
    for (Index k = column.begin + 1; k < column.end; ++k) {
      ASSERT_LE(grid.levels()[k - 1], grid.levels()[k]);
      if (grid.levels()[k - 1] == grid.levels()[k]) {
        ASSERT_LT(one[k - 1], one[k]);
      }
    }
  }
  EXPECT_EQ(expected_begin, x.size());
}

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
