#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

#include "flow/sph/modern_lava.h"
#include "geometry/procedural/primitives.h"
#include "tests/flow/sph/beside_solids.h"
#include "tests/flow/sph/sample_system.h"

/// Lava that meets walls, measured: what stays before them, how high it stands, where it goes, how much passes a gap, what heat
/// it gives them. Down the slope is +x, the slope's plane is z = 0, gravity is tilted.
namespace effuse::flow::sph {
namespace {

using geometry::CollisionMesh;
using geometry::Obstacles;
using geometry::RigidMotion;
using geometry::RigidPose;
using geometry::TriMesh;

constexpr Real kTan = 0.25;  // of the slope
constexpr Real kNu = 0.5;    // [m^2/s]
constexpr Real kDensity = 2600;
const Real kSlope = std::atan(kTan);

ModernOptions on_the_slope(Real spacing) {
  ModernOptions o = thick_lava(spacing, kNu * kDensity, 0.5 * spacing);
  o.density = kDensity;
  o.gravity = kGravity * Vec3(std::sin(kSlope), 0, -std::cos(kSlope));
  return o;
}

/// A wall across: its front is at x = 0, y from -half to half; thickness 0: a sheet.
TriMesh wall_mesh(Real half, Real thickness) {
  if (thickness > 0) return geometry::make_box(Vec3(0, -half, -1), Vec3(thickness, half, 9));
  TriMesh m;
  m.positions = {Vec3(0, -half, -1), Vec3(0, half, -1), Vec3(0, half, 9), Vec3(0, -half, 9)};
  m.triangles = {{0, 1, 2}, {0, 2, 3}};
  return m;
}

Vent fissure(Real x, Real from_y, Real to_y, Real width, Real rate) {
  Vent vent;
  vent.from = Vec3(x, from_y, 0);
  vent.to = Vec3(x, to_y, 0);
  vent.width = width;
  vent.rate = rate;
  vent.temperature = 1400;
  return vent;
}

/// Mass in = mass there + mass gone, to rounding, whatever was asked for: one particle a site.
void expect_mass_kept(const ModernLava& lava, Real volume, std::size_t sites) {
  EXPECT_NEAR(lava.mass_emitted(), lava.particle_mass() * static_cast<Real>(lava.size()) + lava.mass_left(), 1e-12 * lava.mass_emitted());
  EXPECT_NEAR(lava.mass_emitted(), kDensity * volume, lava.particle_mass() * static_cast<Real>(sites));
}

// ---- At right angles: a pond rises behind the wall.

/// Lubrication in the plane of the flow: h_t + (g h^3 / (3 nu) (sin - cos h_x))_x = source, a wall at x = length, by explicit finite
/// volumes. Depths of cells; from -2 m on.
struct Pond {
  static constexpr Real kCell = 0.1, kStart = -2;
  std::vector<Real> depth;
  Real mean(Real from, Real to) const {
    Real sum = 0;
    int n = 0;
    for (std::size_t i = 0; i < depth.size(); ++i)
      if (const Real x = kStart + (static_cast<Real>(i) + 0.5) * kCell; x > from && x < to) sum += depth[i], ++n;
    return sum / n;
  }
};
Pond fill_pond(Real length, Real source_from, Real source_to, Real flux, Real until) {
  Pond pond;
  pond.depth.assign(static_cast<std::size_t>(std::lround((length - Pond::kStart) / Pond::kCell)), 0.0);
  std::vector<Real>& h = pond.depth;
  std::vector<Real> q(h.size() + 1, 0.0);
  for (Real t = 0; t < until;) {
    const Real most = *std::max_element(h.begin(), h.end()) + 0.01;
    const Real dt = std::min({until - t, 0.01, 0.3 * Pond::kCell * Pond::kCell * kNu / (kGravity * most * most * most)});
    for (std::size_t i = 1; i < h.size(); ++i) {
      const Real drive = std::sin(kSlope) - std::cos(kSlope) * (h[i] - h[i - 1]) / Pond::kCell;
      // A level surface stays level: of the depth between; into dry cells from where it comes.
      const Real between = (h[i] + h[i - 1]) / 2, from = drive > 0 ? h[i - 1] : h[i];
      const Real cube = std::min(between * between * between, 4 * from * from * from);
      q[i] = kGravity * drive * cube / (3 * kNu);
    }
    for (std::size_t i = 0; i < h.size(); ++i) {
      const Real x = Pond::kStart + (static_cast<Real>(i) + 0.5) * Pond::kCell;
      h[i] += dt * ((q[i] - q[i + 1]) / Pond::kCell + (x > source_from && x < source_to ? flux / (source_to - source_from) : 0));
    }
    t += dt;
  }
  return pond;
}

struct RunUp {
  Real depth = 0;    ///< mean over the last metre before the wall [m]
  Real top = 0;      ///< of the highest particle there, and half a spacing [m]
  Real tilt = 0;     ///< of the pond's surface against the horizontal [rad]
  Real speed = 0;    ///< largest, anywhere, on the way [m/s]
};

constexpr Real kLength = 7, kFlux = 0.2;  // [m], [m^2/s]

/// A slice of a flow that is the same for all y.
RunUp run_up(Real dx, Real thickness, Real until) {
  const Real width = 6 * dx;
  ModernOptions o = on_the_slope(dx);
  o.period = Vec2(0, width);
  Obstacles obstacles;
  obstacles.add({CollisionMesh(wall_mesh(20, thickness)), RigidMotion(RigidPose{Vec3(kLength, 0, 0), Quat::Identity()}), 0, 1});
  obstacles.update();
  const Vent vent = fissure(0.6, 0, width, 0.8, kFlux * width);
  ModernLava lava(o, {vent}, {ground_at(0, 1e3)}, {}, {&obstacles, {}, {}});
  RunUp result;
  while (lava.time() < until) {
    const ModernReport report = lava.step(until - lava.time());
    result.speed = std::max(result.speed, report.max_speed);
    for (const Vec3& p : lava.positions()) EXPECT_TRUE(p.x() < kLength && p.z() > -dx) << p.transpose() << " at " << lava.time();
  }
  expect_mass_kept(lava, kFlux * width * until, vent.lattice(dx).size());
  // Tops of columns, half a metre each, by their volumes.
  const auto depth = [&](Real from, Real to) {
    const auto n = std::count_if(lava.positions().begin(), lava.positions().end(), [&](const Vec3& p) { return p.x() > from && p.x() < to; });
    return static_cast<Real>(n) * dx * dx * dx / (width * (to - from));
  };
  result.depth = depth(kLength - 1, kLength);
  for (const Vec3& p : lava.positions())
    if (p.x() > kLength - 1) result.top = std::max(result.top, p.z() + dx / 2);
  result.tilt = std::atan((depth(kLength - 1, kLength) - depth(kLength - 2, kLength - 1)) / 1) - kSlope;
  return result;
}

TEST(BarrierSlow, APondRisesBehindAWallAsHydrostaticsHasIt) {
  const Real until = 22;
  const Pond pond = fill_pond(kLength, 0.2, 1.0, kFlux, until);
  const Real expected = pond.mean(kLength - 1, kLength), crest = pond.depth.back() + kTan * Pond::kCell / 2;
  for (const Real thickness : {0.8, 0.0}) {
    const RunUp coarse = run_up(0.2, thickness, until), fine = run_up(0.1, thickness, until);
    fmt::print("wall {} m thick: depth before it {:.3f} (dx 0.2 m), {:.3f} (0.1 m), lubrication {:.3f} m; crest {:.2f}, {:.2f}, {:.2f} m; surface {:+.3f}, {:+.3f} rad off level; fastest {:.2f} m/s\n",
               thickness, coarse.depth, fine.depth, expected, coarse.top, fine.top, crest, coarse.tilt, fine.tilt, fine.speed);
    RecordProperty(thickness > 0 ? "thick_depth_m" : "thin_depth_m", fmt::format("{:.3f}", fine.depth));
    EXPECT_NEAR(coarse.depth, expected, 0.08 * expected);
    EXPECT_NEAR(fine.depth, expected, 0.05 * expected);
    EXPECT_NEAR(fine.depth, coarse.depth, 0.05 * expected);
    // Nothing climbs higher than pond and speed allow.
    EXPECT_LT(coarse.top, crest + coarse.speed * coarse.speed / (2 * kGravity) + 0.2);
    EXPECT_LT(fine.top, crest + fine.speed * fine.speed / (2 * kGravity) + 0.1);
    EXPECT_NEAR(coarse.tilt, 0, 0.1);
    EXPECT_NEAR(fine.tilt, 0, 0.05);
  }
}

// ---- In the open: walls that lava runs along, and round.

constexpr Real kEnd = 5.5;  // of the slope [m]

/// Lava from a fissure across the slope, three metres long, and a wall four metres below it.
struct Open {
  Obstacles obstacles;
  Vent vent = fissure(0, -1.5, 1.5, 0.8, 0.6);
  RigidPose pose;
  Real half, thickness, dx;
  ModernLava lava;

