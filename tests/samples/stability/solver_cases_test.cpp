#include <algorithm>

#include "flow/bodies/rigid_bodies.h"
#include "flow/springs/builders.h"
#include "flow/springs/spring_system.h"
#include "flow/waves/wave_grid.h"
#include "tests/samples/stability/hard_case.h"

/// Hard cases of the other solvers.
namespace effuse::stability {

namespace {

using flow::Scheme;

/// The jello cube with springs of 10^7 N/m in the room of its world.
///   throws it into a corner, or turns it inside out. guarded: steps that the scheme bears, else a frame's tenth.
std::string stiff_jello(Scheme scheme, bool inverted, bool guarded) {
  namespace springs = flow::springs;
  constexpr Real kStiff = 1e7, kMass = 1.0 / 512, kFrame = 1.0 / 24;
  const springs::SpringBody body = springs::jello_cube(5, Vec3::Constant(-0.5), 1, kMass, {kStiff, scheme == Scheme::kEuler ? 60.0 : 1.0, 0});
  springs::SpringSystem system(body.network);
  for (int axis = 0; axis < 3; ++axis)
    for (const Real side : {1.0, -1.0}) system.surroundings.walls.push_back({side * Vec3::Unit(axis), 0.8});
  system.surroundings.response = {1e4, 1, 0};
  system.surroundings.gravity = Vec3(0, 0, -kGravity);
  springs::SpringState y = body.state;
  if (inverted)
    for (Vec3& x : y.x) x = 0.2 * Vec3(-x.x(), x.y(), x.z()) + 0.8 * x;  // pressed flat, and a fifth of it mirrored
  for (Vec3& v : y.v) v = inverted ? Vec3::Zero() : Vec3(10, -10, 20);
  const Real safe = springs::longest_stable_step(scheme, system.spectrum(y));
  const Real dt = scheme == Scheme::kImplicitEuler ? kFrame : guarded ? 0.4 * safe : kFrame / 10;
  const auto steps = scheme == Scheme::kImplicitEuler ? 48 : static_cast<int>(std::min(20000.0, 0.2 / dt));
  // Without their springs' energy points go no faster than they were thrown; with it, than it all in one.
  const Real energy = springs::kinetic_energy(body.network, y) + springs::spring_energy(body.network, y) + 2 * kGravity * kMass * 125;
  flow::StepStorage<springs::SpringState> storage;
  storage.k1 = storage.k2 = storage.k3 = storage.k4 = y;
  const std::string name = fmt::format("jello-1e7-{}-{}", flow::kSchemeNames[static_cast<std::size_t>(scheme)], inverted ? "inverted" : "corner");
  Course course({"energy"});
  for (int k = 0; k < steps; ++k) {
    flow::integrate_step(scheme, system, k * dt, dt, y, storage);
    const Real now = springs::kinetic_energy(body.network, y) + springs::spring_energy(body.network, y);
    course.add(k * dt, {now / energy});
    if (!(now < 1.5 * energy)) return course.failed(name, fmt::format("{:.3g} J after {} steps of {:.3g} s, {:.3g} J at the start", now, k + 1, dt, energy));
  }
  for (const Vec3& x : y.x)
    if (!(x.lpNorm<Eigen::Infinity>() < 3)) return course.failed(name, "out of the room");
  return "";
}

std::string heavy_on_light(bool guarded) {
  using namespace flow::bodies;
  BodyOptions o;
  o.sleep_speed = 0;
  o.substeps = guarded ? 16 : 1;
  if (!guarded) o.step = 1.0 / 30;
  std::vector<Real> z(9, 0.0);
  RigidBodies world(o, geometry::Terrain::from_height_field(geometry::HeightField({-50, -50}, {50, 50}, 3, 3, z)));
  const auto box = Shape::box(Vec3::Constant(0.5));
  const BodyId light = world.add(box, 1, {Vec3(0, 0, 0.5), Quat::Identity()});
  const BodyId heavy = world.add(box, 1e4, {Vec3(0, 0, 1.5), Quat::Identity()});
  Course course({"deepest", "aside"});
  while (world.time() < 20) {
    const BodyReport report = world.step(1.0 / 30);
    const Real aside = std::hypot(world.centres()[heavy].x(), world.centres()[heavy].y());
    course.add(world.time(), {report.penetration / 0.2, aside / 0.05});
    if (!(report.penetration < 0.2)) return course.failed("stack-of-mass-ratio-1e4", fmt::format("{:.2g} m into each other at {:.3g} s", report.penetration, world.time()));
    if (!(aside < 0.05)) return course.failed("stack-of-mass-ratio-1e4", fmt::format("it fell off at {:.3g} s", world.time()));
  }
  return std::abs(world.centres()[light].z() - 0.5) < 0.1 ? "" : "the light one was pushed aside";
}

std::string top_for_an_hour(bool guarded) {
  using namespace flow::bodies;
  const Vec3 moments(1, 2, 3), L(0.02, 12, 0.02);
  constexpr Real dt = 1.0 / 240;
  Quat q = Quat::Identity();
  const auto energy = [&] { return angular_velocity(q, L, moments).dot(L) / 2; };
  const Real begin = energy();
  Course course({"energy"});
  for (int k = 0; k < 3600 * 240; ++k) {
    q = turn_freely(guarded ? RotorScheme::kSplitting : RotorScheme::kSymplecticEuler, q, L, moments, dt);
    const Real off = std::abs(energy() / begin - 1);
    if (k % 1000 == 0) course.add(k * dt, {off / 1e-3});
    if (!(off < 1e-3) || !(std::abs(q.norm() - 1) < 1e-9)) return course.failed("top-for-an-hour", fmt::format("energy off by {:.2g} after {:.0f} s", off, k * dt));
  }
  return "";
}

std::string waves_at_the_limit(bool guarded) {
  flow::waves::WaveOptions o;
  o.nx = o.ny = 8;
  o.border = flow::waves::Border::kPeriodic;
  o.guarded = guarded;
  const auto start = [&] {
    flow::waves::WaveGrid grid(o, {1.0});
    // The shortest wave both ways: the one that blows up.
    for (std::size_t c = 0; c < grid.size(); ++c) grid.height()[c] = (c + c / 8) % 2 == 0 ? 0.1 : -0.1;
    grid.height()[3] += 0.05;
    return grid;
  };
  flow::waves::WaveGrid below = start();
  const Real limit = below.longest_step();
  for (int k = 0; k < 1000000; ++k) below.step((1 - 1e-3) * limit);
  Real largest = 0;
  for (const Real h : below.height()) largest = std::max(largest, std::abs(h));
  // The quadratic form that the scheme keeps is not the energy itself near the limit.
  if (!(largest < 10 * 0.15 * std::sqrt(1e3))) return fmt::format("{:.3g} m high after a million steps below the limit", largest);
  flow::waves::WaveGrid above = start();
  try {
    for (int k = 0; k < 1000000; ++k) {
      above.step((1 + 1e-3) * limit);
      if (!(std::abs(above.height()[3]) < 1e6)) return fmt::format("it blew up after {} steps above the limit", k + 1);
    }
  } catch (const UnstableError&) {
    return "";  // refused, as it should be
  }
  return "";
}

}  // namespace

std::vector<HardCase> solver_cases() {
  std::vector<HardCase> cases;
  for (const bool inverted : {false, true})
    for (const Scheme scheme : {Scheme::kEuler, Scheme::kSymplecticEuler, Scheme::kMidpoint, Scheme::kRk4, Scheme::kImplicitEuler})
      cases.push_back({fmt::format("jello-1e7-{}-{}", flow::kSchemeNames[static_cast<std::size_t>(scheme)], inverted ? "inverted" : "corner"), scheme == Scheme::kImplicitEuler ? "" : "step limit",
                       [=](bool guarded) { return stiff_jello(scheme, inverted, guarded); }});
  cases.push_back({"stack-of-mass-ratio-1e4", "substeps", heavy_on_light});
  cases.push_back({"top-for-an-hour", "splitting", top_for_an_hour});
  cases.push_back({"waves-at-the-limit", "refusal of longer steps", waves_at_the_limit});
  return cases;
}

}  // namespace effuse::stability
