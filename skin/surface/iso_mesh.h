#pragma once

#include "geometry/mesh/tri_mesh.h"
#include "skin/surface/blocks.h"

namespace effuse::skin {

/// The zero level of phi as triangles, by OpenVDB's volumeToMesh (dual: a vertex in each cell that the surface crosses),
/// winding counter-clockwise from outside, quads split along the shorter diagonal. Closed and oriented; sheets may
/// touch in edges and vertices (manifold.h parts them). Positions in voxels from the origin. Vertices in an order that
/// does not depend on threads.
geometry::TriMesh iso_mesh(const Blocks& blocks, float outside, const Field& phi);

}  // namespace effuse::skin
