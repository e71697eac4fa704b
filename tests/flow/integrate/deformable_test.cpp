#include "flow/integrate/deformable.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "geometry/base/error.h"
#include "geometry/base/random.h"

namespace effuse::flow {
namespace {

std::vector<Vec3> random_points(std::size_t n, std::uint64_t seed) {
  std::vector<Vec3> x;
  for (std::size_t i = 0; i < n; ++i) x.push_back(Vec3(random_uniform(seed, 0, i), random_uniform(seed, 1, i), random_uniform(seed, 2, i)));
  return x;
}

// Work done on vertices is work done on points; and what is on the vertices all arrives.
TEST(HungSurface, ScatterIsTheTransposeOfGather) {
  const std::vector<Vec3> places = random_points(4, 1);
  const std::vector<geometry::Triangle> triangles = {{0, 1, 2}, {0, 2, 3}};
  const std::vector<Index> first = {0, 2, 3, 6, 8}, point = {0, 4, 1, 2, 3, 0, 1, 4};
  const std::vector<Real> weight = {3, 1, 2, 0.5, 0.25, 0.25, 1, 4};
  const HungSurface surface = hang(places, triangles, first, point, weight);
  ASSERT_EQ(surface.size(), 4u);
  const std::vector<Vec3> of_points = random_points(5, 2), of_vertices = random_points(4, 3);
  std::vector<Vec3> gathered, scattered(5, Vec3::Zero());
  surface.gather(of_points, gathered);
  surface.scatter(of_vertices, scattered);
  Real one = 0, other = 0;
  Vec3 given = Vec3::Zero(), got = Vec3::Zero();
  for (std::size_t q = 0; q < 4; ++q) one += gathered[q].dot(of_vertices[q]), given += of_vertices[q];
  for (std::size_t i = 0; i < 5; ++i) other += of_points[i].dot(scattered[i]), got += scattered[i];
  EXPECT_NEAR(one, other, 1e-14);
  EXPECT_LT((given - got).norm(), 1e-14);
  // 3 : 1 of points 0 and 4.
  EXPECT_LT((gathered[0] - (0.75 * of_points[0] + 0.25 * of_points[4])).norm(), 1e-15);
}

TEST(HungSurface, VerticesAtOnePlaceAreOneAndThoseOfNoTriangleNone) {
  std::vector<Vec3> places = random_points(6, 4);
  places[4] = places[1];
  const std::vector<geometry::Triangle> triangles = {{0, 1, 2}, {4, 3, 2}, {1, 4, 3}};
  const HungSurface surface = hang(places, triangles, std::vector<Index>{0, 1, 2, 3, 4, 5, 6}, std::vector<Index>{0, 1, 2, 3, 4, 5}, std::vector<Real>(6, 1));
  EXPECT_EQ(surface.size(), 4u) << "0 to 3";
  ASSERT_EQ(surface.triangles.size(), 2u) << "the third has two corners at one place";
  EXPECT_EQ(surface.triangles[1], (geometry::Triangle{1, 3, 2}));
}

TEST(OwedImpulses, AreForcesOfTheNextStep) {
  OwedImpulses owed;
  EXPECT_TRUE(owed.as_forces(0.1).empty());
  owed.add(1, Vec3(0, 0, 2), 3);
  owed.add(1, Vec3(0, 1, 0), 3);
  const std::vector<Vec3> alone = owed.as_forces(0.5), both = owed.as_forces(0.5, std::vector<Vec3>(3, Vec3(1, 0, 0)));
  EXPECT_EQ(alone[1], Vec3(0, 2, 4));
  EXPECT_EQ(both[0], Vec3(1, 0, 0));
  EXPECT_EQ(both[1], Vec3(1, 2, 4));
  owed.clear();
  EXPECT_TRUE(owed.as_forces(0.1).empty());
}

/// A chain of n points, each block a random one that is positive definite: lower half, and dense.
Eigen::SparseMatrix<double> chain(std::size_t n) {
  std::vector<Eigen::Triplet<double>> entries;
  for (std::size_t i = 0; i < n; ++i) {
    const int at = static_cast<int>(3 * i);
    for (int c = 0; c < 3; ++c)
      for (int r = c; r < 3; ++r) entries.emplace_back(at + r, at + c, r == c ? 4 + random_uniform(5, static_cast<std::uint64_t>(r), i) : 0.3 * random_uniform(6, static_cast<std::uint64_t>(3 * r + c), i));
    if (i + 1 == n) continue;
    for (int c = 0; c < 3; ++c)
      for (int r = 0; r < 3; ++r) entries.emplace_back(at + 3 + r, at + c, 0.5 * random_uniform(7, static_cast<std::uint64_t>(3 * r + c), i) - 0.25);
  }
  Eigen::SparseMatrix<double> lower(static_cast<Eigen::Index>(3 * n), static_cast<Eigen::Index>(3 * n));
  lower.setFromTriplets(entries.begin(), entries.end());
  lower.makeCompressed();
  return lower;
}

// Direct, and by iterations beyond kMostDirect.
TEST(BlockMatrix, SolveUndoesMultiply) {
  for (const std::size_t n : {std::size_t{1}, std::size_t{40}, BlockMatrix::kMostDirect + 10}) {
    BlockMatrix m;
    m.assign(chain(n), 2);
    m.add_diagonal(0, 3 * Mat3::Identity());
    m.factor();
    const std::vector<Vec3> x = random_points(n, 8);
    std::vector<Vec3> b(n), back(n);
    m.multiply(x, b);
    m.solve(b, back);
    Real worst = 0;
    for (std::size_t i = 0; i < n; ++i) worst = std::max(worst, (back[i] - x[i]).norm());
    EXPECT_LT(worst, n > BlockMatrix::kMostDirect ? 1e-6 : 1e-13) << n;
    // The diagonal's part.
    const Eigen::MatrixXd dense = Eigen::MatrixXd(chain(n).topLeftCorner(3, 3)).selfadjointView<Eigen::Lower>();
    if (n == 1) {
      EXPECT_LT((b[0] - (2 * dense + 3 * Eigen::MatrixXd::Identity(3, 3)) * x[0]).norm(), 1e-13);
    }
  }
}

TEST(BlockMatrix, SaysThatItIsNotPositiveDefinite) {
  BlockMatrix m;
  m.assign(chain(4), 1);
  m.add_diagonal(2, -20 * Mat3::Identity());
  EXPECT_THROW(m.factor(), UnstableError);
}

}  // namespace
}  // namespace effuse::flow
