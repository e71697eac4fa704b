#pragma once

#include "flow/effects/lava_model.h"

namespace effuse::flow {

/// The parameters of [lava] with model = "classic": flow/sph/classic_lava.h. Faults stay in the table.
LavaModel read_classic_lava(Parameters& lava);

}  // namespace effuse::flow
