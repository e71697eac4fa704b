#include "flow/sph/kernel.h"

#include <gtest/gtest.h>

namespace effuse::flow::sph {
namespace {

template <class Kernel>
class KernelTest : public testing::Test {};
using Kernels = testing::Types<SpikyKernel, CubicSpline, WendlandC2>;
TYPED_TEST_SUITE(KernelTest, Kernels);

/// integral of f(r) 4 pi r^2 dr from 0 to the support, midpoint rule with 20,000 points.
template <class F>
Real radial_integral(Real support, F f) {
  const int n = 20000;
  Real sum = 0;
  for (int k = 0; k < n; ++k) {
    const Real r = support * (k + 0.5) / n;
    sum += f(r) * 4 * kPi * r * r * support / n;
  }
  return sum;
}

TYPED_TEST(KernelTest, IntegratesToOneAndHasTheSecondMomentItSays) {
  const TypeParam kernel(1.7);
  EXPECT_NEAR(radial_integral(1.7, [&](Real r) { return kernel.W(r); }), 1, 1e-7);
  EXPECT_NEAR(radial_integral(1.7, [&](Real r) { return kernel.W(r) * r * r / 3; }), kernel.second_moment(), 1e-7);
  EXPECT_EQ(kernel.W(1.7), 0);
  EXPECT_EQ(kernel.dW(1.71), 0);
}

TYPED_TEST(KernelTest, SlopeIsTheDerivative) {
  const TypeParam kernel(2.0);
  for (const Real r : {0.1, 0.5, 0.9, 1.1, 1.6, 1.95}) EXPECT_NEAR(kernel.dW(r), (kernel.W(r + 1e-6) - kernel.W(r - 1e-6)) / 2e-6, 1e-6) << r;
}

TYPED_TEST(KernelTest, HalfSpaceHoldsHalfAtTheParticleAndNothingBeyondTheSupport) {
  const TypeParam kernel(1.5);
  const HalfSpaceTable table(kernel);
  EXPECT_NEAR(table.gamma(0), 0.5, 1e-6);
  EXPECT_EQ(table.gamma(1.5), 0);
  EXPECT_NEAR(table.gamma(-1.5), 1, 1e-12);
  for (const Real d : {-0.9, -0.2, 0.1, 0.33, 0.75, 1.2}) {
    // Brute force over shells: the share of the sphere of radius r beyond the plane is (1 - d/r)/2.
    const Real truth = radial_integral(1.5, [&](Real r) { return kernel.W(r) * std::clamp((1 - d / r) / 2, 0.0, 1.0); });
    EXPECT_NEAR(table.gamma(d), truth, 2e-5) << d;
    EXPECT_NEAR(table.slope(d), (table.gamma(d + 0.01) - table.gamma(d - 0.01)) / 0.02, 2e-3) << d;
  }
}

TEST(CubicSplineTest, SumsToOneOnALatticeAtTwoSpacings) {
  const CubicSpline kernel(2);
  Real sum = 0;
  for (int x = -2; x <= 2; ++x)
    for (int y = -2; y <= 2; ++y)
      for (int z = -2; z <= 2; ++z) sum += kernel.W(Vec3(x, y, z).norm());
  EXPECT_NEAR(sum, 1, 1e-3);
}

}  // namespace
}  // namespace effuse::flow::sph
