#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "flow/reference/solidification.h"
#include "flow/sph/heat.h"
#include "samples/study/measure.h"
#include "samples/study/study.h"
#include "samples/study/validation/stack.h"

namespace effuse::study {

namespace {

using namespace flow::sph;

/// Where a profile that rises with depth reaches T, on the monotone cubic through its points (Fritsch & Carlson 1980):
/// straight lines between layers a spacing apart would cut the corner of a front.
Real depth_of(const Curve& profile, Real T) {
  const std::size_t n = profile.x.size();
  std::vector<Real> chord(n - 1), slope(n);
  for (std::size_t k = 0; k + 1 < n; ++k) chord[k] = (profile.y[k + 1] - profile.y[k]) / (profile.x[k + 1] - profile.x[k]);
  slope[0] = chord[0];
  slope[n - 1] = chord[n - 2];
  for (std::size_t k = 1; k + 1 < n; ++k) {
    const Real a = profile.x[k] - profile.x[k - 1], b = profile.x[k + 1] - profile.x[k];
    slope[k] = chord[k - 1] * chord[k] <= 0 ? 0 : 3 * (a + b) / ((2 * b + a) / chord[k - 1] + (b + 2 * a) / chord[k]);
  }
  for (std::size_t k = 0; k + 1 < n; ++k) {
    if (profile.y[k + 1] < T) continue;
    const Real h = profile.x[k + 1] - profile.x[k];
    Real low = 0, high = 1;
    for (int step = 0; step < 50; ++step) {
      const Real s = (low + high) / 2;
      const Real y = profile.y[k] * (1 + 2 * s) * (1 - s) * (1 - s) + slope[k] * h * s * (1 - s) * (1 - s) + profile.y[k + 1] * s * s * (3 - 2 * s) +
                     slope[k + 1] * h * s * s * (s - 1);
      (y < T ? low : high) = s;
    }
    return profile.x[k] + low * h;
  }
  return profile.x[n - 1];
}

Measure measure(std::string what, std::string unit, Real measured, Real reference, Real error, Real hold, std::string unit_of_error = "") {
  Measure m;
  m.what = std::move(what);
  m.unit = std::move(unit);
  m.measured = measured;
  m.reference = reference;
  m.error = error;
  m.hold = hold;
  m.unit_of_error = std::move(unit_of_error);
  return m;
}
Measure share(std::string what, std::string unit, Real measured, Real reference, Real hold) {
  return measure(std::move(what), std::move(unit), measured, reference, relative_error(measured, reference), hold);
}

HeatOptions conduction_only() {
  HeatOptions options;
  options.curve.latent_heat = 0;
  options.crust = false;
  options.longest_interval = 0;
  return options;
}

constexpr Real kDensity = 2600;  // [kg/m^3]

CaseResult contact_case() {
  CaseResult result;
  // Left and right of the middle of a stack: one conductivity, then one nine times the other.
  for (const Real ratio : {1.0, 9.0}) {
    const Stack stack(ratio > 1 ? 40 : 28, 0.1);
    HeatOptions options = conduction_only();
    const Real b = std::sqrt(ratio), T_cold = 600, T_hot = 1400, Ti = (b * T_cold + T_hot) / (b + 1);
    options.solid_conductivity = ratio * options.conductivity;
    // It "melts" at the very temperature the contact keeps, without latent heat: the conductivity changes there and stays so.
    options.curve.solidus = options.curve.liquidus = Ti;
    const Real kappa = options.conductivity / (kDensity * options.curve.heat_capacity);
    const flow::reference::ContactOfHalfSpaces exact{T_cold, T_hot, b, 1, ratio * kappa, kappa};
    Heat heat(options, stack.dx(), kDensity);
    for (std::size_t i = 0; i < stack.size(); ++i) heat.born(i < stack.size() / 2 ? T_cold : T_hot);
    const Real before = heat.total_enthalpy(), t = std::pow((ratio > 1 ? 1.5 : 2.5) * stack.dx(), 2) / kappa;
    for (int k = 0; k < 100; ++k) stack.step(heat, t / 100);

    Plot plot{.file = ratio > 1 ? "contact_two_conductivities" : "contact_erf",
              .title = ratio > 1 ? "Contact of two conductivities, 9 : 1" : "Step of temperature",
              .x_label = "distance [m]",
              .y_label = "temperature [K]",
              .log_x = false,
              .log_y = false,
              .curves = {}};
    Curve line, dots = stack.profile(heat);
    line.name = "exact";
    line.reference = true;
    dots.name = fmt::format("particles, {} m", stack.dx());
    dots.points = true;
    Real worst = 0;
    const Real middle = stack.layers() * stack.dx() / 2, reach = 8 * stack.dx();
    for (std::size_t k = 0; k < dots.x.size(); ++k) {
      dots.x[k] -= middle;
      // Farther off the stack's insulated ends are felt.
      if (std::abs(dots.x[k]) < reach) worst = std::max(worst, std::abs(dots.y[k] - exact.temperature(dots.x[k], t)));
    }
    for (const Real x : spaced(-reach, reach, 201)) {
      line.x.push_back(x);
      line.y.push_back(exact.temperature(x, t));
    }
    plot.curves = {line, dots};
    const std::string which = ratio > 1 ? "conductivities 9 : 1" : "one conductivity";
    result.measures.push_back(measure(which + ", largest error of the profile over the jump", "K", worst, 0, worst / (T_hot - T_cold), 0.02));
    if (ratio > 1) {
      const int m = stack.layers() / 2;
      const Real measured = (ratio * dots.y[m - 1] + dots.y[m]) / (ratio + 1);
      result.measures.push_back(measure(which + ", temperature of the contact (error over the jump)", "K", measured, Ti,
                                        std::abs(measured - Ti) / (T_hot - T_cold), 0.01));
    }
    result.measures.push_back(measure(which + ", drift of the energy", "J/J", heat.total_enthalpy() / before, 1, std::abs(heat.total_enthalpy() / before - 1), 1e-12));
    result.plots.push_back(std::move(plot));
  }
  result.note = "Particles of 10 cm on a lattice, support 3 dx, Wendland C2; the profile when the layer is five spacings wide.";
  return result;
}

CaseResult stefan_case() {
  // Lava of 1150 degC under a wall held at 25 degC, all latent heat at 1070 degC.
  Stack stack(48, 0.01);
  stack.expose_top();
  HeatOptions options;
  options.curve = {.heat_capacity = 1150, .latent_heat = 350e3, .solidus = 1070 + kZeroCelsius, .liquidus = 1070 + kZeroCelsius};
  options.conductivity = 1.5;
  const Real wall = 25 + kZeroCelsius, T0 = 1150 + kZeroCelsius, Tm = options.curve.solidus;
  options.air = {.emissivity = 0, .thompson_ramsey = false, .convection = 1e7, .air_temperature = wall};
  const flow::reference::FreezingFront exact(wall, Tm, T0, options.curve.latent_heat, options.curve.heat_capacity,
                                             options.conductivity / (kDensity * options.curve.heat_capacity));
  Heat heat(options, stack.dx(), kDensity);
  for (std::size_t i = 0; i < stack.size(); ++i) heat.born(T0);

  CaseResult result;
  Curve front, reference;
  front.name = "particles of 1 cm, crust columns";
  front.points = true;
  reference.name = "Neumann";
  reference.reference = true;
  constexpr int kResolved = 8;  // a melting point of no width stops a front at every particle: it lags by a fifth of one
  Real t = 0, worst = 0;
  for (const Real end : spaced_log(60, 18000, 26)) {
    while (t < end - 1e-9) {
      const Real dt = std::min({60.0, 1 + 0.02 * t, end - t});
      stack.step(heat, dt);
      t += dt;
    }
    const auto solid = heat.solid_fraction();
    const Real s = std::accumulate(solid.begin(), solid.end(), 0.0) * std::pow(stack.dx(), 3) / stack.area();
    front.x.push_back(t);
    front.y.push_back(s);
    reference.x.push_back(t);
    reference.y.push_back(exact.front(t));
    if (exact.front(t) > kResolved * stack.dx()) worst = std::max(worst, relative_error(s, exact.front(t)));
  }
  const PowerLaw law = fit_power_law(front.x, front.y);
  result.measures.push_back(share("front at 1 h", "m", interpolate_log(front.x, front.y, 3600), exact.front(3600), 0.03));
  result.measures.push_back(share("front at 5 h", "m", front.y.back(), exact.front(t), 0.03));
  result.measures.push_back(measure(fmt::format("largest error of the front once it is {} particles deep", kResolved), "", worst, 0, worst, 0.03));
  result.measures.push_back(measure("exponent of the front", "", law.exponent, 0.5, std::abs(law.exponent - 0.5), 0.03, "absolute"));

  Curve profile = stack.profile(heat), line;
  profile.name = front.name;
  profile.points = true;
  line.name = "Neumann";
  line.reference = true;
  for (const Real x : spaced(0, 0.48, 241)) {
    line.x.push_back(x);
    line.y.push_back(exact.temperature(x, t));
  }
  result.plots.push_back({.file = "stefan_front", .title = "Freezing front under a cold wall", .x_label = "time [s]", .y_label = "depth of the front [m]",
                          .log_x = true, .log_y = true, .curves = {reference, front}});
  result.plots.push_back({.file = "stefan_profile", .title = "Freezing under a cold wall, 5 h", .x_label = "depth [m]", .y_label = "temperature [K]",
                          .log_x = false, .log_y = false, .curves = {line, profile}});
  result.note = "The melting point of no width is one of 0.1 K in the solver. Steps of 2 % of the time, at most a minute.";
  return result;
}

CaseResult radiation_case() {
  CaseResult result;
  HeatOptions options = conduction_only();
  const Real T0 = 1360, d = 1;
  options.air = {.emissivity = 0.9, .thompson_ramsey = false, .convection = 0, .air_temperature = 0};
  const std::vector<Vec3> x = {Vec3::Zero()};
  const std::vector<Real> sky = {d * d};
  ColumnGrid grid;
  grid.build(x, Stack::kSupport * d);
  Neighbors nobody;
  nobody.find(grid, Stack::kSupport * d);
  const auto exact = [&](Real t) { return flow::reference::radiative_cooling(T0, 0.9, kDensity, options.curve.heat_capacity, d, t); };

  Plot plot{.file = "radiation", .title = "A lump that radiates", .x_label = "time [s]", .y_label = "temperature [K]", .log_x = false, .log_y = false, .curves = {}};
  Curve reference;
  reference.name = "closed form";
  reference.reference = true;
  for (const Real t : spaced(0, 86400, 201)) {
    reference.x.push_back(t);
    reference.y.push_back(exact(t));
  }
  plot.curves.push_back(reference);
  for (const Real dt : {10.0, 600.0}) {
    Heat heat(options, d, kDensity);
    heat.born(T0);
    Curve curve;
    curve.name = fmt::format("steps of {} s", dt);
    curve.points = true;
    Real worst = 0;
    for (int k = 1; k <= std::lround(86400 / dt); ++k) {
      heat.step(dt, {.x = x, .neighbors = nobody, .kernel = KernelKind::kWendlandC2, .support = Stack::kSupport * d, .period = Vec2::Zero(), .sky_area = sky,
                     .ground_area = {}, .ground_temperature = {}, .dissipation = {}});
      const Real t = k * dt, T = heat.temperature()[0];
      worst = std::max(worst, relative_error(T, exact(t)));
      if (k % std::lround(3600 / dt) != 0) continue;
      curve.x.push_back(t);
      curve.y.push_back(T);
      if (t == 3600 || t == 86400) result.measures.push_back(share(fmt::format("temperature at {:.0f} h, {}", t / 3600, curve.name), "K", T, exact(t), 1e-3));
    }
    result.measures.push_back(measure(fmt::format("largest error in a day, {}", curve.name), "", worst, 0, worst, 1e-3));
    plot.curves.push_back(std::move(curve));
  }
  result.plots.push_back(std::move(plot));
  result.note = "A particle of 1 m of one temperature, one face exposed to nothing at 0 K; implicit, in sub-steps of its own.";
  return result;
}

CaseResult crust_case() {
  constexpr Real kMinute = 60, kHour = 3600, kIsotherm = 1070 + kZeroCelsius;
  flow::reference::CoolingHalfSpace lava;
  lava.depth = 5;
  const std::vector<Real> times = spaced_log(10, 48 * kHour, 49);
  const auto exact = flow::reference::cool(lava, times, kIsotherm);

  CaseResult result;
  Plot surface{.file = "crust_surface", .title = "Surface of cooling lava", .x_label = "time [s]", .y_label = "temperature [degC]", .log_x = true, .log_y = false, .curves = {}};
  Plot thickness{.file = "crust_thickness", .title = "Crust on a half-space", .x_label = "time [s]", .y_label = "depth of 1070 degC [m]", .log_x = true, .log_y = true, .curves = {}};
  Curve T_exact, s_exact;
  T_exact.name = s_exact.name = "1-D reference";
  T_exact.reference = s_exact.reference = true;
  for (const auto& moment : exact) {
    T_exact.x.push_back(moment.t);
    T_exact.y.push_back(moment.surface_temperature - kZeroCelsius);
    s_exact.x.push_back(moment.t);
    s_exact.y.push_back(moment.crust);
  }
  surface.curves.push_back(T_exact);
  thickness.curves.push_back(s_exact);
  const Real early_exact = fit_power_law(s_exact.x, s_exact.y, 10 * kMinute, 10 * kHour).exponent;

  for (const Real dx : {0.05, 0.1, 0.5}) {
    Stack stack(std::max(5, static_cast<int>(2.2 / dx)), dx);
    stack.expose_top();
    HeatOptions options;
    options.conductivity = lava.conductivity;
    options.air = {.emissivity = lava.emissivity, .thompson_ramsey = false, .convection = lava.convection, .air_temperature = lava.air_temperature};
    Heat heat(options, dx, lava.density);
    for (std::size_t i = 0; i < stack.size(); ++i) heat.born(lava.T0);
    const Real before = heat.total_enthalpy();
    Curve T, s;
    T.name = s.name = fmt::format("particles of {:.0f} cm", 100 * dx);
    T.points = s.points = true;
    Real t = 0, out = 0, worst_T = 0, worst_s = 0, worst_out = 0;
    for (std::size_t k = 0; k < times.size(); ++k) {
      while (t < times[k] - 1e-9) {
        const Real dt = std::min({300.0, 0.5 + 0.02 * t, times[k] - t});
        const HeatBudget budget = stack.step(heat, dt);
        out += budget.radiated + budget.convected;
        t += dt;
      }
      T.x.push_back(t);
      T.y.push_back(heat.surface_temperature()[0] - kZeroCelsius);
      s.x.push_back(t);
      s.y.push_back(depth_of(stack.profile(heat), kIsotherm));
      if (t < 10 * kMinute * 0.99 || t > 10 * kHour * 1.01) continue;
      worst_T = std::max(worst_T, relative_error(T.y.back(), T_exact.y[k]));
      worst_s = std::max(worst_s, std::abs(s.y.back() - s_exact.y[k]) / dx);
      worst_out = std::max(worst_out, relative_error(out / stack.area(), exact[k].lost));
    }
    const std::string cm = fmt::format("{:.0f} cm: ", 100 * dx);
    result.measures.push_back(share(cm + "surface temperature at 1 h", "degC", interpolate(T.x, T.y, kHour), interpolate(T_exact.x, T_exact.y, kHour), 0.05));
    result.measures.push_back(measure(cm + "surface temperature, largest error from 10 min to 10 h", "", worst_T, 0, worst_T, 0.05));
    const Real late = fit_power_law(s.x, s.y, 10 * kHour, 48 * kHour).exponent, early = fit_power_law(s.x, s.y, 10 * kMinute, 10 * kHour).exponent;
    result.measures.push_back(measure(cm + "exponent of the thickness, 10 h to 48 h", "", late, 0.5, std::abs(late - 0.5), 0.03, "absolute"));
    result.measures.push_back(measure(cm + "exponent from 10 min to 10 h, against the reference's", "", early, early_exact, std::abs(early - early_exact), 0.03, "absolute"));
    result.measures.push_back(measure(cm + "thickness, largest error from 10 min to 10 h", "spacings", worst_s, 0, worst_s, 0.2, "spacings"));
    result.measures.push_back(measure(cm + "heat lost, largest error from 10 min to 10 h", "", worst_out, 0, worst_out, 0.03));
    const Real gap = std::abs(before - heat.total_enthalpy() - out) / out;
    result.measures.push_back(measure(cm + "gap of the energy budget", "", gap, 0, gap, 1e-9));
    surface.curves.push_back(std::move(T));
    thickness.curves.push_back(std::move(s));
  }
  result.plots = {std::move(surface), std::move(thickness)};
  result.note = fmt::format(
      "Lava of 1150 degC, emissivity 0.95, h 50 W/m2/K, latent heat over 1000 to 1150 degC, 40 % vesicles. The thickness goes as the square root of time only "
      "once the surface is near the air's temperature: the reference's own exponent is {:.3f} from 10 min to 10 h.",
      early_exact);
  return result;
}

}  // namespace

void add_heat_cases(std::vector<Case>& cases) {
  cases.push_back({"contact", "Contact of two half-spaces", "Carslaw & Jaeger 1959, section 2.15", true, contact_case});
  cases.push_back({"stefan", "Freezing front", "Neumann; Carslaw & Jaeger 1959, section 11.2", false, stefan_case});
  cases.push_back({"radiation", "Radiative cooling", "closed form", true, radiation_case});
  cases.push_back({"crust", "Crust on a half-space", "1-D enthalpy solution, converged to 0.1 %", false, crust_case});
}

}  // namespace effuse::study
