#include "geometry/procedural/curl_noise.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "geometry/base/random.h"
#include "geometry/procedural/noise.h"

namespace effuse::geometry {
namespace {

constexpr std::array<std::uint64_t, 3> kSeeds = {5, 6, 7};

Vec3 point(std::uint64_t n) { return Vec3(random_uniform(1, 0, n) * 20 - 10, random_uniform(1, 1, n) * 20 - 10, random_uniform(1, 2, n) * 20 - 10); }

TEST(CurlNoise, IsTheCurlOfThreeGradientNoises) {
  const CurlNoise noise(kSeeds);
  Real sum = 0;
  constexpr std::uint64_t kPoints = 2000;
  for (std::uint64_t n = 0; n < kPoints; ++n) {
    Vec3 g[3];
    for (std::size_t k = 0; k < 3; ++k) g[k] = gradient_noise_sample(point(n), kSeeds[k]).gradient;
    const Vec3 w = noise(point(n)), curl(g[2].y() - g[1].z(), g[0].z() - g[2].x(), g[1].x() - g[0].y());
    ASSERT_LT((w - curl).norm(), 1e-13) << n;
    sum += w.squaredNorm() / 3 / kPoints;
  }
  EXPECT_NEAR(std::sqrt(sum), 1, 0.1);
}

TEST(CurlNoise, HasTheSameBitsFromItsTable) {
  const CurlNoise hashed(kSeeds);
  CurlNoise covered(kSeeds);
  for (const Real half : {2., 9., 3.}) {  // grows; then keeps what holds it
    covered.cover(Box3(Vec3::Constant(-half), Vec3::Constant(half)), 20'000);
    EXPECT_GT(covered.memory(), 0u);
    // Some of the points lie outside, some on its faces and corners.
    for (std::uint64_t n = 0; n < 500; ++n) ASSERT_EQ(covered(point(n)), hashed(point(n))) << half << ' ' << n;
    for (int c = 0; c < 27; ++c) {
      const Vec3 p = half * Vec3(c % 3 - 1, c / 3 % 3 - 1, c / 9 - 1);
      ASSERT_EQ(covered(p), hashed(p)) << p.transpose();
    }
    std::vector<Vec3> many, got(77);
    for (std::uint64_t n = 0; n < got.size(); ++n) many.push_back(point(n));
    covered.sample(many, got);
    for (std::size_t n = 0; n < got.size(); ++n) ASSERT_EQ(got[n], hashed(many[n])) << half << ' ' << n;
  }
}

TEST(CurlNoise, TakesNoTableBeyondItsLimitNorWhatIsNoPlace) {
  CurlNoise noise(kSeeds);
  noise.cover(Box3(Vec3::Zero(), Vec3::Constant(1e4)), 1'000'000);
  noise.cover(Box3(), 1'000'000);
  noise.cover(Box3(Vec3::Constant(-1e300), Vec3::Constant(1e300)), 1'000'000);
  noise.cover(Box3(Vec3::Constant(std::numeric_limits<Real>::quiet_NaN()), Vec3::Constant(1)), 1'000'000);
  EXPECT_EQ(noise.memory(), 0u);
  EXPECT_EQ(noise(Vec3(0, 1e300, 0)), Vec3::Zero());
  EXPECT_EQ(noise(Vec3(0, std::numeric_limits<Real>::quiet_NaN(), 0)), Vec3::Zero());
}

}  // namespace
}  // namespace effuse::geometry
