#include "samples/study/cost/frontier.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "samples/study/measure.h"

namespace effuse::study {

namespace {
constexpr Real kInfinity = std::numeric_limits<Real>::infinity();
}

std::vector<WorkPoint> frontier(std::span<const WorkPoint> runs) {
  std::vector<WorkPoint> sorted;
  for (const WorkPoint& run : runs)
    if (std::isfinite(run.error) && std::isfinite(run.seconds)) sorted.push_back(run);
  std::stable_sort(sorted.begin(), sorted.end(), [](const WorkPoint& a, const WorkPoint& b) { return a.seconds != b.seconds ? a.seconds < b.seconds : a.error < b.error; });
  std::vector<WorkPoint> best;
  for (const WorkPoint& run : sorted)
    if (best.empty() || run.error < best.back().error) best.push_back(run);
  return best;
}

Real seconds_for(std::span<const WorkPoint> frontier, Real error) {
  if (frontier.empty() || !(error >= frontier.back().error)) return kInfinity;
  if (error >= frontier.front().error) return frontier.front().seconds;
  std::vector<Real> errors, seconds;
  for (std::size_t k = frontier.size(); k-- > 0;) {
    errors.push_back(frontier[k].error);
    seconds.push_back(frontier[k].seconds);
  }
  return interpolate_log(errors, seconds, error);
}

std::vector<TimeRatio> time_ratios(std::span<const WorkPoint> one, std::span<const WorkPoint> other) {
  if (one.empty() || other.empty()) return {};
  std::vector<Real> errors;
  for (const auto& runs : {one, other})
    for (const WorkPoint& run : runs)
      if (run.error >= std::max(one.back().error, other.back().error)) errors.push_back(run.error);
  std::sort(errors.begin(), errors.end());
  errors.erase(std::unique(errors.begin(), errors.end()), errors.end());
  std::vector<TimeRatio> ratios;
  for (const Real error : errors) ratios.push_back({error, seconds_for(one, error) / seconds_for(other, error)});
  return ratios;
}

}  // namespace effuse::study
