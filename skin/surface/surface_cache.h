#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "skin/surface/iso_mesh.h"
#include "skin/surface/level_set_impl.h"

/// For the .cpp files of this folder: what a frame's surface leaves for the next one's.
namespace effuse::skin {

/// A set of hashes. 0 is never in it, so that a particle of hash 0 counts as moved.
class HashSet {
 public:
  HashSet() = default;
  explicit HashSet(const std::vector<std::uint64_t>& hashes);
  bool has(std::uint64_t h) const { return h != 0 && slots_[slot(h)] == h; }

 private:
  /// Where h is, or a free one. Open addressing.
  std::size_t slot(std::uint64_t h) const {
    std::size_t s = h & (slots_.size() - 1);
    while (slots_[s] != 0 && slots_[s] != h) s = (s + 1) & (slots_.size() - 1);
    return s;
  }
  std::vector<std::uint64_t> slots_ = {0, 0};  // a power of two; 0: free
};

/// The field of a level set that a cache has handed out, once nobody holds that level set any more: the next frame's is made from it, in
/// place. Any thread.
class ReturnedField {
 public:
  void give_back(std::uint64_t frame, Field phi);
  /// The youngest that was given back; frame 0: none.
  std::pair<std::uint64_t, Field> take();

 private:
  std::mutex mutex_;
  std::uint64_t frame_ = 0;
  Field phi_;
};

struct SurfaceCache::Impl {
  // What the values were made of; another origin, or other options: nothing is taken over.
  bool filled = false;
  LevelSetOptions options;
  const geometry::Terrain* terrain = nullptr;
  Vec3 origin = Vec3::Zero();

  Blocks blocks;
  std::vector<Vec3> x;              // of all particles, sorted [voxels]
  std::vector<std::uint64_t> hash;  // of each of those
  HashSet hashes;
  Field lifted, distance, above;    // before the shift; the ground's two only with a terrain
  std::map<int, std::vector<Real>> volumes;  // by shift, in steps: of each block
  std::map<int, std::vector<Real>> final_volumes;  // of the surface as it was handed out
  std::shared_ptr<ReturnedField> returned = std::make_shared<ReturnedField>();

  int shift = 0;  // in steps
  std::vector<BlockPieces> pieces;
  std::vector<std::uint8_t> touched;  // blocks in which pieces were dropped

  std::uint64_t frame = 0, mesh_frame = 0;  // the last one built, meshed
  MeshCache mesh;
};

/// Blocks whose values may differ from the last frame's, and where these lie there.
struct Renewal {
  std::vector<Index> before;        ///< of each block, among the last frame's; kNone: it is new. Rising
  std::vector<std::uint8_t> stale;  ///< 1: to be computed
  std::size_t stale_blocks = 0;
  std::vector<std::uint8_t> bereft;  ///< 1: a block beside it is gone
};

/// Which blocks to compute when particles are felt within `influence` voxels. hash: of each particle now; hashes: the set of those.
Renewal find_stale(const SurfaceCache::Impl& last, const ParticleGrid& particles, const std::vector<std::uint64_t>& hash, const HashSet& hashes,
                   const Blocks& blocks, Real influence);

/// Marks the blocks around those of `before` that are not among `after`. after: where each of `before` lies there, kNone: nowhere.
void mark_beside_gone(const Blocks& before, std::span<const Index> after, std::vector<std::uint8_t>& marks);

/// Values in a new order, in place: block b gets what block before[b] had. before: rising, but for kNone, whose values mean nothing then.
void rearrange(Field& field, std::span<const Index> before);

/// Hash of each sorted particle's position and radius.
std::vector<std::uint64_t> particle_hashes(const ParticleGrid& particles);

/// The marked blocks and those within so many blocks of them.
std::vector<std::uint8_t> widened(const Blocks& blocks, std::vector<std::uint8_t> marks, int rings);

}  // namespace effuse::skin
