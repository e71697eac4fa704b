#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "skin/surface/blocks.h"
#include "skin/surface/particle_grid.h"

namespace effuse::skin {

/// All lengths in voxels.
struct RasterOptions {
  float reach = 4;             ///< R: a particle is felt this far
  float spacing = 2;           ///< of the particles
  float radius_factor = 1.2f;  ///< rbar in units of the particles' own radii
  float outside = 2.8f;        ///< values are cut here
};

/// From this reach on sums are taken at every second voxel: these are no farther apart than a quarter of it, and cubic interpolation
/// of the sums is right to 1e-3 of them.
inline constexpr float kFineReach = 8;

/// The blocks with a voxel closer than reach to a particle. No value: there would be more than `most`; looked for no further.
std::optional<Blocks> blocks_around(const ParticleGrid& particles, Real reach, std::size_t most);
Blocks blocks_around(const ParticleGrid& particles, Real reach);

/// Zhu & Bridson's field with the bound between separate particles (build_level_set's docstring):
///
///   w_i = max(0, 1 - |x - x_i|^2 / R^2)^3        W = sum w_i
///   phi = max(|x - sum w_i x_i / W| - sum w_i r_i / W,  3 (min |x - x_i| - 1.15 spacing)),   at most `outside`
///
///   phi     out: the field [voxels]
///   weight  out: W
/// Gathered block by block in float, coordinates counted from the block; within 1e-4 voxels of double. From a reach of eight
/// voxels on the sums are taken at every second voxel and cubic between: near the surface within 0.05 spacings, 0.003 on average.
/// Blocks that lie two spacings and more from any point without a particle within one spacing are filled with one value.
/// Same bits on any number of threads and any order of the points.
void rasterize(const ParticleGrid& particles, const Blocks& blocks, const RasterOptions& options, Field& phi, Field& weight);

/// Of a block at every second voxel, four along each side: W, sum w x (x from the block's voxel (0, 0, 0)), sum w r, and the squared
/// distance of the nearest particle, at most reach^2.
inline constexpr int kNodesAlong = kSide / 2;
struct NodeSums {
  std::array<float, kNodesAlong * kNodesAlong * kNodesAlong> W, x, y, z, r, nearest;
};

/// The field, and what it takes to make parts of it anew.
struct RasterField {
  Field phi, weight;
  std::vector<NodeSums, Unwritten<NodeSums>> nodes;        ///< of each block, from kFineReach on
  std::vector<std::uint8_t> covered;  ///< of each block, from kFineReach on: particles lie near all its nodes
};

/// Rows of voxels of a block: bit 8 i + j is row (i, j, .).
using RowSet = std::uint64_t;

/// rasterize(), into a RasterField; with rows, that of the same blocks and other particles, of which every row that a particle of one of the two
/// alone is felt in is among `rows`, all of a block that was none before: the same bits as of all rows.
///   rows    of each block; empty: all of all
///   raster  in, out
void rasterize(const ParticleGrid& particles, const Blocks& blocks, const RasterOptions& options, std::span<const RowSet> rows, RasterField& raster);

/// The same at one point, in double, over all particles: the twin that tests compare with.
Real zhu_bridson(const ParticleGrid& particles, const RasterOptions& options, const Vec3& p);

}  // namespace effuse::skin
