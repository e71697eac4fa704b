#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <vector>

#include "flow/bodies/rigid_bodies.h"
#include "flow/bodies/rotor.h"
#include "flow/fem/elastic_solid.h"
#include "flow/reference/rigid_motion.h"
#include "flow/waves/wave_grid.h"
#include "geometry/base/error.h"
#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "samples/study/cost/cost.h"
#include "samples/study/study.h"

/// What accuracy costs the other solvers: grid and step of waves, step of bodies, elements of elastic solids.
namespace effuse::study {

namespace {

constexpr Real kInfinity = std::numeric_limits<Real>::infinity();

template <class Solver>
std::uint64_t hash_of(const Solver& solver) {
  StateHash hash;
  solver.add_to(hash);
  return hash.value();
}

// ---- Waves ----

/// A standing wave of a length of 10 m in a closed channel, g H = 1, for three periods: relative L2 error of the height.
CostRun standing_wave(int cells, Real courant, flow::waves::WaveScheme scheme) {
  using namespace flow::waves;
  constexpr Real kLength = 10, kPeriods = 3.1;
  WaveOptions o;
  o.nx = cells, o.ny = 4;
  o.cell = kLength / cells;
  o.scheme = scheme;
  WaveGrid grid(o, {1.0});
  const Real k = 2 * kPi / kLength, end = kPeriods * kLength;
  const auto shape = [&](std::size_t c) { return std::cos(k * grid.centre(c).x()); };
  for (std::size_t c = 0; c < grid.size(); ++c) grid.height()[c] = shape(c);
  const auto steps = static_cast<std::uint64_t>(std::ceil(end / (courant * o.cell / std::sqrt(2.0))));
  const Real dt = end / static_cast<Real>(steps);
  // Kicks and drifts take turns: the explicit scheme's rate is that of half a step before.
  if (scheme == WaveScheme::kExplicit)
    for (std::size_t c = 0; c < grid.size(); ++c) grid.rate()[c] = k * std::sin(k * dt / 2) * shape(c);
  const Real begin = processor_time();
  CostRun run;
  try {
    for (std::uint64_t s = 0; s < steps; ++s)
      if (!grid.step(dt)) throw UnstableError("the implicit solve did not converge");
  } catch (const UnstableError&) {
    run.error = kInfinity;
  }
  run.seconds = processor_time() - begin;
  run.steps = steps;
  run.memory = grid.memory();
  run.hash = hash_of(grid);
  if (run.error > 0) return run;
  Real wrong = 0, right = 0;
  for (std::size_t c = 0; c < grid.size(); ++c) {
    wrong += std::pow(grid.height()[c] - shape(c) * std::cos(k * end), 2);
    right += std::pow(shape(c), 2);  // of the amplitude: the wave itself may stand at zero
  }
  run.error = std::sqrt(wrong / right);
  return run;
}

CaseResult waves(bool full) {
  const ThreadLimit one(1);
  using flow::waves::WaveScheme;
  CaseResult result;
  struct Way {
    const char* name;
    Real courant;
    WaveScheme scheme;
  };
  for (const Way& way : {Way{"explicit, 0.9 of the limit", 0.9, WaveScheme::kExplicit}, Way{"explicit, 0.45 of it", 0.45, WaveScheme::kExplicit}, Way{"explicit, 1.1 of it", 1.1, WaveScheme::kExplicit},
                         Way{"implicit, 0.9 of it", 0.9, WaveScheme::kImplicit}, Way{"implicit, 4 times it", 4, WaveScheme::kImplicit}})
    for (int cells = 20; cells <= (full ? 640 : 160); cells *= 2)
      result.costs.push_back(cost_of(way.name, fmt::format("{} cells a wave", cells), 10.0 / cells, [&] { return standing_wave(cells, way.courant, way.scheme); }, 5, 0.5));
  for (const char* name : {"explicit, 0.9 of the limit", "implicit, 0.9 of it"}) result.measures.push_back(order_measure(std::string("order of ") + name, order_of(result.costs, name), 2, 0.1));
  const Cheapest best = cheapest(result.costs, 1e-3);
  result.plots.push_back(cost_plot("waves_cost", fmt::format("A standing wave, 3 periods: {} is cheapest for 0.1 %; beyond the limit the explicit scheme is refused", best.curve), "relative L2 error", result.costs));
  result.plots.push_back(convergence_plot("waves_order", "A standing wave: both schemes are of second order in the cell's side", "cell [m]", "relative L2 error", result.costs, std::vector<Slope>{{"explicit, 0.9 of the limit", 2}}));
  result.note = "A wave of 10 m between mirrors, c = 1 m/s, steps in shares of the explicit limit. " + told(result.costs, 1e-2) + ".";
  return result;
}

// ---- Rigid bodies ----

constexpr flow::bodies::RotorScheme kRotorSchemes[] = {flow::bodies::RotorScheme::kSplitting, flow::bodies::RotorScheme::kMidpoint, flow::bodies::RotorScheme::kRk4, flow::bodies::RotorScheme::kSymplecticEuler};
constexpr Real kRotorOrders[] = {2, 2, 4, 1};
const Vec3 kMoments(1, 2, 3), kMomentum(0.2, 2, 0.2);  // about the middle axis, which it turns over from again and again
constexpr Real kTopSeconds = 10;

struct Top {
  Quat q;
  Real drift = 0;  ///< largest change of energy, relative
};
Top turned(flow::bodies::RotorScheme scheme, std::uint64_t steps) {
  Top top{Quat::Identity(), 0};
  const auto energy = [&](const Quat& q) { return flow::bodies::angular_velocity(q, kMomentum, kMoments).dot(kMomentum) / 2; };
  const Real begin = energy(top.q), dt = kTopSeconds / static_cast<Real>(steps);
  for (std::uint64_t k = 0; k < steps; ++k) {
    top.q = flow::bodies::turn_freely(scheme, top.q, kMomentum, kMoments, dt);
    top.drift = std::max(top.drift, std::abs(energy(top.q) / begin - 1));
  }
  return top;
}

CaseResult tops(bool full) {
  CaseResult result;
  const std::uint64_t coarsest = 480, finest = coarsest << (full ? 11 : 10);
  const Quat exact = turned(flow::bodies::RotorScheme::kRk4, finest).q;
  std::vector<CostPoint> drifts;
  for (const flow::bodies::RotorScheme scheme : kRotorSchemes)
    for (std::uint64_t steps = coarsest; steps <= finest / 8; steps *= 2) {
      Top top;
      const std::string name(flow::bodies::kRotorSchemeNames[static_cast<std::size_t>(scheme)]);
      const Real dt = kTopSeconds / static_cast<Real>(steps);
      result.costs.push_back(cost_of(name, fmt::format("steps of {:.3g} ms", 1e3 * dt), dt, [&] {
        CostRun run;
        const Real before = processor_time();
        top = turned(scheme, steps);
        run.seconds = std::max(processor_time() - before, 1e-6);
        run.error = top.q.angularDistance(exact);
        run.steps = steps;
        run.memory = sizeof(Quat);
        StateHash hash;
        for (int c = 0; c < 4; ++c) hash.add(top.q.coeffs()[c]);
        run.hash = hash.value();
        return run;
      }, 5, 0.1));
      drifts.push_back(result.costs.back());
      drifts.back().error = top.drift;
    }
  std::vector<Slope> slopes;
  for (std::size_t s = 0; s < std::size(kRotorSchemes); ++s) {
    const std::string name(flow::bodies::kRotorSchemeNames[s]);
    result.measures.push_back(order_measure("order of " + name, order_of(result.costs, name, 1e-11), kRotorOrders[s], 0.1));
    if (s > 0) slopes.push_back({name, kRotorOrders[s]});
  }
  result.plots.push_back(cost_plot("bodies_top_cost", fmt::format("A top that turns over and over: {} is cheapest for 0.01 rad, {} for 1e-6", cheapest(result.costs, 1e-2).curve, cheapest(result.costs, 1e-6).curve), "angle off [rad]", result.costs));
  result.plots.push_back(convergence_plot("bodies_top_order", "A top that turns over and over: orders 2, 2, 4, 1", "step [s]", "angle off [rad]", result.costs, slopes));
  result.plots.push_back(convergence_plot("bodies_top_energy", "A top's energy wavers with splitting and midpoint, and drifts with the others", "step [s]", "largest change of energy", drifts, {}));
  result.note = fmt::format("Moments 1, 2, 3, 10 s near the middle axis; reference: rk4 with steps of {:.3g} ms. {}.", 1e3 * kTopSeconds / static_cast<Real>(finest), told(result.costs, 1e-3));
  return result;
}

/// A bar on a hinge, let go at 60 degrees: period against the elliptic integral's.
CaseResult hinge(bool full) {
  using namespace flow::bodies;
  const ThreadLimit one(1);
  CaseResult result;
  for (const int substeps : {1, 4})
    for (int rate = 30; rate <= (full ? 960 : 240); rate *= 2)
      result.costs.push_back(cost_of(fmt::format("{} {} a look", substeps, substeps == 1 ? "substep" : "substeps"), fmt::format("{} looks a second", rate), 1.0 / rate, [&] {
        constexpr Real kFrom = kPi / 3, kSeconds = 20;
        BodyOptions options;
        options.sleep_speed = 0;
        options.step = 1.0 / rate;
        options.substeps = substeps;
        RigidBodies world(options);
        const BodyId hook = world.add_static(Shape::sphere(0.01), {Vec3::Zero(), Quat::Identity()});
        const Quat q(Eigen::AngleAxisd(kFrom, -Vec3::UnitY()));
        const BodyId bar = world.add(Shape::box(Vec3(0.05, 0.05, 0.5)), 1000, {q * Vec3(0, 0, -0.5), q});
        Joint joint;
        joint.kind = Joint::Kind::kHinge;
        joint.a = hook;
        joint.b = bar;
        joint.axis = Vec3::UnitY();
        world.join(joint);
        const Real m = world.mass(bar), inertia = m / 12 * (1 + 0.01) + m / 4;
        const Real exact = flow::reference::Pendulum{std::sqrt(m * kGravity * 0.5 / inertia), kFrom}.period();
        Real before = kFrom, first = 0, last = 0;
        int crossings = 0;
        CostRun run;
        const Real begin = processor_time();
        while (world.time() < kSeconds) {
          const Real t = world.time();
          world.step(options.step);
          ++run.steps;
          const Vec3 x = world.centres()[bar];
          const Real angle = std::atan2(x.x(), -x.z());
          if (before < 0 && angle >= 0) {
            last = t + (world.time() - t) * -before / (angle - before);
            if (crossings++ == 0) first = last;
          }
          before = angle;
        }
        run.seconds = processor_time() - begin;
        run.error = std::abs((last - first) / (crossings - 1) / exact - 1);
        run.memory = world.memory();
        run.hash = hash_of(world);
        return run;
      }, 3, 0.5));
  const std::string usual = "4 substeps a look";
  result.measures.push_back(order_measure("order of " + usual, order_of(result.costs, usual), 2, 0.3));
  const auto at = std::find_if(result.costs.begin(), result.costs.end(), [&](const CostPoint& p) { return p.curve == usual && p.setting == "120 looks a second"; });
  result.measures.push_back({"period at the defaults", "", at->error, 0, at->error, 1e-3, ""});
  result.plots.push_back(cost_plot("bodies_hinge_cost", fmt::format("A bar on a hinge: at the defaults its period is {:.1g} off; {} for 1e-4", at->error, cheapest(result.costs, 1e-4).curve), "relative error of the period", result.costs));
  result.plots.push_back(convergence_plot("bodies_hinge_order", "A bar on a hinge: the period's error falls with the step's square", "step [s]", "relative error of the period", result.costs, std::vector<Slope>{{usual, 2}}));
  result.note = "Let go at 60 degrees, 20 s. " + told(result.costs, 1e-4) + ".";
  return result;
}

// ---- Elastic solids ----

/// A cantilever of length 10, 1 x 1 across, under a load at its end, at rest after long steps of implicit Euler: tip against
/// w = F L^3 / (3 E I) + F L / (kappa G A) (Timoshenko; kappa of Cowper 1966).
CaseResult cantilever(bool full) {
  const ThreadLimit one(1);
  using namespace flow::fem;
  CaseResult result;
  std::vector<Real> tips;
  for (int across = 1; across <= (full ? 8 : 4); across *= 2) {
    Real ratio = 0;
    result.costs.push_back(cost_of("tip", fmt::format("{} elements across", across), 1.0 / across, [&] {
      constexpr Real L = 10, E = 1e6, nu = 0.3, F = 1;
      ElasticSolid solid(box_of_tets(Vec3::Zero(), Vec3(L, 1, 1), static_cast<int>(L) * across, across, across), {E, nu, 1000, 0, 0});
      solid.gravity = Vec3::Zero();
      solid.load.assign(solid.nodes(), Vec3::Zero());
      std::vector<Index> tip;
      std::vector<Real> height;
      for (Index i = 0; i < solid.nodes(); ++i) {
        const Vec3& x = solid.state().x[i];
        if (x.x() < 1e-9) solid.held()[i] = 1;
        if (x.x() > L - 1e-9) {
          tip.push_back(i);
          height.push_back(x.z());
        }
      }
      for (const Index i : tip) solid.load[i] = Vec3(0, 0, -F / static_cast<Real>(tip.size()));
      CostRun run;
      const Real begin = processor_time();
      for (; run.steps < 2; ++run.steps) solid.step(1e5);
      run.seconds = processor_time() - begin;
      Real w = 0;
      for (std::size_t k = 0; k < tip.size(); ++k) w += (height[k] - solid.state().x[tip[k]].z()) / static_cast<Real>(tip.size());
      constexpr Real I = 1.0 / 12, G = E / (2 * (1 + nu)), kappa = 10 * (1 + nu) / (12 + 11 * nu);
      ratio = w / (F * L * L * L / (3 * E * I) + F * L / (kappa * G));
      run.error = std::abs(ratio - 1);
      run.memory = solid.memory();
      run.hash = hash_of(solid);
      return run;
    }, 3, 1));
    tips.push_back(ratio);
  }
  const Real fine = tips.back(), coarse = tips[tips.size() - 2], extrapolated = fine + (fine - coarse) / 3;
  result.measures.push_back({"tip, extrapolated from the two finest", "", extrapolated, 1, std::abs(extrapolated - 1), full ? 0.03 : 0.06, ""});
  const Real order = order_of(result.costs, "tip", 0, 2);
  result.measures.push_back({"order of the tip's error, the two finest", "", order, 2, std::abs(order - 2), 0.7, "absolute"});
  result.plots.push_back(cost_plot("solids_cantilever_cost", fmt::format("A cantilever of linear tetrahedra: {} across leave {:.2g} % for {:.2g} s; two finest extrapolate to {:.2g} %", full ? "eight" : "four", 100 * result.costs.back().error, result.costs.back().seconds, 100 * std::abs(extrapolated - 1)),
                                   "relative error of the tip", result.costs));
  result.plots.push_back(convergence_plot("solids_cantilever_order", "A cantilever of linear tetrahedra: too stiff, by the square of their size", "size over the height", "relative error of the tip", result.costs, std::vector<Slope>{{"tip", 2}}));
  result.note = "10 : 1 : 1, Poisson's ratio 0.3, a load of which it bends by 0.4 % of its length.";
  return result;
}

}  // namespace

std::vector<Case> solver_cases() {
  std::vector<Case> cases;
  const auto add = [&](const std::string& name, const std::string& title, const std::string& source, CaseResult (*run)(bool)) {
    cases.push_back({name, title, source, true, [run] { return run(false); }, [run] { return run(true); }});
  };
  add("waves", "Waves: cells and steps of a standing wave", "cos kx cos wt", waves);
  add("top", "Bodies: schemes of a free top", "RK4 with steps an eighth of the finest here", tops);
  add("hinge", "Bodies: step of a bar on a hinge", "complete elliptic integral", hinge);
  add("cantilever", "Elastic solids: elements of a cantilever", "Timoshenko's beam, Cowper 1966", cantilever);
  return cases;
}

}  // namespace effuse::study
