#pragma once

#include "geometry/mesh/tri_mesh.h"

namespace effuse::geometry {

struct WeldReport {
  std::size_t merged_vertices = 0;
  std::size_t dropped_triangles = 0;  ///< became a point or an edge
};

/// Makes vertices at exactly equal positions one (the first; its attributes stay), drops triangles
/// that collapse and vertices nobody uses. Normals are cleared when anything merged: they were per corner.
WeldReport weld(TriMesh& mesh);

}  // namespace effuse::geometry
