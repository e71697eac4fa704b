#include "skin/surface/surface_cache.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::skin {

SurfaceCache::SurfaceCache() : impl_(std::make_unique<Impl>()) {}
SurfaceCache::~SurfaceCache() = default;
SurfaceCache::SurfaceCache(SurfaceCache&&) noexcept = default;
SurfaceCache& SurfaceCache::operator=(SurfaceCache&&) noexcept = default;

namespace {

/// Open addressing; 0 is taken for free, so that a particle of hash 0 counts as moved.
class HashSet {
 public:
  explicit HashSet(const std::vector<std::uint64_t>& hashes) : slots_(std::bit_ceil(2 * hashes.size() + 2), 0) {
    for (const std::uint64_t h : hashes) {
      std::size_t s = h & (slots_.size() - 1);
      while (slots_[s] != 0 && slots_[s] != h) s = (s + 1) & (slots_.size() - 1);
      slots_[s] = h;
    }
  }
  bool has(std::uint64_t h) const {
    std::size_t s = h & (slots_.size() - 1);
    while (slots_[s] != 0 && slots_[s] != h) s = (s + 1) & (slots_.size() - 1);
    return slots_[s] == h && h != 0;
  }

 private:
  std::vector<std::uint64_t> slots_;
};

}  // namespace

std::vector<std::uint64_t> particle_hashes(const ParticleGrid& particles) {
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

Renewal find_stale(const SurfaceCache::Impl& last, const ParticleGrid& particles, const std::vector<std::uint64_t>& hash, const Blocks& blocks, Real influence) {
  ZONE("skin.stale");
  Renewal renewal;
  renewal.before.resize(blocks.size());
  renewal.stale.assign(blocks.size(), 0);
  parallel_for(
      blocks.size(),
      [&](std::size_t b) {
        const BlockCoord& c = blocks.coords()[b];
        renewal.before[b] = last.blocks.block_at(Vec3(kSide * c[0], kSide * c[1], kSide * c[2]));
      },
      1024);

  // Particles of one frame only.
  const HashSet then(last.hash), now(hash);
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
    for (const Box3& box : moved) {
      const Eigen::Vector3i low = ((box.min().array() - influence) / kSide).floor().cast<int>(), high = ((box.max().array() + influence) / kSide).floor().cast<int>();
      for (int i = low.x(); i <= high.x(); ++i)
        for (int j = low.y(); j <= high.y(); ++j)
          for (int k = low.z(); k <= high.z(); ++k)
            if (const Index at = blocks.block_at(Vec3(kSide * i, kSide * j, kSide * k)); at != kNone) renewal.stale[at] = 1;
    }
  };
  mark(particles.x(), hash, then);
  mark(last.x, last.hash, now);
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    renewal.stale[b] = renewal.stale[b] || renewal.before[b] == kNone;
    renewal.stale_blocks += renewal.stale[b];
  }
  return renewal;
}

}  // namespace effuse::skin
