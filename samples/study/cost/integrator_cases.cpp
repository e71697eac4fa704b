#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <memory>

#include "flow/integrate/integrate.h"
#include "flow/reference/rigid_motion.h"
#include "flow/springs/builders.h"
#include "flow/springs/spring_system.h"
#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "samples/study/cost/cost.h"
#include "samples/study/study.h"

/// Schemes of integration beside each other: what each takes for the error it makes, the order its error falls at, and the step at which
/// it blows up.
namespace effuse::study {

namespace {

using flow::Scheme;
using Mat2 = Eigen::Matrix2d;

constexpr Scheme kSchemes[] = {Scheme::kEuler, Scheme::kSymplecticEuler, Scheme::kMidpoint, Scheme::kRk4, Scheme::kImplicitEuler};
constexpr Real kOrders[] = {1, 1, 2, 4, 1};
constexpr Real kInfinity = std::numeric_limits<Real>::infinity();
constexpr Real kRounding = 3e-12;  // errors below are made of it

std::string name_of(Scheme scheme) { return std::string(flow::kSchemeNames[static_cast<std::size_t>(scheme)]); }

/// A point in a plane, or an angle and its rate in the first components.
struct Motion {
  Vec2 x = Vec2::Zero(), v = Vec2::Zero();
};
void add_scaled_velocities(Motion& y, Real a, const Motion& k) { y.v += a * k.v; }
void add_scaled_positions(Motion& y, Real a, const Motion& k) { y.x += a * k.x; }

/// x'' = a(x), of whose derivative implicit Euler makes use.
template <class Law>
struct Ballistic {
  Law law;
  void velocity_rates(Real, const Motion& y, Motion& k) const { k.v = law.acceleration(y.x); }
  void position_rates(Real, const Motion& y, Motion& k) const { k.x = y.v; }
  void rates(Real t, const Motion& y, Motion& k) const {
    velocity_rates(t, y, k);
    position_rates(t, y, k);
  }
  void implicit_euler(Real, Real dt, Motion& y) const {
    const Vec2 before = y.x, still = y.x + dt * y.v;  // x = still + dt^2 a(x), by Newton
    Vec2 x = still;
    for (int k = 0; k < 50; ++k) {
      const Vec2 residual = x - still - dt * dt * law.acceleration(x);
      const Vec2 move = (Mat2::Identity() - dt * dt * law.derivative(x)).partialPivLu().solve(residual);
      x -= move;
      if (!(move.norm() > 1e-15 * (1 + x.norm()))) break;
    }
    y.v = (x - before) / dt;
    y.x = x;
  }
};

struct Hooke {
  Vec2 acceleration(const Vec2& x) const { return -x; }
  Mat2 derivative(const Vec2&) const { return -Mat2::Identity(); }
};
struct Falling {
  Vec2 acceleration(const Vec2& x) const { return {-std::sin(x.x()), 0}; }
  Mat2 derivative(const Vec2& x) const { return Vec2(-std::cos(x.x()), 0).asDiagonal(); }
};
struct Gravity {
  Vec2 acceleration(const Vec2& x) const { return -x / std::pow(x.norm(), 3); }
  Mat2 derivative(const Vec2& x) const {
    const Real r = x.norm();
    return (3 / (r * r) * (x * x.transpose()) - Mat2::Identity()) / std::pow(r, 3);
  }
};

/// A problem whose answer at the end is known.
struct Problem {
  std::string name, what;      ///< file names; titles
  std::string source;
  Motion start, end;
  Real duration = 1, period = 1;
  Real size = 1;               ///< what errors are shares of
  int coarsest, finest;        ///< steps a period, powers of two
};

Problem oscillator() {
  Problem p{"oscillator", "Oscillator, 10 periods", "cos t", {}, {}, 0, 2 * kPi, 1, 4, 14};
  p.duration = 10.125 * p.period;  // not whole periods, at which symplectic Euler is right by symmetry
  p.start.x = {1, 0};
  p.end.x = {std::cos(p.duration), 0};
  p.end.v = {-std::sin(p.duration), 0};
  return p;
}

Problem pendulum() {
  constexpr Real kFrom = 2;  // [rad]
  const flow::reference::Pendulum exact{1, kFrom};
  Problem p{"pendulum", "Pendulum let go at 115 degrees, 5 periods", "theta = 2 asin(k sn(K - t)), k = sin(theta_0 / 2)", {}, {}, 0, exact.period(), 1, 4, 14};
  p.duration = 5.125 * p.period;
  p.start.x = {kFrom, 0};
  p.end.x = {exact.angle(p.duration), 0};
  // Energy: rate^2 / 2 = cos theta - cos theta_0; an eighth of a period on it falls.
  p.end.v = {-std::sqrt(2 * (std::cos(p.end.x.x()) - std::cos(kFrom))), 0};
  return p;
}

Problem orbit() {
  constexpr Real kEccentricity = 0.5;
  Problem p{"orbit", "Orbit of eccentricity 0.5, 3 turns", "Kepler's equation", {}, {}, 0, 2 * kPi, 1, 5, 15};
  p.duration = 3.3 * p.period;
  const auto at = [&](Real t) {
    Real e = t;
    for (int k = 0; k < 100; ++k) e -= (e - kEccentricity * std::sin(e) - t) / (1 - kEccentricity * std::cos(e));
    const Real across = std::sqrt(1 - kEccentricity * kEccentricity), rate = 1 / (1 - kEccentricity * std::cos(e));
    return Motion{{std::cos(e) - kEccentricity, across * std::sin(e)}, {-std::sin(e) * rate, across * std::cos(e) * rate}};
  };
  p.start = at(0);
  p.end = at(p.duration);
  return p;
}

template <class Law>
Motion integrated(const Problem& problem, Scheme scheme, std::uint64_t steps) {
  Ballistic<Law> system;
  Motion y = problem.start;
  flow::StepStorage<Motion> storage;
  const Real dt = problem.duration / static_cast<Real>(steps);
  for (std::uint64_t k = 0; k < steps; ++k) flow::integrate_step(scheme, system, static_cast<Real>(k) * dt, dt, y, storage);
  return y;
}

template <class Law>
CostRun run_problem(const Problem& problem, Scheme scheme, std::uint64_t steps) {
  // A clock that ticks in microseconds needs more than one of the short runs.
  Motion y;
  int times = 0;
  const Real begin = processor_time();
  Real seconds = 0;
  for (; times == 0 || seconds < 2e-3; seconds = processor_time() - begin, ++times) y = integrated<Law>(problem, scheme, steps);
  CostRun run;
  run.seconds = std::max(seconds / times, 1e-9);
  run.error = std::hypot((y.x - problem.end.x).norm(), (y.v - problem.end.v).norm()) / problem.size;
  if (!std::isfinite(run.error) || run.error > 10) run.error = kInfinity;
  run.steps = steps;
  run.memory = sizeof(Motion);
  StateHash hash;
  for (const Real value : {y.x.x(), y.x.y(), y.v.x(), y.v.y()}) hash.add(value);
  run.hash = hash.value();
  return run;
}

/// "rk4 is cheapest for errors of 0.01 and 1e-06"
std::string finding(const std::vector<CostPoint>& points, Real rough, Real fine) {
  const std::string one = cheapest(points, rough).curve, other = cheapest(points, fine).curve;
  if (one.empty()) return "";
  if (other.empty()) return fmt::format("{} is cheapest for errors of {:g}, none gets to {:g}", one, rough, fine);
  return one == other ? fmt::format("{} is cheapest for errors of {:g} and of {:g}", one, rough, fine) : fmt::format("{} is cheapest for errors of {:g}, {} for {:g}", one, rough, other, fine);
}

template <class Law>
CaseResult compare(const Problem& problem) {
  CaseResult result;
  for (std::size_t s = 0; s < std::size(kSchemes); ++s)
    for (int power = problem.coarsest; power <= problem.finest + (kOrders[s] > 1 ? 0 : 3); ++power) {
      const auto steps = static_cast<std::uint64_t>(std::lround(problem.duration / problem.period * std::ldexp(1, power)));
      const Real dt = problem.duration / static_cast<Real>(steps);
      result.costs.push_back(cost_of(name_of(kSchemes[s]), fmt::format("{} steps a period", 1 << power), dt, [&] { return run_problem<Law>(problem, kSchemes[s], steps); }, 5, 0.2));
      // Beyond what rounding allows there is nothing to see.
      if (result.costs.back().error < kRounding / 10) break;
    }
  std::vector<Slope> slopes;
  for (std::size_t s = 0; s < std::size(kSchemes); ++s) {
    const std::string name = name_of(kSchemes[s]);
    const Real order = order_of(result.costs, name, kRounding);
    result.measures.push_back(order_measure("order of " + name, order, kOrders[s], 0.1));
    if (kSchemes[s] != Scheme::kImplicitEuler && kSchemes[s] != Scheme::kSymplecticEuler) slopes.push_back({name, kOrders[s]});
  }
  result.plots.push_back(cost_plot("cost_" + problem.name, fmt::format("{}: {}", problem.what, finding(result.costs, 1e-2, 1e-6)), "error of place and velocity", result.costs));
  result.plots.push_back(convergence_plot("order_" + problem.name, fmt::format("{}: errors fall with the step's first, second and fourth power", problem.what), "step [s]", "error of place and velocity", result.costs, slopes));
  result.note = told(result.costs, 1e-3) + ".";
  return result;
}

/// The longest step at which 20,000 steps of the oscillator grow less than a hundredfold, by bisection; infinite: any.
Real edge_of(Scheme scheme) {
  const auto bounded = [&](Real dt) {
    Ballistic<Hooke> system;
    Motion y;
    y.x = {1, 0};
    flow::StepStorage<Motion> storage;
    for (int k = 0; k < 20000; ++k) flow::integrate_step(scheme, system, 0, dt, y, storage);
    return std::hypot(y.x.norm(), y.v.norm()) < 100;
  };
  Real low = 1e-5, high = 100;
  if (bounded(high)) return kInfinity;
  if (!bounded(low)) return 0;
  for (int k = 0; k < 40; ++k) (bounded(std::sqrt(low * high)) ? low : high) = std::sqrt(low * high);
  return low;
}

/// What a step does to the amplitude of an oscillation, against omega dt: beyond 1 it grows.
CaseResult stability_edge() {
  CaseResult result;
  Plot plot{"stability_edge", "Only implicit Euler is stable at any step; Euler and midpoint are at none", "step over 1 / omega", "growth of an oscillation in a step", true, true, {}};
  for (const Scheme scheme : kSchemes) {
    Curve curve{name_of(scheme), {}, {}, false, false};
    for (int k = 0; k <= 60; ++k) {
      const Real dt = std::pow(10, -1 + k / 30.0);
      Ballistic<Hooke> system;
      Motion y;
      y.x = {1, 0};
      flow::StepStorage<Motion> storage;
      constexpr int kSteps = 200;
      for (int i = 0; i < kSteps; ++i) flow::integrate_step(scheme, system, 0, dt, y, storage);
      curve.x.push_back(dt);
      curve.y.push_back(std::pow(std::hypot(y.x.norm(), y.v.norm()), 1.0 / kSteps));
    }
    plot.curves.push_back(std::move(curve));
  }
  result.plots.push_back(std::move(plot));
  const auto add = [&](Scheme scheme, Real theory) {
    const Real edge = edge_of(scheme);
    result.measures.push_back({"longest stable step of " + name_of(scheme), "1 / omega", edge, theory, std::abs(edge - theory) / theory, 0.01, ""});
  };
  add(Scheme::kSymplecticEuler, 2);
  add(Scheme::kRk4, std::sqrt(8.0));
  result.note = fmt::format("By bisection, 20,000 steps that grow less than a hundredfold. Euler: {:.2g}, midpoint: {:.2g} (each grows at any step, the midpoint rule as the step's fourth power), implicit Euler: none found up to 100.",
                            edge_of(Scheme::kEuler), edge_of(Scheme::kMidpoint));
  return result;
}

/// A jello world: the cube's constants, its start, and what it meets.
struct JelloSetting {
  std::string name, what;
  Real stiffness, damping, wall_stiffness, wall_damping;
  Vec3 velocity, force;
  Eigen::Vector4d plane;
  Vec3 corner;  ///< by which the last corner is pulled out [m]
  Real duration;
  bool smooth;  ///< meets nothing in that time
};

struct JelloRun {
  flow::springs::SpringState state;
  Real seconds = 0;
  std::size_t memory = 0;
  bool finite = true;
};

JelloRun run_jello(const JelloSetting& setting, Scheme scheme, std::uint64_t steps) {
  namespace springs = flow::springs;
  constexpr Real kMass = 0.001953, kRoom = 2;
  const springs::SpringBody body = springs::jello_cube(8, Vec3::Zero(), 1, kMass, {setting.stiffness, setting.damping, 0});
  springs::SpringSystem system(body.network);
  geometry::ForceGrid field;
  field.resolution = 2;
  field.values.assign(8, setting.force);
  system.surroundings.field = &field;
  for (int axis = 0; axis < 3; ++axis)
    for (const Real side : {1.0, -1.0}) system.surroundings.walls.push_back({side * Vec3::Unit(axis), kRoom});
  const Real length = setting.plane.head<3>().norm();
  system.surroundings.walls.push_back({setting.plane.head<3>() / length, setting.plane[3] / length});
  system.surroundings.response = {setting.wall_stiffness, setting.wall_damping, 0};

  JelloRun run;
  run.state = body.state;
  run.state.x.back() += setting.corner;
  for (Vec3& v : run.state.v) v = setting.velocity;
  flow::StepStorage<springs::SpringState> storage;
  storage.k1 = storage.k2 = storage.k3 = storage.k4 = run.state;
  const Real dt = setting.duration / static_cast<Real>(steps), begin = processor_time();
  for (std::uint64_t k = 0; k < steps && run.finite; ++k) {
    flow::integrate_step(scheme, system, static_cast<Real>(k) * dt, dt, run.state, storage);
    run.finite = run.state.x[0].allFinite() && run.state.x[0].norm() < 1e3 && run.state.x.back().norm() < 1e3;
  }
  run.seconds = processor_time() - begin;
  run.memory = system.memory() + 6 * run.state.x.size() * 2 * sizeof(Vec3);
  return run;
}

CaseResult jello(const JelloSetting& setting, bool full) {
  const ThreadLimit one(1);
  const Real coarse = 8e-4;  // about the explicit schemes' limit
  const auto steps_of = [&](Real dt) { return static_cast<std::uint64_t>(std::lround(setting.duration / dt)); };
  const flow::springs::SpringState exact = run_jello(setting, Scheme::kRk4, steps_of(coarse / (full ? 128 : 64))).state;
  CaseResult result;
  const auto add = [&](Scheme scheme, Real dt) {
    result.costs.push_back(cost_of(name_of(scheme), fmt::format("steps of {:.3g} us", 1e6 * dt), dt, [&] {
      const JelloRun run = run_jello(setting, scheme, steps_of(dt));
      CostRun cost;
      cost.seconds = run.seconds;
      cost.steps = steps_of(dt);
      cost.memory = run.memory;
      Real sum = 0;
      for (std::size_t i = 0; i < exact.x.size(); ++i) sum += (run.state.x[i] - exact.x[i]).squaredNorm();
      cost.error = run.finite ? std::sqrt(sum / static_cast<Real>(exact.x.size())) : kInfinity;
      if (!(cost.error < 10)) cost.error = kInfinity;
      StateHash hash;
      hash.add(std::span<const Vec3>(run.state.x));
      cost.hash = hash.value();
      return cost;
    }, 3, 0.5));
  };
  for (const Scheme scheme : kSchemes) {
    const bool implicit = scheme == Scheme::kImplicitEuler;
    // A step of it is a solve: longer ones, which no other scheme bears.
    for (int k = 0; k < (implicit ? 2 : 5) + (full ? 2 : 0); ++k) add(scheme, (implicit ? 16 : 2) * coarse * std::ldexp(1, -k));
  }
  std::vector<Slope> slopes;
  for (std::size_t s = 0; s < std::size(kSchemes); ++s) {
    const std::string name = name_of(kSchemes[s]);
    if (kSchemes[s] == Scheme::kImplicitEuler) continue;  // its steps here are long
    // What meets a wall on the way has forces with a kink, where no scheme keeps a high order.
    // Euler shows its order at finer steps than a short study takes.
    if (setting.smooth && (full || kSchemes[s] != Scheme::kEuler)) result.measures.push_back(order_measure("order of " + name, order_of(result.costs, name), kOrders[s], 0.1));
    if (kSchemes[s] == Scheme::kEuler || (setting.smooth && kSchemes[s] == Scheme::kRk4)) slopes.push_back({name, kOrders[s]});
  }
  const std::vector<CostPoint> best = points_of(result.costs, name_of(Scheme::kRk4));
  result.measures.push_back({"RK4 at its finest", "m", best.back().error, 0, best.back().error, 1e-4, "m"});
  result.plots.push_back(cost_plot("cost_" + setting.name, fmt::format("{}: {}", setting.what, finding(result.costs, 1e-2, 1e-4)), "rms error of the points [m]", result.costs));
  result.plots.push_back(convergence_plot("order_" + setting.name, setting.what + (setting.smooth ? ": errors fall as each scheme's order says; beyond about 0.8 ms explicit schemes blow up" : ": forces with a kink leave RK4 no higher order than the others; implicit Euler never blows up"), "step [s]", "rms error of the points [m]", result.costs, slopes));
  result.note = fmt::format("512 points, {} s; reference: RK4 at {:.3g} us. {}.", setting.duration, 1e6 * coarse / (full ? 128 : 64), told(result.costs, 1e-3));
  return result;
}

const JelloSetting kFlight{"jello_flight", "Jello cube in free flight, a corner pulled out", 200, 0.25, 400, 0.25, {10, -10, 20}, {0, 0, 0}, {-1, 1, 1, 2}, Vec3::Constant(1.0 / 7), 0.04, true};
const JelloSetting kWorld{"jello_world", "The world jello.w, thrown into walls", 200, 0.25, 400, 0.25, {10, -10, 20}, {0, 0, 0}, {-1, 1, 1, 2}, Vec3::Constant(1.0 / 7), 0.08, false};
const JelloSetting kFall{"jello_gravity", "The world gravity.w, thrown into walls", 500, 0.25, 1000, 0.25, {10, -10, 0}, {0, 0, -0.06}, {-1, 1, 2, 6}, {0, 0, 0}, 0.13, false};

}  // namespace

std::vector<Case> integrator_cases() {
  std::vector<Case> cases;
  const auto add = [&](const Problem& problem, CaseResult (*run)(const Problem&)) {
    cases.push_back({problem.name, problem.what + ": seconds and error by scheme and step", problem.source, true, [problem, run] { return run(problem); }});
  };
  add(oscillator(), compare<Hooke>);
  add(pendulum(), compare<Falling>);
  add(orbit(), compare<Gravity>);
  cases.push_back({"stability-edge", "The longest stable step of each scheme", "eigenvalues of the step's matrix", true, stability_edge});
  for (const JelloSetting* setting : {&kFlight, &kWorld, &kFall}) {
    std::string name = setting->name;
    name[name.find('_')] = '-';
    cases.push_back({name, setting->what + ": seconds and error by scheme and step", "RK4 with steps an eighth of the finest here and less", true, [setting] { return jello(*setting, false); },
                     [setting] { return jello(*setting, true); }});
  }
  return cases;
}

}  // namespace effuse::study
