#include "skin/surface/blocks.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"

namespace effuse::skin {

namespace {
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

Blocks::Blocks(std::vector<BlockCoord> coords) : coords_(std::move(coords)) {
  std::sort(coords_.begin(), coords_.end());
  for (const BlockCoord& c : coords_) table_.number(pack(c[0], c[1], c[2]));
  CHECK_EQ(table_.size(), coords_.size());
  around_.resize(coords_.size());
  parallel_for(coords_.size(), [&](std::size_t b) {
    const BlockCoord& c = coords_[b];
    for (int dx = -1; dx <= 1; ++dx)
      for (int dy = -1; dy <= 1; ++dy)
        for (int dz = -1; dz <= 1; ++dz)
          around_[b][static_cast<std::size_t>((dx + 1) * 9 + (dy + 1) * 3 + dz + 1)] = find(c[0] + dx, c[1] + dy, c[2] + dz);
  });
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

void Blocks::padded(std::span<const float> field, float outside, std::size_t b, float* out) const {
  const std::array<Index, 27>& near = around_[b];
  for (int i = -1; i <= kSide; ++i) {
    const int a = i < 0 ? 0 : i < kSide ? 1 : 2;
    for (int j = -1; j <= kSide; ++j) {
      const int c = j < 0 ? 0 : j < kSide ? 1 : 2;
      float* row = out + ((i + 1) * 10 + (j + 1)) * 10;
      const std::size_t in_block = voxel_index(i & 7, j & 7, 0);
      const auto block = [&](int d) { return near[static_cast<std::size_t>(a * 9 + c * 3 + d)]; };
      row[0] = block(0) == kNone ? outside : field[block(0) * kVoxels + in_block + 7];
      if (block(1) == kNone)
        std::fill_n(row + 1, kSide, outside);
      else
        std::memcpy(row + 1, &field[block(1) * kVoxels + in_block], kSide * sizeof(float));
      row[9] = block(2) == kNone ? outside : field[block(2) * kVoxels + in_block];
    }
  }
}

}  // namespace effuse::skin
