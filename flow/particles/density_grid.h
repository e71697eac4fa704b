#pragma once

#include <cstddef>
#include <span>

#include "geometry/mesh/volume.h"

namespace effuse::flow::particles {

struct DensityGridOptions {
  Real cell = 0;                        ///< [m]; 0: half the mean radius
  std::size_t most_cells = 20'000'000;  ///< a grid that would have more gets wider cells
};

/// Soft balls as a field of extinction:
///
///   density      sum over particles of tau_i (1 - d^2/r_i^2)^2 15 / (16 r_i),  tau_i = -log(1 - opacity_i): extinction [1/m], whose
///                integral through the middle of a lone particle is tau_i
///   temperature  mean by the same weights [K]; where there is none 0
/// Radii below 0.75 of a cell count as that, thinned so that extinction times volume stays. The grid holds all particles, a
/// cell to spare on each side; no particles: no cells. Sizes must agree (checked), radii be > 0. The same bits on any number of threads.
geometry::GridVolume density_grid(std::span<const Vec3> x, std::span<const Real> radius, std::span<const Real> opacity, std::span<const Real> temperature,
                                  const DensityGridOptions& options = {});

}  // namespace effuse::flow::particles
