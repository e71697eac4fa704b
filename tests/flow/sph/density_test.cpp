#include "flow/sph/density.h"

#include <gtest/gtest.h>

#include <cmath>

#include "flow/sph/viscosity.h"
#include "tests/flow/sph/sample_system.h"

namespace effuse::flow::sph {
namespace {

FlowShape shape_of(SampleSystem& s) {
  FlowShape shape;
  find_shape(s.system(), s.lattice, s.film, s.walls, shape);
  return shape;
}

/// A film on a plane, endless in x and y.
SampleSystem film(int layers, Real jitter, Real supports = 3, Real dx = 0.5) {
  SampleSystem s(lattice_block(8, 8, layers, dx, jitter), dx, supports);
  s.period = Vec2(8 * dx, 8 * dx);
  s.solids = {plane_solid(Vec3::Zero(), Vec3::UnitZ())};
  s.find();
  return s;
}

TEST(LatticeSum, IsNearOneAndExactlyWhatALatticeAddsUp) {
  for (const KernelKind kernel : {KernelKind::kWendlandC2, KernelKind::kCubicSpline}) {
    SampleSystem s(lattice_block(8, 8, 8, 0.5), 0.5, 2.6, kernel);
    EXPECT_NEAR(s.lattice, 1, 0.03);
    const FlowShape shape = shape_of(s);
    EXPECT_NEAR(shape.density[8 * 8 * 4 + 8 * 4 + 4], 1, 1e-12) << "an inner particle";
  }
}

class FilmShape : public testing::TestWithParam<std::tuple<int, Real>> {};

TEST_P(FilmShape, ALatticeOnThePlaneHasDensityOneUpToItsSurface) {
  const auto [layers, supports] = GetParam();
  SampleSystem s = film(layers, 0, supports);
  const FlowShape shape = shape_of(s);
  for (std::size_t i = 0; i < s.size(); ++i) EXPECT_NEAR(shape.density[i], 1, 1e-3) << "z " << s.x[i].z();
}

TEST_P(FilmShape, FindsTheTopLayerAndItsAreaAndThatOfTheGround) {
  const auto [layers, supports] = GetParam();
  SampleSystem s = film(layers, 0, supports);
  const FlowShape shape = shape_of(s);
  Real exposed = 0, grounded = 0;
  for (std::size_t i = 0; i < s.size(); ++i) {
    exposed += shape.exposed[i];
    grounded += shape.grounded[i];
    EXPECT_EQ(shape.surface[i] != 0, s.x[i].z() > (layers - 1) * s.dx) << "z " << s.x[i].z();
    EXPECT_NEAR(shape.off[i], std::min(layers * s.dx - s.x[i].z(), s.support - 0.5 * s.dx), s.x[i].z() > layers * s.dx - s.support + 0.5 * s.dx ? 1e-3 * s.dx : s.dx);
  }
  const Real area = s.period.x() * s.period.y();
  EXPECT_NEAR(exposed, area, 0.01 * area);
  EXPECT_NEAR(grounded, area, 0.01 * area);
}

TEST_P(FilmShape, GivesItsWallsTheFrictionOfItsDepth) {
  const auto [layers, supports] = GetParam();
  SampleSystem s = film(layers, 0, supports);
  shape_of(s);
  // Told by neighbours near the surface: those must be within sight.
  for (std::size_t i = 0; i < s.size(); ++i) {
    if (s.x[i].z() + s.support < (layers - 0.4) * s.dx) continue;
    for (const Wall& wall : s.walls[i]) EXPECT_NEAR(wall.friction, s.film.film(layers * s.dx), 2e-3) << s.x[i].z();
  }
}

// On an obstacle lava above that has no wall in reach sees the surface for them.
TEST(FilmShapeOfMiddlingDepth, TellsTheDepthToThoseWhoSeeNoSurface) {
  for (const int layers : {5, 6}) {
    SampleSystem s = film(layers, 0, 3);
    for (Wall& wall : s.walls.walls) wall.mirrors = true;
    shape_of(s);
    for (const Wall& wall : s.walls.walls) EXPECT_NEAR(wall.friction, s.film.film(layers * s.dx), 2e-3) << layers;
  }
}

INSTANTIATE_TEST_SUITE_P(Films, FilmShape, testing::Combine(testing::Values(1, 2, 3, 4, 7), testing::Values(3.0, 2.6)));

/// Integral of the kernel over what lies behind a plane at d1 or behind another at d2, normals `angle` apart; midpoint rule.
Real behind_either(const WendlandC2& W, Real d1, Real d2, Real angle) {
  constexpr int kCells = 48;
  const Real h = W.support / kCells;
  const Vec3 n1 = Vec3::UnitZ(), n2(std::sin(angle), 0, std::cos(angle));
  Real sum = 0;
  for (int i = -kCells; i < kCells; ++i)
    for (int j = 0; j < kCells; ++j)  // the other half is the same
      for (int k = -kCells; k < kCells; ++k) {
        const Vec3 p = h * Vec3(i + 0.5, j + 0.5, k + 0.5);
        if (p.squaredNorm() < W.support * W.support && (p.dot(n1) < -d1 || p.dot(n2) < -d2)) sum += 2 * h * h * h * W.W(p.norm());
      }
  return sum;
}

TEST(TrimWalls, CountWhatLiesBehindTwoWallsOnce) {
  const WendlandC2 W(3);
  const BoundaryTable table(W, 0.15);  // so fine that its layers are an integral
  Real worst_without = 0;
  for (const Real angle : {30.0, 60.0, 90.0, 120.0, 150.0})
    for (const auto& [d1, d2] : {std::pair{0.25, 0.25}, {0.5, 0.5}, {0.25, 1.0}, {0.5, 1.5}, {1.0, 1.0}}) {
      Walls walls{{0, 2}, {{}, {}}};
      const Real a = angle * kPi / 180;
      walls.walls[0].normal = Vec3(std::sin(a), 0, std::cos(a));
      walls.walls[0].distance = walls.walls[0].reach = d2;
      walls.walls[1].distance = walls.walls[1].reach = d1;
      const Real exact = behind_either(W, d1, d2, a), before = table.at(d1).gamma + table.at(d2).gamma;
      trim_walls(table, walls);
      EXPECT_NEAR(table.at(walls.walls[0]).gamma + table.at(walls.walls[1]).gamma, exact, 0.04) << angle << " deg, " << d1 << " and " << d2;
      // The gradient is that of the sum: by how it changes when the walls come nearer.
      for (const std::size_t k : {0u, 1u}) {
        const Real e = 1e-3;
        const auto sum = [&](Real off) {
          Walls moved{{0, 2}, {{}, {}}};
          moved.walls[0].normal = walls.walls[0].normal;
          moved.walls[0].distance = d2 + (k == 0 ? off : 0);
          moved.walls[1].distance = d1 + (k == 1 ? off : 0);
          trim_walls(table, moved);
          return table.at(moved.walls[0]).gamma + table.at(moved.walls[1]).gamma;
        };
        if (d1 != d2) {
          EXPECT_NEAR(table.at(walls.walls[k]).slope, (sum(e) - sum(-e)) / (2 * e), 2e-3);
        }
      }
      worst_without = std::max(worst_without, std::abs(before - exact));
    }
  EXPECT_GT(worst_without, 0.15) << "the test tells nothing";
}

TEST(TrimWalls, OfOnePlaneCountOnceAndOfTwoFacesTwice) {
  const Real dx = 0.5;
  SampleSystem s(lattice_block(8, 8, 3, dx), dx, 3);
  s.period = Vec2(8 * dx, 8 * dx);
  s.solids = {plane_solid(Vec3::Zero(), Vec3::UnitZ())};
  s.find();
  const std::vector<Real> once = shape_of(s).density;
  s.solids.push_back(s.solids.front());
  s.find();
  trim_walls(s.table, s.walls);
  const std::vector<Real> doubled = shape_of(s).density;
  for (std::size_t i = 0; i < s.size(); ++i) EXPECT_NEAR(doubled[i], once[i], 1e-4);
  s.solids.back() = plane_solid(Vec3(0, 0, 3 * dx), -Vec3::UnitZ());
  s.find();
  trim_walls(s.table, s.walls);
  for (const Real d : shape_of(s).density) EXPECT_NEAR(d, 1, 2e-3) << "a gap, full";
}

TEST(FlowShape, DisorderedFilmsKeepTheirDensityAndTheirAreas) {
  // 10 % jitter: each density within 8 %, their mean within 1 %, areas within 5 %.
  for (const int layers : {2, 4, 8}) {
    SampleSystem s = film(layers, 0.1);
    const FlowShape shape = shape_of(s);
    Real mean = 0, exposed = 0, grounded = 0, worst = 0;
    for (std::size_t i = 0; i < s.size(); ++i) {
      mean += shape.density[i] / static_cast<Real>(s.size());
      worst = std::max(worst, std::abs(shape.density[i] - 1));
      exposed += shape.exposed[i];
      grounded += shape.grounded[i];
    }
    const Real area = s.period.x() * s.period.y();
    EXPECT_NEAR(mean, 1, 0.01) << layers;
    EXPECT_LT(worst, 0.08) << layers;
    EXPECT_NEAR(exposed, area, 0.05 * area) << layers;
    EXPECT_NEAR(grounded, area, 0.05 * area) << layers;
  }
}

TEST(FlowShape, DropsAndSheetsShowTheirWholeSurface) {
  SampleSystem drop({Vec3::Zero()}, 0.5);
  FlowShape shape = shape_of(drop);
  EXPECT_NEAR(shape.exposed[0] / 0.25, std::cbrt(36 * kPi), 1e-6) << "a ball of the particle's volume";
  EXPECT_EQ(shape.surface[0], 1);
  EXPECT_EQ(shape.off[0], drop.support);

  SampleSystem sheet(lattice_block(8, 8, 1, 0.5), 0.5);
  sheet.period = Vec2(4, 4);
  sheet.find();
  shape = shape_of(sheet);
  for (std::size_t i = 0; i < sheet.size(); ++i) {
    EXPECT_NEAR(shape.exposed[i] / 0.25, 2, 1e-6) << "both faces";
    EXPECT_EQ(shape.surface[i], 1);
  }
}

TEST(FlowShape, InsideADisorderedBlockNextToNothingIsExposed) {
  SampleSystem s(lattice_block(6, 6, 12, 0.5, 0.1), 0.5);
  s.period = Vec2(3, 3);
  s.find();
  const FlowShape shape = shape_of(s);
  Real exposed = 0;
  int inner = 0;
  for (std::size_t i = 0; i < s.size(); ++i) {
    if (std::abs(s.x[i].z() - 3) > 1.2) continue;
    exposed += shape.exposed[i] / (s.dx * s.dx);
    EXPECT_EQ(shape.surface[i], 0);
    EXPECT_EQ(shape.grounded[i], 0);
    ++inner;
  }
  // The gradient of disorder is here and there as large as that of a surface 1.5 spacings off.
  EXPECT_LT(exposed, 1e-3 * inner);
}

class ShearRate : public testing::TestWithParam<Real> {
 protected:
  SampleSystem s{lattice_block(6, 6, 5, 0.3, GetParam()), 0.3};
  std::vector<Vec3> v = std::vector<Vec3>(s.size());
  std::vector<Real> rate = std::vector<Real>(s.size());
};

TEST_P(ShearRate, OfALinearFieldIsExactAtFreeSurfacesToo) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const std::vector<Vec3> draw = random_vectors(4, seed);
    Mat3 G;
    G << draw[0], draw[1], draw[2];
    for (std::size_t i = 0; i < s.size(); ++i) v[i] = G * s.x[i] + draw[3];
    shear_rate_squared(s.system(), 0, v, rate);
    const Mat3 D = (G + G.transpose()) / 2;
    for (const Real r : rate) EXPECT_NEAR(r, 2 * D.squaredNorm(), 1e-9 * D.squaredNorm());
  }
}

