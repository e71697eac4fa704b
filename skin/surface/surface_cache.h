#pragma once

#include <cstring>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <type_traits>
#include <vector>

#include "skin/surface/iso_mesh.h"
#include "skin/surface/level_set_impl.h"

/// For the .cpp files of this folder: what a frame's surface leaves for the next one's.
namespace effuse::skin {

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
  ParticleGrid particles;
  RasterField raster;                    // the field as it comes from the particles; empty for kAnisotropic
  Field lifted, distance, above;    // before the shift; the ground's two only with a terrain
  std::map<int, std::vector<Real>> volumes;  // by shift, in steps: of each block
  std::vector<KnownVolumes::Range> range;
  std::map<int, std::vector<Real>> final_volumes;  // of the surface as it was handed out
  std::shared_ptr<ReturnedField> returned = std::make_shared<ReturnedField>();

  int shift = 0;  // in steps
  Pieces pieces;
  std::vector<std::uint8_t> touched;  // blocks in which pieces were dropped

  std::uint64_t frame = 0, mesh_frame = 0;  // the last one built, meshed
  MeshCache mesh;
};

/// Blocks whose values may differ from the last frame's, and where these lie there.
struct Renewal {
  std::vector<Index> before;        ///< of each block, among the last frame's; kNone: it is new. Rising
  std::vector<std::uint8_t> stale;  ///< 1: to be computed
  std::vector<ChangedVoxels> changed;  ///< of each block, once it is computed
  std::size_t stale_blocks = 0;
  std::vector<std::uint8_t> bereft;  ///< 1: a block beside it is gone
  std::vector<RowSet> rows;          ///< of each block, those of which the sums over particles may differ
};

/// f(i) for the particles of `one` that are not among `others`: no particle of the same place, to the bit, and radius, or fewer of them. The two
/// grids have the same origin and columns of the same side.
template <class F>
void each_not_among(const ParticleGrid& one, const ParticleGrid& others, F&& f) {
  const auto lies_before = [](const Vec3& p, const Vec3& q) { return p.z() != q.z() ? p.z() < q.z() : p.x() != q.x() ? p.x() < q.x() : p.y() < q.y(); };
  for (const ParticleGrid::Column& column : one.columns()) {
    // Both by rising height: one walk along the two.
    const ParticleGrid::Column* there = others.column(column.x, column.y);
    Index k = there ? there->begin : 0;
    const Index end = there ? there->end : 0, n = column.end - column.begin;
    if (end - k == n && std::memcmp(&one.x()[column.begin], &others.x()[k], n * sizeof(Vec3)) == 0 &&
        std::memcmp(&one.radius()[column.begin], &others.radius()[k], n * sizeof(float)) == 0)
      continue;
    for (Index i = column.begin; i < column.end; ++i) {
      const Vec3& p = one.x()[i];
      while (k < end && lies_before(others.x()[k], p)) ++k;
      if (k < end && others.x()[k] == p && others.radius()[k] == one.radius()[i]) ++k;
      else f(i);
    }
  }
}

/// Which blocks to compute when particles are felt within `influence` voxels by what becomes of the field, within `reach` by the sums.
Renewal find_stale(const SurfaceCache::Impl& last, const ParticleGrid& particles, const Blocks& blocks, Real influence, Real reach);

/// Marks the blocks around those of `before` that are not among `after`. after: where each of `before` lies there, kNone: nowhere.
void mark_beside_gone(const Blocks& before, std::span<const Index> after, std::vector<std::uint8_t>& marks);

/// Values in a new order, in place: block b gets what block before[b] had, so many numbers a block. before: rising, but for kNone, whose values
/// mean nothing then.
template <class T, class Allocator>
void rearrange(std::vector<T, Allocator>& values, std::span<const Index> before, std::size_t per_block = kVoxels) {
  static_assert(std::is_trivially_copyable_v<T>);
  struct Run {
    std::size_t to, from, blocks;
  };
  std::vector<Run> runs;
  for (std::size_t b = 0; b < before.size(); ++b) {
    if (before[b] == kNone) continue;
    if (!runs.empty() && runs.back().to + runs.back().blocks == b && runs.back().from + runs.back().blocks == before[b]) ++runs.back().blocks;
    else runs.push_back({b, before[b], 1});
  }
  const std::size_t size = before.size() * per_block;
  if (size > values.capacity()) values.reserve(size + size / 8);
  if (size > values.size()) values.resize(size);
  // What goes down from the lowest on, what goes up from the highest on: nothing is written over that is still to go.
  const auto move = [&](const Run& r) { std::memmove(&values[r.to * per_block], &values[r.from * per_block], r.blocks * per_block * sizeof(T)); };
  for (const Run& r : runs)
    if (r.to < r.from) move(r);
  for (std::size_t k = runs.size(); k-- > 0;)
    if (runs[k].to > runs[k].from) move(runs[k]);
  values.resize(size);
}

/// The marked blocks and those within so many blocks of them.
std::vector<std::uint8_t> widened(const Blocks& blocks, std::vector<std::uint8_t> marks, int rings);

}  // namespace effuse::skin
