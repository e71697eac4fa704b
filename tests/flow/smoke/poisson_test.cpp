#include "flow/smoke/poisson.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "geometry/base/parallel.h"
#include "geometry/base/random.h"

namespace effuse::flow::smoke {
namespace {

std::vector<Real> noise(std::size_t n, std::uint64_t stream) {
  std::vector<Real> values(n);
  for (std::size_t i = 0; i < n; ++i) values[i] = random_uniform(7, stream, i) - 0.5;
  return values;
}

/// Some solid cells, a tenth of all, and none of the first layer.
std::vector<std::uint8_t> stones(const std::array<int, 3>& n) {
  std::vector<std::uint8_t> solid(static_cast<std::size_t>(n[0] * n[1] * n[2]));
  for (std::size_t i = 0; i < solid.size(); ++i) solid[i] = random_uniform(3, 9, i) < 0.1;
  return solid;
}

TEST(SmokePoisson, IsSymmetricAndPositive) {
  const std::array<int, 3> n = {9, 6, 7};
  Poisson poisson(n, stones(n), {true, false, true, false, false, true});
  const std::vector<Real> a = noise(poisson.size(), 1), b = noise(poisson.size(), 2);
  std::vector<Real> Aa(a.size()), Ab(a.size());
  poisson.apply(a, Aa);
  poisson.apply(b, Ab);
  Real aAb = 0, bAa = 0, aAa = 0;
  for (std::size_t i = 0; i < a.size(); ++i) aAb += a[i] * Ab[i], bAa += b[i] * Aa[i], aAa += a[i] * Aa[i];
  EXPECT_NEAR(aAb, bAa, 1e-12 * aAa);
  EXPECT_GT(aAa, 0);
}

TEST(SmokePoisson, FindsWhatWasPutInAmongStones) {
  const std::array<int, 3> n = {33, 20, 17};  // no powers of two
  const std::vector<std::uint8_t> solid = stones(n);
  Poisson poisson(n, solid, {true, true, false, false, false, true});
  std::vector<Real> p = noise(poisson.size(), 1), b(p.size()), found(p.size(), 0);
  for (std::size_t i = 0; i < p.size(); ++i)
    if (solid[i]) p[i] = 0;
  poisson.apply(p, b);
  const Poisson::Report report = poisson.solve(b, found, 1e-10);
  EXPECT_TRUE(report.converged);
  EXPECT_LE(report.residual, 1e-10);
  std::vector<Real> again(p.size());
  poisson.apply(found, again);
  for (std::size_t i = 0; i < p.size(); ++i) EXPECT_NEAR(again[i], b[i], 1e-8) << i;
}

TEST(SmokePoisson, ItsIterationsDoNotGrowWithTheGrid) {
  int of[2];
  for (const int k : {0, 1}) {
    const int n = k == 0 ? 16 : 64;
    Poisson poisson({n, n, n}, std::vector<std::uint8_t>(static_cast<std::size_t>(n * n * n), 0), {true, true, true, true, false, true});
    const std::vector<Real> b = noise(poisson.size(), 4);
    std::vector<Real> p(b.size(), 0);
    of[k] = poisson.solve(b, p, 1e-6).iterations;
  }
  EXPECT_LE(of[1], 2 * of[0]) << of[0] << " and " << of[1];
  EXPECT_LE(of[1], 40);
}

TEST(SmokePoisson, AClosedRoomIsSolvedButForAConstant) {
  const std::array<int, 3> n = {12, 10, 8};
  Poisson poisson(n, std::vector<std::uint8_t>(960, 0), {});
  std::vector<Real> b = noise(960, 5), p(960, 0), again(960);
  Real mean = 0;
  for (const Real x : b) mean += x / 960;
  for (Real& x : b) x -= mean;
  EXPECT_TRUE(poisson.solve(b, p, 1e-9).converged);
  poisson.apply(p, again);
  for (std::size_t i = 0; i < 960; ++i) EXPECT_NEAR(again[i], b[i], 1e-7);
}

/// p = product of sines that are 0 a cell beyond each open side: the error falls with the square of the cell.
TEST(SmokePoisson, ConvergesWithTheSquareOfTheCell) {
  Real error[2];
  for (const int k : {0, 1}) {
    const int n = k == 0 ? 15 : 31;  // n + 1 cells from zero to zero
    const Real h = 1.0 / (n + 1);
    Poisson poisson({n, n, n}, std::vector<std::uint8_t>(static_cast<std::size_t>(n * n * n), 0), {true, true, true, true, true, true});
    std::vector<Real> b(poisson.size()), p(poisson.size(), 0), exact(poisson.size());
    for (int z = 0; z < n; ++z)
      for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x) {
          const std::size_t c = static_cast<std::size_t>((z * n + y) * n + x);
          exact[c] = std::sin(kPi * (x + 1) * h) * std::sin(kPi * (y + 1) * h) * std::sin(kPi * (z + 1) * h);
          b[c] = 3 * kPi * kPi * exact[c] * h * h;
        }
    poisson.solve(b, p, 1e-11);
    error[k] = 0;
    for (std::size_t c = 0; c < p.size(); ++c) error[k] = std::max(error[k], std::abs(p[c] - exact[c]));
  }
  EXPECT_NEAR(std::log2(error[0] / error[1]), 2, 0.05) << error[0] << " " << error[1];
}

TEST(SmokePoisson, TheSameBitsOnOneThreadAndOnMany) {
  const std::array<int, 3> n = {20, 30, 25};
  std::vector<Real> of[2];
  for (const int k : {0, 1}) {
    const ThreadLimit limit(k == 0 ? 1 : 2);
    Poisson poisson(n, stones(n), {true, true, true, true, false, true});
    of[k].assign(poisson.size(), 0);
    poisson.solve(noise(poisson.size(), 8), of[k], 1e-5);
  }
  EXPECT_EQ(of[0], of[1]);
}

}  // namespace
}  // namespace effuse::flow::smoke
