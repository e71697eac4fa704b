#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "flow/reference/solidification.h"
#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "samples/study/cost/cost.h"
#include "samples/study/measure.h"
#include "samples/study/study.h"
#include "samples/study/validation/stack.h"

/// What the crust's cells buy: the surface's temperature, which glows.
namespace effuse::study {

namespace {

using flow::sph::Heat;
using flow::sph::HeatOptions;

/// Lava of 1150 degC under the sky, particles of dx: largest error of its surface in degC from 10 s to an hour, relative.
/// cells: of the crust's column; 0: none, a particle glows as it is as a whole.
CostRun cooled(int cells, Real dx, std::span<const Real> times, std::span<const flow::reference::CoolingMoment> exact) {
  const flow::reference::CoolingHalfSpace lava;
  Stack stack(8, dx);
  stack.expose_top();
  HeatOptions options;
  options.conductivity = lava.conductivity;
  options.air = {.emissivity = lava.emissivity, .thompson_ramsey = false, .convection = lava.convection, .air_temperature = lava.air_temperature};
  options.crust = cells > 0;
  if (cells > 0) options.crust_cells = cells;
  Heat heat(options, dx, lava.density);
  for (std::size_t i = 0; i < stack.size(); ++i) heat.born(lava.T0);
  CostRun run;
  Real t = 0;
  for (std::size_t k = 0; k < times.size(); ++k) {
    const Real begin = processor_time();
    while (t < times[k] - 1e-9) {
      const Real dt = std::min({2.0, 0.1 + 0.01 * t, times[k] - t});
      stack.step(heat, dt);
      t += dt;
      ++run.steps;
    }
    run.seconds += processor_time() - begin;
    run.error = std::max(run.error, std::abs(heat.surface_temperature()[0] - exact[k].surface_temperature) / (exact[k].surface_temperature - kZeroCelsius));
  }
  run.memory = stack.size() * 8 * sizeof(Real) + (cells > 0 ? Stack::kAcross * Stack::kAcross * sizeof(flow::sph::CrustColumn) : 0);
  StateHash hash;
  hash.add(heat.enthalpy());
  run.hash = hash.value();
  return run;
}

CaseResult crust_cells(bool full) {
  const ThreadLimit one(1);
  const std::vector<Real> times = spaced_log(10, 3600, 25);
  const std::vector<flow::reference::CoolingMoment> exact = flow::reference::cool({}, times);
  CaseResult result;
  for (const Real dx : full ? std::vector<Real>{0.05, 0.1, 0.2, 0.5, 1} : std::vector<Real>{0.1, 0.5})
    for (const int cells : {0, 2, 3, 4, 6, 8, 12, 16})
      result.costs.push_back(cost_of(fmt::format("particles of {:g} cm", 100 * dx), cells == 0 ? "no column" : fmt::format("{} cells", cells), std::max(cells, 1), [&] { return cooled(cells, dx, times, exact); }, 3, 1));
  const auto at = [&](const std::string& curve, const std::string& setting) {
    return *std::find_if(result.costs.begin(), result.costs.end(), [&](const CostPoint& p) { return p.curve == curve && p.setting == setting; });
  };
  for (const char* curve : {"particles of 10 cm", "particles of 50 cm"}) {
    const CostPoint usual = at(curve, "16 cells"), none = at(curve, "no column");
    result.measures.push_back({fmt::format("{}: surface, 16 cells", curve), "", usual.error, 0, usual.error, 0.05, ""});
    // The test can tell: without a column the skin stays hot.
    result.measures.push_back({fmt::format("{}: error with 16 cells over that without any", curve), "", usual.error, none.error, usual.error / none.error, 0.2, "x"});
  }
  const CostPoint none = at("particles of 50 cm", "no column"), eight = at("particles of 50 cm", "8 cells"), usual = at("particles of 50 cm", "16 cells");
  result.plots.push_back(convergence_plot("heat_cells", fmt::format("Surface of cooling lava, particles of 50 cm: {:.0f} % off without a crust's column, {:.2g} % with 8 cells, {:.2g} % with 16", 100 * none.error, 100 * eight.error, 100 * usual.error), "cells of the crust (1: none)",
                                          "largest relative error of the surface in degC", result.costs, {}));
  result.plots.push_back(cost_plot("heat_cells_cost", fmt::format("Cells of the crust: 16 take {:.2g} times the time of none", usual.seconds / none.seconds), "largest relative error of the surface in degC", result.costs));
  result.note = "Lava of 1150 degC, emissivity 0.95, h 50 W/m2/K, 40 % vesicles, ten seconds to an hour; lattices endless in x and y.";
  return result;
}

}  // namespace

std::vector<Case> heat_cases() {
  return {{"heat-cells", "Cells of the crust against the temperature of what glows", "1-D enthalpy solution, converged to 0.1 %", true, [] { return crust_cells(false); }, [] { return crust_cells(true); }}};
}

}  // namespace effuse::study
