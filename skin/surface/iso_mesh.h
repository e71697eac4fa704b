#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "skin/surface/blocks.h"

namespace effuse::skin {

/// What the cells of one block give to the mesh; cell (i, j, k) has voxel (i, j, k) at its low corner. A function of the values of
/// the block and of those around it alone.
struct MeshedBlock {
  std::vector<std::uint8_t> configuration, joined;  // of each cell (dual_cells.h)
  std::vector<std::uint16_t> first;                 // vertex of each cell's first patch
  std::vector<Eigen::Vector3f> position;            // of the vertices, from the block's voxel (0, 0, 0)
  std::vector<Vec3> normal;
  /// Counter-clockwise from outside. A corner: a vertex of a block nearby, 0..26 as Blocks::around, and which there.
  struct Quad {
    std::array<std::uint8_t, 4> block;
    std::array<std::uint16_t, 4> vertex;
    bool along;  // split from the first corner to the third
  };
  std::vector<Quad> quads;
};

/// The last mesh made, block by block.
struct MeshCache {
  Blocks blocks;
  float outside = 0;
  std::vector<std::unique_ptr<MeshedBlock>> meshed;  ///< of blocks that the surface crosses
  /// How many each block has, at hand: to ask the blocks themselves costs a way to memory each.
  struct Count {
    Index vertices = 0, quads = 0;
  };
  std::vector<Count> count;
  std::vector<std::int8_t> side;  ///< of each block: -1 all of it is inside, 1 outside, 0 both
};

/// The zero level of phi as triangles with normals: dual, with one vertex for each patch of the surface in each cell that it crosses,
/// in the middle of the patch's crossings and from there along the field's slope onto the surface (one step of Newton's, a fifth of a
/// voxel at most, the field's second differences taken into account: without it coarse voxels cut corners off), and two triangles for each crossed edge, split along the shorter diagonal. Counter-
/// clockwise from outside. Closed, oriented and manifold for every phi: patches that share a cell have vertices of their own,
/// and faces on which two sheets would share an edge are turned to part them.
///
/// Normals: central differences of phi, trilinear between voxels; where those point against the crossings (places thinner than
/// two voxels), the cell's own gradient.
///   outside  value where there are no blocks, >= 0 (checked)
///   last, unchanged  the mesh is left in `last` for the next one, and taken from it for blocks in the same surroundings: of each
///            block whose values are those of one of last's, which; kNone for the others. Empty: for all
///   changed  of each block, where its values are not those of last's at its place; empty: as `unchanged` says, all of a block
/// Positions in voxels from the origin. Same bits on any number of threads. 0.16 us a triangle and thread.
/// Source: Nielson 2004, Dual marching cubes; Wenger 2013, Isosurfaces, ch. 5 (the faces).
geometry::TriMesh iso_mesh(const Blocks& blocks, float outside, const Field& phi, MeshCache* last = nullptr, std::span<const Index> unchanged = {},
                           std::span<const ChangedVoxels> changed = {});

}  // namespace effuse::skin
