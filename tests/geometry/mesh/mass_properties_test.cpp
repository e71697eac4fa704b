#include "geometry/mesh/mass_properties.h"

#include <gtest/gtest.h>

#include "geometry/base/random.h"
#include "geometry/procedural/primitives.h"

namespace effuse::geometry {
namespace {

Quat random_rotation(std::uint64_t k) {
  return Quat(random_normal(1, 0, k), random_normal(1, 1, k), random_normal(1, 2, k), random_normal(1, 3, k)).normalized();
}

TEST(MassProperties, OfABoxAreThoseOfTheFormula) {
  const Vec3 low(-1, 2, 3), high(1, 5, 3.5), size = high - low;
  const MassProperties m = mass_properties(make_box(low, high));
  const Real V = size.prod();
  EXPECT_NEAR(m.volume, V, 1e-14 * V);
  EXPECT_LT((m.centre - (low + high) / 2).norm(), 1e-14 * high.norm());
  const Vec3 squares = size.cwiseAbs2();
  const Mat3 exact = (V / 12 * (Vec3::Constant(squares.sum()) - squares)).asDiagonal();
  EXPECT_LT((m.inertia - exact).norm(), 1e-13 * exact.norm());
}

TEST(MassProperties, OfATetrahedronWithAHoleInItAreThoseOfTheTwoApart) {
  // Sums of solids: a big box less a small one, whose mesh faces inward.
  TriMesh hollow = make_box(Vec3(0, 0, 0), Vec3(4, 4, 4)), hole = make_box(Vec3(1, 1, 1), Vec3(2, 3, 2));
  for (Triangle& t : hole.triangles) std::swap(t[1], t[2]);
  append(hollow, hole);
  const MassProperties m = mass_properties(hollow);
  EXPECT_NEAR(m.volume, 62, 1e-12);
  EXPECT_LT((m.centre - (64 * Vec3(2, 2, 2) - 2 * Vec3(1.5, 2, 1.5)) / 62).norm(), 1e-13);
}

TEST(MassProperties, OfASphereOfManyTrianglesComeNearTheSphere) {
  // Flat triangles fall short of the sphere by a share of volume that is divided by four with each subdivision (0.55 / 4^5 here);
  // of inertia by five thirds of that.
  const MassProperties m = mass_properties(make_sphere(Vec3(1, -2, 3), 0.5, 5));
  const Real V = 4 * kPi / 3 * 0.125, I = 0.4 * V * 0.25;
  EXPECT_NEAR(m.volume / V, 1, 0.6 / 1024);
  EXPECT_LT((m.inertia / I - Mat3::Identity()).norm(), 5.0 / 3 * std::sqrt(3) * 0.6 / 1024);
}

TEST(MassProperties, TurnAndMoveWithTheMesh) {
  const TriMesh torus = make_torus(Vec3(0, 0, 0), 2, 0.5, 24, 12);
  const MassProperties before = mass_properties(torus);
  for (std::uint64_t k = 0; k < 20; ++k) {
    const Quat q = random_rotation(k);
    const Vec3 shift = 1e5 * Vec3(random_normal(2, 0, k), random_normal(2, 1, k), random_normal(2, 2, k));
    TriMesh moved = torus;
    for (Vec3& p : moved.positions) p = q * p + shift;
    const MassProperties after = mass_properties(moved);
    // Coordinates of 1e5 are rounded to 1.5e-11.
    EXPECT_NEAR(after.volume, before.volume, 1e-9 * before.volume);
    EXPECT_LT((after.centre - (q * before.centre + shift)).norm(), 1e-9);
    const Mat3 R = q.toRotationMatrix();
    EXPECT_LT((after.inertia - R * before.inertia * R.transpose()).norm(), 1e-9 * before.inertia.norm());
  }
}

TEST(MassProperties, InwardFacingMeshesHaveNegativeVolumeAndEmptyOnesNone) {
  TriMesh box = make_box(Vec3(0, 0, 0), Vec3(1, 2, 3));
  for (Triangle& t : box.triangles) std::swap(t[1], t[2]);
  EXPECT_NEAR(mass_properties(box).volume, -6, 1e-13);
  EXPECT_EQ(mass_properties(TriMesh{}).volume, 0);
}

TEST(PrincipalAxes, TakeTheTensorApart) {
  for (std::uint64_t k = 0; k < 100; ++k) {
    const Vec3 moments(1 + random_uniform(3, 0, k), 2 + random_uniform(3, 1, k), k % 3 ? 3 + random_uniform(3, 2, k) : 1);
    const Mat3 R = random_rotation(100 + k).toRotationMatrix();
    const Mat3 I = R * moments.asDiagonal() * R.transpose();
    const PrincipalAxes axes = principal_axes(I);
    const Mat3 A = axes.axes.toRotationMatrix();
    EXPECT_LT((A * axes.moments.asDiagonal() * A.transpose() - I).norm(), 1e-13 * I.norm());
    EXPECT_LE(axes.moments[0], axes.moments[1]);
    EXPECT_LE(axes.moments[1], axes.moments[2]);
    EXPECT_NEAR(axes.axes.norm(), 1, 1e-15);
  }
}

}  // namespace
}  // namespace effuse::geometry
