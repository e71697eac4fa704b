#pragma once

#include <vector>

#include "flow/scene/meeting.h"
#include "geometry/base/types.h"

namespace effuse::flow {

/// Square cells seen from above; cell (i, j) is number j nx + i.
struct PlanCells {
  Vec2 corner = Vec2::Zero();
  Real cell = 1;
  int nx = 0, ny = 0;
};

/// Volume of lava under the surface of water, by cells [m^3]: of each particle the share of a ball's height that lies under `level`
/// of its own cell [m], spread over the cells about it as a Gaussian of deviation max(cell, spacing), on water alone. A particle that meets
/// no water cell displaces none.
///   level  one a cell; where there is no water: not a number
/// Serial, in the particles' order: the same bits always.
std::vector<Real> lava_under(const FlowView& lava, const PlanCells& cells, const std::vector<Real>& level);

}  // namespace effuse::flow
