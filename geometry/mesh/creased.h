#pragma once

#include <vector>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::geometry {

/// The mesh with normals that are smooth up to a crease angle [rad] and part at sharper edges: three vertices a triangle, each with the mean
/// of the normals, weighted by area, of those triangles about it that lean less against its own. Attributes are left out.
///   from  out, if not null: of each vertex the one it was
TriMesh creased(const TriMesh& mesh, Real crease, std::vector<Index>* from = nullptr);

}  // namespace effuse::geometry