  Open(Real dx_, Real turned, Real half_, Real thickness_)
      : pose{Vec3(4, 0, 0), Quat(Eigen::AngleAxisd(-turned, Vec3::UnitZ()))}, half(half_), thickness(thickness_), dx(dx_), lava(make()) {}
  ModernLava make() {
    obstacles.add({CollisionMesh(wall_mesh(half, thickness)), RigidMotion(pose), 0, 1});
    obstacles.update();
    return {on_the_slope(dx), {vent}, {ground_at(0, kEnd)}, [](const Vec3& p) { return p.x() < kEnd; }, {&obstacles, {}, {}}};
  }
  /// Steps once; who goes through the wall, or is in it.
  std::size_t step() {
    std::map<std::uint64_t, Vec3> before;
    for (std::size_t i = 0; i < lava.size(); ++i) before[lava.ids()[i]] = pose.body(lava.positions()[i]);
    lava.step(1);
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < lava.size(); ++i) {
      const Vec3 to = pose.body(lava.positions()[i]);
      if (thickness > 0) wrong += to.x() > 0 && to.x() < thickness && std::abs(to.y()) < half;
      const auto old = before.find(lava.ids()[i]);
      if (old == before.end() || (old->second.x() < 0) == (to.x() < 0)) continue;
      // Past the plane of its front: beyond its ends. Round them a step's way is not straight, and shorter than half a spacing.
      const Real share = old->second.x() / (old->second.x() - to.x()), y = old->second.y() + share * (to.y() - old->second.y());
      wrong += std::abs(y) < half - 0.5 * dx;
    }
    return wrong;
  }
  std::size_t behind() const {
    return static_cast<std::size_t>(std::count_if(lava.positions().begin(), lava.positions().end(), [&](const Vec3& p) { return pose.body(p).x() > 0; }));
  }
};

TEST(BarrierSlow, AWallTurnedByThirtyDegreesDivertsLavaAlongIt) {
  Real angle[2], depth[2], speed[2];
  for (const int k : {0, 1}) {
    const Real dx = k == 0 ? 0.2 : 0.14;
    Open open(dx, kPi / 6, 12, k == 0 ? 0.8 : 0.0);
    const Real until = 22;
    while (open.lava.time() < until) ASSERT_EQ(open.step(), 0u) << "at " << open.lava.time();
    EXPECT_EQ(open.behind(), 0u);
    expect_mass_kept(open.lava, 0.6 * open.lava.time(), open.vent.lattice(dx).size());
    // Beside the wall, in its own frame: across, along.
    Vec3 mean = Vec3::Zero();
    Real n = 0, top = 0;
    for (std::size_t i = 0; i < open.lava.size(); ++i) {
      const Vec3 at = open.pose.body(open.lava.positions()[i]);
      if (at.x() < -0.5) continue;
      mean += open.pose.orientation.conjugate() * open.lava.velocities()[i];
      n += 1;
      top = std::max(top, at.z() + dx / 2);
    }
    mean /= n;
    angle[k] = std::atan2(mean.x(), mean.y());
    speed[k] = mean.y();
    depth[k] = top;
    fmt::print("wall turned by 30 degrees, dx {} m: lava within half a metre goes along it at {:.3f} m/s, {:+.1f} degrees off; highest {:.2f} m\n", dx, mean.y(), angle[k] * 180 / kPi, top);
  }
  for (const int k : {0, 1}) {
    EXPECT_GT(speed[k], 0.05) << "downhill along it";
    EXPECT_NEAR(angle[k], 0, 15 * kPi / 180);
  }
  EXPECT_NEAR(speed[1], speed[0], 0.15 * speed[1]);
  EXPECT_NEAR(depth[1], depth[0], 0.2);
}

TEST(BarrierSlow, LavaGoesRoundTheEndsOfANarrowWallAndNowhereElse) {
  for (const Real turned : {0.0, kPi / 6})
    for (const Real thickness : {0.8, 0.0}) {
      Open open(0.2, turned, 1.2, thickness);
      while (open.lava.time() < 25) ASSERT_EQ(open.step(), 0u) << "at " << open.lava.time();
      EXPECT_GT(open.behind(), 100u);
      EXPECT_GT(open.lava.mass_left(), 0) << "over the edge below";
      expect_mass_kept(open.lava, 0.6 * open.lava.time(), open.vent.lattice(0.2).size());
    }
}

// ---- A gap.

/// Two walls across with a gap between them, again and again down the slope and along it: what passes, steady [m^3/s]. A periodic piece
/// of it has no ends to feed, and what passes is the momentum over the density and the length.
Real discharge(Real dx, Real gap, bool slips, Real until) {
  const Real length = 4.8, width = 3.6, thickness = 0.8, depth = 1;
  ModernOptions o = on_the_slope(dx);
  o.rheology = Rheology::newtonian(2 * kNu * kDensity);
  o.max_step = 0.25 * dx;
  o.period = Vec2(length, width);
  Obstacles obstacles;
  const Vec3 middle(length / 2, width / 2, 0), half(thickness / 2, gap / 2, 0);
  obstacles.add({CollisionMesh(geometry::make_box(Vec3(middle.x() - half.x(), -9, -1), Vec3(middle.x() + half.x(), middle.y() - half.y(), 9))), {}, 0, 1});
  obstacles.add({CollisionMesh(geometry::make_box(Vec3(middle.x() - half.x(), middle.y() + half.y(), -1), Vec3(middle.x() + half.x(), 9, 9))), {}, 0, 1});
  obstacles.update();
  ModernLava lava(o, {}, {ground_at(0, 1e3)}, {}, {&obstacles, {}, {1, slips ? 0.0 : 1.0}});
  std::vector<Vec3> x;
  for (const Vec3& p : lattice_block(static_cast<int>(std::lround(length / dx)), static_cast<int>(std::lround(width / dx)), static_cast<int>(std::lround(depth / dx)), dx))
    if (std::abs(p.x() - middle.x()) > half.x() || std::abs(p.y() - middle.y()) < half.y()) x.push_back(p);
  lava.add(x, std::vector<Vec3>(x.size(), Vec3::Zero()), std::vector<Real>(x.size(), 1400));
  Real passed = 0, span = 0;
  while (lava.time() < until) {
    const Real dt = lava.step(1).dt;
    EXPECT_EQ(lava.size(), x.size());
    if (lava.time() < until - 3) continue;
    Real q = 0;
    for (const Vec3& v : lava.velocities()) q += v.x() * dx * dx * dx / length;
    passed += q * dt;
    span += dt;
  }
  return passed / span;
}

TEST(BarrierSlow, AsMuchPassesAGapAtHalfTheSpacing) {
  const Real coarse = discharge(0.2, 1.2, false, 12), fine = discharge(0.1, 1.2, false, 12);
  fmt::print("gap 1.2 m wide: {:.4f} m^3/s at dx 0.2 m, {:.4f} at 0.1 m: {:+.1f} %\n", coarse, fine, 100 * (coarse / fine - 1));
  RecordProperty("gap_discharge_coarse", fmt::format("{:.4f}", coarse));
  RecordProperty("gap_discharge_fine", fmt::format("{:.4f}", fine));
  EXPECT_NEAR(coarse, fine, 0.05 * fine);
}

TEST(BarrierSlow, AsMuchPassesAGapWithoutFrictionAtHalfTheSpacing) {
  const Real coarse = discharge(0.2, 1.2, true, 10), fine = discharge(0.1, 1.2, true, 10);
  fmt::print("the same, free slip: {:.4f}, {:.4f} m^3/s: {:+.1f} %\n", coarse, fine, 100 * (coarse / fine - 1));
  EXPECT_NEAR(coarse, fine, 0.02 * fine);
}

// ---- Heat.

/// Weightless lava at rest between two upright walls, as a mesh; nothing is lost to the air.
struct Warm {
  static constexpr Real kSpacing = 0.25;
  static constexpr int kAcross = 12, kHigh = 6;
  Obstacles obstacles;
  ModernLava lava;
  HeatBudget budget;
  std::vector<Real> given = {0, 0, 0}, hottest = {0, 0, 0};  // to and of each surface; hottest in the last step
  explicit Warm(Real wall_temperature, Real lava_temperature = 1450, std::vector<Real> effusivity = {}) : lava(make(wall_temperature, effusivity)) {
    std::vector<Vec3> x = lattice_block(kAcross, 6, kHigh, kSpacing);
    lava.add(x, std::vector<Vec3>(x.size(), Vec3::Zero()), std::vector<Real>(x.size(), lava_temperature));
  }
  ModernLava make(Real wall_temperature, const std::vector<Real>& effusivity) {
    const Real width = kAcross * kSpacing;
    obstacles.add({CollisionMesh(geometry::make_box(Vec3(-3, -20, -20), Vec3(0, 20, 20))), {}, wall_temperature, 1});
    obstacles.add({CollisionMesh(geometry::make_box(Vec3(width, -20, -20), Vec3(width + 3, 20, 20))), {}, wall_temperature, 2});
    obstacles.update();
    ModernOptions o = on_the_slope(kSpacing);
    o.gravity.setZero();
    o.max_step = 200;
    o.period = Vec2(0, 6 * kSpacing);
    o.heat.on = true;
    o.heat.viscous_heating = false;
    o.heat.curve.latent_heat = 0;
    o.heat.air.emissivity = o.heat.air.convection = 0;
    o.heat.crust = effusivity.empty();
    SolidOptions solids{&obstacles, {}, {}};
    solids.effusivity = effusivity;
    solids.heated = [this](std::span<const Real> heat, std::span<const Real> temperature) {
      hottest.assign(3, 0);
      for (std::size_t k = 0; k < heat.size(); ++k) given[k] += heat[k], hottest[k] = temperature[k];
    };
    return {o, {}, {ground_at(0, -1e3)}, {}, solids};
  }
  Real area() const { return 2 * 6 * kHigh * kSpacing * kSpacing; }
  void run(Real until) {
    while (lava.time() < until) {
      const ModernReport report = lava.step(until - lava.time());
      budget.ground += report.heat.ground;
      budget.radiated += report.heat.radiated;
      budget.convected += report.heat.convected;
    }
  }
};

TEST(Barrier, WallsAsHotAsTheLavaTakeNothing) {
  Warm warm(1450);
  const Real before = warm.lava.heat().total_enthalpy();
  warm.run(2000);
  EXPECT_NEAR(warm.lava.heat().total_enthalpy(), before, 1e-12 * before);
  EXPECT_EQ(warm.budget.radiated + warm.budget.convected, 0);
  EXPECT_NEAR(warm.budget.ground, 0, 1e-12 * before);
}

// Two half-spaces: through each square metre  2 (T - T_wall) / (1 / b_lava + 1 / b_wall) sqrt(t / pi)  in the time t, b = sqrt(k rho c);
// the cold layer stays thinner than half of what is between the walls.
TEST(BarrierSlow, ColdWallsTakeWhatTwoHalfSpacesExchangeAndHotOnesGiveIt) {
  for (const Real wall : {288.15, 1700.0}) {
    Warm warm(wall);
    const HeatOptions& heat = warm.lava.options().heat;
    const Real before = warm.lava.heat().total_enthalpy();
    const Real b_lava = std::sqrt(heat.conductivity * kDensity * heat.curve.heat_capacity);
    for (const Real t : {1000.0, 10000.0, 40000.0}) {
      warm.run(t);
      const Real exact = warm.area() * 2 * (1450 - wall) / (1 / b_lava + 1 / heat.ground_effusivity) * std::sqrt(t / kPi);
      EXPECT_NEAR(warm.budget.ground, exact, 0.1 * std::abs(exact)) << "wall at " << wall << " K, " << t << " s";
      EXPECT_NEAR(before - warm.lava.heat().total_enthalpy(), warm.budget.ground, 1e-9 * before);
    }
  }
}

// The same with a wall of concrete and one of steel: each takes what its own effusivity says, and is where lava touches it as hot as
// two half-spaces brought together:  (b T + b_wall T_wall) / (b + b_wall).
TEST(Barrier, WallsOfTheirOwnMaterialsTakeTheirOwnHeat) {
  const Real concrete = std::sqrt(1.4 * 2300 * 880), steel = std::sqrt(60.5 * 7854 * 434), T_wall = 288.15, T_lava = 1450;
  Warm warm(T_wall, T_lava, {0, concrete, steel});
  const HeatOptions& heat = warm.lava.options().heat;
  const Real before = warm.lava.heat().total_enthalpy(), b_lava = std::sqrt(heat.conductivity * kDensity * heat.curve.heat_capacity);
  for (const Real t : {1000.0, 10000.0}) {
    warm.run(t);
    for (const Index wall : {1u, 2u}) {
      const Real b = wall == 1 ? concrete : steel;
      const Real exact = warm.area() / 2 * 2 * (T_lava - T_wall) / (1 / b_lava + 1 / b) * std::sqrt(t / kPi);
      EXPECT_NEAR(warm.given[wall], exact, 0.01 * exact) << "wall " << wall << ", " << t << " s";
      const Real contact = (b_lava * T_lava + b * T_wall) / (b_lava + b);
      EXPECT_NEAR(warm.hottest[wall], contact, 0.02 * (contact - T_wall)) << "wall " << wall << ", " << t << " s";
    }
    EXPECT_NEAR(before - warm.lava.heat().total_enthalpy(), warm.given[1] + warm.given[2], 1e-9 * before);
    EXPECT_NEAR(warm.given[0], 0, 1e-12 * before) << "no ground there";
  }
}

// A cold block that goes through lava: all that the lava loses is booked, and the block stays as cold as it was told to be.
TEST(Barrier, HeatIsNotLostWhereAColdBlockGoesThrough) {
  const Real dx = 0.25;
  ModernOptions o = on_the_slope(dx);
  o.gravity = Vec3(0, 0, -kGravity);
  o.heat.on = true;
  o.heat.viscous_heating = false;
  Obstacles obstacles;
  const std::size_t block = obstacles.add({CollisionMesh(geometry::make_box(Vec3(-0.4, -0.4, -0.4), Vec3(0.4, 0.4, 0.4))), {}, 300, 1});
  obstacles.update();
  const auto at = [](Real t) { return RigidPose{Vec3(-1 + t, 1.2, 0.6), Quat::Identity()}; };
  ModernLava lava(o, {}, {ground_at(0, 1e3)}, {}, {&obstacles, [&](Real from, Real to) {
    obstacles.move(block, RigidMotion(at(from), at(to), to - from));
    obstacles.update();
  }, {}});
  const std::vector<Vec3> x = lattice_block(10, 10, 4, dx);
  lava.add(x, std::vector<Vec3>(x.size(), Vec3::Zero()), std::vector<Real>(x.size(), 1450));
  const Real before = lava.heat().total_enthalpy();
  Real lost = 0, to_solids = 0;
  while (lava.time() < 4) {
    const HeatBudget heat = lava.step(0.1).heat;
    lost += heat.radiated + heat.convected + heat.ground - heat.dissipated;
    to_solids += heat.ground;
  }
  EXPECT_NEAR(before - lava.heat().total_enthalpy(), lost, 1e-9 * before);
  EXPECT_GT(to_solids, 0);
  EXPECT_EQ(obstacles[block].temperature, 300);
}

}  // namespace
}  // namespace effuse::flow::sph