TEST_P(ShearRate, OfShearOverAWallIsExactWithSlipToo) {
  // Linear through zero at slip_length behind it. Nearer than a quarter of a spacing the drag takes the wall for further: not looked at.
  for (const Real slip : {0.0, 0.4}) {
    const Vec3 wall_speed(0.7, 0.1, 0);
    s.solids = {plane_solid(Vec3::Zero(), Vec3::UnitZ(), wall_speed)};
    s.find();
    for (std::size_t i = 0; i < s.size(); ++i) v[i] = wall_speed + Vec3(2 * (s.x[i].z() + slip), 0, 0);
    shear_rate_squared(s.system(), slip, v, rate);
    for (std::size_t i = 0; i < s.size(); ++i)
      if (s.x[i].z() > 0.25 * s.dx) {
        EXPECT_NEAR(std::sqrt(rate[i]), 2, 1e-6) << "z " << s.x[i].z() << " slip " << slip;
      }
  }
}

TEST_P(ShearRate, OfARigidRotationIsNothing) {
  for (std::size_t i = 0; i < s.size(); ++i) v[i] = Vec3(1, 2, 3) + Vec3(0.3, -0.5, 0.8).cross(s.x[i]);
  shear_rate_squared(s.system(), 0, v, rate);
  for (const Real r : rate) EXPECT_LT(r, 1e-22);
}
INSTANTIATE_TEST_SUITE_P(Jitter, ShearRate, testing::Values(0, 0.1, 0.3));

