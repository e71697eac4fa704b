#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "geometry/base/types.h"
#include "geometry/mesh/tri_mesh.h"

namespace effuse::geometry {

/// Heights on a regular grid of posts, z = h(x, y), bilinear between them (Stora et al. 1999 have the
/// terrain so). Post (i, j) stands at corner + (i * spacing.x, j * spacing.y): j = 0 is the south row.
/// A post that is NaN is a hole: the cells around it are not ground. The covered area is closed: its
/// border belongs to it (along holes to within 1e-9 cells).
///
/// Immutable: const queries from many threads.
class HeightField {
 public:
  /// z: nx * ny heights [m], i fastest, south row first. nx, ny >= 2, spacing > 0, z finite or NaN,
  /// at least one whole cell (else InputError, with every fault found).
  HeightField(const Vec2& corner, const Vec2& spacing, int nx, int ny, std::vector<Real> z);

  int nx() const { return nx_; }
  int ny() const { return ny_; }
  Vec2 corner() const { return corner_; }
  Vec2 spacing() const { return spacing_; }
  Real post(int i, int j) const { return z_.data()[static_cast<std::size_t>(j) * nx_ + i]; }
  const std::vector<Real>& posts() const { return z_; }
  /// Of the whole cells.
  Box3 bounds() const { return bounds_; }
  /// Steepest slope |grad h| of the surface anywhere in the whole cells.
  Real max_slope() const { return max_slope_; }
  /// Cells that are not ground.
  std::size_t holes() const { return holes_; }

  /// Lower left post of a whole cell that (x, y) lies in, borders included; nullopt where not covered.
  /// A point on the border between cells gets the upper or right one if that is whole.
  struct Cell {
    int i, j;
  };
  std::optional<Cell> cell(Real x, Real y) const {
    if (!(x >= corner_.x() && y >= corner_.y() && x <= far_corner_.x() && y <= far_corner_.y())) return std::nullopt;  // NaN, too
    const Real u = (x - corner_.x()) * per_spacing_.x(), v = (y - corner_.y()) * per_spacing_.y();
    const int i = std::min(static_cast<int>(u), nx_ - 2), j = std::min(static_cast<int>(v), ny_ - 2);
    if (whole(i, j)) [[likely]]
      return Cell{i, j};
    return cell_beside_hole(u, v, i, j);
  }
  /// Whether cell (i, j), 0 <= i < nx - 1, 0 <= j < ny - 1, has four heights.
  bool whole(int i, int j) const {
    const Real* z = z_.data() + static_cast<std::size_t>(j) * nx_ + i;
    const Real sum = z[0] + z[1] + z[nx_] + z[nx_ + 1];
    return sum == sum;
  }

  /// Whether (x, y) lies in a cell with four heights.
  bool covers(Real x, Real y) const { return cell(x, y).has_value(); }
  /// Bilinear height [m]; NaN where not covered.
  Real height(Real x, Real y) const;
  /// Height [m] of the bilinear function of whole cell c at (x, y).
  Real height(const Cell& c, Real x, Real y) const {
    const Real u = (x - corner_.x()) * per_spacing_.x() - c.i, v = (y - corner_.y()) * per_spacing_.y() - c.j;
    const Real* z = z_.data() + static_cast<std::size_t>(c.j) * nx_ + c.i;
    const Real south = z[0] + u * (z[1] - z[0]), north = z[nx_] + u * (z[nx_ + 1] - z[nx_]);
    return south + v * (north - south);
  }
  /// Unit upward normal of a C0 field of slopes: central differences at the posts (one-sided at holes
  /// and borders), bilinear between them. Continuous across cell borders, unlike the surface's own
  /// normal, so that a sliding particle does not rattle. NaN where not covered.
  Vec3 normal(Real x, Real y) const;
  /// The same field carried on over holes (from the nearest posts) and past the border (clamped):
  /// continuous everywhere, never NaN for finite x and y.
  Vec3 extended_normal(Real x, Real y) const {
    const Real u = std::clamp((x - corner_.x()) * per_spacing_.x(), Real{0}, Real(nx_ - 1));
    const Real v = std::clamp((y - corner_.y()) * per_spacing_.y(), Real{0}, Real(ny_ - 1));
    const int i = std::min(static_cast<int>(u), nx_ - 2), j = std::min(static_cast<int>(v), ny_ - 2);
    const Vec2* s = slope_.data() + static_cast<std::size_t>(j) * nx_ + i;
    const Vec2 south = s[0] + (u - i) * (s[1] - s[0]), north = s[nx_] + (u - i) * (s[nx_ + 1] - s[nx_]);
    const Vec2 slope = south + (v - j) * (north - south);
    const Real up = 1 / std::sqrt(1 + slope.squaredNorm());
    return {-slope.x() * up, -slope.y() * up, up};
  }

  /// The surface as triangles, two a cell, split along the diagonal whose ends differ less in height
  /// (a tie: from the lower left post). Both diagonals lie equally far from the bilinear surface's middle;
  /// the flatter one keeps ridges and valleys whole. Cells with holes and posts no cell uses are left
  /// out. Vertex normals are those of normal().
  TriMesh mesh() const;
  /// Whether mesh() splits whole cell (i, j) from its lower left to its upper right post.
  bool splits_rising(int i, int j) const;

 private:
  /// The rest of cell(): (u, v) lie in cell (i, j), which is a hole, perhaps on its border.
  std::optional<Cell> cell_beside_hole(Real u, Real v, int i, int j) const;

  Vec2 corner_, spacing_, per_spacing_, far_corner_;
  int nx_, ny_;
  std::vector<Real> z_;
  std::vector<Vec2> slope_;  // dz/dx, dz/dy at the posts; filled in at holes
  Box3 bounds_;
  Real max_slope_ = 0;
  std::size_t holes_ = 0;
};

}  // namespace effuse::geometry
