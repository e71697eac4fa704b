#pragma once

#include <span>
#include <vector>

#include "geometry/fracture/cell_layout.h"
#include "geometry/fracture/convex_clip.h"

namespace effuse::geometry {

/// What of a closed mesh that need not be convex lies in each region, as triangles; side: the region's that cut them. By CGAL.
/// Throws InputError where CGAL does.
std::vector<std::vector<ClipPolygon>> cut_mesh(const TriMesh& body, std::span<const CellRegion> regions);

}  // namespace effuse::geometry
