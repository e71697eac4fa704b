#pragma once

#include <array>
#include <span>
#include <vector>

#include "flow/effects/lava_in_water.h"
#include "flow/scene/parameters.h"
#include "geometry/mesh/tri_mesh.h"

namespace effuse::flow {

/// What water is made of, for pictures: colour of what is deep, and how far one sees down into it.
struct WaterLook {
  Vec3 color = Vec3::Zero();  ///< linear light
  Real clear = 3;             ///< [m] in which what lies under it fades to 1/e
};

/// The keys color and clear, temperature, and boiling: [W/(m^2 K)] of lava under it; what water of all kinds have in common.
void read_water(Parameters& p, WaterLook& look, Real& temperature, Real& boiling);

/// "color", "water" (WaterLook::clear, 0: no water) on every vertex of a mesh: the picture's renderer lets them mirror the sky and see down.
void paint_water(geometry::TriMesh& mesh, const WaterLook& look);

/// The mesh of water on a grid over ground: a vertex on each cell's middle that is water, and on the land up to two cells beside it, so that it
/// ends in the ground and not at a staircase.
class WaterSurface {
 public:
  ///   depth  of each cell at rest [m]; 0: land
  ///   level  of the water at rest [m]
  WaterSurface(const WaterLook& look, const PlanCells& cells, const std::vector<Real>& depth, Real level);
  /// height, rate: of each cell [m], [m/s]. With normals, "velocity", "color", "water".
  geometry::TriMesh at(std::span<const Real> height, std::span<const Real> rate) const;
  std::size_t memory() const;

 private:
  WaterLook look_;
  PlanCells cells_;
  Real level_;
  std::vector<geometry::Triangle> triangles_;
  std::vector<Index> vertex_cell_;             // of each vertex
  std::vector<std::array<Index, 4>> beside_;   // of a vertex on land: water cells around; kNone: fewer
};

}  // namespace effuse::flow
