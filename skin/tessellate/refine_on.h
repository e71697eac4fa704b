#pragma once

#include "geometry/mesh/tri_mesh.h"
#include "skin/detail/refine.h"
#include "skin/tessellate/voronoi.h"

namespace effuse::skin {

/// Cuts the edges of a tessellation until none is longer than asked for, as refine_to() does, with every vertex, old and new, on
/// the SmoothSurface of the mesh that it is a tessellation of. So what fans of triangles a spacing wide cut off comes back, and this skin
/// lies where that mesh refined by refine_to() does: moved by the same Relief they look alike.
///
///   surface  the mesh given to tessellate_voronoi(), with normals (checked)
///   options  edge, view, most_triangles; it is always curved
///   particles  if given, vertices lie on their surface instead, as far as it says where that is (ParticleSurface): new ones where the line through the
///            middle of the edge, along the mean of the normals at its ends, meets it. For a tessellation made with it
///
/// A cut triangle's parts are of its region (Tessellation::region, no parent needed); new vertices are no centres; attributes are those
/// of the surface where they lie. Each round halves the longest edge, then new vertices walk from a corner of their triangle to the nearest
/// point of the surface: never to the other side of a sheet.
/// 3 us a vertex. Same bits on any number of threads.
RefineToReport refine_on(Tessellation& tessellation, const geometry::TriMesh& surface, const RefineOptions& options,
                         const ParticleSurface* particles = nullptr);

}  // namespace effuse::skin
