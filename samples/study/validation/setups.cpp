#include "samples/study/validation/setups.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "samples/study/measure.h"

namespace effuse::study {

flow::sph::ModernLava::ContactSource plane(const Vec3& normal, const Vec3& point, const Vec3& velocity, Real temperature) {
  return [=](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      const Real d = (x[i] - point).dot(normal);
      out[i] = d < reach ? geometry::Contact{Vec3(x[i] - d * normal), normal, d, velocity, temperature, 0} : geometry::Contact{};
    }
  };
}

std::vector<Vec3> block(const Vec3& low, const std::array<int, 3>& counts, Real spacing) {
  std::vector<Vec3> x;
  for (int k = 0; k < counts[2]; ++k)
    for (int j = 0; j < counts[1]; ++j)
      for (int i = 0; i < counts[0]; ++i) x.push_back(low + spacing * Vec3(i + 0.5, j + 0.5, k + 0.5));
  return x;
}

void add_at_rest(flow::sph::ModernLava& lava, const std::vector<Vec3>& x, Real temperature) {
  lava.add(x, std::vector<Vec3>(x.size(), Vec3::Zero()), std::vector<Real>(x.size(), temperature));
}

void RunStatistics::add(const flow::sph::ModernReport& report) {
  ++steps;
  retries += report.retries;
  pressure_iterations += report.pressure_iterations;
  viscosity_iterations += report.viscosity_iterations;
  density_iterations += report.density_iterations;
  largest_step = std::max(largest_step, report.dt);
  largest_density_error = std::max(largest_density_error, report.density_error);
}

std::string RunStatistics::text() const {
  const double n = std::max(steps, 1);
  return fmt::format("{} steps of at most {:.3g} s, {:.0f} pressure, {:.0f} viscosity and {:.0f} density iterations a step{}", steps, largest_step,
                     static_cast<double>(pressure_iterations) / n, static_cast<double>(viscosity_iterations) / n, static_cast<double>(density_iterations) / n,
                     retries ? fmt::format(", {} steps tried again", retries) : "");
}

void run_until(flow::sph::ModernLava& lava, Real t, Real max_step, RunStatistics& statistics,
               const std::function<void(const flow::sph::ModernReport&)>& watch) {
  // What rounding leaves of the time is no step.
  while (t - lava.time() > 1e-9 * t) {
    const flow::sph::ModernReport report = lava.step(std::min(max_step, t - lava.time()));
    statistics.add(report);
    if (watch) watch(report);
  }
}

flow::sph::ModernOptions isothermal(Real spacing, Real mu) {
  flow::sph::ModernOptions options;
  options.spacing = spacing;
  options.rheology = flow::sph::Rheology::newtonian(mu);
  options.heat.on = false;
  return options;
}

Real mean_radius(std::span<const Vec3> x, Real spacing) {
  constexpr int kSectors = 48;
  std::vector<Real> farthest(kSectors, 0);
  for (const Vec3& p : x) {
    const int k = std::clamp(static_cast<int>((std::atan2(p.y(), p.x()) / (2 * kPi) + 0.5) * kSectors), 0, kSectors - 1);
    farthest[static_cast<std::size_t>(k)] = std::max(farthest[static_cast<std::size_t>(k)], std::hypot(p.x(), p.y()));
  }
  Real sum = 0;
  for (Real r : farthest) sum += r;
  return sum / kSectors + spacing / 2;
}

Measure compared(std::string what, std::string unit, Real measured, Real reference, Real hold) {
  return {std::move(what), std::move(unit), measured, reference, relative_error(measured, reference), hold, ""};
}

Measure bounded(std::string what, Real error, Real hold, std::string unit_of_error) {
  return {std::move(what), unit_of_error, error, 0, error, hold, unit_of_error};
}

}  // namespace effuse::study
