#include "skin/detail/triangle_noise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "geometry/base/random.h"

namespace effuse::skin {
namespace {

const Real kHeight = std::sqrt(3.0) / 2;

Vec2 anywhere(std::uint64_t i, Real size = 4000) {
  return size * Vec2(random_uniform(11, 0, i) - 0.5, random_uniform(11, 1, i) - 0.5);
}

TEST(TriangleNoise, ItsGradientIsItsSlope) {
  const Real step = 1e-5;
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const Vec2 p = anywhere(i, 40);
    const TriangleSample at = triangle_noise_sample(p, 3);
    const Vec2 slope((triangle_noise(p + Vec2(step, 0), 3) - triangle_noise(p - Vec2(step, 0), 3)) / (2 * step),
                     (triangle_noise(p + Vec2(0, step), 3) - triangle_noise(p - Vec2(0, step), 3)) / (2 * step));
    // Second derivatives jump across edges: there central differences are off by step times the jump.
    ASSERT_NEAR((at.gradient - slope).norm(), 0, 1e-3) << p.transpose();
    ASSERT_LE(std::abs(at.value), 1.6);
  }
}

TEST(TriangleNoise, ValueAndGradientAreContinuousAcrossEveryKindOfEdgeAndAtNodes) {
  // Points on the three families of edges, and the nodes; two points 2e-7 apart on either side.
  const Vec2 along[3] = {Vec2(1, 0), Vec2(0.5, kHeight), Vec2(-0.5, kHeight)};
  for (std::uint64_t i = 0; i < 3000; ++i) {
    const Vec2& e = along[i % 3];
    const Vec2 across(-e.y(), e.x());
    const Real a = std::floor(200 * random_uniform(5, 0, i)) - 100, b = std::floor(200 * random_uniform(5, 1, i)) - 100;
    const Real t = i % 10 == 0 ? 0 : random_uniform(5, 2, i);  // 0: at the node
    const Vec2 p = a * Vec2(1, 0) + b * Vec2(0.5, kHeight) + t * e;
    const TriangleSample left = triangle_noise_sample(p + 1e-7 * across, 9), right = triangle_noise_sample(p - 1e-7 * across, 9);
    // 2e-7 apart, slopes below 6, curvatures below 40.
    ASSERT_NEAR(left.value, right.value, 1.2e-6) << p.transpose();
    ASSERT_NEAR((left.gradient - right.gradient).norm(), 0, 1e-5) << p.transpose();
  }
}

TEST(TriangleNoise, StatisticsAreTheSameInEveryDirectionWithinFivePercent) {
  constexpr int kDirections = 16;
  const std::uint64_t n = 200000;
  // Slope in each direction, and the difference to the point one quarter, one half and one side away.
  const Real apart[] = {0.25, 0.5, 1.0};
  std::vector<Real> slope(kDirections, 0), difference[3];
  for (auto& d : difference) d.assign(kDirections, 0);
  Real mean = 0, squares = 0, largest = 0;
  for (std::uint64_t i = 0; i < n; ++i) {
    const Vec2 p = anywhere(i);
    const TriangleSample at = triangle_noise_sample(p, 1);
    mean += at.value;
    squares += at.value * at.value;
    largest = std::max(largest, std::abs(at.value));
    for (int k = 0; k < kDirections; ++k) {
      const Real angle = kPi * k / kDirections;
      const Vec2 d(std::cos(angle), std::sin(angle));
      slope[k] += std::pow(at.gradient.dot(d), 2);
      // A tenth of the points serve: these cost a value each.
      if (i % 10 == 0)
        for (int a = 0; a < 3; ++a) difference[a][k] += std::pow(triangle_noise(p + apart[a] * d, 1) - at.value, 2);
    }
  }
  mean /= static_cast<Real>(n);
  const Real deviation = std::sqrt(squares / static_cast<Real>(n) - mean * mean);
  EXPECT_NEAR(mean, 0, 0.01);
  EXPECT_NEAR(deviation, triangle_noise_constants::kDeviation, 0.005);
  EXPECT_GT(largest, 1.0) << "the bound in the header is not far off";
  const auto spread = [](const std::vector<Real>& v) {
    const auto [low, high] = std::minmax_element(v.begin(), v.end());
    Real sum = 0;
    for (const Real x : v) sum += x;
    return (*high - *low) / (sum / static_cast<Real>(v.size()));
  };
  RecordProperty("slope_spread", std::to_string(spread(slope)));
  EXPECT_LT(spread(slope), 0.05);
  for (int a = 0; a < 3; ++a) EXPECT_LT(spread(difference[a]), 0.05) << apart[a];
}

TEST(TriangleNoise, OctavesHaveDeviationOneAndAddDetail) {
  for (const int octaves : {1, 3, 5}) {
    Real squares = 0, slopes = 0;
    const std::uint64_t n = 20000;
    for (std::uint64_t i = 0; i < n; ++i) {
      const TriangleSample at = triangle_octaves(anywhere(i), 4, octaves, 0.6);
      squares += at.value * at.value;
      slopes += at.gradient.squaredNorm();
    }
    EXPECT_NEAR(std::sqrt(squares / static_cast<Real>(n)), 1, 0.03) << octaves;
    EXPECT_GT(std::sqrt(slopes / static_cast<Real>(n)), 1.5 * octaves) << octaves;
  }
}

TEST(TriangleNoise, SeedsDifferAndFarPointsAreFinite) {
  EXPECT_NE(triangle_noise(Vec2(0.3, 0.4), 1), triangle_noise(Vec2(0.3, 0.4), 2));
  EXPECT_TRUE(std::isfinite(triangle_noise(Vec2(1e12, -1e12), 1)));
  EXPECT_EQ(triangle_noise(Vec2(1e300, 0), 1), 0);
  EXPECT_EQ(triangle_noise(Vec2(std::nan(""), 0), 1), 0);
}

}  // namespace
}  // namespace effuse::skin
