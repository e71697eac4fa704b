#pragma once

#include <limits>
#include <optional>
#include <vector>

#include "geometry/terrain/height_field.h"

namespace effuse::geometry {

/// Nearest points and rays on a height field: a tree of blocks of cells with their range of heights.
/// Costs 16 bytes for 12 cells. Keeps a reference: the field must outlive it. Const queries from many threads.
class HeightFieldSearch {
 public:
  explicit HeightFieldSearch(const HeightField& field);

  struct Nearest {
    Vec3 point;
    Real distance;  ///< [m], >= 0
  };
  /// The point of the bilinear surface nearest to p, if nearer than reach [m]: exact to 1e-9 cells at any
  /// distance. Near the surface by Newton's method in the cell below p; a ball of the distance found tells which
  /// other cells can matter. Where a cell's patch could hold several nearest points (a twisted cell seen from far
  /// away) they are the roots of a polynomial of degree five, isolated in Bernstein form.
  std::optional<Nearest> nearest(const Vec3& p, Real reach = std::numeric_limits<Real>::infinity()) const;
  /// The same when field.cell(p.x(), p.y()) is known.
  std::optional<Nearest> nearest(const Vec3& p, Real reach, const std::optional<HeightField::Cell>& own) const;

  /// Least t in (0, t_max] at which p + t d meets the triangles of field.mesh(), from either side.
  std::optional<Real> ray(const Vec3& p, const Vec3& d, Real t_max) const;

  /// A lower bound on the distance [m] from p, which stands dz above the surface in cell c, to any ground within
  /// reach of it: |dz| / sqrt(1 + S^2), S the steepest slope; 0 where a hole within reach may hide a cliff.
  Real distance_bound(const HeightField::Cell& c, Real dz, Real reach) const;

 private:
  struct Range {
    Real low, high;
  };
  struct Level {
    int nx, ny;  // blocks
    std::vector<Range> range;
  };
  struct Best;
  struct RayState;
  void try_cell(int i, int j, const Vec3& p, Best& best) const;
  void try_window(const Vec3& p, Best& best) const;
  void descend(int level, int i, int j, const Vec3& p, Best& best) const;
  void descend_ray(int level, int i, int j, RayState& state) const;
  Box3 box(int level, int i, int j) const;

  const HeightField& field_;
  std::vector<Level> levels_;            // [0]: blocks of kLeaf x kLeaf cells, then 2 x 2 blocks each
  std::vector<std::uint8_t> hole_near_;  // cells from each cell to the nearest hole (Chebyshev, capped); empty: no holes
  Real cone_;                            // 1 / sqrt(1 + S^2)
};

}  // namespace effuse::geometry
