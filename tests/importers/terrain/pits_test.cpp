#include "importers/terrain/pits.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "geometry/base/random.h"
#include "importers/terrain/fill_holes.h"
#include "importers/terrain/trim.h"

namespace effuse::importers {
namespace {

constexpr Real kAll = std::numeric_limits<Real>::infinity();

/// A slope of 1 m a post to the west, with a pit 3 m deep and a crater 20 m deep.
std::vector<Real> slope_with_pits() {
  std::vector<Real> z(30 * 20);
  for (int j = 0; j < 20; ++j)
    for (int i = 0; i < 30; ++i) z[static_cast<std::size_t>(30 * j + i)] = 100 + i;
  z[30 * 10 + 10] -= 4;                                                  // its neighbours to the west are 1 m lower than it was: 3 m
  for (int j = 4; j < 9; ++j)
    for (int i = 19; i < 24; ++i) z[static_cast<std::size_t>(30 * j + i)] = 97;  // walls of 18 m to the west are its spill
  return z;
}

TEST(Pits, AreFoundWithTheirVolume) {
  const std::vector<Real> z = slope_with_pits();
  const Flood water = flood(z, 30, 20, {0, 0}, {2, 5});
  ASSERT_EQ(water.depressions.size(), 2u);
  EXPECT_EQ(water.depressions[0].depth(), 21);
  EXPECT_EQ(water.depressions[0].posts, 25u);
  EXPECT_EQ(water.depressions[0].volume, 25 * 21 * 10);
  EXPECT_EQ(water.depressions[1].depth(), 3);
  EXPECT_EQ(water.depressions[1].lowest, Vec2(20, 50));
}

TEST(Pits, FilledOrBreachedNothingIsClosedAnyMore) {
  for (const PitPolicy policy : {PitPolicy::kFill, PitPolicy::kBreach}) {
    std::vector<Real> z = slope_with_pits();
    const RemovedPits removed = remove_pits(z, 30, 20, {2, 5}, policy, kAll);
    EXPECT_TRUE(flood(z, 30, 20, {0, 0}, {2, 5}).depressions.empty());
    EXPECT_EQ(removed.pits, 2u);
    EXPECT_EQ(removed.kept, 0u);
  }
}

TEST(Pits, FillingAddsTheVolumeThatWasFound) {
  std::vector<Real> z = slope_with_pits();
  EXPECT_EQ(remove_pits(z, 30, 20, {2, 5}, PitPolicy::kFill, kAll).volume, 25 * 21 * 10 + 3 * 10);
}

TEST(Pits, ABreachOnlyLowersAndMovesLessGroundThanAFill) {
  std::vector<Real> before = slope_with_pits(), z = before;
  const RemovedPits removed = remove_pits(z, 30, 20, {2, 5}, PitPolicy::kBreach, kAll);
  Real volume = 0;
  for (std::size_t k = 0; k < z.size(); ++k) {
    EXPECT_LE(z[k], before[k]);
    volume += (before[k] - z[k]) * 10;
  }
  EXPECT_NEAR(removed.volume, volume, 1e-9);
  EXPECT_LT(volume, 25 * 21 * 10);
}

TEST(Pits, DeeperOnesThanAskedStay) {
  std::vector<Real> z = slope_with_pits();
  const RemovedPits removed = remove_pits(z, 30, 20, {2, 5}, PitPolicy::kFill, 5);
  EXPECT_EQ(removed.pits, 1u);
  EXPECT_EQ(removed.kept, 1u);
  ASSERT_EQ(flood(z, 30, 20, {0, 0}, {2, 5}).depressions.size(), 1u);
}

TEST(Pits, OnRoughGroundWithHolesBothEnd) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    std::vector<Real> rough(60 * 50);
    for (std::size_t k = 0; k < rough.size(); ++k) rough[k] = random_uniform(seed, 1, k) < 0.02 ? std::numeric_limits<Real>::quiet_NaN() : 10 * random_uniform(seed, 0, k);
    for (const PitPolicy policy : {PitPolicy::kFill, PitPolicy::kBreach}) {
      std::vector<Real> z = rough;
      remove_pits(z, 60, 50, {1, 1}, policy, kAll);
      EXPECT_TRUE(flood(z, 60, 50, {0, 0}, {1, 1}).depressions.empty()) << "seed " << seed;
    }
  }
}

TEST(FillHoles, AHarmonicSurfaceComesBack) {
  // x^2 - y^2 solves Laplace's equation; on the grid exactly.
  const int n = 65;
  std::vector<Real> truth(n * n), z;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) truth[static_cast<std::size_t>(n * j + i)] = 0.01 * ((i - 32) * (i - 32) - (j - 32) * (j - 32));
  z = truth;
  for (int j = 12; j < 50; ++j)
    for (int i = 9; i < 52; ++i) z[static_cast<std::size_t>(n * j + i)] = std::numeric_limits<Real>::quiet_NaN();
  const FilledHoles filled = fill_holes(z, n, n);
  EXPECT_EQ(filled.posts, 38u * 43);
  EXPECT_EQ(filled.largest, 38u * 43);
  Real worst = 0;
  for (std::size_t k = 0; k < z.size(); ++k) worst = std::max(worst, std::abs(z[k] - truth[k]));
  EXPECT_LT(worst, 1e-3 * 20.48 * 2) << "1e-3 of the range, as promised";
}

TEST(FillHoles, CornersWithoutDataAreCarriedOn) {
  std::vector<Real> z(20 * 10, 5);
  for (int j = 0; j < 5; ++j)
    for (int i = 0; i < 5; ++i) z[static_cast<std::size_t>(20 * j + i)] = std::numeric_limits<Real>::quiet_NaN();
  fill_holes(z, 20, 10);
  for (const Real h : z) EXPECT_NEAR(h, 5, 1e-9);
}

TEST(Trim, TakesAwayThinWedgesOnly) {
  // Beside the raster: posts left of a line that leans by one post over the height.
  const auto wedge = [](int wide) {
    std::vector<char> beside(60 * 50, 0);
    for (int j = 0; j < 50; ++j)
      for (int i = 0; i < 60; ++i) beside[static_cast<std::size_t>(60 * j + i)] = i * 50 < wide * j;
    return beside;
  };
  const CellWindow thin = trimmed(wedge(2), 60, 50, 0.05);
  EXPECT_EQ(thin.column, 2);
  EXPECT_EQ(thin.columns, 58);
  EXPECT_EQ(thin.rows, 50);
  const CellWindow wide = trimmed(wedge(20), 60, 50, 0.05);
  EXPECT_EQ(wide.columns * wide.rows, 60 * 50) << "a third of it would go";
  EXPECT_EQ(trimmed(std::vector<char>(600, 0), 30, 20, 0.05).columns, 30);
}

}  // namespace
}  // namespace effuse::importers
