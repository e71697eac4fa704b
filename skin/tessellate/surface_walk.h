#pragma once

#include <vector>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::skin {

/// A point on a triangle mesh.
struct Spot {
  Vec3 x = Vec3::Zero();
  Vec3 weights = Vec3(1, 0, 0);  ///< of the triangle's corners
  Index triangle = 0;
};

/// Finds the nearest point of a mesh from one that is near, by walking over its triangles: no tree to build, and no leap from
/// one side of a thin sheet to the other. Const calls from many threads. Keeps a reference to the mesh.
class SurfaceWalk {
 public:
  explicit SurfaceWalk(const geometry::TriMesh& mesh);

  /// The nearest point to p that is reached from `start` by ever nearer triangles.
  Spot nearest(const Vec3& p, Index start) const;
  /// Unit normal at a spot: the mesh's own normals if it has them, else the angle-free mean of those of the triangles.
  Vec3 normal(const Spot& spot) const;
  const geometry::TriMesh& mesh() const { return mesh_; }

 private:
  const geometry::TriMesh& mesh_;
  std::vector<Index> begin_, around_;  // triangles at vertex v: around_[begin_[v]] .. around_[begin_[v + 1]]
  std::vector<Vec3> normals_;          // if the mesh has none
};

/// Gives mesh the surface's attributes at the spots, one for each of its vertices: linear in the surface's triangles.
void carry_over(const geometry::TriMesh& surface, const std::vector<Spot>& spots, geometry::TriMesh& mesh);

}  // namespace effuse::skin
