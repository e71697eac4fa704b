#pragma once

#include <span>
#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "skin/detail/near_grid.h"

namespace effuse::skin {

/// A smooth surface through (nearly) the vertices of a mesh, across their normals: the zero of
///
///   f(x) = sum_k w_k (n_k + n(x)) . (x - p_k) / (2 sum_k w_k),   n(x) = unit(sum_k w_k n_k),   w_k = (1 - (|x - p_k| / R_k)^2)^3
///
/// with R_k twice the mean length of the edges at vertex k. It knows nothing of triangles, so it is as smooth across their
/// edges as inside them. Exact for planes, and for spheres but for how unevenly vertices lie: measured below 0.002 edge^2 on the
/// unit sphere, normals to 0.1 edge. Elsewhere it smooths what is as short as two edges.
///
/// Vertices whose normal is turned from the point's by more than a right angle do not count (the other side of a sheet), those
/// by less than 60 degrees count fully. Where all normals within R, both sides counted, have a mean shorter than 0.93, points are
/// moved in part, where it is shorter than 0.8 not at all: on sharp edges and sheets thinner than two edges.
/// Source: moving least squares after Alexa et al. 2001 and Kolluri 2005; the mean of both normals makes it exact on spheres.
class SmoothSurface {
 public:
  /// mesh: with normals (checked). Keeps its own copy.
  explicit SmoothSurface(const geometry::TriMesh& mesh);

  /// Takes a point near the surface, with a normal near the surface's, onto it; one with no vertex near stays.
  ///   piece  which connected piece of the mesh the point is on: a bubble beside a large surface is not drawn onto it
  ///   edge   length of the edges that it is on [m]: never moved farther
  void project(Vec3& x, Vec3& normal, Index piece, Real edge) const;
  /// Of each vertex of the mesh: its piece, and the mean length of its edges [m].
  std::span<const Index> pieces() const { return piece_; }
  std::span<const Real> edges() const { return edge_; }

 private:
  struct Vertex {
    Vec3 x, normal;
    Real radius;
    Index piece, place;
  };
  Real reach_ = 0;  // the largest radius
  std::vector<Index> piece_;
  std::vector<Real> edge_;
  NearGrid<Vertex> grid_;
};

}  // namespace effuse::skin
