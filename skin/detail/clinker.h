#pragma once

#include <cstdint>

#include "skin/tessellate/regions.h"

namespace effuse::skin {

/// How far clinkers have come at a point: 0 molten .. 1 cold and crusted. Both C1; rises with cold.
struct ClinkerGrowth {
  Real height = 0;     ///< share of their full height: cold^1.5, so that they come after the swell
  Real size = 0;       ///< how soon after the border they are up: 0.9 (domes) .. 1.05 (blocks with broken faces)
  Real roughness = 0;  ///< of their tops, share of their height: 0 .. 0.3
};
ClinkerGrowth clinker_growth(Real cold);

/// The clinkers' common shape by Regions::Place::inside and ClinkerGrowth::size, 0 on the border .. 1:
///
///   t (2 - t),   t = min(size inside^(5/4), 1)
///
/// C1, and without curvature on the border, so that cracks are no kinks. At most 5 a spacing steep between two particles a
/// spacing apart: steeper sides would flicker where particles pass one another.
Real clinker_dome(Real inside, Real size);

/// A clinker's height over its region's border at a point: 0 on the border, with no slope there, whatever its neighbours do. The less
/// of a side and a top, their rim rounded by a norm:
///
///   z    = (side^-6 + lid^-6)^(-1/6),   side = 1.5 clinker_dome(inside, size),   lid = top, held above 0 softly
///   top  = share (1 + tilt . (u, v) - 2.2 sharp sum_k max(n_k . (u, v) - d_k, 0)) + roughness rough(u, v)
///
///   share, tilt  random by id: 0.3 .. 1.3, small ones more often, and up to 0.9 in (u, v)
///   n_k, d_k     five faces broken off all round: directions, and distances up to 0.3; edges rounded over 0.05
///   sharp        0 .. 1 as growth.size goes from domes to blocks
///   rough        triangle noise of three octaves, the first 0.6 spacings wide, each id another part of it
///   (u, v)       offset from the particle in material coordinates, across the surface [spacings]
///
/// C1 wherever (u, v) and `inside` are. Grows with each of the three parts of growth.
Real clinker(const Regions::Place& place, std::uint64_t id, const Vec2& uv, const ClinkerGrowth& growth, std::uint64_t seed);

/// Mean of clinker() over a surface of particles one spacing apart with that growth (height left out): measured, see the test. A skin
/// displaced by clinker minus this keeps its volume.
Real mean_clinker(Real size);

}  // namespace effuse::skin
