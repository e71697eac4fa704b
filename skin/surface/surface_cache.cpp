#include "skin/surface/surface_cache.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "geometry/base/zones.h"

namespace effuse::skin {

SurfaceCache::SurfaceCache() : impl_(std::make_unique<Impl>()) {}
SurfaceCache::~SurfaceCache() = default;
SurfaceCache::SurfaceCache(SurfaceCache&&) noexcept = default;
SurfaceCache& SurfaceCache::operator=(SurfaceCache&&) noexcept = default;

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

void mark_beside_gone(const Blocks& before, std::span<const Index> after, std::vector<std::uint8_t>& marks) {
  for (std::size_t b = 0; b < after.size(); ++b)
    if (after[b] == kNone)
      for (const Index other : before.around(b))
        if (other != kNone && after[other] != kNone) marks[after[other]] = 1;
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

Renewal find_stale(const SurfaceCache::Impl& last, const ParticleGrid& particles, const Blocks& blocks, Real influence, Real reach) {
  ZONE("skin.stale");
  Renewal renewal;
  renewal.before = same_places(blocks, last.blocks);
  renewal.stale.assign(blocks.size(), 0);
  renewal.bereft.assign(blocks.size(), 0);
  renewal.rows.assign(blocks.size(), 0);
  mark_beside_gone(last.blocks, same_places(last.blocks, blocks), renewal.bereft);

  // Boxes round the particles of one frame alone, block by block.
  KeyTable table;
  std::vector<Box3> moved;
  const auto add = [&](const Vec3& x) {
    const auto block = [&](int a) { return static_cast<int>(std::floor(x[a] / kSide)); };
    const Index n = table.number(pack(block(0), block(1), block(2)));
    if (n == moved.size()) moved.emplace_back();
    moved[n].extend(x);
  };
  each_not_among(particles, last.particles, [&](Index i) { add(particles.x()[i]); });
  each_not_among(last.particles, particles, [&](Index i) { add(last.particles.x()[i]); });

  // Upright rows of blocks: boxes beside one another reach much the same ones.
  struct Reached {
    int from, to;
    RowSet rows;
  };
  struct Upright {
    int i, j;
    std::vector<Reached> reached;
  };
  const auto each_reached = [&](Real far, auto&& rows_of, auto&& f) {
    KeyTable places;
    std::vector<Upright> uprights;
    for (const Box3& box : moved) {
      const Vec3 margin = Vec3::Constant(far), lowest = box.min() - margin, highest = box.max() + margin;
      const Eigen::Vector3i low = (lowest / kSide).array().floor().cast<int>(), high = (highest / kSide).array().floor().cast<int>();
      for (int i = low.x(); i <= high.x(); ++i)
        for (int j = low.y(); j <= high.y(); ++j) {
          const Index r = places.number(pack(i, j, 0));
          if (r == uprights.size()) uprights.push_back({i, j, {}});
          std::vector<Reached>& reached = uprights[r].reached;
          const RowSet rows = rows_of(lowest, highest, i, j);
          if (!reached.empty() && rows == reached.back().rows && low.z() <= reached.back().to + 1 && high.z() + 1 >= reached.back().from)
            reached.back() = {std::min(reached.back().from, low.z()), std::max(reached.back().to, high.z()), rows};
          else reached.push_back({low.z(), high.z(), rows});
        }
    }
    for (const Upright& upright : uprights)
      for (const Reached& r : upright.reached)
        for (int k = r.from; k <= r.to; ++k)
          if (const Index at = blocks.block_at(Vec3(kSide * upright.i, kSide * upright.j, kSide * k)); at != kNone) f(at, r.rows);
  };
  each_reached(influence, [](const Vec3&, const Vec3&, int, int) { return RowSet{0}; }, [&](Index b, RowSet) { renewal.stale[b] = 1; });
  // Bits from .. to of eight, of the voxels between two places of block i.
  const auto between = [](Real low, Real high, int i) {
    const int from = std::max(0, static_cast<int>(std::ceil(low)) - kSide * i), to = std::min(kSide - 1, static_cast<int>(std::floor(high)) - kSide * i);
    return from > to ? 0u : (255u >> (7 - to)) & (255u << from);
  };
  const auto rows_between = [&](const Vec3& low, const Vec3& high, int i, int j) {
    const unsigned across = between(low.x(), high.x(), i), along = between(low.y(), high.y(), j);
    RowSet rows = 0;
    for (int k = 0; k < kSide; ++k)
      if (across >> k & 1u) rows |= RowSet{along} << (8 * k);
    return rows;
  };
  each_reached(reach, rows_between, [&](Index b, RowSet rows) { renewal.rows[b] |= rows; });
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const bool fresh = renewal.before[b] == kNone;
    // A block that is gone may have had sums that those beside it used.
    if (fresh || renewal.bereft[b]) renewal.rows[b] = ~RowSet{0};
    renewal.stale[b] = renewal.stale[b] || fresh;
    renewal.stale_blocks += renewal.stale[b];
  }
  return renewal;
}

}  // namespace effuse::skin
