#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/random.h"
#include "geometry/mesh/validate.h"
#include "geometry/procedural/noise.h"
#include "geometry/procedural/primitives.h"

namespace effuse::geometry {
namespace {

Vec3 random_point(std::uint64_t k, Real size) {
  return size * Vec3(random_uniform(1, 0, k) - 0.5, random_uniform(1, 1, k) - 0.5, random_uniform(1, 2, k) - 0.5);
}

TEST(Primitives, VerticesLieOnTheirShapes) {
  for (const Vec3& x : make_sphere({1, 2, 3}, 4, 2).positions) EXPECT_NEAR((x - Vec3(1, 2, 3)).norm(), 4, 1e-14);
  for (const Vec3& x : make_torus({1, 2, 3}, 5, 2, 11, 7).positions) {
    const Vec3 y = x - Vec3(1, 2, 3);
    EXPECT_NEAR(std::hypot(std::hypot(y.x(), y.y()) - 5, y.z()), 2, 1e-14);
  }
  EXPECT_EQ(make_sphere({0, 0, 0}, 1, 2).triangles.size(), 320u);
  EXPECT_EQ(make_grid({0, 0, 0}, {1, 1}, 3, 2).triangles.size(), 12u);
}

TEST(Primitives, AppendKeepsOnlyAttributesOfBoth) {
  TriMesh a = make_box({0, 0, 0}, {1, 1, 1}), b = make_box({2, 0, 0}, {3, 1, 1});
  a.attributes["crust"] = {1, std::vector<float>(8, 0)};
  a.attributes["age"] = {1, std::vector<float>(8, 0)};
  b.attributes["crust"] = {1, std::vector<float>(8, 1)};
  append(a, b);
  EXPECT_NO_THROW(validate(a));
  EXPECT_EQ(a.attributes.size(), 1u);
  EXPECT_EQ(validate(a).components, 2u);
}

class Noise : public testing::TestWithParam<Real> {};  // distance from the origin

TEST_P(Noise, GradientIsTheDerivative) {
  const Real step = 1e-4;
  for (std::uint64_t k = 0; k < 500; ++k) {
    const Vec3 p = Vec3(GetParam(), -GetParam(), 0.5 * GetParam()) + random_point(k, 20);
    for (const bool fractal : {false, true}) {
      const FractalOptions options{3, 2.1, 0.6, 1.7};
      const auto f = [&](const Vec3& x) { return fractal ? fractal_noise(x, 5, options) : gradient_noise_sample(x, 5); };
      const NoiseSample sample = f(p);
      for (int axis = 0; axis < 3; ++axis) {
        const Vec3 d = step * Vec3::Unit(axis);
        const Real slope = (f(p + d).value - f(p - d).value) / ((p + d)[axis] - (p - d)[axis]);
        // Third derivatives of some hundreds times step^2 / 6, and rounding of the scaled coordinates over the step.
        EXPECT_NEAR(sample.gradient[axis], slope, 2e-5 + 2e-11 * GetParam()) << p.transpose();
      }
    }
  }
}

TEST_P(Noise, StaysInItsRangeWithTheSameSpreadEverywhere) {
  Real sum = 0, sum2 = 0, largest = 0;
  constexpr int n = 40000;
  for (std::uint64_t k = 0; k < n; ++k) {
    const Real v = gradient_noise(Vec3(GetParam(), -GetParam(), 0.5 * GetParam()) + random_point(k, 60), 9);
    sum += v, sum2 += v * v, largest = std::max(largest, std::abs(v));
  }
  EXPECT_NEAR(sum / n, 0, 0.01);
  EXPECT_NEAR(std::sqrt(sum2 / n), 0.28, 0.02);
  EXPECT_GT(largest, 0.75);
  EXPECT_LE(largest, 1.04);
}
INSTANTIATE_TEST_SUITE_P(Origins, Noise, testing::Values(0.0, 1e5, 6.5e6));

TEST(NoiseField, FirstAndSecondDerivativesAreContinuousAcrossTheLattice) {
  // Slope of the gradient on both sides of lattice planes.
  for (std::uint64_t k = 0; k < 200; ++k) {
    Vec3 p = random_point(k, 20);
    const int axis = static_cast<int>(k % 3);
    p[axis] = std::round(p[axis]);
    const Vec3 d = 1e-5 * Vec3::Unit(axis);
    const Vec3 here = gradient_noise_sample(p, 2).gradient;
    const Vec3 after = (gradient_noise_sample(p + d, 2).gradient - here) / 1e-5, before = (here - gradient_noise_sample(p - d, 2).gradient) / 1e-5;
    EXPECT_LT((after - before).norm(), 0.02) << "third derivatives of about 100 times the step are allowed";
  }
}

TEST(NoiseField, IsZeroAtLatticePointsAndDiffersBySeed) {
  EXPECT_EQ(gradient_noise({3, -4, 5}, 1), 0);
  int equal = 0;
  for (std::uint64_t k = 0; k < 100; ++k) equal += gradient_noise(random_point(k, 10), 1) == gradient_noise(random_point(k, 10), 2);
  EXPECT_LT(equal, 3);
}

TEST(NoiseField, HasNoPeriodNorMirrorNearTheOrigin) {
  Real shifted = 0, mirrored = 0;
  constexpr int n = 4000;
  for (std::uint64_t k = 0; k < n; ++k) {
    const Vec3 p = random_point(k, 20);
    shifted += gradient_noise(p, 1) * gradient_noise(p + Vec3(256, 0, 0), 1);
    mirrored += gradient_noise(p, 1) * gradient_noise(-p, 1);
  }
  EXPECT_LT(std::abs(shifted / n), 0.08 * 0.1);
  EXPECT_LT(std::abs(mirrored / n), 0.08 * 0.1);
}

TEST(NoiseField, AtHugeOrBrokenCoordinatesIsZeroNotACrash) {
  EXPECT_EQ(gradient_noise({1e300, 0, 0}, 1), 0);
  EXPECT_EQ(gradient_noise({std::nan(""), 0, 0}, 1), 0);
}

}  // namespace
}  // namespace effuse::geometry
