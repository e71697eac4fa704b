#pragma once

#include <functional>
#include <string>
#include <vector>

#include "geometry/mesh/tri_mesh.h"

/// Bodies whose surface is known, and how far a mesh is from it. Lengths in particle spacings.
namespace effuse::study {

struct Solid {
  std::string name;   ///< "round slab": titles; blanks become - in names of cases
  std::string size;   ///< "radius 8"
  Box3 box;           ///< holds it, half a spacing to spare
  Real volume = 0;
  std::function<Real(const Vec3&)> distance;  ///< exact, negative inside
  std::function<Vec3(const Vec3&)> outward;   ///< unit normal of the surface nearest to a point; near the surface only
  /// A point of the surface for (u, v, w) in [0, 1)^3, uniform by area.
  std::function<Vec3(Real u, Real v, Real w)> point;
};

/// Sphere, slab with sharp edges, slab with edges rounded by one spacing, cylinder, torus: 8 to 20 spacings wide.
const std::vector<Solid>& solids();

/// How far a mesh is from a solid's surface.
struct SurfaceError {
  Real volume = 0;     ///< |enclosed / true - 1|
  Real hausdorff = 0;  ///< largest distance, both ways: of the mesh's vertices and face centres from the surface, and of points of the surface from the mesh
  Real mean = 0;       ///< the larger of the two means: over the mesh by area, over the surface
  Real normal = 0;     ///< mean angle between the mesh's vertex normals and the surface's [rad]
  bool solid = false;  ///< closed, oriented, manifold, in one piece
  std::string what;    ///< of the mesh, in words
};
/// mesh: with normals (checked). Points of the surface: `samples` of them, from a fixed sequence.
SurfaceError surface_error(const geometry::TriMesh& mesh, const Solid& solid, std::size_t samples);

}  // namespace effuse::study
