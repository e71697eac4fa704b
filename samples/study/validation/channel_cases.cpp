#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "flow/reference/channel.h"
#include "samples/study/measure.h"
#include "samples/study/study.h"
#include "samples/study/validation/setups.h"

/// Flows that change across their depth only: columns of particles, periodic in x and y, between plates or on slopes.
namespace effuse::study {
namespace {

using flow::sph::ModernLava;
using flow::sph::ModernOptions;
namespace reference = flow::reference;

constexpr Real kDegree = kPi / 180;
constexpr int kAcross = 6;  // particles along the periodic sides: two supports of three spacings

/// options with periodic sides kAcross spacings wide.
ModernOptions column(ModernOptions options) {
  options.period = Vec2::Constant(kAcross * options.spacing);
  return options;
}

Vec3 tilted_gravity(Real slope) { return kGravity * Vec3(std::sin(slope), 0, -std::cos(slope)); }

/// Heights and speeds along `along` of all particles, by rising height.
struct Speeds {
  std::vector<Real> z, u;
};
Speeds speeds(const ModernLava& lava, const Vec3& along) {
  std::vector<std::size_t> order(lava.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return lava.positions()[a].z() < lava.positions()[b].z(); });
  Speeds s;
  for (std::size_t i : order) {
    s.z.push_back(lava.positions()[i].z());
    s.u.push_back(lava.velocities()[i].dot(along));
  }
  return s;
}

/// Volume that passes, per width and second [m^2/s]: the sum of u dx^3 over the ground's area.
Real flux(const Speeds& s, const ModernOptions& options) {
  Real sum = 0;
  for (Real u : s.u) sum += u;
  return sum * std::pow(options.spacing, 3) / (options.period.x() * options.period.y());
}

/// Speed at the surface of a film of the depth given: u = a + b (depth - z)^2 fitted to its upper half, as nothing pulls at the surface.
Real surface_speed(const Speeds& s, Real depth) {
  Real n = 0, sq = 0, sqq = 0, su = 0, squ = 0;
  for (std::size_t i = 0; i < s.z.size(); ++i) {
    if (s.z[i] < depth / 2) continue;
    const Real q = (depth - s.z[i]) * (depth - s.z[i]);
    n += 1, sq += q, sqq += q * q, su += s.u[i], squ += q * s.u[i];
  }
  return (su * sqq - squ * sq) / (n * sqq - sq * sq);
}

/// A measured profile and its reference as two curves, u over z.
template <class U>
void add_profile(Plot& plot, const std::string& name, const Speeds& s, Real depth, const U& exact) {
  Curve line{name + " exact", {}, {}, false, true}, marks{name, s.z, s.u, true, false};
  for (Real z : spaced(0, depth, 101)) {
    line.x.push_back(z);
    line.y.push_back(exact(z));
  }
  plot.curves.push_back(std::move(line));
  plot.curves.push_back(std::move(marks));
}

/// The error of a profile against a function.
template <class U>
Real profile_error(const Speeds& s, const U& exact) {
  return relative_l2_error(s.z, s.u, exact);
}

CaseResult hydrostatic_rest(Real mu) {
  const Real depth = 1, dx = depth / 20;
  const ModernOptions options = column(isothermal(dx, mu));
  ModernLava lava(options, {}, {plane(Vec3::UnitZ(), Vec3::Zero())});
  add_at_rest(lava, block(Vec3::Zero(), {kAcross, kAcross, 20}, dx));

  // The level is the mean height of the uppermost layer.
  const auto level = [&] {
    const Speeds s = speeds(lava, Vec3::UnitZ());
    Real sum = 0;
    for (std::size_t i = s.z.size() - kAcross * kAcross; i < s.z.size(); ++i) sum += s.z[i];
    return sum / (kAcross * kAcross) + dx / 2;
  };
  const Real level_at_first = level(), speed_of_fall = std::sqrt(kGravity * depth);
  Real drift = 0, fastest = 0;
  Curve speed{"fastest particle", {}, {}, false, false}, drifts{"drift of the level", {}, {}, false, false};
  RunStatistics statistics;
  run_until(lava, 10, 0.05, statistics, [&](const flow::sph::ModernReport& report) {
    const Real moved = level() - level_at_first;
    drift = std::max(drift, std::abs(moved) / dx);
    // The first second is the settling of the lattice into its pressure.
    if (lava.time() > 1) fastest = std::max(fastest, report.max_speed / speed_of_fall);
    speed.x.push_back(lava.time());
    speed.y.push_back(report.max_speed / speed_of_fall);
    drifts.x.push_back(lava.time());
    drifts.y.push_back(std::abs(moved) / dx);
  });

  std::vector<Real> z, p, exact;
  for (std::size_t i = 0; i < lava.size(); ++i) {
    z.push_back(lava.positions()[i].z());
    p.push_back(lava.pressures()[i] / 1000);
    exact.push_back(options.density * kGravity * (depth - z.back()) / 1000);
  }
  CaseResult result;
  result.measures = {bounded("pressure, L2 of the profile at 10 s", relative_l2_error(p, exact), 0.02),
                     {"fastest particle from 1 s to 10 s, of sqrt(g H)", "", fastest, 0, fastest, 1e-3, ""},
                     {"largest drift of the level, of a spacing", "", drift, 0, drift, 0.1, ""}};
  result.plots = {{fmt::format("rest_{:.0f}_pressure", mu), "Column at rest: pressure after 10 s", "height [m]", "pressure [kPa]", false, false,
                   {{"rho g (H - z)", {0, depth}, {options.density * kGravity * depth / 1000, 0}, false, true}, {"particles", z, p, true, false}}},
                  {fmt::format("rest_{:.0f}_drift", mu), "Column at rest: speed over sqrt(g H), drift of the level over dx", "time [s]", "ratio", false, true, {speed, drifts}}};
  result.note = fmt::format("H = 1 m, mu = {} Pa s, 20 particles deep; {}.", mu, statistics.text());
  return result;
}

// Flows between plates run askew to the lattice: along one of its axes operators can look better than they are.
const Vec3 kAskew(std::cos(30 * kDegree), std::sin(30 * kDegree), 0);

CaseResult poiseuille() {
  const reference::PlanePoiseuille exact{0.05, 1, 0.1};
  const Real dx = exact.width / 20;
  const Real density = 1000;
  ModernOptions options = column(isothermal(dx, exact.nu * density));
  options.density = density;
  options.gravity = exact.force * kAskew;
  ModernLava lava(options, {}, {plane(Vec3::UnitZ(), Vec3::Zero()), plane(-Vec3::UnitZ(), Vec3(0, 0, exact.width))});
  add_at_rest(lava, block(Vec3::Zero(), {kAcross, kAcross, 20}, dx));

  CaseResult result;
  Plot plot{"poiseuille", "Plane Poiseuille flow from rest", "distance from the wall [m]", "speed [m/s]", false, false, {}};
  RunStatistics statistics;
  Real worst = 0;
  for (Real t : {0.5, 1.0, 2.0, 4.0}) {
    run_until(lava, t, 0.02, statistics);
    const Speeds s = speeds(lava, kAskew);
    const auto u = [&](Real y) { return exact.velocity(y, t); };
    worst = std::max(worst, profile_error(s, u));
    add_profile(plot, fmt::format("{} s", t), s, exact.width, u);
  }
  run_until(lava, 12, 0.1, statistics);
  const Speeds s = speeds(lava, kAskew);
  const auto u = [&](Real y) { return exact.velocity(y); };
  add_profile(plot, "12 s", s, exact.width, u);
  result.measures = {bounded("L2 of the profile, steady", profile_error(s, u), 0.02), bounded("worst L2 of the start-up (0.5, 1, 2, 4 s)", worst, 0.02),
                     compared("volume flux, steady", "m2/s", flux(s, options), exact.flux(), 0.02)};
  result.plots = {plot};
  result.note = fmt::format("20 particles a gap, nu 0.1, Re 0.6, 30 degrees askew to the lattice; {}.", statistics.text());
  return result;
}

CaseResult couette() {
  const reference::Couette exact{0.0625, 1, 0.1};
  const Real dx = exact.width / 20;
  const Real density = 1000;
  ModernOptions options = column(isothermal(dx, exact.nu * density));
  options.density = density;
  options.gravity = Vec3::Zero();
  ModernLava lava(options, {}, {plane(Vec3::UnitZ(), Vec3::Zero()), plane(-Vec3::UnitZ(), Vec3(0, 0, exact.width), exact.speed * kAskew)});
  add_at_rest(lava, block(Vec3::Zero(), {kAcross, kAcross, 20}, dx));

  CaseResult result;
  Plot plot{"couette", "Couette flow from rest", "distance from the resting wall [m]", "speed [m/s]", false, false, {}};
  RunStatistics statistics;
  Real worst = 0;
  for (Real t : {0.5, 1.0, 2.0}) {
    run_until(lava, t, 0.02, statistics);
    const Speeds s = speeds(lava, kAskew);
    const auto u = [&](Real y) { return exact.velocity(y, t); };
    worst = std::max(worst, profile_error(s, u));
    add_profile(plot, fmt::format("{} s", t), s, exact.width, u);
  }
  run_until(lava, 8, 0.1, statistics);
  const Speeds s = speeds(lava, kAskew);
  const auto u = [&](Real y) { return exact.velocity(y); };
  add_profile(plot, "8 s", s, exact.width, u);
  result.measures = {bounded("L2 of the profile, steady", profile_error(s, u), 0.02), bounded("worst L2 of the start-up (0.5, 1, 2 s)", worst, 0.02),
                     compared("volume flux, steady", "m2/s", flux(s, options), exact.flux(), 0.02)};
  result.plots = {plot};
  result.note = fmt::format("20 particles a gap, nu 0.1, 30 degrees askew to the lattice; {}.", statistics.text());
  return result;
}

/// A film from rest. Surface speed and flux are means over the second half of the run: layers that pass over each other make both waver.
struct FilmRun {
  Speeds speeds;  ///< at the end
  Real surface = 0, flux = 0;
  RunStatistics statistics;
};
FilmRun run_film(const ModernOptions& options, int layers, Real until, Real max_step) {
  ModernLava lava(options, {}, {plane(Vec3::UnitZ(), Vec3::Zero())});
  add_at_rest(lava, block(Vec3::Zero(), {kAcross, kAcross, layers}, options.spacing));
  FilmRun run;
  run_until(lava, until / 2, max_step, run.statistics);
  run_until(lava, until, max_step, run.statistics, [&](const flow::sph::ModernReport& report) {
    run.speeds = speeds(lava, Vec3::UnitX());
    run.surface += surface_speed(run.speeds, layers * options.spacing) * report.dt / (until / 2);
    run.flux += flux(run.speeds, options) * report.dt / (until / 2);
  });
  return run;
}

CaseResult nusselt_film() {
  const Real depth = 1, dx = depth / 10;
  CaseResult result;
  Plot plot{"film", "Film on a slope", "height above the slope [m]", "speed [m/s]", false, false, {}};
  for (const auto& [slope_deg, mu] : {std::pair{5.0, 2e4}, std::pair{25.0, 1e5}}) {
    ModernOptions options = column(isothermal(dx, mu));
    options.gravity = tilted_gravity(slope_deg * kDegree);
    const reference::NusseltFilm exact{depth, slope_deg * kDegree, mu / options.density};
    // Sheared by 0.06 / s: after 40 s the top has passed the bottom by more than a depth, and the lattice is gone.
    const Real until = 40;
    const FilmRun fine = run_film(options, 10, until, 0.06), coarse = run_film(options, 10, until, 0.6);
    const std::string at = fmt::format("{} degrees: ", slope_deg);
    result.measures.push_back(compared(at + "surface speed", "m/s", fine.surface, exact.surface_speed(), 0.03));
    result.measures.push_back(compared(at + "volume flux", "m2/s", fine.flux, exact.flux(), 0.03));
    result.measures.push_back(compared(at + "surface speed with ten times the step", "m/s", coarse.surface, fine.surface, 0.02));
    result.measures.push_back(compared(at + "volume flux with ten times the step", "m2/s", coarse.flux, fine.flux, 0.02));
    add_profile(plot, fmt::format("{} degrees", slope_deg), fine.speeds, depth, [&](Real y) { return exact.velocity(y); });
    plot.curves.push_back({fmt::format("{} degrees, ten times the step", slope_deg), coarse.speeds.z, coarse.speeds.u, true, false});
    result.note += fmt::format("{}mu = {:.0e} Pa s, to {} s, {}; against {}. ", at, mu, until, fine.statistics.text(), coarse.statistics.text());
  }
  result.plots = {plot};
  result.note += "10 particles deep.";
  return result;
}

/// Height at which a plug begins: the vertex of the parabola u = s z - c z^2 through the particles slower than three quarters of the top two
/// layers. Nearer the edge regularisation rounds the profile off.
Real plug_edge(const Speeds& speeds) {
  constexpr std::size_t kTop = 2 * kAcross * kAcross;
  Real top = 0;
  for (std::size_t i = speeds.u.size() - kTop; i < speeds.u.size(); ++i) top += speeds.u[i] / kTop;
  Real z2 = 0, z3 = 0, z4 = 0, uz = 0, uz2 = 0;
  for (std::size_t i = 0; i < speeds.z.size(); ++i) {
    const Real z = speeds.z[i], u = speeds.u[i];
    if (u > 0.75 * top) continue;
    z2 += z * z, z3 += z * z * z, z4 += z * z * z * z, uz += u * z, uz2 += u * z * z;
  }
  const Real determinant = z3 * z3 - z2 * z4, s = (z3 * uz2 - z4 * uz) / determinant, c = (z2 * uz2 - z3 * uz) / determinant;
  return s / (2 * c);
}

CaseResult bingham_film() {
  constexpr int kLayers = 20;
  const Real depth = 1, dx = depth / kLayers, until = 16, step = 0.1;
  reference::BinghamFilm film{depth, 10 * kDegree, 2600, 2e4, 0};
  CaseResult result;
  Plot plot{"bingham", "Bingham film on a slope of 10 degrees", "height above the slope [m]", "speed [m/s]", false, false, {}};
  const Real newtonian_speed = film.plug_speed();
  // Where it does not yield the fluid creeps with the smaller of mu_max and Papanastasiou's m tau_y.
  const Real m = 1e5, mu_max = 1e8;
  const auto with_strength = [&](Real r) {
    film.yield = r * film.wall_stress();
    ModernOptions options = column(isothermal(dx, film.mu));
    options.density = film.density;
    options.gravity = tilted_gravity(film.slope);
    options.rheology.yield.kind = flow::sph::YieldKind::kConstant;
    options.rheology.yield.tau = film.yield;
    options.rheology.regularisation = m;
    options.rheology.mu_max = mu_max;
    // What the pressure solve leaves is shear of the order of tolerance / step, which a fluid at rest takes for yielding.
    options.divergence_tolerance = 1e-6;
    return options;
  };
  for (Real r : {0.3, 0.6}) {
    const FilmRun run = run_film(with_strength(r), kLayers, until, step);
    const std::string at = fmt::format("r = {}: ", r);
    result.measures.push_back(compared(at + "volume flux", "m2/s", run.flux, film.flux(), 0.05));
    result.measures.push_back(compared(at + "mean speed against Jeffreys", "m/s", run.flux / depth, film.jeffreys_mean(), 0.05));
    result.measures.push_back(bounded(at + "L2 of the profile", profile_error(run.speeds, [&](Real y) { return film.velocity(y); }), 0.05));
    const Real edge = plug_edge(run.speeds);
    result.measures.push_back({at + "lower edge of the plug, off by spacings", "m", edge, film.sheared_depth(), std::abs(edge - film.sheared_depth()) / dx, 1, "dx"});
    add_profile(plot, fmt::format("r = {}", r), run.speeds, depth, [&](Real y) { return film.velocity(y); });
    result.note += at + run.statistics.text() + ". ";
  }
  const FilmRun still = run_film(with_strength(1.1), kLayers, until / 4, step);
  const Real creep = film.wall_stress() * depth / (2 * mu_max);
  result.measures.push_back({"stands still at r = 1.1: surface speed over the Newtonian", "", still.surface / newtonian_speed, 0, std::abs(still.surface) / newtonian_speed, 1e-3, ""});
  result.measures.push_back(compared("creep at r = 1.1 against tau H / (2 mu_max)", "m/s", still.surface, creep, 0.05));
  result.plots = {plot};
  result.note += fmt::format("{} particles deep, mu = {:.0e} Pa s, mu_max = {:.0e} Pa s, m = {:.0e} s; flux and speed as means over the second half of {} s.", kLayers, film.mu,
                             mu_max, m, until);
  return result;
}

}  // namespace

void add_channel_cases(std::vector<Case>& cases) {
  const std::string batchelor = "exact solution of the Navier-Stokes equations (Batchelor 1967)";
  cases.push_back({"rest", "Hydrostatic rest, 10 s, 1000 Pa s", "p = rho g (H - z), no motion", true, [] { return hydrostatic_rest(1000); }});
  // As runny as lava gets: what order the particles leave, they leave fast.
  cases.push_back({"rest-thin", "Hydrostatic rest, 10 s, 100 Pa s", "p = rho g (H - z), no motion", false, [] { return hydrostatic_rest(100); }});
  cases.push_back({"poiseuille", "Plane Poiseuille flow and its start", batchelor, true, poiseuille});
  cases.push_back({"couette", "Couette flow and its start", batchelor, true, couette});
  cases.push_back({"film", "Nusselt film on slopes of 5 and 25 degrees", "Nusselt 1916", false, nusselt_film});
  cases.push_back({"bingham", "Bingham film, Jeffreys' mean, and rest below the yield strength", "Bingham 1922; Jeffreys 1925 as in Chevrel et al. 2018, eq. 7", false, bingham_film});
}

}  // namespace effuse::study
