#pragma once

#include <vector>

#include "geometry/mesh/points.h"
#include "skin/detail/near_grid.h"

namespace effuse::skin {

/// What the particles say about a point near them, smooth in the point and in every particle: the material coordinates that
/// detail hangs on, how they are stretched, temperature, crust and the strain rate.
///
/// Weights w_i = (1 - (|x - x_i| / reach)^2)^3, so that a particle comes within reach and leaves it without a jump. Temperature
/// and crust are weighted means. Vectors f (rest, rest2, velocity) are fitted by an affine map, by least squares:
///
///   f(x) = fbar + A (x - xbar),   A = sum w (f_i - fbar)(x_i - xbar)^T (sum w (x_i - xbar)(x_i - xbar)^T + lambda sum w I)^-1
///
/// bars: weighted means. Exact under rotation, shear and stretch but for lambda = (0.05 spacing)^2 (2 % of a spacing at a surface),
/// which keeps A from growing where particles lie in a plane (across it there is no slope) and lets it fade for a lone drop. Particles moved rigidly give
/// the same rest, and slopes and outward turned with them.
///
/// Thread-safe after construction. About 3 us a point.
class Material {
 public:
  /// Keeps its own copy. Throws InputError for positions that are not finite or particles a million spacings apart.
  ///   spacing  of the particles [m], > 0 (checked)
  ///   reach    of the weights [spacings]; at 2 already a particle that comes up among others shakes the fit
  Material(const geometry::Points& points, Real spacing, Real reach = 2.5);

  struct Sample {
    bool any = false;                   ///< a particle within reach; if not, nothing else is set
    Real weight = 0;                    ///< sum of w: at a reach of 2.5, 0.8 on a lone particle's drop, 1.2 at a corner, 2.5 at an edge, 5 on a face
    Vec3 outward = Vec3::Zero();        ///< x - xbar [m]: at the surface of a body of particles, out of it; 0.3 spacings long or more
    Vec3 rest[2];                       ///< of the two material frames [m]; x itself for a frame that the points do not have
    Mat3 slope[2];                      ///< d rest / dx; the unit matrix for such a frame
    Real temperature = 0, crust = 0;    ///< [K], 0..1; 0 when the points have none
    Mat3 strain_rate = Mat3::Zero();    ///< [1/s] symmetric part of the velocity's slope; 0 when the points have no velocity
  };
  Sample at(const Vec3& x) const;

  bool has_rest(int frame) const { return has_rest_[frame]; }
  bool has_temperature() const { return has_temperature_; }
  bool has_crust() const { return has_crust_; }
  /// Material coordinates of particle i (as the points numbered it), or its position for a frame that they do not have.
  const Vec3& rest_of(Index i, int frame) const { return grid_.sorted()[place_[i]].rest[frame]; }

 private:
  struct Particle {
    Vec3 x, rest[2], velocity;
    Real temperature, crust;
    Index place;
  };

  Real reach_;
  bool has_rest_[2], has_velocity_, has_temperature_, has_crust_;
  NearGrid<Particle> grid_;
  std::vector<Index> place_;  // in the grid's order, of each of the points
  Real spacing_;
};

}  // namespace effuse::skin
