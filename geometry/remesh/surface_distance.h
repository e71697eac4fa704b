#pragma once

#include <cstddef>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::geometry {

/// How far one surface lies from another.
struct SurfaceDistance {
  Real largest = 0;           ///< distance of a sample from the other surface [m]
  Vec3 where = Vec3::Zero();  ///< that sample
  std::size_t samples = 0;
  Real spacing = 0;           ///< of the samples: no point of the surface is farther than spacing / sqrt(3) from one [m]
};

/// The one-sided Hausdorff distance from one surface to another, sampled: at every vertex of `from` that a triangle uses, and on a lattice in
/// every triangle whose edges are no longer than spacing [m] (> 0, checked). The true one is larger by spacing / sqrt(3) at
/// most; on meshes flat between vertices by far less. Both meshes must have a triangle with an area, or the result is 0 (from) or infinity (to).
/// The same bits on any number of threads; about 200,000 samples a second and thread.
SurfaceDistance distance_to(const TriMesh& from, const TriMesh& to, Real spacing);

/// Both directions, the larger one; samples are those of both. spacing 0: ten samples
/// for each triangle of the finer mesh, at least 5,000 and at most a million on each.
SurfaceDistance hausdorff_distance(const TriMesh& a, const TriMesh& b, Real spacing = 0);

/// Vertex attributes and normals of one mesh on the vertices of another, from the nearest point of its surface, blended
/// across the triangle there; target's own are replaced.
void transfer_attributes(const TriMesh& source, TriMesh& target);

}  // namespace effuse::geometry
