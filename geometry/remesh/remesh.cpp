#include "geometry/remesh/remesh.h"

#include <CGAL/Polygon_mesh_processing/detect_features.h>
#include <CGAL/Polygon_mesh_processing/remesh.h>
#include <fmt/format.h>

#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/zones.h"
#include "geometry/mesh/measure.h"
#include "geometry/remesh/cgal_mesh_internal.h"
#include "geometry/remesh/cut_triangles.h"

namespace effuse::geometry {

namespace PMP = CGAL::Polygon_mesh_processing;

Remeshed remesh(const TriMesh& mesh, Real edge) {
  ZONE("mesh.remesh");
  CHECK(std::isfinite(edge) && edge > 0);
  const Real expected = surface_area(mesh) / (std::sqrt(3.0) / 4 * edge * edge);
  if (expected > static_cast<Real>(kMostTriangles)) throw InputError(Place{}, fmt::format("edges of {:g} m would make about {:.3g} triangles, at most {} will do", edge, expected, kMostTriangles));
  // Slivers have next to no area, and edges that are cut all the same.
  Real length = 0;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) length += (mesh.positions[t[k]] - mesh.positions[t[(k + 1) % 3]]).norm() / 2;
  if (length / edge > static_cast<Real>(kMostTriangles)) throw InputError(Place{}, fmt::format("edges of {:g} m would cut those there are into about {:.3g}, at most {} will do", edge, length / edge, kMostTriangles));
  Remeshed result;
  const Vec3 middle = bounds(mesh).center();
  // Where one edge is cut into hundreds CGAL hangs hundreds of triangles on one corner, and takes the square of the time.
  constexpr Real kLarge = 5;  // [edge^2], ten triangles
  CgalMesh surface = to_cgal_mesh(cut_triangles(mesh, kLarge * edge * edge), middle);
  cgal_or_error("remeshed", [&] {
    auto kept = surface.add_property_map<CgalMesh::Edge_index, bool>("e:kept", false).first;
    PMP::detect_sharp_edges(surface, kSharp * 180 / kPi, kept);
    for (const auto e : surface.edges())
      if (surface.is_border(e)) kept[e] = true;
    std::vector<CgalMesh::Edge_index> lines;
    for (const auto e : surface.edges())
      if (kept[e]) lines.push_back(e);
    // Edges that are kept must not be longer than the split length, or nothing beside them is refined.
    PMP::split_long_edges(lines, edge, surface, CGAL::parameters::edge_is_constrained_map(kept));
    PMP::isotropic_remeshing(faces(surface), edge, surface, CGAL::parameters::number_of_iterations(3).protect_constraints(true).edge_is_constrained_map(kept));
    return true;
  });
  result.mesh = from_cgal_mesh(surface, middle);
  transfer_attributes(mesh, result.mesh);
  result.error = hausdorff_distance(mesh, result.mesh);
  return result;
}

}  // namespace effuse::geometry
