#pragma once

#include <map>
#include <vector>

#include "skin/surface/iso_mesh.h"
#include "skin/surface/level_set_impl.h"

/// For the .cpp files of this folder: what a frame's surface leaves for the next one's.
namespace effuse::skin {

struct SurfaceCache::Impl {
  // What the values were made of; another origin, or other options: nothing is taken over.
  bool filled = false;
  LevelSetOptions options;
  const geometry::Terrain* terrain = nullptr;
  Vec3 origin = Vec3::Zero();

  Blocks blocks;
  std::vector<Vec3> x;                   // of all particles, sorted [voxels]
  std::vector<std::uint64_t> hash;       // of each of those
  Field lifted, distance, above;         // before the shift; the ground's two only with a terrain
  std::map<int, std::vector<Real>> volumes;  // by shift, in steps: of each block
  std::map<int, std::vector<Real>> final_volumes;  // of the surface as it was handed out

  float shift = 0;
  std::vector<BlockPieces> pieces;
  std::vector<std::uint8_t> touched;  // blocks in which pieces were dropped

  std::uint64_t frame = 0, mesh_frame = 0;  // the last one built, meshed
  MeshCache mesh;
};

/// Blocks whose values may differ from the last frame's, and where these lie there.
struct Renewal {
  std::vector<Index> before;        ///< of each block, among the last frame's; kNone: it is new
  std::vector<std::uint8_t> stale;  ///< 1: to be computed
  std::size_t stale_blocks = 0;
};

/// Which blocks to compute when particles are felt within `influence` voxels. hash: of each particle now.
Renewal find_stale(const SurfaceCache::Impl& last, const ParticleGrid& particles, const std::vector<std::uint64_t>& hash, const Blocks& blocks, Real influence);

/// Hash of each sorted particle's position and radius.
std::vector<std::uint64_t> particle_hashes(const ParticleGrid& particles);

/// The marked blocks and those within so many blocks of them.
std::vector<std::uint8_t> widened(const Blocks& blocks, std::vector<std::uint8_t> marks, int rings);

}  // namespace effuse::skin
