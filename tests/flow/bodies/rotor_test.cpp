#include "flow/bodies/rotor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "flow/reference/rigid_motion.h"
#include "geometry/motion/pose_track.h"

namespace effuse::flow::bodies {
namespace {

const Vec3 kMoments(1, 2, 3.5);
const Vec3 kSpin(1, 2, 0.5);

/// Error of the body-frame angular velocity at time 2 against Euler's solution.
Real error_at_two(RotorScheme scheme, int steps) {
  const reference::FreeTop top{kMoments, kSpin};
  Quat q = Quat::Identity();
  const Vec3 L = kMoments.cwiseProduct(kSpin);
  for (int k = 0; k < steps; ++k) q = turn_freely(scheme, q, L, kMoments, 2.0 / steps);
  return (q.conjugate() * angular_velocity(q, L, kMoments) - top.spin(2)).norm();
}

struct Claim {
  RotorScheme scheme;
  Real order;
};
class RotorOrder : public testing::TestWithParam<Claim> {};

TEST_P(RotorOrder, HalvingTheStepDividesTheErrorByTwoToTheOrder) {
  const auto [scheme, order] = GetParam();
  const Real coarse = error_at_two(scheme, 200), fine = error_at_two(scheme, 400);
  ASSERT_GT(fine, 1e-13) << "below rounding, the slope means nothing";
  EXPECT_NEAR(std::log2(coarse / fine), order, 0.1) << coarse << " -> " << fine;
}
INSTANTIATE_TEST_SUITE_P(All, RotorOrder,
                         testing::Values(Claim{RotorScheme::kSplitting, 2}, Claim{RotorScheme::kMidpoint, 2}, Claim{RotorScheme::kRk4, 4},
                                         Claim{RotorScheme::kSymplecticEuler, 1}));

/// Largest relative change of energy over Dzhanibekov's turns about the middle axis.
Real energy_drift(RotorScheme scheme, Real dt, int turns) {
  const Vec3 spin(0.01, 5, 0.01), L = kMoments.cwiseProduct(spin);
  const Real E0 = L.dot(spin) / 2;
  Quat q = Quat::Identity();
  Real worst = 0;
  for (int k = 0; k < turns * 2 * kPi / 5 / dt; ++k) {
    q = turn_freely(scheme, q, L, kMoments, dt);
    worst = std::max(worst, std::abs(L.dot(angular_velocity(q, L, kMoments)) / 2 / E0 - 1));
  }
  EXPECT_NEAR(q.norm(), 1, 1e-14);
  return worst;
}

TEST(Rotor, KeepsEnergyOverAThousandTurnsOfDzhanibekovsBody) {
  EXPECT_LT(energy_drift(RotorScheme::kSplitting, 1.0 / 480, 1000), 1e-5);
  EXPECT_LT(energy_drift(RotorScheme::kMidpoint, 1.0 / 480, 100), 1e-4);
  EXPECT_LT(energy_drift(RotorScheme::kRk4, 1.0 / 480, 100), 1e-6);
  // Ten times as fast as the step is meant for: wavers, and does not drift away.
  EXPECT_LT(energy_drift(RotorScheme::kSplitting, 1.0 / 48, 1000), 1e-2);
  EXPECT_LT(energy_drift(RotorScheme::kMidpoint, 1.0 / 48, 1000), 1e-2);
}

TEST(Rotor, ExplicitEulerGainsEnergyWhichIsWhyItIsNotTheDefault) {
  EXPECT_GT(energy_drift(RotorScheme::kSymplecticEuler, 1.0 / 480, 100), 1e-2);
}

TEST(Rotor, TurnsABodyOfEqualMomentsSteadily) {
  for (const RotorScheme scheme : {RotorScheme::kSplitting, RotorScheme::kMidpoint, RotorScheme::kRk4, RotorScheme::kSymplecticEuler}) {
    Quat q = Quat::Identity();
    const Vec3 w(0.3, -0.2, 0.5), I = Vec3::Constant(2);
    for (int k = 0; k < 100; ++k) q = turn_freely(scheme, q, 2 * w, I, 0.01);
    // Splitting turns about three axes in turn: exact to its order only.
    EXPECT_LT(q.angularDistance(geometry::rotation_by(w)), 1e-5) << static_cast<int>(scheme);
  }
}

TEST(Rotor, TheMidpointTakesTurnsOfARadianAStep) {
  const Vec3 L(1, 20, 3);
  const Quat q = turn_freely(RotorScheme::kMidpoint, Quat::Identity(), L, kMoments, 0.1);
  // Back again by the reverse step: the scheme is its own adjoint.
  EXPECT_LT(turn_freely(RotorScheme::kMidpoint, q, L, kMoments, -0.1).angularDistance(Quat::Identity()), 1e-12);
}

TEST(Rotation, OfAVectorTurnsAboutItByItsLength) {
  for (const Real angle : {1e-12, 1e-5, 1e-3, 0.5, 3.0, 10.0}) {
    const Vec3 axis = Vec3(1, -2, 2) / 3;
    EXPECT_LT((geometry::rotation_by(angle * axis).coeffs() - Quat(Eigen::AngleAxisd(angle, axis)).coeffs()).norm(), 1e-15) << angle;
  }
}

}  // namespace
}  // namespace effuse::flow::bodies
