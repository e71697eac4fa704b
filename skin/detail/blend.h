#pragma once

#include <algorithm>

#include "geometry/base/types.h"

namespace effuse::skin {

/// 0 up to `from`, 1 from `to` on, 3 t^2 - 2 t^3 between: C1.
inline Real smoothstep(Real from, Real to, Real x) {
  const Real t = std::clamp((x - from) / (to - from), Real{0}, Real{1});
  return t * t * (3 - 2 * t);
}

}  // namespace effuse::skin
