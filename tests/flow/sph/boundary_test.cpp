#include "flow/sph/boundary.h"

#include <gtest/gtest.h>

#include <cmath>

#include "flow/sph/viscosity.h"
#include "tests/flow/sph/sample_system.h"

namespace effuse::flow::sph {
namespace {

struct Case {
  KernelKind kernel;
  Real supports;  // support in spacings
};
void PrintTo(const Case& c, std::ostream* out) { *out << kKernelNames[static_cast<std::size_t>(c.kernel)] << " " << c.supports; }

constexpr Real kDx = 0.2;
constexpr Real kInterpolation = 1e-5;  // of the table's largest value: its docstring
constexpr Real kCusp = 5e-4;           // the same, of the spiky kernel where a layer passes the particle

class BoundaryTableTest : public testing::TestWithParam<Case> {
 protected:
  const Real support = GetParam().supports * kDx;
  const BoundaryTable table = SampleSystem::make_table(GetParam().kernel, support, kDx);
  const Real lattice = lattice_sum(GetParam().kernel, support, kDx);
};

TEST_P(BoundaryTableTest, ALatticeAgainstTheWallHasTheDensityOfALattice) {
  // Particles in layers at (k + 1/2) dx: what is missing below the wall, gamma(d), and what is there, gamma(-d).
  const Real error = GetParam().kernel == KernelKind::kSpiky ? kCusp : 2 * kInterpolation;
  for (int k = 0; (k + 0.5) * kDx < support; ++k) {
    const Real d = (k + 0.5) * kDx;
    EXPECT_NEAR(table.at(d).gamma + table.at(-d).gamma, lattice, error) << "layer " << k;
  }
  EXPECT_EQ(table.at(support).gamma, 0);
  EXPECT_EQ(table.at(1.5 * support).gamma, 0);
}

TEST_P(BoundaryTableTest, SlopeIsTheDerivativeOfGamma) {
  Real steepest = 0, error = 0;
  const Real h = support / 512;  // gamma is linear between nodes: differences over whole nodes
  for (int node = -511; node < 511; ++node) {
    const Real d = node * h;
    // The spiky kernel's cusp, when a layer passes the particle: no derivative there.
    const Real phase = d / kDx + 0.5 - std::round(d / kDx + 0.5);
    if (GetParam().kernel == KernelKind::kSpiky && d < 0 && std::abs(phase) * kDx < 3 * h) continue;
    steepest = std::max(steepest, std::abs(table.at(d).slope));
    error = std::max(error, std::abs((table.at(d + h).gamma - table.at(d - h).gamma) / (2 * h) - table.at(d).slope));
  }
  // Central differences are off by h^2/6 of the third derivative, some 1e2 / support^2 of the slope; of the spiky kernel, 1/|d| near its cusp.
  EXPECT_LT(error, (GetParam().kernel == KernelKind::kSpiky ? 5e-3 : 2e-4) * steepest);
}

TEST_P(BoundaryTableTest, MomentsAreThoseOfTheContinuum) {
  // Integrals over d of the drags, and the moments of the half-space, have closed forms.
  Real drag_t = 0, drag_n = 0;
  const int n = 4096;
  for (int k = 0; k < n; ++k) {
    const BoundaryTable::Row row = table.at((k + 0.5) * support / n);
    drag_t += row.drag_t * support / n;
    drag_n += row.drag_n * support / n;
  }
  EXPECT_NEAR(drag_t, 1, 2e-5);
  EXPECT_NEAR(drag_n, 3, 6e-5);
  EXPECT_NEAR(table.at(0).moment_n, 0.5, 1e-5);
  EXPECT_NEAR(table.at(0).moment_t, 0.5, 1e-5);
  EXPECT_EQ(table.at(-0.3 * support).drag_t, table.at(0).drag_t) << "inside: as at the wall";
}

TEST_P(BoundaryTableTest, DistanceOfSlopeFindsTheDistanceAgain) {
  // From support - dx/2 on not one layer is within reach.
  for (Real d = 0.02 * support; d < support - 0.6 * kDx; d += 0.03 * support)
    EXPECT_NEAR(table.distance_of_slope(-table.at(d).slope), d, 1e-6 * support);
  EXPECT_EQ(table.distance_of_slope(-1.01 * table.at(0).slope), 0);
  EXPECT_EQ(table.distance_of_slope(0), support);
}

INSTANTIATE_TEST_SUITE_P(Kernels, BoundaryTableTest,
                         testing::Values(Case{KernelKind::kWendlandC2, 3}, Case{KernelKind::kWendlandC2, 2.6}, Case{KernelKind::kWendlandC2, 2},
                                         Case{KernelKind::kCubicSpline, 3}, Case{KernelKind::kSpiky, 3}));

/// Kernel's integral over the part of the shells around the point that `share` of radius r gives.
template <class Share>
Real shells(const WendlandC2& W, Share&& share) {
  const int n = 4000;
  Real sum = 0;
  for (int k = 0; k < n; ++k) {
    const Real r = (k + 0.5) * W.support / n;
    sum += W.support / n * 4 * kPi * r * r * W.W(r) * share(r);
  }
  return sum;
}
/// A point at distance d outside a ball: share of the shell of radius r that lies in it.
Real share_in_ball(Real r, Real d, Real radius) {
  const Real c = (r * r + (radius + d) * (radius + d) - radius * radius) / (2 * r * (radius + d));
  return (1 - std::clamp(c, -1.0, 1.0)) / 2;
}
Real share_beyond_plane(Real r, Real d) { return (1 - std::clamp(d / r, -1.0, 1.0)) / 2; }
/// A point at distance d from the wall inside a hollow ball: share of the shell outside that.
Real share_out_of_ball(Real r, Real d, Real radius) {
  const Real off = radius - d;
  const Real c = (radius * radius - r * r - off * off) / (2 * r * off);
  return (1 - std::clamp(c, -1.0, 1.0)) / 2;
}

TEST(BoundaryTable, BendIsTheFirstOrderOfTheVolumeBelowCurvedGround) {
  const WendlandC2 W(1);
  const BoundaryTable table(W, 1.0 / 3);
  const Real R = 1e4;  // so flat that the first order is all: curvature c = 2 / R
  for (const Real d : {0.0, 0.1, 0.3, 0.5, 0.8}) {
    // From the difference of shares itself: both integrals agree to 1e-4.
    const Real change = shells(W, [&](Real r) { return share_in_ball(r, d, R) - share_beyond_plane(r, d); });
    EXPECT_NEAR(change, -2 / R * table.at(d).bend, 2e-3 * 2 / R * table.at(0).bend) << d;
  }
}

/// Ground of one kind, and the kernel's integral over it seen from distance d.
struct CurvedGround {
  const char* name;
  Real radius;           // [m], positive convex
  bool cylinder;
};
void PrintTo(const CurvedGround& g, std::ostream* out) { *out << g.name << " " << g.radius; }

Real volume_integral(const CurvedGround& g, const WendlandC2& W, Real d) {
  const Real R = std::abs(g.radius);
  if (!g.cylinder) return shells(W, [&](Real r) { return g.radius > 0 ? share_in_ball(r, d, R) : share_out_of_ball(r, d, R); });
  // Midpoint rule in a box; z down from the point.
  const int n = 120;
  const Real h = 2 * W.support / n;
  Real sum = 0;
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < n; ++k) {
      const Real x = -W.support + (i + 0.5) * h, z = -W.support + (k + 0.5) * h;
      const Real across = g.radius > 0 ? R - std::hypot(x, R + d - z) : std::hypot(x, R - d + z) - R;  // depth below the surface
      const Real share = std::clamp(across / h + 0.5, 0.0, 1.0);
      if (share == 0) continue;
      for (int j = 0; j < n; ++j) {
        const Real y = -W.support + (j + 0.5) * h;
        sum += share * h * h * h * W.W(std::sqrt(x * x + y * y + z * z));
      }
    }
  return sum;
}

class BendWalls : public testing::TestWithParam<CurvedGround> {};

TEST_P(BendWalls, MakesTheTableCountTheVolumeBelowCurvedGround) {
  const CurvedGround g = GetParam();
  const Real R = std::abs(g.radius), sign = g.radius > 0 ? 1 : -1;
  // Axis or centre below (convex) or above (concave) the origin, the ground's surface at z = 0 there. Four jittered layers on it.
  const Vec3 center(0, 0, -g.radius);
  const auto contact = [&](const Vec3& x) {
    Vec3 off = x - center;
    if (g.cylinder) off.y() = 0;
    const Vec3 normal = sign * off.normalized();
    const Real d = sign * (off.norm() - R);
    return geometry::Contact{Vec3(x - d * normal), normal, d, Vec3::Zero(), 0, 0};
  };
  const Real dx = 1;
  std::vector<Vec3> x;
  for (const Vec3& p : lattice_block(10, 10, 8, dx, 0.1)) {
    const Vec3 y = p - Vec3(5, 5, 4);
    if (const Real d = contact(y).distance; d > 0.4 * dx && d < 4 * dx) x.push_back(y);
  }
  SampleSystem s(x, dx);
  s.solids = {contact};
  s.find();
  std::vector<Real> kept;
  bend_walls(s.system(), s.walls, kept);

  const WendlandC2 W(s.support);
  Real plain = 0, bent = 0, curvature_error = 0;
  int count = 0;
  for (std::size_t i = 0; i < s.size(); ++i) {
    if (x[i].head<2>().norm() > 1.5 || s.walls[i].empty()) continue;
    const Wall& wall = s.walls[i][0];
    if (wall.reach > 2 * dx) continue;
    EXPECT_EQ(kept[s.walls.first[i]], wall.reach);
    // The table counts lattice layers: compare what the curve changes, in parts of a full density.
    const Real truth = volume_integral(g, W, wall.reach) - shells(W, [&](Real r) { return share_beyond_plane(r, wall.reach); });
    const Real counted = s.table.at(wall.distance).gamma - s.table.at(wall.reach).gamma;
    plain = std::max(plain, std::abs(truth));
    bent = std::max(bent, std::abs(truth - counted));
    curvature_error = std::max(curvature_error, std::abs(wall.curvature * g.radius / (g.cylinder ? 1 : 2) - 1));
    ++count;
  }
  ASSERT_GT(count, 5);
  // Of a cylinder, half of the squared feet should lie across its axis: of some thirty neighbours that is not quite so.
  EXPECT_LT(curvature_error, g.cylinder ? 0.3 : 0.05);
  EXPECT_LT(bent, 0.25 * plain) << "without correction " << plain << ", with " << bent;
}

INSTANTIATE_TEST_SUITE_P(Grounds, BendWalls,
                         testing::Values(CurvedGround{"hill", 8, false}, CurvedGround{"hill", 20, false}, CurvedGround{"bowl", -8, false}, CurvedGround{"bowl", -20, false},
                                         CurvedGround{"ridge", 8, true}, CurvedGround{"gully", -8, true}));

TEST(BendWallsOnPlanes, LeavesPlanesAloneEvenTwoThatMeet) {
  SampleSystem s(lattice_block(6, 6, 6, 1, 0.1), 1);
  s.solids = {plane_solid(Vec3::Zero(), Vec3::UnitZ()), plane_solid(Vec3::Zero(), Vec3::UnitX(), Vec3::Zero(), 1)};
  s.find();
  std::vector<Real> kept;
  bend_walls(s.system(), s.walls, kept);
  for (const Wall& wall : s.walls.walls) {
    EXPECT_NEAR(wall.distance, wall.reach, 1e-12);
    EXPECT_NEAR(wall.curvature, 0, 1e-12);
  }
}

/// What flows, pushed by `force`, between x = 0 and so many layers' height, steady: on a plane, or between two [m^2/s].
Real layered_flux(SampleSystem& s, int layers, Real nu, Real force, Real friction) {
  constexpr Real rho = 2600;
  s.period = Vec2(6 * s.dx, 6 * s.dx);
  s.find();
  for (Wall& wall : s.walls.walls) wall.friction = friction;
  // A step so long that nothing but the balance of force and friction is left.
  const Real dt = 1e8;
  const std::vector<Vec3> start(s.size(), Vec3(dt * force, 0, 0));
  std::vector<Vec3> v(s.size(), Vec3::Zero());
  const std::vector<Real> mu(s.size(), rho * nu);
  ViscositySolver solver;
  EXPECT_TRUE(solver.solve(s.system(), rho, mu, 0, dt, start, 1e-9, 1000, v).converged);
  Real flux = 0;
  for (const Vec3& u : v) flux += u.x() * layers * s.dx / static_cast<Real>(v.size());
  return flux;
}

class FilmFrictionTest : public testing::TestWithParam<int> {};

TEST_P(FilmFrictionTest, GivesAFilmOnALatticeTheExactFlux) {
  const int layers = GetParam();
  const Real dx = 0.5, nu = 2, force = 1.7, depth = layers * dx;
  SampleSystem s(lattice_block(6, 6, layers, dx), dx);
  s.solids = {plane_solid(Vec3::Zero(), Vec3::UnitZ())};
  const Real exact = force * std::pow(depth, 3) / (3 * nu);
  EXPECT_NEAR(layered_flux(s, layers, nu, force, s.film.film(depth)), exact, 1e-6 * exact);
}

TEST_P(FilmFrictionTest, GivesAChannelOnALatticeTheExactFlux) {
  const int layers = GetParam();
  const Real dx = 0.5, nu = 2, force = 1.7, width = layers * dx;
  SampleSystem s(lattice_block(6, 6, layers, dx), dx);
  s.solids = {plane_solid(Vec3::Zero(), Vec3::UnitZ()), plane_solid(Vec3(0, 0, width), -Vec3::UnitZ(), Vec3::Zero(), 1)};
  const Real exact = force * std::pow(width, 3) / (12 * nu);
  EXPECT_NEAR(layered_flux(s, layers, nu, force, s.film.channel(width)), exact, 1e-6 * exact);
}

INSTANTIATE_TEST_SUITE_P(Layers, FilmFrictionTest, testing::Values(1, 2, 3, 4, 5, 6, 10, 12));

TEST(FilmFrictionTest, IsLinearBetweenWholeLayersAndConstantOutside) {
  const BoundaryTable table(WendlandC2(1.5), 0.5);
  const FilmFriction film(table, 0.5);
  EXPECT_EQ(film.film(0.1), film.film(0.5));
  EXPECT_EQ(film.film(100), film.film(6));
  EXPECT_NEAR(film.film(0.75), (film.film(0.5) + film.film(1)) / 2, 1e-12);
  EXPECT_NEAR(film.film(0.5), 2, 0.3) << "one layer feels half of the friction: its docstring";
  EXPECT_NEAR(film.film(6), 1, 0.05) << "deep films need no help";
}

}  // namespace
}  // namespace effuse::flow::sph
