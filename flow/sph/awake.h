#pragma once

#include <span>
#include <vector>

#include "geometry/base/types.h"

namespace effuse::flow::sph {

/// Which particles a step has to look at when most of them sleep: those awake, the sleepers near them (drowsy: within
/// one cell), and those near these (still: within two). Cells are `cell` wide, so that everything within `cell` of
/// a drowsy particle is in the set.
struct AwakeSet {
  std::vector<Index> particles;  ///< awake first, then drowsy, then still; rising within each
  std::size_t awake = 0, drowsy = 0;

  /// x: n positions [m], asleep: n flags. O(n); without sleepers it is all of them, in order.
  void find(std::span<const Vec3> x, std::span<const std::uint8_t> asleep, Real cell);
};

}  // namespace effuse::flow::sph
