#include <fmt/format.h>

#include <cmath>

#include "flow/reference/cooling_current.h"
#include "flow/reference/gravity_current.h"
#include "samples/study/measure.h"
#include "samples/study/study.h"
#include "samples/study/validation/setups.h"

/// Flows that cool while they spread.
namespace effuse::study {
namespace {

using flow::sph::ModernLava;
using flow::sph::ModernOptions;
namespace reference = flow::reference;

// Warm silicone oil from a hole onto a polystyrene plate. The oil's viscosity does not depend on its temperature: the radius is that of the
// isothermal current, and what the oil loses must in the end be what it brings.
CaseResult bm3() {
  const Real dx = 9e-4, density = 964, nu = 3.56e-3, rate = 2.2e-8, warm = 315, cold = 293, end = 380;
  ModernOptions options = isothermal(dx, nu * density);
  options.density = density;
  options.heat.on = true;
  options.heat.curve = {.heat_capacity = 1500, .latent_heat = 0, .solidus = 1, .liquidus = 1};
  options.heat.conductivity = 0.151;  // nu / 34000 is the diffusivity
  options.heat.air = {.emissivity = 0.96, .thompson_ramsey = false, .convection = 2, .air_temperature = cold};
  options.heat.ground_conductance = 0.03 / 0.002;
  options.heat.viscous_heating = false;
  options.heat.longest_interval = 1;
  flow::sph::Vent vent;
  vent.width = 8e-3;
  vent.rate = rate;
  vent.temperature = warm;
  ModernLava lava(options, {vent}, {plane(Vec3::UnitZ(), Vec3::Zero(), Vec3::Zero(), cold)});

  const reference::GravityCurrent exact(reference::Spread::kAxisymmetric, 1, rate, nu);
  // Through each face: film / (3 k) from the mean of a parabolic profile to its end, then the air or the floor.
  const Real film = 2.2e-3, inside = film / (3 * options.heat.conductivity), half_way = (warm + 2 * cold) / 3;
  const Real air = options.heat.air.flux(half_way) / (half_way - cold), floor_plate = options.heat.ground_conductance;
  const reference::CoolingCurrent law_of_loss{rate, nu, density, options.heat.curve.heat_capacity, warm - cold, 1 / (1 / air + inside) + 1 / (1 / floor_plate + inside)};
  const Real supply = law_of_loss.supply();  // 0.70 W
  const Real cold_heat = options.heat.curve.enthalpy(cold), warm_heat = options.heat.curve.enthalpy(warm);
  Curve radius{"particles", {}, {}, true, false}, total{"total", {}, {}, false, false}, sky{"radiation and convection", {}, {}, false, false},
      floor{"floor", {}, {}, false, false};
  RunStatistics statistics;
  Real to_sky = 0, to_floor = 0, radiated = 0, last_time = 0, last_sky = 0, last_floor = 0;
  CaseResult result;
  for (Real t = 20; t <= end + 1e-9; t += 20) {
    run_until(lava, t, 1, statistics, [&](const flow::sph::ModernReport& report) {
      to_sky += report.heat.radiated + report.heat.convected;
      to_floor += report.heat.ground;
      radiated += report.heat.radiated;
    });
    radius.x.push_back(t);
    radius.y.push_back(mean_radius(lava.positions(), dx));
    const Real span = t - last_time;
    sky.x.push_back(t - span / 2), floor.x.push_back(t - span / 2), total.x.push_back(t - span / 2);
    sky.y.push_back((to_sky - last_sky) / span);
    floor.y.push_back((to_floor - last_floor) / span);
    total.y.push_back(sky.y.back() + floor.y.back());
    last_time = t, last_sky = to_sky, last_floor = to_floor;
    if (t == 120 || t == 200 || t == 300 || t == end) result.measures.push_back(compared(fmt::format("radius at {} s", t), "m", radius.y.back(), exact.front(t), 0.05));
  }

  const Real let_out = static_cast<Real>(lava.size()) * lava.particle_mass();
  const Real stored = lava.heat().total_enthalpy() - let_out * cold_heat;
  const Real brought = let_out * (warm_heat - cold_heat);
  result.measures.push_back(compared("stored and lost against brought by the particles", "J", stored + to_sky + to_floor, brought, 0.01));
  result.measures.push_back(compared("stored and lost against rho c Q dT t", "J", stored + to_sky + to_floor, supply * end, 0.01));
  const Real last = total.x.back();
  result.measures.push_back(compared(fmt::format("total loss at {} s against the depth-averaged law", last), "W", total.y.back(), law_of_loss.loss(last), 0.05));

  Curve losses{"depth-averaged law", spaced(10, end, 38), {}, false, true};
  for (Real t : losses.x) losses.y.push_back(law_of_loss.loss(t));
  Curve law{"Huppert", spaced(20, end, 100), {}, false, true};
  for (Real t : law.x) law.y.push_back(exact.front(t));
  result.plots = {{"bm3_radius", "BM3: warm oil that spreads and cools", "time [s]", "radius [m]", false, false, {law, radius}},
                  {"bm3_loss", "BM3: what it loses", "time [s]", "power [W]", false, false, {{"rho c Q dT", {0, end}, {supply, supply}, false, true}, losses, total, sky, floor}}};
  result.note = fmt::format("The loss tends to {:.3f} W, of which the law has reached {:.3f} W at {} s and {:.3f} W after an hour. ", supply, law_of_loss.loss(end), end,
                            law_of_loss.loss(3600));
  result.note += fmt::format("{} particles at the end, dx = 0.9 mm (film 2.2 mm), to {} s; radiation is {:.0f} % of the loss to the air; no surface tension; {}.", lava.size(), end,
                             100 * radiated / to_sky, statistics.text());
  return result;
}

}  // namespace

void add_cooling_cases(std::vector<Case>& cases) {
  cases.push_back({"bm3", "BM3: axisymmetric spread with cooling", "Huppert 1982; energy balance; set-up of Garel et al. 2012, experiment C14", false, bm3});
}

}  // namespace effuse::study
