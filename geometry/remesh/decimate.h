#pragma once

#include <cstddef>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::geometry {

struct Decimated {
  std::size_t before = 0, after = 0;  ///< triangles
  Real error = 0;                     ///< [m] of the dearest collapse: root mean square distance of the moved vertex from the planes it stood for, weighted by area; where colours decide, of those, too
};

/// The same surface in at most `triangles` triangles, for eyes: quick, and without a bound of its error (simplify() and skin's coarsen() have one). Vertices
/// go into one of their neighbours, cheapest first, so that those left keep their place, normal and attributes. The cost is the quadric of the
/// planes about both ends (Garland & Heckbert 1997, Surface simplification using quadric error metrics, SIGGRAPH 97), weighted by area, those upright on
/// the border among them; where the mesh has a "color", also how far its brightness is from what the triangles had there (Hoppe 1999, New quadric metric for simplifying
/// meshes with appearance attributes, IEEE Visualization), so that seams of light stay.
///
/// Closed manifolds stay closed manifolds of the same genus (link condition), borders stay where they are up to that cost and never close, vertices on edges of more
/// than two triangles stay. Triangles do not turn over. Where that leaves nothing to collapse, more triangles than wanted stay: see `after`.
///
/// mesh: indices in range, attributes and normals of its length (checked). Unused vertices go. Serial, the same bits always; some 70,000 collapses a second.
Decimated decimate(TriMesh& mesh, std::size_t triangles);

}  // namespace effuse::geometry
