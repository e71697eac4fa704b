#pragma once

#include <string>
#include <vector>

#include "flow/fem/fill_with_tets.h"
#include "geometry/collide/rigid_pose.h"

namespace effuse::flow {

/// What a solid of finite elements is made of, and the surface that shows it: of a mesh that cannot break the mesh itself, carried by the
/// tetrahedra it lies in; else the tetrahedra's own, faces that breaking has made among it.
struct ElasticShape {
  fem::TetMesh tets;  ///< where it starts
  fem::ElasticMaterial material;
  Real spacing = 0;
  geometry::TriMesh surface;  ///< empty: the tetrahedra's
  std::vector<Index> tet_of;
  std::vector<std::array<float, 4>> weight;
  std::vector<std::uint8_t> outer;  ///< four a tetrahedron: whether the face opposite its corner was on the surface from the start

  /// The surface now, with "velocity" and "color" (linear; color: sRGB, negative: none given), and, of what can break, "inner", 1 on faces
  /// that breaking has made.
  geometry::TriMesh look(const fem::ElasticSolid& solid, const Vec3& color) const;
  std::size_t memory() const;
};

/// A box about the pose's origin, in whole cells of about the spacing. Throws InputError, told of `what`, when there would be too many.
ElasticShape box_shape(const Vec3& edges, Real spacing, const fem::ElasticMaterial& material, const geometry::RigidPose& pose, const std::string& what);

/// A closed mesh, filled (fem::fill_with_tets); its density is raised by the volume that cut corners lose, so that its mass is the mesh's.
ElasticShape mesh_shape(geometry::TriMesh mesh, Real spacing, const fem::ElasticMaterial& material, const geometry::RigidPose& pose, const std::string& what);

/// Pieces that hang together.
std::size_t pieces_of(const fem::ElasticSolid& solid);

}  // namespace effuse::flow
