#pragma once

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Surface_mesh.h>

#include <exception>
#include <vector>

#include "geometry/base/error.h"
#include "geometry/mesh/tri_mesh.h"
#include "geometry/repair/repair.h"

/// Our meshes as CGAL's and back.
namespace effuse::geometry {

using CgalKernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using CgalMesh = CGAL::Surface_mesh<CgalKernel::Point_3>;

/// Positions relative to `middle`: products of map coordinates would cancel. Vertices keep their numbers.
inline CgalMesh to_cgal_mesh(const TriMesh& mesh, const Vec3& middle) {
  const MeshReport report = validate(mesh);
  if (!sound(report)) throw InputError(Place{}, "the mesh is not sound, repair it first: " + to_string(report));
  CgalMesh out;
  out.reserve(static_cast<CgalMesh::size_type>(mesh.positions.size()), static_cast<CgalMesh::size_type>(report.edges), static_cast<CgalMesh::size_type>(mesh.triangles.size()));
  for (const Vec3& p : mesh.positions) out.add_vertex(CgalKernel::Point_3(p.x() - middle.x(), p.y() - middle.y(), p.z() - middle.z()));
  for (const Triangle& t : mesh.triangles) {
    const auto face = out.add_face(CgalMesh::Vertex_index(t[0]), CgalMesh::Vertex_index(t[1]), CgalMesh::Vertex_index(t[2]));
    if (face == CgalMesh::null_face()) throw InputError(Place{}, "the mesh is not manifold, repair it first");
  }
  return out;
}

/// Removed elements are gone (collect_garbage).
inline TriMesh from_cgal_mesh(CgalMesh& mesh, const Vec3& middle) {
  mesh.collect_garbage();
  TriMesh out;
  out.positions.reserve(mesh.number_of_vertices());
  for (const auto v : mesh.vertices()) out.positions.push_back(middle + Vec3(mesh.point(v).x(), mesh.point(v).y(), mesh.point(v).z()));
  for (const auto f : mesh.faces()) {
    Triangle t{};
    std::size_t k = 0;
    for (const auto v : mesh.vertices_around_face(mesh.halfedge(f))) t[k++ % 3] = static_cast<Index>(v.idx());
    out.triangles.push_back(t);
  }
  return out;
}

/// CGAL's own checks fail as errors of the mesh.
template <class Call>
auto cgal_or_error(const char* what, const Call& call) {
  try {
    return call();
  } catch (const InputError&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    throw InputError(Place{}, std::string("the mesh could not be ") + what + ": " + std::string(error.what()).substr(0, 200));
  }
}

}  // namespace effuse::geometry
