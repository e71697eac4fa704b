#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "flow/sph/flow_map.h"
#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "samples/study/cost/cost.h"
#include "samples/study/cost/flows.h"
#include "samples/study/measure.h"
#include "samples/study/study.h"
#include "samples/study/validation/mountain.h"

/// What accuracy of the lava costs: its spacing, its solver's tolerances, the paper's stiffness, the kernel's support, the step.
namespace effuse::study {

namespace {

using flow::sph::ModernOptions;

CostRun cost_run(const FilmWork& work, Real error) { return {work.seconds, error, work.steps, work.memory, work.hash}; }
CostRun cost_run(const FrontWork& work, Real error) { return {work.seconds, error, work.steps, work.memory, work.hash}; }

/// A title's "at 5 layers 1.9 %".
std::string share(Real error) { return fmt::format("{:.2g} %", 100 * error); }

/// The value at spacing 0 and the order, from three of spacings falling by one ratio r (Richardson):
///   p = log((f3 - f2) / (f2 - f1)) / log r,  f = f1 + (f1 - f2) / (r^p - 1),  f1 the finest.
/// The order is held within 0.5 to 3: three values near each other may tell anything. Source: Roache 1994, J. Fluids Eng. 116, 405-413.
struct Extrapolated {
  Real value = 0, order = 0, remaining = 0;  ///< remaining: of the finest, relative
};
Extrapolated extrapolated(Real coarse, Real middle, Real fine, Real ratio) {
  const Real change = (coarse - middle) / (middle - fine);
  Extrapolated e;
  e.order = std::clamp(change > 0 ? std::log(change) / std::log(ratio) : 1.0, 0.5, 3.0);
  e.value = fine + (fine - middle) / (std::pow(ratio, e.order) - 1);
  e.remaining = std::abs(fine - e.value) / std::abs(e.value);
  return e;
}

CaseResult film_spacing(bool full) {
  const ThreadLimit one(1);
  CaseResult result;
  std::vector<int> layers = {3, 4, 6, 8, 12};
  if (full) layers.insert(layers.end(), {16, 24});
  for (const int n : layers) {
    const std::string setting = fmt::format("{} layers", n);
    FilmWork last;
    result.costs.push_back(cost_of("profile", setting, 1.0 / n, [&] {
      last = modern_film(n);
      return cost_run(last, last.l2);
    }, 3, 1));
    CostPoint means = result.costs.back();
    means.curve = "surface speed or flux, the worse";
    means.error = last.surface_and_flux;
    result.costs.push_back(means);
  }
  const std::vector<CostPoint> profile = points_of(result.costs, "profile");
  // Finer than six layers the error of a sum over a fixed number of neighbours is left.
  std::vector<CostPoint> coarse = profile;
  coarse.resize(3);
  const Real order = order_of(coarse, "profile");
  result.measures.push_back(order_measure("order of the profile's error in the spacing, 3 to 6 layers", order, 1, 0.5));
  const auto at = [&](const std::string& setting) { return std::find_if(profile.begin(), profile.end(), [&](const CostPoint& p) { return p.setting == setting; })->error; };
  result.measures.push_back({"profile with 4 layers", "", at("4 layers"), 0, at("4 layers"), 0.05, ""});
  result.measures.push_back({"profile with 8 layers", "", at("8 layers"), 0, at("8 layers"), 0.02, ""});
  result.plots.push_back(cost_plot("lava_film_cost", fmt::format("Film on a slope: three layers are {} off, six {} for {:.2g} times the time; more help little", share(profile[0].error), share(profile[2].error), profile[2].seconds / profile[0].seconds), "relative error", result.costs));
  result.plots.push_back(convergence_plot("lava_film_order", fmt::format("Film on a slope: the error falls with the spacing's power {:.2g} down to the kernel's own", order), "spacing over the depth", "relative error", result.costs, std::vector<Slope>{{"profile", 1}}));
  result.note = "1 m on 5 degrees, 2000 Pa s, against Nusselt's profile. " + told(result.costs, 0.02) + ".";
  return result;
}

CaseResult bm1_spacing(bool full) {
  const ThreadLimit one(1);
  CaseResult result;
  std::vector<int> layers = {2, 3, 4, 6};
  if (full) layers.insert(layers.end(), {8, 12});
  Real coarse = 0, middle = 0, fine = 0;
  for (const int n : layers) {
    result.costs.push_back(cost_of("front", fmt::format("{} layers", n), 1.0 / n, [&] {
      const FrontWork work = modern_front(n);
      coarse = middle, middle = fine, fine = work.fronts.back();
      return cost_run(work, work.error);
    }, 1));
  }
  const Real worst = result.costs.back().error;
  result.measures.push_back({fmt::format("front with {} layers", layers.back()), "", worst, 0, worst, 0.03, ""});
  result.plots.push_back(cost_plot("lava_bm1_cost", fmt::format("BM1 viscous dam break: {} with {} layers in {:.2g} s a metre of width, {} with {} in {:.2g} s", share(result.costs.front().error), layers.front(), result.costs.front().seconds, share(worst), layers.back(), result.costs.back().seconds),
                                   "relative error of the front, rms", result.costs));
  result.plots.push_back(convergence_plot("lava_bm1_order", "BM1 viscous dam break: error of the front against the spacing", "spacing over the depth", "relative error of the front, rms", result.costs, std::vector<Slope>{{"front", 1}}));
  result.note = "Front at 10, 25, 50 and 100 s against the thin-film equation's. " + told(result.costs, 0.03) + ".";
  return result;
}

/// Tolerances, against the same flow solved a hundred times tighter than any of them.
CaseResult tolerances(bool full) {
  const ThreadLimit one(1);
  constexpr int kLayers = 3;
  const auto fronts_of = [](Real divergence, Real viscosity) {
    return modern_front(kLayers, [&](ModernOptions& o) {
      o.divergence_tolerance = divergence;
      o.density_tolerance = 2 * divergence;
      o.viscosity_tolerance = viscosity;
    });
  };
  const FrontWork exact = fronts_of(1e-7, 1e-7);
  const auto error_of = [&](const FrontWork& work) {
    Real sum = 0;
    for (std::size_t k = 0; k < work.fronts.size(); ++k) sum += std::pow(work.fronts[k] / exact.fronts[k] - 1, 2);
    return std::max(std::sqrt(sum / static_cast<Real>(work.fronts.size())), 1e-9);
  };
  CaseResult result;
  std::vector<Real> values = {1e-1, 1e-2, 1e-3, 1e-4};
  if (full) values.insert(values.end(), {1e-5, 1e-6});
  for (const bool pressure : {true, false})
    for (const Real value : values)
      result.costs.push_back(cost_of(pressure ? "pressure" : "viscosity", fmt::format("{:.0e}", value), value, [&] {
        const FrontWork work = pressure ? fronts_of(value, 1e-6) : fronts_of(1e-6, value);
        return cost_run(work, error_of(work));
      }, 1));
  const FrontWork defaults = modern_front(kLayers);
  const Real error = error_of(defaults);
  result.costs.push_back({"defaults", "as they are", ModernOptions().viscosity_tolerance, error, defaults.seconds, 0, 1, defaults.steps, defaults.memory, defaults.hash});
  const Real of_spacing = defaults.error;
  result.measures.push_back({"error that the default tolerances make, over that of the spacing", "", error, of_spacing, error / of_spacing, 0.5, "x"});
  result.plots.push_back(convergence_plot("lava_tolerance", fmt::format("The default tolerances cost {} of the front, the spacing {}", share(error), share(of_spacing)), "tolerance", "relative difference of the front", result.costs, {}));
  result.plots.push_back(cost_plot("lava_tolerance_cost", fmt::format("Tight tolerances take {:.2g} times the defaults' time", exact.seconds / defaults.seconds), "relative difference of the front", result.costs));
  result.note = fmt::format("BM1 with {} layers. Reference: both at 1e-7. One at a time, the other at 1e-6.", kLayers);
  return result;
}

CaseResult support(bool full) {
  const ThreadLimit one(1);
  CaseResult result;
  for (const int layers : full ? std::vector<int>{4, 6, 8, 12} : std::vector<int>{4, 6, 8})
    for (const Real support : {2.0, 2.5, 3.0, 4.0})
      result.costs.push_back(cost_of(fmt::format("support {:g}", support), fmt::format("{} layers", layers), 1.0 / layers, [&] {
        const FilmWork work = modern_film(layers, [&](ModernOptions& o) { o.support = support; });
        return cost_run(work, work.l2);
      }, 3, 0.7));
  const std::vector<CostPoint> usual = points_of(result.costs, "support 3");
  const Cheapest best = cheapest(result.costs, usual[1].error);
  result.measures.push_back({fmt::format("time of support 3 over the cheapest's ({}) at its error with 6 layers", best.curve), "", usual[1].seconds / best.seconds, 1, usual[1].seconds / best.seconds, 2, "x"});
  result.plots.push_back(cost_plot("lava_support_cost", fmt::format("Kernel's support: {} is cheapest for {}", best.curve, share(usual[1].error)), "relative error of the profile", result.costs));
  result.plots.push_back(convergence_plot("lava_support", "Kernel's support: a narrow one does not converge, a wide one smears", "spacing over the depth", "relative error of the profile", result.costs, {}));
  result.note = "The film on a slope, supports in spacings. " + told(result.costs, 0.02) + ".";
  return result;
}

CaseResult step_factor(bool full) {
  const ThreadLimit one(1);
  constexpr int kLayers = 3;
  const auto run = [](Real factor) {
    return modern_front(kLayers, [&](ModernOptions& o) {
      o.courant *= factor;
      o.max_step *= factor;
    });
  };
  const FrontWork exact = run(full ? 1.0 / 32 : 1.0 / 8);
  CaseResult result;
  for (const Real factor : full ? std::vector<Real>{4, 2, 1, 0.5, 0.25, 0.125} : std::vector<Real>{4, 2, 1, 0.5})
    result.costs.push_back(cost_of("front", fmt::format("{:g} times the default", factor), factor, [&] {
      const FrontWork work = run(factor);
      Real sum = 0;
      for (std::size_t k = 0; k < work.fronts.size(); ++k) sum += std::pow(work.fronts[k] / exact.fronts[k] - 1, 2);
      return cost_run(work, std::max(std::sqrt(sum / static_cast<Real>(work.fronts.size())), 1e-9));
    }, 1));
  const auto usual = std::find_if(result.costs.begin(), result.costs.end(), [](const CostPoint& p) { return p.parameter == 1; });
  result.measures.push_back({"front, default step against an eighth of it and less", "", usual->error, 0, usual->error, 0.03, ""});
  result.plots.push_back(cost_plot("lava_step_cost", fmt::format("The default step costs {} of the front, twice as long ones {}", share(usual->error), share(result.costs[1].error)), "relative difference of the front", result.costs));
  result.plots.push_back(convergence_plot("lava_step", "BM1: the front against the step", "step over the default one", "relative difference of the front", result.costs, std::vector<Slope>{{"front", 1}}));
  result.note = fmt::format("BM1 with {} layers; reference: steps of a {} of the default ones.", kLayers, full ? "thirty-second" : "eighth");
  return result;
}

/// The paper's solver: how stiff its state equation must be.
CaseResult stiffness(bool full) {
  const ThreadLimit one(1);
  CaseResult result;
  constexpr int kLayers = 5;
  std::vector<Real> factors = {4, 16, 64, 256};
  if (full) factors.push_back(1024);
  std::vector<CostPoint> profiles;
  for (const Real k : factors) {
    FilmWork last;
    result.costs.push_back(cost_of("density", fmt::format("k = {:g} g H", k), k, [&] {
      last = classic_film(kLayers, k);
      return cost_run(last, last.density);
    }, 3, 1));
    profiles.push_back(result.costs.back());
    profiles.back().curve = "profile";
    profiles.back().error = last.l2;
  }
  const Real order = -order_of(result.costs, "density", 0, factors.size());
  const FilmWork modern = modern_film(kLayers);
  result.costs.insert(result.costs.end(), profiles.begin(), profiles.end());
  result.costs.push_back({"modern: profile", "incompressible", 1, modern.l2, modern.seconds, 0, 1, modern.steps, modern.memory, modern.hash});
  const CostPoint& soft = result.costs.front();
  const CostPoint& stiff = result.costs[factors.size() - 1];
  // Hydrostatic: rho / rho0 - 1 = g (H - z) / k.
  result.measures.push_back({"density error falls as a power of the stiffness", "", order, 1, std::abs(order - 1), 0.5, "absolute"});
  result.measures.push_back({"seconds rise as a power of the stiffness", "", fit_power_law(std::vector<Real>{soft.parameter, stiff.parameter}, std::vector<Real>{soft.seconds, stiff.seconds}).exponent, 0.5,
                             std::abs(fit_power_law(std::vector<Real>{soft.parameter, stiff.parameter}, std::vector<Real>{soft.seconds, stiff.seconds}).exponent - 0.5), 0.5, "absolute"});
  result.plots.push_back(cost_plot("lava_stiffness_cost", fmt::format("The paper's lava: {:g} times stiffer takes {:.2g} times the steps and compresses {:.2g} times less", stiff.parameter / soft.parameter,
                                                                      static_cast<Real>(stiff.steps) / static_cast<Real>(soft.steps), soft.error / stiff.error),
                                   "relative error", result.costs));
  std::vector<CostPoint> density = points_of(result.costs, "density");
  Plot fall = convergence_plot("lava_stiffness", "The paper's lava: compression falls as one over the stiffness", "k over g H", "rms of the density's error", density, {});
  const Real x0 = density.front().parameter, x1 = density.back().parameter, y0 = 0.6 * density.front().error;
  fall.curves.push_back({"slope -1", {x0, x1}, {y0, y0 * x0 / x1}, false, true});
  result.plots.push_back(std::move(fall));
  result.note = fmt::format("A film of {} layers of classic lava. Frames of 1/24 s: {:.0f} steps a frame at k = {:g} g H, {:.0f} at {:g}; modern takes {:.1f}.", kLayers, static_cast<Real>(soft.steps) / (24 * kFilmSeconds), soft.parameter,
                            static_cast<Real>(stiff.steps) / (24 * kFilmSeconds), stiff.parameter, static_cast<Real>(modern.steps) / (24 * kFilmSeconds));
  return result;
}

/// Area covered [m^2], in squares of 5 m, and the front [m], as flow.csv has it.
struct Reach {
  Real area = 0, front = 0;
};
Reach reach_of(const flow::Effect& lava) {
  constexpr Real kSquare = 5;
  std::set<std::pair<long, long>> squares;
  const geometry::Points points = lava.points();
  for (const Vec3& p : points.position) squares.insert({std::lround(p.x() / kSquare), std::lround(p.y() / kSquare)});
  std::vector<flow::sph::PlanLine> vents;
  for (const flow::Opening& opening : lava.openings()) vents.push_back({opening.from.head<2>(), opening.to.head<2>()});
  const auto front = flow::sph::find_front(points, vents);
  return {kSquare * kSquare * static_cast<Real>(squares.size()), front ? front->distance : 0};
}

CaseResult mountain_spacing(bool full) {
  const ThreadLimit one(1);
  const Real ratio = std::sqrt(2.0);
  std::vector<Real> spacings;
  for (int k = 0; k < (full ? 5 : 3); ++k) spacings.push_back(2.4 / std::pow(ratio, k));
  CaseResult result;
  std::vector<Reach> reaches;
  std::vector<CostPoint> fronts;
  for (const Real dx : spacings) {
    Reach reach;
    result.costs.push_back(cost_of("area", fmt::format("{:.2f} m", dx), dx, [&] {
      const auto loaded = load_scene("maunga-whau-modern.toml", {fmt::format("lava.spacing={:.17g} m", dx), "lava.vent[0].stop=60 s", "film.fps=1", "film.time_scale=10", "film.frames=12"});
      const Real before = processor_time();
      for (int frame = 0; frame < loaded->scene.frames; ++frame) loaded->simulation->advance([] { return true; });
      CostRun run;
      run.seconds = processor_time() - before;
      const flow::Effect& lava = *loaded->simulation->effects().front();
      reach = reach_of(lava);
      for (const auto& [name, value] : lava.figures())
        if (name == "steps") run.steps = static_cast<std::uint64_t>(value);
      run.memory = lava.memory();
      StateHash hash;
      lava.add_to(hash);
      run.hash = hash.value();
      return run;
    }, 1));
    reaches.push_back(reach);
    fronts.push_back(result.costs.back());
    fronts.back().curve = "front";
  }
  const std::size_t n = reaches.size();
  const Extrapolated area = extrapolated(reaches[n - 3].area, reaches[n - 2].area, reaches[n - 1].area, ratio);
  const Extrapolated front = extrapolated(reaches[n - 3].front, reaches[n - 2].front, reaches[n - 1].front, ratio);
  for (std::size_t k = 0; k < n; ++k) {
    result.costs[k].error = std::max(std::abs(reaches[k].area / area.value - 1), 1e-4);
    fronts[k].error = std::max(std::abs(reaches[k].front / front.value - 1), 1e-4);
  }
  result.costs.insert(result.costs.end(), fronts.begin(), fronts.end());
  result.measures.push_back({"front, what remains at the finest by Richardson's estimate", "m", reaches[n - 1].front, front.value, front.remaining, 0.15, ""});
  result.measures.push_back({"area covered, what remains at the finest by Richardson's estimate", "m2", reaches[n - 1].area, area.value, area.remaining, 0.25, ""});
  result.plots.push_back(cost_plot("lava_mountain_cost", fmt::format("Maunga Whau: particles of {:.2g} m leave {} of the front and {} of the area", spacings.back(), share(front.remaining), share(area.remaining)), "relative error, of Richardson's value", result.costs));
  result.plots.push_back(convergence_plot("lava_mountain", "Maunga Whau: front and area against the spacing", "spacing [m]", "relative error, of Richardson's value", result.costs, std::vector<Slope>{{"front", 1}}));
  result.note = fmt::format("Two minutes of maunga-whau-modern.toml, its vent open for one. The reference is extrapolated from the three finest spacings: order {:.2g} of the front, {:.2g} of the area.", front.order, area.order);
  return result;
}

}  // namespace

std::vector<Case> lava_cases() {
  std::vector<Case> cases;
  const auto add = [&](const std::string& name, const std::string& title, const std::string& source, CaseResult (*run)(bool)) {
    cases.push_back({name, title, source, true, [run] { return run(false); }, [run] { return run(true); }});
  };
  add("lava-film", "Spacing: a film on a slope", "Nusselt 1916", film_spacing);
  add("lava-bm1", "Spacing: BM1 viscous dam break", "thin-film equation, finite volumes; set-up of Cordonnier, Lev & Garel 2015", bm1_spacing);
  add("lava-mountain", "Spacing: lava on Maunga Whau", "Richardson's extrapolation, Roache 1994", mountain_spacing);
  add("lava-support", "Support of the kernel", "Nusselt 1916", support);
  add("lava-tolerance", "Tolerances of pressure and viscosity", "the same with tolerances of 1e-7", tolerances);
  add("lava-step", "Length of the step", "the same with shorter steps", step_factor);
  add("lava-stiffness", "Stiffness of the paper's state equation", "rest density; Nusselt 1916", stiffness);
  return cases;
}

}  // namespace effuse::study