TEST(ShearRate, OfDropsPairsAndSheetsIsFinite) {
  for (const std::vector<Vec3>& x : {std::vector<Vec3>{Vec3::Zero()}, std::vector<Vec3>{Vec3::Zero(), Vec3(0.2, 0, 0)}, std::vector<Vec3>(3, Vec3::Zero()), lattice_block(4, 4, 1, 0.3)}) {
    const SampleSystem s(x, 0.3);
    std::vector<Vec3> v(x.size());
    std::vector<Real> rate(x.size());
    for (std::size_t i = 0; i < x.size(); ++i) v[i] = Vec3(1.5 * x[i].y(), 0, 0);
    shear_rate_squared(s.system(), 0, v, rate);
    for (const Real r : rate) {
      EXPECT_TRUE(std::isfinite(r));
      EXPECT_LE(r, 1.5 * 1.5 * (1 + 1e-9)) << "what they cannot tell is zero";
    }
  }
}

TEST(Dissipation, IsThePowerThatFrictionTakesFromTheMotionExactly) {
  // Random velocities, viscosities over nine orders; moving walls: seen from their own frame.
  for (const bool periodic : {false, true}) {
    for (const Real slip : {0.0, 0.2}) {
      SampleSystem s(lattice_block(7, 7, 5, 0.3, 0.2), 0.3);
      if (periodic) s.period = Vec2(2.1, 2.1);
      const Vec3 wall_speed(0.3, -0.2, 0);
      s.solids = {plane_solid(Vec3::Zero(), Vec3::UnitZ(), wall_speed)};
      if (!periodic) s.solids.push_back(plane_solid(Vec3(-0.1, 0, 0), Vec3(1, 0, 0.2).normalized(), wall_speed, 1));
      s.find();
      for (Wall& wall : s.walls.walls) wall.friction = 1.3;
      const Real rho = 2600;
      const std::vector<Vec3> v = random_vectors(s.size(), 5);
      std::vector<Real> mu(s.size()), heat(s.size());
      for (std::size_t i = 0; i < s.size(); ++i) mu[i] = std::pow(10.0, 9 * random_uniform(6, 0, i));
      std::vector<Vec3> a(s.size());
      viscous_acceleration(s.system(), rho, mu, slip, v, a);
      dissipation(s.system(), mu, slip, v, heat);
      Real taken = 0, gained = 0;
      for (std::size_t i = 0; i < s.size(); ++i) {
        EXPECT_GE(heat[i], 0);
        taken -= rho * (v[i] - wall_speed).dot(a[i]);
        gained += heat[i];
      }
      EXPECT_NEAR(taken, gained, 1e-12 * gained);
    }
  }
}

}  // namespace
}  // namespace effuse::flow::sph
