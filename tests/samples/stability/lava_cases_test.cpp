#include <algorithm>
#include <array>
#include <limits>

#include "flow/sph/classic_lava.h"
#include "geometry/procedural/primitives.h"
#include "samples/study/validation/setups.h"
#include "samples/study/validation/stack.h"
#include "tests/samples/stability/hard_case.h"

namespace effuse::stability {

using flow::sph::ClassicLava;
using flow::sph::ClassicOptions;
using flow::sph::ModernLava;
using flow::sph::ModernOptions;
using flow::sph::SurfaceLaw;
using study::block;
using study::plane;

namespace {

constexpr Real kDx = 0.1;
const Real kFall = std::sqrt(2 * kGravity * 1.0);  // [m/s] of a metre

ModernOptions fluid(Real mu, Real dx = kDx) {
  ModernOptions o = study::isothermal(dx, mu);
  o.max_step = 0.1;
  o.rest_period = 0;
  return o;
}

const ModernLava::ContactSource kFloor = plane(Vec3::UnitZ(), Vec3::Zero());

Real above_floor(const Vec3& x) { return x.z(); }

LavaBounds on_floor(Real speed) {
  LavaBounds b;
  b.speed = speed;
  b.clearance = above_floor;
  return b;
}

std::string viscosity_ratio(bool guarded) {
  ModernOptions o = fluid(1);
  o.rheology.melt = flow::sph::exponential_melt(1200 + kZeroCelsius, 100, 900 + kZeroCelsius, 1e11);
  o.rheology.crystals.kind = flow::sph::CrystalKind::kNone;
  o.rheology.mu_max = 1e12;
  o.guards.implicit_viscosity = guarded;
  ModernLava lava(o, {}, {kFloor});
  const std::vector<Vec3> x = block(Vec3(0, 0, 0.2), {6, 6, 6}, kDx);
  std::vector<Real> T;
  for (const Vec3& p : x) T.push_back(kZeroCelsius + (p.x() < 0.3 ? 900 : 1200));
  lava.add(x, std::vector<Vec3>(x.size(), Vec3::Zero()), T);
  return run_lava("viscosity-ratio-1e9", lava, 1, 0.05, on_floor(1.3 * kFall));
}

std::string stiff(bool guarded) {
  ModernOptions o = fluid(1e12);
  o.guards.implicit_viscosity = guarded;
  ModernLava lava(o, {}, {kFloor});
  lava.add(block(Vec3(0, 0, 0.3), {6, 6, 6}, kDx), std::vector<Vec3>(216, Vec3(1, 0, -1)), std::vector<Real>(216, 1400));
  return run_lava("viscosity-1e12", lava, 1, 0.05, on_floor(1.3 * std::hypot(kFall, 1.5)));
}

std::string forced_step(bool guarded) {
  ModernOptions o = fluid(1);
  o.max_step = 100 * o.courant * std::sqrt(kDx / kGravity);
  o.guards.step_limit = guarded;
  ModernLava lava(o, {}, {kFloor});
  study::add_at_rest(lava, block(Vec3::Zero(), {5, 5, 8}, kDx));
  return run_lava("step-100-times-the-limit", lava, 4, o.max_step, on_floor(1.3 * kFall));
}

std::string overlapping(bool guarded) {
  ModernOptions o = fluid(500);
  o.guards.make_room = guarded;
  ModernLava lava(o, {}, {kFloor});
  std::vector<Vec3> x = block(Vec3(0, 0, 0.05), {6, 6, 6}, kDx / std::cbrt(4.0));
  x[3] = x[4];
  study::add_at_rest(lava, x);
  LavaBounds b = on_floor(2 * kFall);
  b.crowding = 0.1;
  return run_lava("born-overlapping", lava, 1, 0.02, b);
}

/// One, two, a line, a sheet fall by half a metre.
std::string few(const std::string& name, const std::vector<Vec3>& x, bool guarded) {
  ModernOptions o = fluid(100);
  o.guards.projection = guarded;
  ModernLava lava(o, {}, {kFloor});
  lava.add(x, std::vector<Vec3>(x.size(), Vec3(0.3, 0, -3)), std::vector<Real>(x.size(), 1400));
  LavaBounds b = on_floor(1.2 * std::hypot(kFall, 3));
  b.least_clearance = 0.2 * kDx;
  return run_lava(name, lava, 2, 0.05, b);
}

std::string dropped(bool guarded) {
  // As they arrive from a height of 100 m, with the speed that gives.
  const Real dx = 0.5, speed = std::sqrt(2 * kGravity * 100);
  ModernOptions o = fluid(2000, dx);
  o.guards.step_limit = guarded;
  o.max_step = 0.25;
  ModernLava lava(o, {}, {kFloor});
  const std::vector<Vec3> x = block(Vec3(0, 0, 0.5), guarded ? std::array<int, 3>{50, 50, 40} : std::array<int, 3>{12, 12, 10}, dx);
  lava.add(x, std::vector<Vec3>(x.size(), Vec3(0, 0, -speed)), std::vector<Real>(x.size(), 1400));
  LavaBounds b = on_floor(4 * speed);  // a sheet shoots out at the rim, at twice the speed
  b.energy = 0.5 * speed * speed + kGravity * 20;
  b.crowding = 0.3;
  return run_lava("100000-from-100-m", lava, guarded ? 0.015 : 0.25, 0.25, b);
}

std::string thin_film(bool guarded) {
  // A particle each three spacings, on a slope: a film a ninth of a spacing thick.
  ModernOptions o = fluid(50);
  o.gravity = kGravity * Vec3(std::sin(0.5), 0, -std::cos(0.5));
  o.guards.projection = guarded;
  ModernLava lava(o, {}, {kFloor});
  std::vector<Vec3> x = block(Vec3::Zero(), {10, 10, 1}, 3 * kDx);
  for (Vec3& p : x) p.z() = 0.5 * kDx;
  lava.add(x, std::vector<Vec3>(x.size(), Vec3(0, 0, -2)), std::vector<Real>(x.size(), 1400));
  LavaBounds b = on_floor(3 * kGravity * std::sin(0.5) + 2);
  b.least_clearance = 0.2 * kDx;
  return run_lava("film-thinner-than-a-particle", lava, 3, 0.1, b);
}


std::string closing_plates(bool guarded) {
  geometry::Obstacles obstacles;
  const geometry::CollisionMesh plate(geometry::make_box(Vec3(-0.2, -1, -0.5), Vec3(0.2, 2, 2)));
  obstacles.add({plate, {}, 0, 1});
  obstacles.add({plate, {}, 0, 2});
  constexpr Real kSpeed = 1, kFrom = 1.0, kGap = 0.25;
  const auto left = [=](Real t) { return geometry::RigidPose{Vec3(-0.2 - kFrom / 2 + std::min(kSpeed * t, (kFrom - kGap) / 2), 0, 0), Quat::Identity()}; };
  const auto right = [=](Real t) { return geometry::RigidPose{Vec3(0.2 + kFrom / 2 - std::min(kSpeed * t, (kFrom - kGap) / 2), 0, 0), Quat::Identity()}; };
  flow::sph::SolidOptions solids;
  solids.obstacles = &obstacles;
  solids.move = [&](Real from, Real to) {
    obstacles.move(0, geometry::RigidMotion(left(from), left(to), to - from));
    obstacles.move(1, geometry::RigidMotion(right(from), right(to), to - from));
    obstacles.update();
  };
  solids.move(0, 0);
  ModernOptions o = fluid(500);
  o.guards.projection = guarded;
  ModernLava lava(o, {}, {kFloor}, {}, solids);
  study::add_at_rest(lava, block(Vec3(-0.4, 0, 0), {8, 10, 8}, kDx));
  LavaBounds b;
  b.speed = 15;  // (1 m / 0.25 m) * 1 m/s out to the sides, and falling
  b.clearance = [&](const Vec3& x) {
    std::array<geometry::Contact, 2> found;
    return obstacles.contacts(x, 0.3, found) > 0 ? std::min(found[0].distance, x.z()) : x.z();
  };
  b.least_clearance = -0.05 * kDx;
  return run_lava("between-closing-plates", lava, 0.8, 0.02, b);
}

std::string teleport(bool guarded) {
  geometry::Obstacles obstacles;
  obstacles.add({geometry::CollisionMesh(geometry::make_box(Vec3(-0.25, -0.25, -0.25), Vec3(0.25, 0.25, 0.25))), geometry::RigidMotion(geometry::RigidPose{Vec3(0, 0, 5), Quat::Identity()}), 0, 1});
  obstacles.update();
  flow::sph::SolidOptions solids;
  solids.obstacles = &obstacles;
  const auto at = [](Real t) { return geometry::RigidPose{t < 0.3 ? Vec3(0, 0, 5) : Vec3(0.4, 0.4, 0.4), Quat::Identity()}; };
  solids.move = [&](Real from, Real to) {
    // It is there at once, not on a way.
    obstacles.move(0, geometry::RigidMotion(at(to)));
    obstacles.update();
    (void)from;
  };
  ModernOptions o = fluid(200);
  o.guards.projection = guarded;
  ModernLava lava(o, {}, {kFloor}, {}, solids);
  study::add_at_rest(lava, block(Vec3::Zero(), {8, 8, 6}, kDx));
  LavaBounds b = on_floor(8);
  std::string broken = run_lava("obstacle-teleports-in", lava, 1.5, 0.02, b);
  if (!broken.empty()) return broken;
  for (const Vec3& x : lava.positions()) {
    std::array<geometry::Contact, 1> found;
    if (obstacles.contacts(x, 0.3, found) > 0 && found[0].distance < -0.05 * kDx) return fmt::format("{:.2g} spacings inside it at the end", -found[0].distance / kDx);
  }
  return "";
}

std::string vent_jump(bool guarded) {
  flow::sph::Vent slow, fast;
  slow.from = slow.to = fast.from = fast.to = Vec3::Zero();
  slow.width = fast.width = 1;
  slow.temperature = fast.temperature = 1400;
  slow.rate = 0.02;
  slow.stop = 1;
  fast.start = 1;
  fast.stop = 1.5;
  fast.rate = 2;
  ModernOptions o = fluid(500);
  o.guards.step_limit = guarded;
  ModernLava lava(o, {slow, fast}, {kFloor});
  LavaBounds b = on_floor(12);  // 2 m3/s through 0.8 m2, and falling back
  b.crowding = 0.3;
  const std::string broken = run_lava("vent-jumps-100-fold", lava, 2.5, 0.1, b);
  if (!broken.empty()) return broken;
  const Real volume = slow.volume(2.5) + fast.volume(2.5), sites = static_cast<Real>(slow.lattice(kDx).size() + fast.lattice(kDx).size()) * kDx * kDx * kDx;
  return std::abs(lava.volume() - volume) <= sites ? "" : fmt::format("{:.3g} m3 came, {:.3g} m3 should have", lava.volume(), volume);
}

/// Gravity is another one from now on.
ModernLava with_gravity(const ModernLava& lava, const Vec3& gravity) {
  ModernOptions o = lava.options();
  o.gravity = gravity;
  ModernLava next(o, {}, {kFloor});
  StateWriter out;
  lava.save(out);
  const std::string bytes = out.bytes();
  StateReader in(bytes, "state");
  next.load(in);
  return next;
}

std::string gravity_turns(bool guarded) {
  ModernOptions o = fluid(100);
  o.max_step = 0.5;
  o.guards.step_limit = guarded;
  ModernLava lava(o, {}, {kFloor});
  study::add_at_rest(lava, block(Vec3::Zero(), {6, 6, 6}, kDx));
  const Vec3 down(0, 0, -kGravity);
  for (const Vec3& g : {down, Vec3(0, 0, 0), Vec3(-down), down, Vec3(kGravity, 0, 0)}) {
    lava = with_gravity(lava, g);
    const std::string broken = run_lava("gravity-off-and-round", lava, 0.5, 0.5, on_floor(0.5 * 5 * kGravity));
    if (!broken.empty()) return broken;
    // What takes no notice of each other falls as one: no more energy than gravity gives.
    if (lava.positions()[0].norm() > 20) return "thrown away";
  }
  return "";
}

std::string planted_nan(bool guarded) {
  ModernOptions o = fluid(100);
  o.guards.step_limit = guarded;
  ModernLava lava(o, {}, {kFloor});
  study::add_at_rest(lava, block(Vec3::Zero(), {6, 6, 6}, kDx));
  lava.step(0.01);
  const std::vector<Vec3> before(lava.positions().begin(), lava.positions().end());
  const_cast<Vec3&>(lava.velocities()[17]).x() = std::numeric_limits<Real>::quiet_NaN();
  const std::uint64_t id = lava.ids()[17];
  try {
    lava.step(0.01);
  } catch (const UnstableError& error) {
    const std::string text = error.what();
    if (text.find(fmt::format("particle {} at", id)) == std::string::npos || text.find("velocity that is no number") == std::string::npos) return "not named: " + text;
    for (std::size_t i = 0; i < before.size(); ++i)
      if (lava.positions()[i] != before[i]) return "not where it was";
    return "";
  }
  return "not caught in that step";
}

std::string long_rest(bool guarded) {
  ModernOptions o = fluid(1e5);
  o.heat.on = true;
  o.heat.air.air_temperature = o.ground_temperature = 1400;  // nothing to lose to
  o.sleep_speed = guarded ? 5e-3 : 0;
  o.sleep_delay = 2;
  o.ground_speed = 0;
  // A tray.
  ModernLava lava(o, {}, {kFloor, plane(Vec3::UnitX(), Vec3::Zero()), plane(-Vec3::UnitX(), Vec3(0.8, 0, 0)), plane(Vec3::UnitY(), Vec3::Zero()), plane(-Vec3::UnitY(), Vec3(0, 0.8, 0))});
  study::add_at_rest(lava, block(Vec3::Zero(), {8, 8, 6}, kDx));
  const auto level = [&] {
    Real sum = 0;
    for (const Vec3& x : lava.positions()) sum += x.z();
    return sum / static_cast<Real>(lava.size());
  };
  constexpr Real kFrame = 1.0 / 24;
  std::size_t awake = 1;
  for (int k = 0; k < 2000 && awake > 0; ++k) awake = lava.step(kFrame).awake;
  if (awake > 0) return "not at rest after 2000 frames";
  const Real height = level(), heat = lava.heat().total_enthalpy();
  for (int k = 0; k < 1000000; ++k) lava.step(kFrame);
  if (std::abs(level() - height) > 1e-12) return fmt::format("the level moved by {:.2g} m", level() - height);
  if (std::abs(lava.heat().total_enthalpy() / heat - 1) > 1e-7) return fmt::format("the heat changed by {:.2g}", lava.heat().total_enthalpy() / heat - 1);
  for (const Real T : lava.temperatures())
    if (std::abs(T - 1400) > 1e-3) return fmt::format("{} K", T);
  return "";
}

/// Heat alone, on a lattice whose top layer is hot: no temperature leaves the range it begins with.
std::string heat(const std::string& name, Real conductivity, Real melting_range, Real coldest, bool guarded) {
  study::Stack stack(8, 0.2);
  flow::sph::HeatOptions o;
  o.conductivity = conductivity;
  o.crust = false;
  o.longest_interval = 0;
  o.curve.solidus = 1300 - melting_range / 2;
  o.curve.liquidus = 1300 + melting_range / 2;
  o.air.air_temperature = coldest;
  o.guards.monotone_conduction = guarded;
  flow::sph::Heat lava(o, stack.dx(), 2600);
  for (std::size_t i = 0; i < stack.size(); ++i) lava.born(i % 2 == 0 ? 1400 : coldest);
  const Real before = lava.total_enthalpy();
  for (int k = 0; k < 50; ++k) {
    stack.step(lava, 60);
    for (const Real T : lava.temperature())
      if (!(T >= coldest - 1e-6 && T <= 1400 + 1e-6)) return fmt::format("{}: {:.6g} K after {} steps", name, T, k + 1);
  }
  return std::abs(lava.total_enthalpy() / before - 1) < 1e-9 ? "" : fmt::format("{}: heat of {:.3g} of it is lost", name, lava.total_enthalpy() / before - 1);
}

/// A block at rest, its lowest side at z, of 1500 and 1200 K by turns.
void add_hot_block(ModernLava& lava, Real z) {
  const std::vector<Vec3> x = block(Vec3(0, 0, z), {6, 6, 6}, kDx);
  std::vector<Real> T;
  for (std::size_t i = 0; i < x.size(); ++i) T.push_back(i % 2 == 0 ? 1500 : 1200);
  lava.add(x, std::vector<Vec3>(x.size(), Vec3::Zero()), T);
}

std::string cold_ground(bool guarded) {
  // Hot lava falls onto ice and is cooled by it and by the sky.
  ModernOptions o = fluid(500);
  o.heat.on = true;
  o.heat.conductivity = 1e4;
  o.heat.longest_interval = 0;
  o.heat.air.air_temperature = 200;
  o.ground_temperature = 200;
  o.heat.guards.monotone_conduction = guarded;
  ModernLava lava(o, {}, {plane(Vec3::UnitZ(), Vec3::Zero(), Vec3::Zero(), 200)});
  add_hot_block(lava, 0.1);
  LavaBounds b = on_floor(1.3 * kFall);
  b.coldest = 200 - 1e-6;
  b.hottest = 1500 + 1;  // viscous heating
  return run_lava("hot-onto-ice", lava, 2, 0.05, b);
}

std::string into_water(bool guarded) {
  // Hot lava falls through water's surface, which takes 50 times what air does, onto wet ground.
  ModernOptions o = fluid(500);
  o.heat.on = true;
  o.heat.conductivity = 1e4;
  o.heat.longest_interval = 0;
  o.heat.air.air_temperature = 300;
  o.ground_temperature = 288;
  o.heat.guards.monotone_conduction = guarded;
  ModernLava lava(o, {}, {plane(Vec3::UnitZ(), Vec3::Zero(), Vec3::Zero(), 288)});
  constexpr Real kLevel = 0.25;
  SurfaceLaw water;
  water.air_temperature = 288;
  water.convection = 1e5;
  lava.set_water({[](std::span<const Vec3> x, std::span<std::uint8_t> wet) {
                    for (std::size_t i = 0; i < x.size(); ++i) wet[i] = x[i].z() < kLevel;
                  },
                  water});
  add_hot_block(lava, kLevel);
  LavaBounds b = on_floor(1.3 * std::sqrt(2 * kGravity * (kLevel + 0.7)));
  b.coldest = 288 - 1e-6;
  b.hottest = 1500 + 1;  // viscous heating
  const std::string broken = run_lava("hot-onto-water", lava, 2, 0.05, b);
  if (!broken.empty()) return broken;
  const Real coldest = *std::min_element(lava.temperatures().begin(), lava.temperatures().end());
  return coldest < 1000 ? "" : fmt::format("water has not cooled it: {:.4g} K at least", coldest);
}

std::string stiff_classic(bool guarded) {
  ClassicOptions o;
  o.spacing = kDx;
  o.stiffness = 900 * 1e4;
  o.viscosity.hot_nu = o.viscosity.cold_nu = o.viscosity.max = 0.5;
  o.air_exchange = o.ground_exchange = 0;
  o.rest_period = 0;
  if (!guarded) o.courant = 40;
  ClassicLava lava(o, {}, {kFloor});
  const std::vector<Vec3> x = block(Vec3(0, 0, 0.1), {6, 6, 6}, kDx);
  lava.add(x, std::vector<Vec3>(x.size(), Vec3::Zero()), std::vector<Real>(x.size(), 1400));
  try {
    while (lava.time() < 0.3) {
      lava.step(0.05);
      for (const Vec3& v : lava.state().v)
        if (!(v.norm() < 1.5 * kFall)) return fmt::format("{:.3g} m/s at {:.3g} s", v.norm(), lava.time());
    }
  } catch (const UnstableError& error) {
    return error.what();
  }
  return "";
}

std::vector<Vec3> line(int n, const Vec3& along) {
  std::vector<Vec3> x;
  for (int k = 0; k < n; ++k) x.push_back(Vec3(0, 0, 0.5) + k * kDx * along);
  return x;
}

}  // namespace

std::vector<HardCase> lava_cases() {
  std::vector<Vec3> sheet = block(Vec3(0, 0, 0.5), {8, 8, 1}, kDx);
  return {
      {"viscosity-ratio-1e9", "implicit viscosity", viscosity_ratio},
      {"viscosity-1e12", "implicit viscosity", stiff},
      {"step-100-times-the-limit", "step limit", forced_step},
      {"stiffness-1e4-classic", "step limit", stiff_classic},
      {"born-overlapping", "making room", overlapping},
      {"one-lonely-particle", "projection", [](bool guarded) { return few("one-lonely-particle", line(1, Vec3::UnitX()), guarded); }},
      {"a-pair", "projection", [](bool guarded) { return few("a-pair", line(2, Vec3::UnitX()), guarded); }},
      {"a-line", "projection", [](bool guarded) { return few("a-line", line(12, Vec3::UnitX()), guarded); }},
      {"a-sheet", "projection", [sheet](bool guarded) { return few("a-sheet", sheet, guarded); }},
      {"100000-from-100-m", "step limit", dropped},
      {"film-thinner-than-a-particle", "projection", thin_film},
      {"between-closing-plates", "projection", closing_plates},
      {"obstacle-teleports-in", "projection", teleport},
      {"vent-jumps-100-fold", "step limit", vent_jump},
      {"gravity-off-and-round", "step limit", gravity_turns},
      {"planted-nan", "step limit", planted_nan},
      {"million-frames-of-rest", "sleep", long_rest},
      {"conductivity-0", "", [](bool guarded) { return heat("conductivity-0", 1e-300, 150, 200, guarded); }},
      {"conductivity-1e6", "monotone conduction", [](bool guarded) { return heat("conductivity-1e6", 1e6, 150, 200, guarded); }},
      {"latent-heat-over-0.1-K", "monotone conduction", [](bool guarded) { return heat("latent-heat-over-0.1-K", 1e3, 0.1, 250, guarded); }},
      {"hot-onto-ice", "monotone conduction", cold_ground},
      {"hot-onto-water", "monotone conduction", into_water},
  };
}

}  // namespace effuse::stability
