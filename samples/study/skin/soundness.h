#pragma once

#include "skin/tessellate/make_skin.h"

/// What every skin must be, looked at without the code that made it.
namespace effuse::study {

struct Soundness {
  bool solid = false;                 ///< closed, oriented, manifold: no crack
  Real thin = 0;                      ///< share of triangles with an angle under 5 degrees
  std::size_t without_region = 0;     ///< surface particles that have no region
  std::size_t regions_of_others = 0;  ///< regions of particles that are not on the surface, and regions twice
  std::size_t nowhere = 0;            ///< regions that no vertex (kLevelSet) or triangle (kVoronoi) is of
  bool sound(Real most_thin) const { return solid && thin <= most_thin && without_region + regions_of_others + nowhere == 0; }
};

/// Surface particles are those nearest to a vertex of the smooth surface (make_skin.h), found one by one.
///   points   that it was made of
///   options  that it was made with; not coarsened (checked)
Soundness soundness(const skin::Skin& skin, const geometry::Points& points, const skin::SkinOptions& options);

/// Volume of a closed mesh above the ground [m^3]: of each triangle as much as lies between it and the ground, signed.
Real volume_above(const geometry::TriMesh& mesh, const geometry::Terrain& ground);

}  // namespace effuse::study
