#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::skin {

struct CoarsenOptions {
  Real error = 0;       ///< [m] how far the coarse surface may be from the fine one, > 0
  Real longest = 0;     ///< [m] longer edges are not made; 0: any length
  Real min_angle = 15;  ///< [deg] thinner triangles are not made, unless there were thinner ones in their place
};

struct CoarsenReport {
  std::size_t removed = 0;  ///< vertices
  Real error = 0;           ///< [m] bound of the distance between the two surfaces, <= options.error
  std::vector<Index> kept;  ///< for each vertex its number before
};

/// Takes vertices out of a closed, oriented manifold where it is flat: the mesh stays closed, oriented and manifold (the link
/// condition), of the same pieces and handles, and neither surface is anywhere farther than `error` from the other. Vertices that
/// are left keep their place, normal and attributes, and so their region.
///
/// A vertex goes into one of its neighbours. The triangles round it before and after are two graphs over one polygon
/// (checked for each), so that their distance is at most the largest difference of their heights, which is at the vertex or where an old
/// edge crosses a new one. The differences of one step after the other are added up for each triangle: a bound, of which the true
/// distance is 0.7 to 1. At `error` = 0.1 particle spacings and a voxel of half a spacing, 3.5 to 5.5 times fewer triangles.
///   mesh   as mesh_level_set gives it; two triangles an edge, of opposite direction (checked), one fan a vertex (checked)
///   label  of each vertex, from 0 on, or none: the last vertex of a label stays, so that no region is lost
/// Serial; the same bits always. 2 us a vertex of the fine mesh.
/// Source of the bound: Cohen, Manocha & Olano 1997, Simplifying polygonal models using successive mappings, Visualization '97.
CoarsenReport coarsen(geometry::TriMesh& mesh, const CoarsenOptions& options, std::span<const Index> label = {});

}  // namespace effuse::skin
