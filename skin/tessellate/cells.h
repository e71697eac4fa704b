#pragma once

#include <span>
#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "skin/surface/key_table.h"
#include "skin/tessellate/regions.h"
#include "skin/tessellate/voronoi.h"

/// For the .cpp files of this folder: the surface cut into discs, each of one particle.
namespace effuse::skin {

/// A closed triangulation whose vertices have labels.
struct LabelledMesh {
  std::vector<Vec3> x;
  std::vector<geometry::Triangle> triangles;
  std::vector<Index> parent;    ///< of each triangle: the triangle of the surface it lies in
  std::vector<Index> label;     ///< of each vertex; kNone: in no triangle
  std::vector<Index> particle;  ///< of each label
  std::size_t unclaimed = 0, dropped_pieces = 0;
};

/// Labels are particles: the nearest to each vertex of the surface. Then, `refinement` times, the edges of triangles of three
/// labels are cut in half, the middle labelled with the nearest of the particles round its two triangles. Vertices without a
/// particle get a neighbour's; closed pieces without any are left out.
LabelledMesh label_surface(const geometry::TriMesh& surface, const Regions& regions, std::span<const Vec3> site, int refinement);

/// Pieces of one label that hang together by edges, each a disc.
struct Cells {
  std::vector<Index> of;            ///< of each vertex; kNone: of none
  std::vector<Index> particle;      ///< of each cell
  std::vector<Index> near;          ///< of each cell: its vertex nearest its particle
  std::vector<std::uint8_t> whole;  ///< 1: a piece of a region; 0: a part of one that was cut up
  std::size_t islands = 0;          ///< small pieces given to the cell around them
  std::size_t size() const { return particle.size(); }
};

/// Changes labels, of islands and of pieces that are cut up.
Cells cut_into_discs(LabelledMesh& mesh, std::span<const Vec3> site, Real spacing, const VoronoiOptions& options);

}  // namespace effuse::skin
