#pragma once

#include "flow/scene/parameters.h"
#include "flow/sph/lava_presets.h"

namespace effuse::flow {

/// The table [lava.rheology]: how stiff the lava is. lava is the table [lava]; viscosities are dynamic.
///
///   [lava.rheology]                 law = "vft"; a, b, c         the melt; each law has parameters of its own
///   [lava.rheology.oxides]          sio2 = 51.2, ...             of law = "grd08", wt %
///   [lava.rheology.crystals]        law = "einstein_roscoe"; erupted, grown, start, end, max, intrinsic
///   [lava.rheology.bubbles]         law = "none"; fraction
///   [lava.rheology.yield]           law = "dragoni_ryerson"; ...
///
/// preset gives the defaults; without one: 1000 Pa s, no crystals, bubbles or yield strength. A law that is not the
/// preset's has no defaults. Parameters of laws not chosen are not read, hence faults of the scene. Faults are gathered
/// in the table, not thrown; what is returned is sound in any case.
sph::Rheology read_rheology(Parameters& lava, const sph::LavaPreset* preset);

}  // namespace effuse::flow
