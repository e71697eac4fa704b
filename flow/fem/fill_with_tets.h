#pragma once

#include <array>
#include <string>
#include <vector>

#include "flow/fem/elastic_solid.h"
#include "geometry/mesh/tri_mesh.h"

namespace effuse::flow::fem {

/// Tetrahedra inside a closed mesh, and how that mesh hangs on them:
///   vertex q = sum over k of weight[q][k] * node[tets[tet_of[q]][k]], weights of sum 1, some below 0 where a vertex lies outside
struct TetFill {
  TetMesh mesh;
  std::vector<Index> tet_of;
  std::vector<std::array<float, 4>> weight;
  Real volume = 0;  ///< of the tetrahedra [m^3]; the closed mesh's is a little more: corners are cut
};

/// A body-centred cubic lattice of the given spacing [m] (its cubes' edge), cut at the mesh: lattice points near the surface are moved onto
/// it, tetrahedra that it runs through are cut along it. Good elements up to the surface, whose sharp edges are cut by less than a spacing.
/// Source: Labelle & Shewchuk 2007, Isosurface stuffing, ACM TOG 26 (3), 57; quads are cut from their corner of least number.
/// Throws InputError, told of `what`, when the mesh is not closed, thinner than the lattice, or the lattice has more than max_nodes points.
TetFill fill_with_tets(const geometry::TriMesh& mesh, Real spacing, const std::string& what, std::size_t max_nodes = 300000);

/// Tetrahedron of a mesh in which a point lies, or the one that it lies least outside of, and its barycentric coordinates there.
struct InTet {
  Index tet = 0;
  std::array<Real, 4> weight = {};
};
std::vector<InTet> locate(const TetMesh& mesh, const std::vector<Vec3>& points);

}  // namespace effuse::flow::fem
