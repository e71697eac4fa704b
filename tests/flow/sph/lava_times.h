#pragma once

#include <algorithm>
#include <cstddef>
#include <ctime>
#include <string>
#include <vector>

#include "flow/sph/modern_lava.h"
#include "geometry/base/hash.h"

/// What tests and benchmarks of a step's cost share.
namespace effuse::flow::sph {

/// Processor time of this thread [s].
inline double thread_seconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

inline double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

inline std::string hex_of(const ModernLava& lava) {
  StateHash hash;
  lava.add_to(hash);
  return hash.hex();
}

}  // namespace effuse::flow::sph
