#pragma once

#include <span>
#include <string>
#include <vector>

#include "geometry/base/types.h"

/// What it takes to compare solvers at equal error.
namespace effuse::study {

/// One run: what it cost and how wrong it was.
struct WorkPoint {
  std::string setting;  ///< "10 layers"
  Real seconds = 0;     ///< of processor time, > 0
  Real error = 0;       ///< a share, > 0; not finite: it blew up
};

/// The runs that no other one beats in both seconds and error, by rising seconds: errors fall. Runs that blew up are left out.
std::vector<WorkPoint> frontier(std::span<const WorkPoint> runs);

/// The least seconds for an error: straight lines between the logarithms along a frontier; those of its cheapest run for all larger errors,
/// for what is cheaper still was not tried; infinite below its least error.
Real seconds_for(std::span<const WorkPoint> frontier, Real error);

/// Seconds of one solver over seconds of another at equal error, at each error where either frontier has a corner and which both reach, by
/// rising error. Between these the logarithm of the ratio is a straight line. Empty when a frontier is.
struct TimeRatio {
  Real error, ratio;
};
std::vector<TimeRatio> time_ratios(std::span<const WorkPoint> one, std::span<const WorkPoint> other);

}  // namespace effuse::study
