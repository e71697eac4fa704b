#pragma once

#include <span>

#include "geometry/base/types.h"

namespace effuse::importers {

/// The distance between neighbouring particles [unit of x], from their places alone: of a sample of 20,000 the mean distance
/// to the four nearest others, of those the median. 0 when there are not two places among them.
///
/// Exact for a cubic lattice, and for sheets of one layer; particles of an SPH solver, which are disordered, read up to a
/// tenth low (1 to 9 % over a dam break), random places a fifth. Particles at the same place count once. Coordinates finite (checked).
/// O(n log n), 4 bytes a particle. Deterministic.
Real estimate_spacing(std::span<const Vec3> x);

}  // namespace effuse::importers
