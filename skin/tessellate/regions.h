#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/mesh/points.h"

namespace effuse::skin {

/// The Voronoi regions of the particles on the lava's surface: a surface point belongs to the particle whose centre is
/// nearest, in space. A particle that sinks under the surface sees its region shrink to nothing, and one that rises sees
/// it grow from nothing, so what is built on regions comes and goes without a jump.
///
/// Distances between nearest centres are all that enters: regions move rigidly with the particles, keep their particle's
/// id for as long as it is on the surface, and do not depend on the order of the points (ties: the smaller id, then the
/// smaller x, y, z). Of particles at one place the first in that order has the region, the others have none.
/// Thread-safe after construction.
class Regions {
 public:
  static constexpr Index kNone = ~Index{0};
  static constexpr Real kReach = 3;  ///< [spacings] a particle farther than this from a surface point has no claim on it

  /// Keeps its own copy of positions and ids; places are indices into the points as given here.
  ///   spacing  of the particles [m], > 0 (checked)
  /// Throws InputError for positions that are not finite, or spread over more than a million spacings.
  Regions(const geometry::Points& points, Real spacing);

  /// A point of the surface in its region.
  struct Place {
    Index particle = kNone;  ///< whose region; kNone: none within kReach
    Index neighbor = kNone;  ///< whose region is nearest; kNone: none nearer than `border`
    Real inside = 0;         ///< 0 on the region's border .. 1 well inside, C1 in the point and in every particle's position
    Real border = 0;         ///< distance to the nearest border's plane [m], at most width spacings; C0
  };
  /// With b_j = (|x - x_j|^2 - |x - x_i|^2) / (2 |x_j - x_i|), the distance to the plane between particle i and j:
  ///
  ///   inside = product over j of s(b_j / (width spacing)),   s(t) = t^2 (3 - 2t) on [0, 1], then 1
  ///
  /// so that value and slope vanish on every border: profiles multiplied by it have their support inside the region.
  /// 0.7 us a call where particles are a spacing apart and x is on their surface; width > 0 (checked).
  Place at(const Vec3& x, Real width = 0.5) const;
  /// The nearest particle alone; kNone: none within kReach. hint: a particle believed near, or kNone; the
  /// same answer anyway, faster if it is. 0.25 us.
  Index nearest(const Vec3& x, Index hint = kNone) const;

  std::size_t size() const { return x_.size(); }
  Real spacing() const { return spacing_; }

 private:
  /// Whether the a-th of the sorted particles goes before the b-th, where both are as near.
  bool goes_first(Index a, Index b) const;
  /// The nearest of all, as sorted, within reach [m] of x; kNone. squared: its distance [m^2].
  Index nearest_within(const Vec3& x, Real reach, Real& squared) const;
  Index nearest_sorted(const Vec3& x, Real& squared) const;
  template <class F>
  void each_near(const Vec3& x, Real radius, F&& f) const;
  int column_of(Real v, Real origin) const;

  /// Particles are sorted into rows of upright columns of square base, by height inside each column. A row reaches from its
  /// first to its last column with particles: column y of row x is column_[begin + y - first] ...
  struct Row {
    int first = 0, count = 0;
    std::size_t begin = 0;
  };
  Real spacing_, side_;  // [m] of a particle, of a column
  Box3 box_;
  std::vector<Row> rows_;
  std::vector<Index> column_;      // where each column's particles begin; one more at the end
  std::vector<Vec3> x_;            // sorted
  std::vector<std::uint64_t> id_;  // sorted
  std::vector<Index> place_;       // of the sorted ones among the points given
  std::vector<Index> sorted_;      // and back
};

}  // namespace effuse::skin
