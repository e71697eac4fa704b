#pragma once

#include <vector>

#include "geometry/base/types.h"
#include "geometry/mesh/tri_mesh.h"

namespace effuse::geometry {

/// Heights on a regular grid of posts, z = h(x, y), bilinear between them (Stora et al. 1999 have the
/// terrain so). Post (i, j) stands at corner + (i * spacing.x, j * spacing.y): j = 0 is the south row.
/// A post that is NaN is a hole: the cells around it are not ground.
///
/// Immutable: const queries from many threads.
class HeightField {
 public:
  /// z: nx * ny heights [m], i fastest, south row first. nx, ny >= 2, spacing > 0, z finite or NaN,
  /// at least one whole cell (else InputError).
  HeightField(const Vec2& corner, const Vec2& spacing, int nx, int ny, std::vector<Real> z);

  int nx() const { return nx_; }
  int ny() const { return ny_; }
  Vec2 corner() const { return corner_; }
  Vec2 spacing() const { return spacing_; }
  Real post(int i, int j) const { return z_[static_cast<std::size_t>(j) * nx_ + i]; }
  const std::vector<Real>& posts() const { return z_; }
  Box3 bounds() const { return bounds_; }

  /// Whether (x, y) lies in a cell with four heights.
  bool covers(Real x, Real y) const;
  /// Bilinear height [m]; NaN where not covered.
  Real height(Real x, Real y) const;
  /// Unit upward normal of a C0 field of slopes: central differences at the posts (one-sided at holes
  /// and borders), bilinear between them. Continuous across cell borders, unlike the surface's own
  /// normal, so that a sliding particle does not rattle. NaN where not covered.
  Vec3 normal(Real x, Real y) const;

  /// The surface as triangles, two a cell, split along the diagonal that lies closer to the bilinear
  /// surface's middle; cells with holes are left out. Vertex normals are those of normal().
  TriMesh mesh() const;

 private:
  Vec2 corner_, spacing_;
  int nx_, ny_;
  std::vector<Real> z_;
  std::vector<Vec2> slope_;  // dz/dx, dz/dy at the posts
  Box3 bounds_;
};

}  // namespace effuse::geometry
