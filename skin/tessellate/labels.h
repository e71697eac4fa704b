#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "geometry/mesh/points.h"
#include "geometry/mesh/tri_mesh.h"
#include "skin/tessellate/regions.h"

namespace effuse::skin {

/// Whose each vertex and each triangle of a skin is. Whole numbers beside the mesh: its attributes are floats, which round
/// ids above 2^24.
struct RegionLabels {
  std::vector<Index> particle;     ///< of each region, among the points; rising
  std::vector<std::uint64_t> id;   ///< of each region's particle; its place where the points had no ids
  std::vector<Index> of_vertex;    ///< for each vertex a place in particle and id
  std::vector<Index> of_triangle;  ///< the same for each triangle; empty: regions end inside triangles
  std::size_t unreached = 0;       ///< vertices farther than Regions::kReach from every particle; the nearest's all the same

  std::size_t size() const { return particle.size(); }
};

/// Each vertex is of the region that it lies in: of its nearest particle (Regions says whose, where several are). Particles that
/// are no vertex's nearest have no region. of_triangle stays empty.
///   regions  of the points (sizes must agree, checked), at least one if there are vertices (checked)
/// 0.3 us a vertex; a vertex out of reach costs a look at every point. Same bits on any number of threads.
RegionLabels label_vertices(const geometry::TriMesh& mesh, const Regions& regions, const geometry::Points& points);

}  // namespace effuse::skin
