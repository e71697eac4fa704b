#pragma once

#include <array>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "skin/surface/key_table.h"

/// Sparse voxels: cubes of 8^3, as OpenVDB's leaves have them, in plain arrays.
///
/// Lengths and coordinates are in voxels from the level set's origin: voxel (i, j, k) is the point (i, j, k). A field is an
/// array of 512 numbers a block, z fastest, blocks in the order of Blocks::coords. Signed distances are negative inside.
namespace effuse::skin {

inline constexpr int kSide = 8;
inline constexpr std::size_t kVoxels = 512;
using BlockCoord = std::array<int, 3>;  ///< block (a, b, c) holds voxels 8a .. 8a+7, ...

/// Leaves new numbers as they are: pages are touched first by the threads that fill them, not by one that writes zeros into all of them.
template <class T>
struct Unwritten : std::allocator<T> {
  template <class U>
  struct rebind {
    using other = Unwritten<U>;
  };
  Unwritten() = default;
  template <class U>
  Unwritten(const Unwritten<U>&) {}
  template <class U>
  void construct(U* p) {
    ::new (static_cast<void*>(p)) U;
  }
  template <class U, class... Args>
  void construct(U* p, Args&&... args) {
    ::new (static_cast<void*>(p)) U(std::forward<Args>(args)...);
  }
};
/// Field(n) and resize(n) write nothing: fill it, or say Field(n, 0).
using Field = std::vector<float, Unwritten<float>>;

inline std::size_t voxel_index(int i, int j, int k) { return static_cast<std::size_t>((i << 6) | (j << 3) | k); }

/// Never changes once made: copies are the same object, and cost nothing.
class Blocks {
 public:
  Blocks() : data_(std::make_shared<const Data>()) {}
  /// coords: each once; sorted here.
  explicit Blocks(const std::vector<BlockCoord>& coords);
  Blocks(const Blocks&) = default;  // and no moves: a Blocks without data is none
  Blocks& operator=(const Blocks&) = default;

  std::size_t size() const { return data_->coords.size(); }
  const std::vector<BlockCoord>& coords() const { return data_->coords; }
  /// pack() of the coordinates, rising.
  const std::vector<std::uint64_t>& keys() const { return data_->keys; }
  /// Blocks around block b, itself in the middle (13), by (dx+1)*9 + (dy+1)*3 + dz+1; kNone: there is none.
  const std::array<Index, 27>& around(std::size_t b) const { return data_->around[b]; }

  /// Value at a voxel, `outside` where there is no block. home: a block believed near.
  float at(std::span<const float> field, float outside, Index home, int i, int j, int k) const {
    const Index b = block_of(home, i >> 3, j >> 3, k >> 3);
    return b == kNone ? outside : field[b * kVoxels + voxel_index(i & 7, j & 7, k & 7)];
  }
  /// Trilinear between voxels.
  float sample(std::span<const float> field, float outside, Index home, const Vec3& p) const;
  /// Central differences at the eight voxels round p, trilinear between them.
  Vec3 gradient(std::span<const float> field, float outside, Index home, const Vec3& p) const;
  /// The block that holds the point, or kNone.
  Index block_at(const Vec3& p) const;

  /// Block b with one voxel of its neighbours around it: 10^3 numbers, z fastest.
  void padded(std::span<const float> field, float outside, std::size_t b, float* out) const;

 private:
  Index block_of(Index home, int a, int b, int c) const {
    if (home != kNone) {
      const BlockCoord& h = data_->coords[home];
      const int da = a - h[0] + 1, db = b - h[1] + 1, dc = c - h[2] + 1;
      if (static_cast<unsigned>(da) < 3 && static_cast<unsigned>(db) < 3 && static_cast<unsigned>(dc) < 3)
        return data_->around[home][static_cast<std::size_t>(da * 9 + db * 3 + dc)];
    }
    return find(a, b, c);
  }
  Index find(int a, int b, int c) const { return data_->table.find(pack(a, b, c)); }

  struct Data {
    std::vector<BlockCoord> coords;
    std::vector<std::uint64_t> keys;
    std::vector<std::array<Index, 27>> around;
    KeyTable table;
  };
  std::shared_ptr<const Data> data_;
};

/// Voxels of a block that have changed: low .. high along each axis, and others of that box; low > high: none.
struct ChangedVoxels {
  std::array<std::int8_t, 3> low{0, 0, 0}, high{kSide - 1, kSide - 1, kSide - 1};

  static ChangedVoxels none() { return {{kSide, kSide, kSide}, {-1, -1, -1}}; }
  /// Where two blocks' values differ.
  static ChangedVoxels between(const float* one, const float* other);
  bool any() const { return low[0] <= high[0]; }
  /// Whether one of them is within `after` voxels after the last, or `before` voxels before the first, of the block at a slot of Blocks::around.
  bool near_block(std::size_t slot, int before, int after) const {
    const int d[3] = {static_cast<int>(slot / 9) - 1, static_cast<int>(slot / 3 % 3) - 1, static_cast<int>(slot % 3) - 1};
    for (std::size_t a = 0; a < 3; ++a)
      if ((d[a] < 0 && low[a] >= after) || (d[a] > 0 && high[a] < kSide - before)) return false;
    return any();
  }
};
/// Blocks in which, or within so many voxels before and after which, a voxel has changed. changed: of each block.
std::vector<std::uint8_t> near_changed(const Blocks& blocks, std::span<const ChangedVoxels> changed, int before, int after);

/// Of each block of `blocks`, the one at the same place in `others`; kNone: there is none.
std::vector<Index> same_places(const Blocks& blocks, const Blocks& others);

}  // namespace effuse::skin
