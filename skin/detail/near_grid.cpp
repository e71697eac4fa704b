#include "skin/detail/near_grid.h"

#include <fmt/format.h>

#include "geometry/base/error.h"

namespace effuse::skin {

void refuse_place(std::size_t i) { throw InputError(Place{"particles"}, fmt::format("particle {}: its position is not finite", i)); }

void refuse_spread(Real spread, Real side) {
  throw InputError(Place{"particles"}, fmt::format("spread over {:.4g} m: more than a million times {:.4g} m", spread, side));
}

}  // namespace effuse::skin
