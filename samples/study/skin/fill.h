#pragma once

#include <functional>
#include <vector>

#include "geometry/base/types.h"

namespace effuse::study {

/// How particles lie in what they fill.
enum class Filling {
  kLattice,   ///< cubic
  kDisorder,  ///< as a liquid's under pressure: none near one another, none in rows, walls lined and corners filled
};

/// Particles that fill a body, one for each unit of its volume: spacing 1.
///
///   kLattice   the centres of the cubes of a unit lattice that are inside; the lattice is shifted, by eighths, to where
///              their number is nearest to `volume` and, of equal numbers, their middle nearest to the box's
///   kDisorder  those, moved at random by up to 0.35 each way, then in 60 rounds pushed apart, by a quarter of what two lack to
///              1.25, and back in where they are within 0.45 of the surface. More than a mean distance apart they would still push, as
///              under a liquid's pressure: that drives them to the walls, where the first layer lies half a spacing under the
///              surface, and into edges and corners; none leaves the body
///
///   box       holds the body
///   distance  negative inside, near the surface about the distance from it
///   volume    of the body; 0: the lattice stays where it is
/// A pure function of its arguments. Same bits on any number of threads.
std::vector<Vec3> fill(const Box3& box, const std::function<Real(const Vec3&)>& distance, Real volume, Filling how, std::uint64_t seed = 1);

}  // namespace effuse::study
