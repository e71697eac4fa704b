#pragma once

#include <optional>
#include <span>

#include "geometry/mesh/tri_mesh.h"
#include "geometry/terrain/terrain.h"

namespace effuse::skin {

/// Volume that a closed mesh encloses above the highest ground below each of its points [m^3]; nullptr: all of it. The ground is taken as
/// flat over each triangle, from the heights at its corners. Not known (no value) where a vertex has no ground under it.
std::optional<Real> volume_above(const geometry::TriMesh& mesh, const geometry::Terrain* terrain);

struct VolumeKept {
  Real before = 0, after = 0;  ///< [m^3] enclosed above the ground; both 0 where that is not known, and nothing was moved
  Real offset = 0;             ///< [m] by which all vertices were moved out
};

/// Moves all vertices by one distance along `ways` so that the mesh encloses `target` [m^3] above the ground: flat triangles between
/// points of a round surface enclose less than it does, and relief has a volume of its own. Two steps of Newton's with the area that
/// lies above the ground. Vertices under it go less, from `most` under it on they stay: a skin ends there as it was cut.
///   ways  a vector a vertex (their number is checked), of length one or less: normals of the smooth surface
///   most  [m] it goes no farther in all, > 0 (checked)
/// Nothing but positions changes. Same bits on any number of threads.
VolumeKept keep_volume(geometry::TriMesh& mesh, std::span<const Vec3> ways, Real target, const geometry::Terrain* terrain, Real most);

}  // namespace effuse::skin
