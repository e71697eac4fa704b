#include "flow/particles/emitter.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "geometry/base/error.h"
#include "geometry/procedural/primitives.h"

namespace effuse::flow::particles {
namespace {

/// Chi-squared over bins expected to be equally full, less its mean and over its deviation: normal, nearly.
template <std::size_t N>
Real surprise(const std::array<int, N>& bins) {
  Real all = 0, chi2 = 0;
  for (const int b : bins) all += b;
  for (const int b : bins) chi2 += (b - all / N) * (b - all / N) / (all / N);
  return (chi2 - (N - 1)) / std::sqrt(2.0 * (N - 1));
}

constexpr int kDraws = 20000;
constexpr Real kMost = 4;  // deviations; the seed is fixed

template <std::size_t N>
std::size_t bin(Real u) {
  return std::min(N - 1, static_cast<std::size_t>(u * N));
}

TEST(Emitter, DirectionsAreUniformOverTheCone) {
  EmitterOptions o;
  o.direction = Vec3(1, 2, -1);
  o.spread = 0.7;
  const Emitter emitter(o);
  const Vec3 axis = o.direction.normalized(), side = axis.unitOrthogonal();
  std::array<int, 20> height{}, turn{};
  for (std::uint64_t k = 0; k < kDraws; ++k) {
    const Vec3 d = emitter.particle(k).v;
    ASSERT_NEAR(d.norm(), 1, 1e-12);
    const Real c = d.dot(axis);
    ASSERT_GE(c, std::cos(0.7) - 1e-12);
    ++height[bin<20>((1 - c) / (1 - std::cos(0.7)))];
    ++turn[bin<20>((std::atan2(d.dot(axis.cross(side)), d.dot(side)) + kPi) / (2 * kPi))];
  }
  EXPECT_LT(surprise(height), kMost);
  EXPECT_LT(surprise(turn), kMost);
}

TEST(Emitter, PointsAreUniformOverDiskMeshAndCurve) {
  EmitterOptions o;
  o.shape = EmitterShape::kDisk;
  o.radius = 2;
  o.at = Vec3(1, 1, 1);
  std::array<int, 20> rings{};
  for (std::uint64_t k = 0; k < kDraws; ++k) {
    const Vec3 d = Emitter(o).particle(k).x - o.at;
    ASSERT_NEAR(d.z(), 0, 1e-12);
    ++rings[bin<20>(d.squaredNorm() / 4)];
  }
  EXPECT_LT(surprise(rings), kMost);

  // A box of three different sides: a share of its surface each. Speeds leave along the faces' normals.
  o.shape = EmitterShape::kMesh;
  o.mesh = geometry::make_box(Vec3::Zero(), Vec3(1, 2, 3));
  const Emitter box(o);
  Real share[3] = {};
  for (std::uint64_t k = 0; k < kDraws; ++k) {
    const Newborn p = box.particle(k);
    for (int a = 0; a < 3; ++a)
      if (std::abs(std::abs(p.v[a]) - 1) < 1e-9) {
        share[a] += 1.0 / kDraws;
        EXPECT_NEAR(p.x[a], p.v[a] > 0 ? a + 1 : 0, 1e-12);
      }
  }
  for (int a = 0; a < 3; ++a) {
    const Real expected = (6.0 / (a + 1)) / 11;  // 2 * 3, 1 * 3, 1 * 2 of 11
    EXPECT_NEAR(share[a], expected, 4 * std::sqrt(expected * (1 - expected) / kDraws));
  }

  o.shape = EmitterShape::kCurve;
  o.curve = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(1, 3, 0)};
  const Emitter curve(o);
  std::array<int, 20> along{};
  for (std::uint64_t k = 0; k < kDraws; ++k) {
    const Vec3 x = curve.particle(k).x;
    ++along[bin<20>((x.x() + x.y()) / 4)];
  }
  EXPECT_LT(surprise(along), kMost);
}

TEST(Emitter, BirthsAreEvenlySpacedWhileItIsOpen) {
  EmitterOptions o;
  o.rate = 10;
  o.start = 1;
  o.stop = 3;
  const Emitter emitter(o);
  EXPECT_EQ(emitter.born_by(0.9), 0u);
  EXPECT_EQ(emitter.born_by(2), 10u);
  EXPECT_EQ(emitter.born_by(99), 20u);
  for (std::uint64_t k = 0; k < 20; ++k) EXPECT_NEAR(emitter.particle(k).born, 1 + 0.1 * static_cast<Real>(k), 1e-12);
}

TEST(Emitter, MomentsAreThoseAskedFor) {
  EmitterOptions o;
  o.size = 0.1;
  o.size_spread = 0.2;
  const Emitter emitter(o);
  Real sum = 0, squares = 0;
  for (std::uint64_t k = 0; k < kDraws; ++k) {
    const Real s = emitter.particle(k).size;
    sum += s;
    squares += s * s;
  }
  const Real mean = sum / kDraws;
  EXPECT_NEAR(mean, 0.1, 1e-3);
  EXPECT_NEAR(std::sqrt(squares / kDraws - mean * mean), 0.02, 1e-3);
}

TEST(Emitter, RefusesWhatCannotBe) {
  EmitterOptions o;
  o.rate = -1;
  EXPECT_THROW(Emitter{o}, InputError);
  o = {};
  o.direction = Vec3::Zero();
  EXPECT_THROW(Emitter{o}, InputError);
  o = {};
  o.shape = EmitterShape::kMesh;
  EXPECT_THROW(Emitter{o}, InputError);
  o.shape = EmitterShape::kCurve;
  o.curve = {Vec3::Zero()};
  EXPECT_THROW(Emitter{o}, InputError);
}

}  // namespace
}  // namespace effuse::flow::particles
