#include "skin/surface/blocks.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"

namespace effuse::skin {

namespace {
/// What pack() was given.
BlockCoord unpack(std::uint64_t key) {
  const auto part = [&](int shift) { return static_cast<int>((key >> shift) & ((1u << 21) - 1)) - (1 << 20); };
  return {part(42), part(21), part(0)};
}

/// The voxel at or below p in each coordinate, and how far p lies beyond it.
struct Cell {
  int i, j, k;
  float u, v, w;
  explicit Cell(const Vec3& p)
      : i(static_cast<int>(std::floor(p.x()))),
        j(static_cast<int>(std::floor(p.y()))),
        k(static_cast<int>(std::floor(p.z()))),
        u(static_cast<float>(p.x() - i)),
        v(static_cast<float>(p.y() - j)),
        w(static_cast<float>(p.z() - k)) {}
};
}  // namespace

Blocks::Blocks(const std::vector<BlockCoord>& coords) {
  const auto data = std::make_shared<Data>();
  const std::size_t n = coords.size();
  // Packed coordinates have the order of the coordinates.
  std::vector<std::uint64_t>& key = data->keys;
  key.resize(n);
  for (std::size_t b = 0; b < n; ++b) key[b] = pack(coords[b][0], coords[b][1], coords[b][2]);
  std::sort(key.begin(), key.end());
  data->coords.resize(n);
  for (std::size_t b = 0; b < n; ++b) {
    data->coords[b] = unpack(key[b]);
    data->table.number(key[b]);
  }
  CHECK_EQ(data->table.size(), n);

  // Blocks beside a row of blocks along z are rows, too: one place in each of the nine goes up with the blocks.
  data->around.resize(n);
  parallel_ranges(n, 1024, [&](std::size_t begin, std::size_t end) {
    std::array<std::size_t, 9> at;
    for (std::size_t row = 0; row < 9; ++row) {
      const BlockCoord& c = data->coords[begin];
      const std::uint64_t lowest = pack(c[0] + static_cast<int>(row / 3) - 1, c[1] + static_cast<int>(row % 3) - 1, c[2] - 1);
      at[row] = static_cast<std::size_t>(std::lower_bound(key.begin(), key.end(), lowest) - key.begin());
    }
    for (std::size_t b = begin; b < end; ++b) {
      const BlockCoord& c = data->coords[b];
      std::array<Index, 27>& around = data->around[b];
      for (std::size_t row = 0; row < 9; ++row) {
        const std::uint64_t lowest = pack(c[0] + static_cast<int>(row / 3) - 1, c[1] + static_cast<int>(row % 3) - 1, c[2] - 1);
        while (at[row] < n && key[at[row]] < lowest) ++at[row];
        std::size_t next = at[row];
        for (std::size_t dz = 0; dz < 3; ++dz) {
          const bool there = next < n && key[next] == lowest + dz;
          around[row * 3 + dz] = there ? static_cast<Index>(next++) : kNone;
        }
      }
    }
  });
  data_ = data;
}

std::vector<Index> same_places(const Blocks& blocks, const Blocks& others) {
  std::vector<Index> same(blocks.size(), kNone);
  const std::vector<std::uint64_t>&here = blocks.keys(), &there = others.keys();
  Index other = 0;
  for (std::size_t b = 0; b < here.size(); ++b) {
    while (other < there.size() && there[other] < here[b]) ++other;
    if (other < there.size() && there[other] == here[b]) same[b] = other;
  }
  return same;
}

Index Blocks::block_at(const Vec3& p) const {
  const Cell c(p);
  return find(c.i >> 3, c.j >> 3, c.k >> 3);
}

float Blocks::sample(std::span<const float> field, float outside, Index home, const Vec3& p) const {
  const Cell c(p);
  const auto on_z = [&](int i, int j) {
    const float low = at(field, outside, home, i, j, c.k);
    return low + c.w * (at(field, outside, home, i, j, c.k + 1) - low);
  };
  const auto on_yz = [&](int i) {
    const float low = on_z(i, c.j);
    return low + c.v * (on_z(i, c.j + 1) - low);
  };
  const float low = on_yz(c.i);
  return low + c.u * (on_yz(c.i + 1) - low);
}

Vec3 Blocks::gradient(std::span<const float> field, float outside, Index home, const Vec3& p) const {
  const Cell c(p);
  Vec3 sum = Vec3::Zero();
  for (int corner = 0; corner < 8; ++corner) {
    const int di = corner >> 2, dj = (corner >> 1) & 1, dk = corner & 1;
    const int i = c.i + di, j = c.j + dj, k = c.k + dk;
    const float weight = (di ? c.u : 1 - c.u) * (dj ? c.v : 1 - c.v) * (dk ? c.w : 1 - c.w);
    const auto value = [&](int x, int y, int z) { return static_cast<Real>(at(field, outside, home, x, y, z)); };
    sum += weight * 0.5 *
           Vec3(value(i + 1, j, k) - value(i - 1, j, k), value(i, j + 1, k) - value(i, j - 1, k), value(i, j, k + 1) - value(i, j, k - 1));
  }
  return sum;
}

ChangedVoxels ChangedVoxels::between(const float* one, const float* other) {
  ChangedVoxels changed = none();
  for (int i = 0; i < kSide; ++i)
    for (int j = 0; j < kSide; ++j) {
      const std::size_t row = voxel_index(i, j, 0);
      if (std::memcmp(one + row, other + row, kSide * sizeof(float)) == 0) continue;
      for (int k = 0; k < kSide; ++k) {
        if (std::memcmp(one + row + k, other + row + k, sizeof(float)) == 0) continue;
        const int at[3] = {i, j, k};
        for (std::size_t a = 0; a < 3; ++a) {
          changed.low[a] = static_cast<std::int8_t>(std::min<int>(changed.low[a], at[a]));
          changed.high[a] = static_cast<std::int8_t>(std::max<int>(changed.high[a], at[a]));
        }
      }
    }
  return changed;
}

std::vector<std::uint8_t> near_changed(const Blocks& blocks, std::span<const ChangedVoxels> changed, int before, int after) {
  std::vector<std::uint8_t> marks(blocks.size(), 0);
  for (std::size_t b = 0; b < marks.size(); ++b) {
    if (!changed[b].any()) continue;
    for (std::size_t slot = 0; slot < 27; ++slot)
      if (const Index other = blocks.around(b)[slot]; other != kNone && changed[b].near_block(slot, before, after)) marks[other] = 1;
  }
  return marks;
}

void Blocks::padded(std::span<const float> field, float outside, std::size_t b, float* out) const {
  std::array<const float*, 27> from;
  std::array<float, kVoxels> none;  // of blocks that are not there
  bool all = true;
  for (std::size_t slot = 0; slot < 27; ++slot) {
    const Index block = around(b)[slot];
    from[slot] = block == kNone ? none.data() : &field[block * kVoxels];
    all = all && block != kNone;
  }
  if (!all) none.fill(outside);
  for (int i = -1; i <= kSide; ++i) {
    const int a = i < 0 ? 0 : i < kSide ? 1 : 2;
    for (int j = -1; j <= kSide; ++j, out += 10) {
      const float* const* row = from.data() + a * 9 + (j < 0 ? 0 : j < kSide ? 3 : 6);
      const std::size_t at = voxel_index(i & 7, j & 7, 0);
      out[0] = row[0][at + 7];
      std::memcpy(out + 1, row[1] + at, kSide * sizeof(float));
      out[9] = row[2][at];
    }
  }
}

}  // namespace effuse::skin
