#pragma once

#include <span>
#include <vector>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::geometry {

struct WeldReport {
  std::size_t merged_vertices = 0;
  std::size_t dropped_triangles = 0;  ///< became a point or an edge (or were one)
  std::size_t dropped_vertices = 0;   ///< nobody used them
};

/// Makes vertices at exactly equal positions one (the first; its attributes stay), drops triangles
/// that collapse and vertices nobody uses. Normals are cleared when anything merged: they were per corner.
/// Order is kept. 0 and -0 are equal; NaN equals nothing. Indices must be in range (checked). O(n log n).
WeldReport weld(TriMesh& mesh);

/// For each position the index of the first one exactly equal to it.
std::vector<Index> first_coincident(std::span<const Vec3> positions);

}  // namespace effuse::geometry
