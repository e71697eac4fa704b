#include "samples/study/cost/cost.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <iterator>
#include <limits>
#include <stdexcept>

#include "samples/study/cost/frontier.h"
#include "samples/study/measure.h"

namespace effuse::study {

Real processor_time() { return static_cast<Real>(std::clock()) / CLOCKS_PER_SEC; }

CostPoint cost_of(const std::string& curve, const std::string& setting, Real parameter, const std::function<CostRun()>& run, int repeats, Real enough) {
  CostPoint point;
  point.curve = curve;
  point.setting = setting;
  point.parameter = parameter;
  std::vector<Real> seconds;
  for (Real sum = 0; point.repeats < repeats && (seconds.empty() || sum < enough);) {
    const CostRun one = run();
    if (!seconds.empty() && one.hash != point.hash) throw std::runtime_error(fmt::format("{}, {}: two runs end in different states", curve, setting));
    point.error = one.error;
    point.steps = one.steps;
    point.memory = one.memory;
    point.hash = one.hash;
    seconds.push_back(one.seconds);
    sum += one.seconds;
    ++point.repeats;
  }
  std::sort(seconds.begin(), seconds.end());
  const std::size_t middle = seconds.size() / 2;
  point.seconds = seconds.size() % 2 == 1 ? seconds[middle] : (seconds[middle - 1] + seconds[middle]) / 2;
  point.spread = (seconds.back() - seconds.front()) / 2;
  return point;
}

std::vector<CostPoint> points_of(std::span<const CostPoint> points, const std::string& curve) {
  std::vector<CostPoint> own;
  std::copy_if(points.begin(), points.end(), std::back_inserter(own), [&](const CostPoint& p) { return p.curve == curve; });
  return own;
}

std::vector<std::string> curves_of(std::span<const CostPoint> points) {
  std::vector<std::string> names;
  for (const CostPoint& p : points)
    if (std::find(names.begin(), names.end(), p.curve) == names.end()) names.push_back(p.curve);
  return names;
}

Real order_of(std::span<const CostPoint> points, const std::string& curve, Real least, std::size_t count) {
  std::vector<CostPoint> own = points_of(points, curve);
  std::erase_if(own, [&](const CostPoint& p) { return !std::isfinite(p.error) || !(p.error > 0) || p.error < least; });
  std::stable_sort(own.begin(), own.end(), [](const CostPoint& a, const CostPoint& b) { return a.parameter < b.parameter; });
  if (own.size() > count) own.resize(count);
  std::vector<Real> x, y;
  for (const CostPoint& p : own) {
    x.push_back(p.parameter);
    y.push_back(p.error);
  }
  return x.size() < 2 ? std::numeric_limits<Real>::quiet_NaN() : fit_power_law(x, y).exponent;
}

namespace {

Plot plot_of(const std::string& file, const std::string& title, const std::string& x_label, const std::string& y_label, std::span<const CostPoint> points, double CostPoint::*x) {
  Plot plot{file, title, x_label, y_label, true, true, {}};
  for (const std::string& name : curves_of(points)) {
    Curve curve{name, {}, {}, false, false};
    for (const CostPoint& p : points_of(points, name)) {
      curve.x.push_back(p.*x);
      curve.y.push_back(p.error);
    }
    plot.curves.push_back(std::move(curve));
  }
  return plot;
}

}  // namespace

Plot cost_plot(const std::string& file, const std::string& title, const std::string& error_label, std::span<const CostPoint> points) {
  return plot_of(file, title, "processor time [s]", error_label, points, &CostPoint::seconds);
}

Plot convergence_plot(const std::string& file, const std::string& title, const std::string& parameter_label, const std::string& error_label, std::span<const CostPoint> points, std::span<const Slope> slopes) {
  Plot plot = plot_of(file, title, parameter_label, error_label, points, &CostPoint::parameter);
  for (const Slope& slope : slopes) {
    std::vector<CostPoint> own = points_of(points, slope.curve);
    std::erase_if(own, [](const CostPoint& p) { return !std::isfinite(p.error) || p.error <= 0; });
    if (own.size() < 2) continue;
    const auto [finest, coarsest] = std::minmax_element(own.begin(), own.end(), [](const CostPoint& a, const CostPoint& b) { return a.parameter < b.parameter; });
    // Beside the curve, not on it.
    constexpr Real kBeside = 0.6;
    const Real from = finest->parameter, to = coarsest->parameter, at = kBeside * coarsest->error;
    plot.curves.push_back({fmt::format("slope {:.3g}", slope.order), {from, to}, {at * std::pow(from / to, slope.order), at}, false, true});
  }
  return plot;
}

Cheapest cheapest(std::span<const CostPoint> points, Real error) {
  Cheapest best;
  best.seconds = std::numeric_limits<Real>::infinity();
  for (const std::string& name : curves_of(points)) {
    std::vector<WorkPoint> runs;
    for (const CostPoint& p : points_of(points, name)) runs.push_back({p.setting, p.seconds, p.error});
    const std::vector<WorkPoint> least = frontier(runs);
    const Real seconds = seconds_for(least, error);
    if (!(seconds < best.seconds)) continue;
    best = {name, seconds, ""};
    for (const WorkPoint& run : least)
      if (best.setting.empty() && run.error <= error) best.setting = run.setting;
  }
  return best;
}

std::string told(std::span<const CostPoint> points, Real error) {
  const Cheapest best = cheapest(points, error);
  const auto share = [](Real e) { return e >= 1e-4 ? fmt::format("{:.3g} %", 100 * e) : fmt::format("{:.0e}", e); };
  if (best.curve.empty()) return fmt::format("none gets to {}", share(error));
  const auto time = [](Real s) { return s >= 1 ? fmt::format("{:.2g} s", s) : s >= 1e-3 ? fmt::format("{:.2g} ms", 1e3 * s) : fmt::format("{:.2g} us", 1e6 * s); };
  std::string text = fmt::format("{} takes least for {}: {}", best.curve, share(error), time(best.seconds)), others;
  for (const std::string& name : curves_of(points)) {
    if (name == best.curve) continue;
    const Cheapest other = cheapest(points_of(points, name), error);
    others += (others.empty() ? "; " : ", ") + (other.curve.empty() ? name + " does not get there" : fmt::format("{} {:.2g} times that", name, other.seconds / best.seconds));
  }
  return text + others;
}

Measure order_measure(const std::string& what, Real measured, Real theory, Real hold) { return {what, "", measured, theory, std::abs(measured - theory), hold, "absolute"}; }

}  // namespace effuse::study
