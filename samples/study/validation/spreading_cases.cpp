#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "flow/reference/gravity_current.h"
#include "flow/reference/lister_experiment.h"
#include "flow/reference/thin_film.h"
#include "samples/study/measure.h"
#include "samples/study/study.h"
#include "samples/study/validation/setups.h"

/// Flows that spread under their own weight, isothermal.
namespace effuse::study {
namespace {

using flow::sph::ModernLava;
using flow::sph::ModernOptions;
namespace reference = flow::reference;

/// Depth [m] over x of a slab `width` wide, |x| taken together for one symmetric about x = 0: volume in bins over their area.
struct Depths {
  std::vector<Real> x, h;
};
Depths depths_of_symmetric_slab(std::span<const Vec3> x, Real spacing, Real width, Real reach, Real bin) {
  const auto n = static_cast<std::size_t>(std::ceil(reach / bin));
  Depths d{std::vector<Real>(n), std::vector<Real>(n, 0)};
  for (std::size_t k = 0; k < n; ++k) d.x[k] = (static_cast<Real>(k) + 0.5) * bin;
  for (const Vec3& p : x) {
    const auto k = static_cast<std::size_t>(std::abs(p.x()) / bin);
    if (k < n) d.h[k] += std::pow(spacing, 3) / (2 * bin * width);
  }
  return d;
}

/// Mean of the depths of the cells up to x [m].
Real mean_depth(const reference::DamBreakState& state, Real x) {
  Real sum = 0, n = 0;
  for (std::size_t i = 0; i < state.x.size() && state.x[i] < x; ++i) sum += state.h[i], ++n;
  return sum / n;
}

// Both halves of a dam break that opens to both sides at once: x = 0 is a plane of symmetry, as smooth as the wall of the reference, which a
// wall of particles without slip would not be.
CaseResult bm1() {
  const reference::DamBreak dam;
  const Real dx = dam.depth / 10, density = 2700, width = 6 * dx;
  ModernOptions options = isothermal(dx, dam.nu * density);
  options.density = density;
  options.period = Vec2(0, width);
  ModernLava lava(options, {}, {plane(Vec3::UnitZ(), Vec3::Zero())});
  add_at_rest(lava, block(Vec3(-dam.length, 0, 0), {132, 6, 10}, dx));

  const std::vector<Real> times = {10, 25, 50, 100, 200, 300, 400, 550};
  const std::vector<reference::DamBreakState> exact = reference::solve_dam_break(dam, times);
  CaseResult result;
  Curve line{"thin film", {}, {}, false, true}, marks{"particles", {}, {}, true, false};
  for (const reference::DamBreakState& s : reference::solve_dam_break(dam, spaced_log(1, 550, 60))) {
    line.x.push_back(s.time);
    line.y.push_back(s.front);
  }
  Plot profiles{"bm1_profile", "BM1: depth at 10, 100 and 550 s", "distance from the wall [m]", "depth [m]", false, false, {}};
  RunStatistics statistics;
  std::vector<Real> fronts, exact_fronts;
  for (std::size_t k = 0; k < times.size(); ++k) {
    run_until(lava, times[k], 1, statistics);
    const Real front = (front_position(lava.positions(), Vec3::UnitX(), dx) + front_position(lava.positions(), -Vec3::UnitX(), dx)) / 2;
    fronts.push_back(front);
    exact_fronts.push_back(exact[k].front);
    marks.x.push_back(times[k]);
    marks.y.push_back(front);
    result.measures.push_back(compared(fmt::format("front at {} s", times[k]), "m", front, exact[k].front, 0.03));
    // Over 3 m: particles thin out by whole layers.
    const Real near = depths_of_symmetric_slab(lava.positions(), dx, width, 3, 3).h[0];
    result.measures.push_back(compared(fmt::format("mean depth within 3 m of the wall, {} s", times[k]), "m", near, mean_depth(exact[k], 3), 0.03));
    if (times[k] != 10 && times[k] != 100 && times[k] != 550) continue;
    profiles.curves.push_back({fmt::format("{} s, thin film", times[k]), exact[k].x, exact[k].h, false, true});
    const Depths all = depths_of_symmetric_slab(lava.positions(), dx, width, 18, 0.3);
    profiles.curves.push_back({fmt::format("{} s", times[k]), all.x, all.h, true, false});
  }
  result.measures.push_back(bounded("front, NRMSE over all times (10 % counts as good)", nrmse(fronts, exact_fronts), 0.1));
  const reference::GravityCurrent late(reference::Spread::kPlanar, 0, dam.length * dam.depth, dam.nu);
  Curve late_law{"late similarity", spaced_log(20, 550, 30), {}, false, true};
  for (Real t : late_law.x) late_law.y.push_back(late.front(t));
  result.plots = {{"bm1_front", "BM1 viscous dam break: front", "time [s]", "front [m]", true, false, {line, late_law, marks}}, profiles};
  result.note = fmt::format("dx = H / 10, {} particles, full width (both halves), periodic across; {}.", lava.size(), statistics.text());
  return result;
}

/// When the law's radius is five mean depths, looked for from a time on.
Real first_thin(const reference::GravityCurrent& law, Real t) {
  while (kPi * std::pow(law.front(t), 3) < 5 * law.volume(t)) t *= 1.01;
  return t;
}

/// Radii of a run and of the law, their power laws, and the plot of both. Fitted from where the law's radius is five mean depths: the law is
/// of thin films, the particles are not.
void add_power_law(CaseResult& result, const std::string& file, const std::string& title, const reference::GravityCurrent& exact, const Curve& all) {
  const Real from = first_thin(exact, all.x.front());
  std::vector<Real> t, r;
  for (std::size_t i = 0; i < all.x.size(); ++i)
    if (all.x[i] >= from) {
      t.push_back(all.x[i]);
      r.push_back(all.y[i]);
    }
  const PowerLaw fit = fit_power_law(t, r);
  result.measures.push_back(compared("exponent", "", fit.exponent, exact.exponent(), 0.02));
  result.measures.push_back(compared("prefactor with the exact exponent", "", fit_prefactor(t, r, exact.exponent()), exact.prefactor(), 0.05));
  std::vector<Real> law;
  for (Real s : t) law.push_back(exact.front(s));
  result.measures.push_back(bounded("radius, NRMSE (10 % counts as good)", nrmse(r, law), 0.1));
  Curve line{"Huppert", spaced_log(all.x.front(), all.x.back(), 50), {}, false, true};
  for (Real s : line.x) line.y.push_back(exact.front(s));
  result.plots.push_back({file, title, "time [s]", "radius [m]", true, true, {line, all}});
  result.note = fmt::format("Fitted from {:.0f} s (radius five mean depths) to {:.0f} s. ", from, all.x.back());
}

// Begins as the similarity solution: a cylinder's own collapse, which is not a thin film's, takes until the film is too thin for particles.
CaseResult huppert_release() {
  const Real dx = 0.04, mu = 1e4, end = 120;
  const ModernOptions options = isothermal(dx, mu);
  ModernLava lava(options, {}, {plane(Vec3::UnitZ(), Vec3::Zero())});
  const reference::GravityCurrent planned(reference::Spread::kAxisymmetric, 0, kPi, mu / options.density);
  const Real begin = first_thin(planned, 1);
  std::vector<Vec3> x = block(Vec3(-2, -2, 0), {100, 100, 16}, dx);
  std::erase_if(x, [&](const Vec3& p) { return p.z() > planned.depth(std::hypot(p.x(), p.y()), begin); });
  add_at_rest(lava, x);
  const reference::GravityCurrent exact(reference::Spread::kAxisymmetric, 0, lava.volume(), mu / options.density);

  Curve radius{"particles", {}, {}, true, false};
  RunStatistics statistics;
  for (Real t : spaced_log(begin, end, 30)) {
    run_until(lava, t - begin, 1, statistics);
    radius.x.push_back(t);
    radius.y.push_back(mean_radius(lava.positions(), dx));
  }
  CaseResult result;
  add_power_law(result, "huppert_release", "Fixed volume on level ground", exact, radius);
  // The shape at the end: depth in rings.
  const Real front = exact.front(end);
  Curve shape{"particles", {}, {}, true, false}, line{"Huppert", spaced(0, front, 200), {}, false, true};
  const auto rings = static_cast<std::size_t>(1.1 * front / (2 * dx));
  std::vector<Real> volume(rings, 0);
  for (const Vec3& p : lava.positions()) {
    const auto k = static_cast<std::size_t>(std::hypot(p.x(), p.y()) / (2 * dx));
    if (k < rings) volume[k] += std::pow(dx, 3);
  }
  for (std::size_t k = 0; k < rings; ++k) {
    const Real inner = static_cast<Real>(k) * 2 * dx, outer = inner + 2 * dx;
    shape.x.push_back((inner + outer) / 2);
    shape.y.push_back(volume[k] / (kPi * (outer * outer - inner * inner)));
  }
  for (Real r : line.x) line.y.push_back(exact.depth(r, end));
  result.plots.push_back({"huppert_release_shape", fmt::format("Its depth after {:.0f} s", end), "radius [m]", "depth [m]", false, false, {line, shape}});
  result.note += fmt::format("{} particles; {}.", lava.size(), statistics.text());
  return result;
}

CaseResult huppert_source() {
  const Real dx = 0.25, mu = 1e4, rate = 5.6, end = 60;
  const ModernOptions options = isothermal(dx, mu);
  flow::sph::Vent vent;
  vent.width = 4;
  vent.rate = rate;
  vent.temperature = 1400;
  ModernLava lava(options, {vent}, {plane(Vec3::UnitZ(), Vec3::Zero())});
  const reference::GravityCurrent exact(reference::Spread::kAxisymmetric, 1, rate, mu / options.density);

  Curve radius{"particles", {}, {}, true, false};
  RunStatistics statistics;
  for (Real t : spaced_log(2, end, 30)) {
    run_until(lava, t, 0.5, statistics);
    radius.x.push_back(t);
    radius.y.push_back(mean_radius(lava.positions(), dx));
  }
  CaseResult result;
  add_power_law(result, "huppert_source", "Steady source on level ground", exact, radius);
  result.measures.push_back(compared("volume let out", "m3", lava.volume(), rate * radius.x.back(), 0.01));
  result.note += fmt::format("{} particles at the end, vent {} m wide, film {:.1f} spacings deep at half the radius; {}.", lava.size(), vent.width,
                             exact.depth(exact.front(end) / 2, end) / dx, statistics.text());
  return result;
}

/// For bins of x: mean over both sides of the farthest |y|, and half a spacing.
Curve outline(std::span<const Vec3> x, Real spacing, const std::string& name) {
  const Real bin = 2 * spacing;
  Real first = 0, last = 0;
  for (const Vec3& p : x) {
    first = std::min(first, p.x());
    last = std::max(last, p.x());
  }
  const auto n = static_cast<std::size_t>((last - first) / bin) + 1;
  std::vector<Real> left(n, 0), right(n, 0);
  for (const Vec3& p : x) {
    Real& y = (p.y() < 0 ? left : right)[static_cast<std::size_t>((p.x() - first) / bin)];
    y = std::max(y, std::abs(p.y()));
  }
  Curve curve{name, {}, {}, true, false};
  for (std::size_t k = 0; k < n; ++k) {
    curve.x.push_back(first + (static_cast<Real>(k) + 0.5) * bin);
    curve.y.push_back((left[k] + right[k]) / 2 + spacing / 2);
  }
  return curve;
}

CaseResult bm2() {
  const Real dx = 1.25e-3, density = 970;
  reference::InclineSource source;
  source.source_radius = 8e-3;
  ModernOptions options = isothermal(dx, source.nu * density);
  options.density = density;
  options.gravity = kGravity * Vec3(std::sin(source.slope), 0, -std::cos(source.slope));
  flow::sph::Vent vent;
  vent.width = 2 * source.source_radius;
  vent.rate = source.flux;
  vent.temperature = 300;
  ModernLava lava(options, {vent}, {plane(Vec3::UnitZ(), Vec3::Zero())});

  const std::vector<Real> times = {32, 59};
  const std::vector<reference::InclineState> film = reference::solve_incline_source(source, times, {.cell = 2.5e-3});
  const std::vector<reference::MeasuredOutline> oil = reference::lister_outlines();
  CaseResult result;
  Plot plot{"bm2", "BM2: silicone oil from a point on a slope of 2.5 degrees, outlines", "down the slope [m]", "across [m]", false, false, {}};
  RunStatistics statistics;
  for (std::size_t k = 0; k < times.size(); ++k) {
    run_until(lava, times[k], 1, statistics);
    const Real front = front_position(lava.positions(), Vec3::UnitX(), dx);
    const Real half_width = (front_position(lava.positions(), Vec3::UnitY(), dx) + front_position(lava.positions(), -Vec3::UnitY(), dx)) / 2;
    const std::string at = fmt::format("{} s: ", times[k]);
    result.measures.push_back(compared(at + "length against the thin film", "m", front, film[k].front, 0.05));
    result.measures.push_back(compared(at + "half-width against the thin film", "m", half_width, film[k].half_width, 0.05));
    result.measures.push_back(compared(at + "length against the experiment", "m", front, oil[k].front(), 0.1));
    result.measures.push_back(compared(at + "half-width against the experiment", "m", half_width, oil[k].half_width(), 0.1));
    Curve line{at + "thin film", {}, {}, false, true}, marks{at + "experiment", {}, {}, true, false};
    for (const Vec2& p : film[k].outline) line.x.push_back(p.x()), line.y.push_back(p.y());
    for (const Vec2& p : oil[k].points) marks.x.push_back(p.x()), marks.y.push_back(p.y());
    plot.curves.push_back(std::move(line));
    plot.curves.push_back(std::move(marks));
    plot.curves.push_back(outline(lava.positions(), dx, at + "particles"));
  }
  result.plots = {plot};
  result.note = fmt::format("{} particles at the end, dx = 1.25 mm, vent 16 mm wide as in the thin film; no surface tension; the experiment's later outlines (122 s to 727 s) left out; {}.",
                            lava.size(), statistics.text());
  return result;
}

}  // namespace

void add_spreading_cases(std::vector<Case>& cases) {
  cases.push_back({"bm1", "BM1 viscous dam break", "thin-film equation, finite volumes; set-up of Cordonnier, Lev & Garel 2015", false, bm1});
  cases.push_back({"huppert-release", "Axisymmetric spread of a fixed volume", "Huppert 1982", false, huppert_release});
  cases.push_back({"huppert-source", "Axisymmetric spread from a steady source", "Huppert 1982", false, huppert_source});
  cases.push_back({"bm2", "BM2: point source on a slope of 2.5 degrees", "thin-film equation, finite volumes; experiment of Lister 1992", false, bm2});
}

}  // namespace effuse::study
