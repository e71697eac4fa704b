#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "geometry/base/types.h"
#include "samples/study/study.h"

/// What accuracy costs in time: runs of one problem at many settings, each with what it took and how wrong it was.
namespace effuse::study {

/// What one run leaves: its seconds, and what it takes to judge it.
struct CostRun {
  Real seconds = 0;         ///< of processor time
  Real error = 0;           ///< against an exact or converged reference; not finite: it blew up
  std::uint64_t steps = 0;
  std::size_t memory = 0;   ///< bytes of the solver's state
  std::uint64_t hash = 0;   ///< of the state at the end
};

/// Processor time of the process [s]: what else runs on the machine counts only by the caches it takes.
Real processor_time();

/// Runs it `repeats` times, fewer once all together take more than `enough` seconds: median of the seconds and half their range. Throws
/// std::runtime_error when two runs end in different states.
CostPoint cost_of(const std::string& curve, const std::string& setting, Real parameter, const std::function<CostRun()>& run, int repeats = 5, Real enough = 2);

/// Points of one curve, in their order.
std::vector<CostPoint> points_of(std::span<const CostPoint> points, const std::string& curve);

/// Names of the curves, in the order they come in.
std::vector<std::string> curves_of(std::span<const CostPoint> points);

/// The order a curve's errors fall at with the parameter, by least squares in log-log over its finest `count` points whose error is at
/// least `least`: below that it is rounding. Not a number with fewer than two points.
Real order_of(std::span<const CostPoint> points, const std::string& curve, Real least = 0, std::size_t count = 3);

/// Error against seconds, a curve each; points of one curve are joined in the order given.
Plot cost_plot(const std::string& file, const std::string& title, const std::string& error_label, std::span<const CostPoint> points);

/// Error against the parameter, with a line of each slope given through the curve's point of least error.
struct Slope {
  std::string curve;
  Real order;
};
Plot convergence_plot(const std::string& file, const std::string& title, const std::string& parameter_label, const std::string& error_label, std::span<const CostPoint> points, std::span<const Slope> slopes);

/// The setting that takes least for an error of at most `error`: seconds by straight lines between the logarithms along each curve's
/// frontier. curve "": none gets there.
struct Cheapest {
  std::string curve;
  Real seconds = 0;
  std::string setting;  ///< the cheapest of the runs that is at least as good
};
Cheapest cheapest(std::span<const CostPoint> points, Real error);

/// "rk4 takes least for 0.1 %: 12 ms; euler 40 times that": a sentence for the title or note of a plot.
std::string told(std::span<const CostPoint> points, Real error);

/// The order measured beside the order of theory, held to within `hold`.
Measure order_measure(const std::string& what, Real measured, Real theory, Real hold);

}  // namespace effuse::study
