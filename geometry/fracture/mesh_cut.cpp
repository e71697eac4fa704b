#include "geometry/fracture/mesh_cut.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/corefinement.h>
#include <CGAL/Surface_mesh.h>
#include <fmt/format.h>

#include <cmath>
#include <map>
#include <optional>
#include <tuple>

#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "geometry/mesh/measure.h"

namespace effuse::geometry {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using Mesh = CGAL::Surface_mesh<Point>;
namespace PMP = CGAL::Polygon_mesh_processing;

constexpr Real kTolerance = 1e-12;  ///< of the diagonal, of clipping
constexpr Real kInPlane = 1e-9;     ///< of the diagonal: nearer to a side, a triangle lies in it

/// A mesh over points that are one where they are nearer than the tolerance.
std::optional<Mesh> mesh_of_polygons(const std::vector<ClipPolygon>& polygons, Real tolerance) {
  Mesh mesh;
  std::vector<std::pair<Vec3, Mesh::Vertex_index>> known;
  const auto vertex = [&](const Vec3& p) {
    for (const auto& [q, v] : known)
      if ((p - q).norm() <= tolerance) return v;
    known.emplace_back(p, mesh.add_vertex(Point(p.x(), p.y(), p.z())));
    return known.back().second;
  };
  for (const ClipPolygon& f : polygons) {
    std::vector<Mesh::Vertex_index> loop;
    for (const Vec3& p : f.corners)
      if (const auto v = vertex(p); loop.empty() || (loop.back() != v && loop.front() != v)) loop.push_back(v);
    for (std::size_t k = 1; k + 1 < loop.size(); ++k)
      if (mesh.add_face(loop[0], loop[k], loop[k + 1]) == Mesh::null_face()) return std::nullopt;
  }
  if (!CGAL::is_closed(mesh)) return std::nullopt;
  return mesh;
}

Mesh mesh_of_triangles(const TriMesh& body) {
  Mesh mesh;
  for (const Vec3& p : body.positions) mesh.add_vertex(Point(p.x(), p.y(), p.z()));
  const auto v = [](Index i) { return Mesh::Vertex_index(i); };
  for (const Triangle& t : body.triangles)
    if (mesh.add_face(v(t[0]), v(t[1]), v(t[2])) == Mesh::null_face())
      throw InputError(Place{}, "three triangles meet at an edge of the mesh: one that is to break needs two at each");
  return mesh;
}

}  // namespace

std::vector<std::vector<ClipPolygon>> cut_mesh(const TriMesh& body, std::span<const CellRegion> regions) {
  ZONE("fracture.cut_mesh");
  const Mesh whole = mesh_of_triangles(body);
  Box3 box = bounds(body);
  const Real size = box.diagonal().norm();
  box = Box3(box.min() - Vec3::Constant(0.1 * size), box.max() + Vec3::Constant(0.1 * size));
  try {
    if (!PMP::does_bound_a_volume(whole)) throw InputError(Place{}, "the mesh's parts lie in one another: one that is to break must enclose a single volume");
  } catch (const CGAL::Failure_exception& failure) {
    throw InputError(Place{}, fmt::format("CGAL cannot tell what the mesh encloses ({})", failure.message()));
  }

  std::vector<std::vector<ClipPolygon>> out(regions.size());
  std::vector<std::string> failed(regions.size());
  parallel_for(
      regions.size(),
      [&](std::size_t r) {
        std::vector<ClipPolygon> polygons = box_polygons(box);
        for (Index k = 0; k < regions[r].sides.size(); ++k) clip(polygons, regions[r].sides[k].normal, regions[r].sides[k].offset, k, kTolerance * size);
        if (polygons.empty()) return;
        std::optional<Mesh> region = mesh_of_polygons(polygons, 1e-10 * size);
        if (!region) {
          failed[r] = "its region has no clean surface";
          return;
        }
        Mesh copy = whole, result;
        try {
          if (!PMP::corefine_and_compute_intersection(copy, *region, result, CGAL::parameters::throw_on_self_intersection(true))) {
            failed[r] = "the cut is no manifold";
            return;
          }
        } catch (const std::exception& failure) {
          failed[r] = "the mesh cuts through itself there";
          return;
        }
        for (const auto f : result.faces()) {
          ClipPolygon triangle;
          for (const auto v : result.vertices_around_face(result.halfedge(f))) {
            const Point& p = result.point(v);
            triangle.corners.emplace_back(p.x(), p.y(), p.z());
          }
          const Vec3 n = (triangle.corners[1] - triangle.corners[0]).cross(triangle.corners[2] - triangle.corners[0]);
          Real nearest = kInPlane * size;
          for (Index k = 0; k < regions[r].sides.size(); ++k) {
            const CellRegion::Side& side = regions[r].sides[k];
            if (n.dot(side.normal) < 0) continue;
            Real off = 0;
            for (const Vec3& p : triangle.corners) off = std::max(off, std::abs(side.normal.dot(p) - side.offset));
            if (off < nearest) nearest = off, triangle.side = k;
          }
          out[r].push_back(std::move(triangle));
        }
      },
      1);
  for (std::size_t r = 0; r < regions.size(); ++r)
    if (!failed[r].empty()) throw InputError(Place{}, fmt::format("cell {} cannot be cut from the mesh: {}; another cell_seed or shape = \"hull\" would do", r + 1, failed[r]));
  return out;
}

}  // namespace effuse::geometry
