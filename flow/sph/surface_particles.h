#pragma once

#include <cstdint>
#include <span>

#include "flow/sph/column_grid.h"
#include "geometry/base/types.h"

namespace effuse::flow::sph {

/// When is a particle on the surface? Stora et al. 1999, both tests:
///
///   mass quotient   the plane through the particle, square to the direction towards its neighbours'
///                   centre of mass, cuts the neighbourhood in two; at the surface the outer half holds
///                   little:  m_outer / m_all < mass_quotient
///   coplanarity     the neighbours lie near a plane (a sheet one or two particles thick, where both
///                   halves hold the same mass): the smallest eigenvalue of their covariance is below
///                   `coplanarity` times the largest
///
/// A particle with fewer than min_neighbors is on the surface, too. In a body's inside a lattice at
/// support 2 spacings has a mass quotient of about 0.4, at a flat surface about 0.1 (9 of 83 in the
/// plane count to neither side).
struct SurfaceCriteria {
  Real mass_quotient = 0.3;
  Real coplanarity = 0.12;
  std::size_t min_neighbors = 8;
};

/// Flags (1 = surface) and outward unit directions of all particles; the direction is zero where the
/// neighbourhood has none (inside, or in the middle of a sheet).
///
///   x          positions [m], n
///   neighbors  lists of n particles
///   surface    out: n flags
///   outward    out: n directions
///
/// Equal masses. Parallel, the same bits on any number of threads. O(pairs).
void find_surface(std::span<const Vec3> x, const Neighbors& neighbors, Real support, const SurfaceCriteria& criteria, std::span<std::uint8_t> surface,
                  std::span<Vec3> outward);

}  // namespace effuse::flow::sph
