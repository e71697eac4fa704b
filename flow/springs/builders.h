#pragma once

#include <array>

#include "flow/springs/spring_network.h"
#include "geometry/mesh/tri_mesh.h"

namespace effuse::flow::springs {

/// A network at rest, the surface that shows it, and how the surface hangs on its points:
///   vertex q = sum over k of weight[q][k] * x[point[q][k]]
struct SpringBody {
  SpringNetwork network;
  SpringState state;
  geometry::TriMesh surface;
  std::vector<std::array<Index, 8>> point;   ///< of each vertex; unused ones have no weight
  std::vector<std::array<float, 8>> weight;  ///< sum 1
};

/// Positions of the surface's vertices [m] for points at x.
std::vector<Vec3> surface_positions(const SpringBody& body, const std::vector<Vec3>& x);

/// The jello cube: n^3 points from corner on, n >= 2 a side, point (i, j, k) is number (i n + j) n + k.
/// Structural springs to the six next points, shear springs across the faces and the body of each cell, bend springs to the
/// next but one along the axes. All of one material. Surface: the six faces, two triangles a square.
/// Source: the jello cube assignment after Provot 1995, Graphics Interface, 147-154.
SpringBody jello_cube(int n, const Vec3& corner, Real side, Real mass_per_point, const SpringMaterial& material);

/// Cloth of any mesh: a point a vertex, of the mass of a third of its triangles; edges are springs that stretch, and opposite
/// vertices of neighbouring triangles are joined by springs that bend.
/// area_density [kg/m^2] > 0. Throws InputError when the mesh has no triangle of area > 0 or a vertex without one.
SpringBody cloth(const geometry::TriMesh& mesh, Real area_density, const SpringMaterial& stretch, const SpringMaterial& bend);

/// A lattice of cubes of the given spacing [m] over a closed mesh's inside, each cube that meets the mesh or its inside kept;
/// springs as in the jello cube but for the bend ones, within cubes kept. Points weigh density [kg/m^3] times the share of the
/// mesh's volume about them (never less than a sixteenth of a cube's). Stiffness is that of the longest cell edge: the material's
/// stiffness [N/m] is used as it is. The mesh's vertices hang trilinearly in their cubes.
/// Throws InputError when the mesh is not closed, or the lattice would have more than max_points points.
SpringBody filled(const geometry::TriMesh& mesh, Real spacing, Real density, const SpringMaterial& material, std::size_t max_points = 200000);

}  // namespace effuse::flow::springs
