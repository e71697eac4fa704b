#include "skin/surface/surface_cache.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <utility>

#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::skin {

SurfaceCache::SurfaceCache() : impl_(std::make_unique<Impl>()) {}
SurfaceCache::~SurfaceCache() = default;
SurfaceCache::SurfaceCache(SurfaceCache&&) noexcept = default;
SurfaceCache& SurfaceCache::operator=(SurfaceCache&&) noexcept = default;

HashSet::HashSet(const std::vector<std::uint64_t>& hashes) : slots_(std::bit_ceil(2 * hashes.size() + 2), 0) {
  for (const std::uint64_t h : hashes) slots_[slot(h)] = h;
}

void ReturnedField::give_back(std::uint64_t frame, Field phi) {
  const std::lock_guard lock(mutex_);
  if (frame < frame_) return;
  frame_ = frame;
  phi_ = std::move(phi);
}

std::pair<std::uint64_t, Field> ReturnedField::take() {
  const std::lock_guard lock(mutex_);
  return {std::exchange(frame_, 0), std::exchange(phi_, {})};
}

void rearrange(Field& field, std::span<const Index> before) {
  struct Run {
    std::size_t to, from, blocks;
  };
  std::vector<Run> runs;
  for (std::size_t b = 0; b < before.size(); ++b) {
    if (before[b] == kNone) continue;
    if (!runs.empty() && runs.back().to + runs.back().blocks == b && runs.back().from + runs.back().blocks == before[b]) ++runs.back().blocks;
    else runs.push_back({b, before[b], 1});
  }
  const std::size_t size = before.size() * kVoxels;
  if (size > field.capacity()) field.reserve(size + size / 8);
  if (size > field.size()) field.resize(size);
  // What goes down from the lowest on, what goes up from the highest on: nothing is written over that is still to go.
  const auto move = [&](const Run& r) { std::memmove(&field[r.to * kVoxels], &field[r.from * kVoxels], r.blocks * kVoxels * sizeof(float)); };
  for (const Run& r : runs)
    if (r.to < r.from) move(r);
  for (std::size_t k = runs.size(); k-- > 0;)
    if (runs[k].to > runs[k].from) move(runs[k]);
  field.resize(size);
}

void mark_beside_gone(const Blocks& before, std::span<const Index> after, std::vector<std::uint8_t>& marks) {
  for (std::size_t b = 0; b < after.size(); ++b)
    if (after[b] == kNone)
      for (const Index other : before.around(b))
        if (other != kNone && after[other] != kNone) marks[after[other]] = 1;
}

std::vector<std::uint64_t> particle_hashes(const ParticleGrid& particles) {
  ZONE("skin.hash");
  std::vector<std::uint64_t> hash(particles.size());
  parallel_for(
      hash.size(),
      [&](std::size_t i) {
        std::uint64_t h = 0;
        const auto mix = [&](std::uint64_t bits) {
          h = (h ^ bits) * 0x9e3779b97f4a7c15ULL;
          h ^= h >> 29;
        };
        for (int a = 0; a < 3; ++a) mix(std::bit_cast<std::uint64_t>(particles.x()[i][a]));
        mix(std::bit_cast<std::uint32_t>(particles.radius()[i]));
        hash[i] = h;
      },
      4096);
  return hash;
}

std::vector<std::uint8_t> widened(const Blocks& blocks, std::vector<std::uint8_t> marks, int rings) {
  for (; rings > 0; --rings) {
    std::vector<std::uint8_t> wider = marks;
    for (std::size_t b = 0; b < marks.size(); ++b)
      if (marks[b])
        for (const Index other : blocks.around(b))
          if (other != kNone) wider[other] = 1;
    marks.swap(wider);
  }
  return marks;
}

Renewal find_stale(const SurfaceCache::Impl& last, const ParticleGrid& particles, const std::vector<std::uint64_t>& hash, const HashSet& hashes,
                   const Blocks& blocks, Real influence) {
  ZONE("skin.stale");
  Renewal renewal;
  renewal.before = same_places(blocks, last.blocks);
  renewal.stale.assign(blocks.size(), 0);
  renewal.bereft.assign(blocks.size(), 0);
  mark_beside_gone(last.blocks, same_places(last.blocks, blocks), renewal.bereft);

  // Particles of one frame only.
  const auto mark = [&](const std::vector<Vec3>& x, const std::vector<std::uint64_t>& own, const HashSet& others) {
    KeyTable table;
    std::vector<Box3> moved;  // of each block's
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (others.has(own[i])) continue;
      const auto block = [&](int a) { return static_cast<int>(std::floor(x[i][a] / kSide)); };
      const Index n = table.number(pack(block(0), block(1), block(2)));
      if (n == moved.size()) moved.emplace_back();
      moved[n].extend(x[i]);
    }
    // Upright rows of blocks: boxes beside one another reach much the same ones.
    struct Row {
      int i, j;
      std::vector<std::array<int, 2>> reached;  // from, to
    };
    KeyTable row_table;
    std::vector<Row> rows;
    for (const Box3& box : moved) {
      const Eigen::Vector3i low = ((box.min().array() - influence) / kSide).floor().cast<int>(), high = ((box.max().array() + influence) / kSide).floor().cast<int>();
      for (int i = low.x(); i <= high.x(); ++i)
        for (int j = low.y(); j <= high.y(); ++j) {
          const Index r = row_table.number(pack(i, j, 0));
          if (r == rows.size()) rows.push_back({i, j, {}});
          std::vector<std::array<int, 2>>& reached = rows[r].reached;
          if (!reached.empty() && low.z() <= reached.back()[1] + 1 && high.z() + 1 >= reached.back()[0]) reached.back() = {std::min(reached.back()[0], low.z()), std::max(reached.back()[1], high.z())};
          else reached.push_back({low.z(), high.z()});
        }
    }
    for (const Row& row : rows)
      for (const auto& [from, to] : row.reached)
        for (int k = from; k <= to; ++k)
          if (const Index at = blocks.block_at(Vec3(kSide * row.i, kSide * row.j, kSide * k)); at != kNone) renewal.stale[at] = 1;
  };
  mark(particles.x(), hash, last.hashes);
  mark(last.x, last.hash, hashes);
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    renewal.stale[b] = renewal.stale[b] || renewal.before[b] == kNone;
    renewal.stale_blocks += renewal.stale[b];
  }
  return renewal;
}

}  // namespace effuse::skin
