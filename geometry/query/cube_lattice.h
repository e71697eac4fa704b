#pragma once

#include <array>
#include <vector>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::geometry {

/// Cubes of one size over the inside of a closed mesh, on their shared corners: what springs and finite elements fill a body with.
struct CubeLattice {
  Real spacing = 0;                          ///< edge of a cube [m]
  std::vector<Vec3> corners;                 ///< [m]
  std::vector<std::array<Index, 8>> cubes;   ///< corner (i, j, k) of 0, 1 each is number 4 i + 2 j + k
  std::vector<std::array<int, 3>> place;     ///< of each cube in the lattice
  std::vector<float> share;                  ///< of each cube inside the mesh, by 4^3 samples; 0 for one that the mesh only runs through
  std::vector<Index> cube_of;                ///< for each of the mesh's vertices: the cube it lies in
  std::vector<std::array<float, 8>> weight;  ///< and its trilinear weights there, sum 1
};

/// The lattice lies in the middle of the mesh's box. Kept are cubes with a sample inside and those that hold a vertex.
/// Throws InputError, told of `what`, when the mesh is not closed or the lattice would have more than max_corners corners.
CubeLattice fill_with_cubes(const TriMesh& mesh, Real spacing, const std::string& what, std::size_t max_corners);

}  // namespace effuse::geometry
