#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>

#include "geometry/collide/contact.h"
#include "geometry/mesh/tri_mesh.h"
#include "geometry/terrain/georeference.h"
#include "geometry/terrain/height_field.h"

namespace effuse::geometry {

/// The ground: a height field or any mesh, behind one set of questions. Solid below / behind its
/// surface. Immutable and cheap to copy (shared); const queries from many threads.
///
/// Height field: the closest point of the bilinear surface, exact to 1e-9 cells at any distance (Newton's method
/// in the cell below, a tree of height ranges beyond; height_field_search.h). The sign is that of z - h(x, y). The
/// normal is not the surface's own, which jumps at every cell border, but HeightField::normal's field at the foot of
/// the point along that field: continuous in the point everywhere over the covered area, exact on a plane, and of
/// second order in the spacing on a smooth hill. Outside the covered area: no contact.
///
/// Mesh (overhangs, caves, several sheets; closed or open, facing up or outward; coincident vertices are one):
/// closest point from a CGAL AABB tree, exact; sign from the angle-weighted pseudonormal of the closest feature
/// (Baerentzen & Aanaes 2005); normal blended from vertex normals across the triangle so that it is continuous, but
/// flat up to edges sharper than MeshSurface::kCreaseAngle and turned round them (mesh_surface.h). A point whose
/// closest point lies on the border of an open mesh, beyond its rim, has no contact.
///
/// Points that are not finite have no contact. One thread, cells of 10 m, reach 1 m: 8 M contacts a second on a height field (20 M when
/// most are out of reach), on a mesh of 10 k triangles 4 to 7 M of many points at once (contacts()), 2 to 3 M one by one.
class Terrain {
 public:
  /// Ground temperature [K] is handed on in every contact.
  static Terrain from_height_field(HeightField field, Georeference georeference = {}, Real temperature = 0);
  /// Throws InputError unless the mesh is well formed with at least one triangle of area > 0.
  static Terrain from_mesh(TriMesh mesh, Georeference georeference = {}, Real temperature = 0);

  /// Nearest ground within reach [m] of p; Contact::any() is false when there is none. Points deep in the
  /// ground are found at any depth for height fields, within reach only for meshes.
  Contact contact(const Vec3& p, Real reach = std::numeric_limits<Real>::infinity()) const;
  /// The same for many points, in parallel; out has their size.
  void contacts(std::span<const Vec3> points, Real reach, std::span<Contact> out) const;

  /// Signed distance [m], negative in the ground, +infinity where there is none.
  Real signed_distance(const Vec3& p) const;
  /// Highest ground above or below (x, y) [m]; nullopt where there is none. Of meshes, triangles that face down are
  /// no ground: under them is a roof.
  std::optional<Real> height(Real x, Real y) const;
  /// First ground at or below z0 on the vertical through (x, y).
  std::optional<Real> height_below(Real x, Real y, Real z0) const;
  /// First hit of the ray p + t d, t in (0, t_max]; the mesh's triangles for both kinds.
  std::optional<Real> ray(const Vec3& p, const Vec3& d, Real t_max) const;

  bool is_height_field() const;
  const HeightField* height_field() const;  ///< nullptr for a mesh
  const TriMesh& mesh() const;              ///< triangulated once for height fields
  Box3 bounds() const;
  const Georeference& georeference() const;

 private:
  struct Impl;
  explicit Terrain(std::shared_ptr<const Impl> impl);
  std::shared_ptr<const Impl> impl_;
};

}  // namespace effuse::geometry
