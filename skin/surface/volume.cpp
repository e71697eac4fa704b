#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/surface/clones.h"
#include "skin/surface/level_set_impl.h"

namespace effuse::skin {

namespace {

/// Share of a tetrahedron where the linear function with these corner values is negative.
float negative_share(const std::array<float, 4>& v) {
  std::array<float, 4> n, p;
  std::size_t negative = 0, positive = 0;
  for (const float x : v) (x < 0 ? n[negative++] : p[positive++]) = x;
  const auto cut = [](float a, float b) { return a / (a - b); };  // how far along a -> b the zero lies
  switch (negative) {
    case 0:
      return 0;
    case 1:
      return cut(n[0], p[0]) * cut(n[0], p[1]) * cut(n[0], p[2]);
    case 2: {
      // A prism between the two negative corners, in three tetrahedra.
      const float a = cut(n[0], p[0]), b = cut(n[0], p[1]), c = cut(n[1], p[0]), d = cut(n[1], p[1]);
      return a * b + c * d * (1 - a) + a * d * (1 - b);
    }
    case 3:
      return 1 - cut(p[0], n[0]) * cut(p[0], n[1]) * cut(p[0], n[2]);
    default:
      return 1;
  }
}

/// The same for a cell with corners at c + (0|1) strides of a padded block, six tetrahedra about one diagonal.
float negative_share_of_cell(const float* c, float shift) {
  constexpr int kWay[6][2] = {{100, 10}, {100, 1}, {10, 100}, {10, 1}, {1, 100}, {1, 10}};
  float sum = 0;
  for (const auto& way : kWay) sum += negative_share({c[0] - shift, c[way[0]] - shift, c[way[0] + way[1]] - shift, c[111] - shift});
  return sum / 6;
}

/// Sums over the eight corners of the cells that begin at each voxel of a padded block (the last ones mean nothing).
EFFUSE_CLONES void corner_sums(float* v) {
  for (std::size_t i = 0; i < 999; ++i) v[i] += v[i + 1];
  for (std::size_t i = 0; i < 990; ++i) v[i] += v[i + 10];
  for (std::size_t i = 0; i < 900; ++i) v[i] += v[i + 100];
}

/// Volumes enclosed by one field at different shifts.
class Enclosed {
 public:
  using Range = KnownVolumes::Range;
  Enclosed(const Blocks& blocks, float outside, const Field& phi, const Field& above)
      : blocks_(blocks), outside_(outside), phi_(phi), above_(above), range_(blocks.size(), {1, 0}), full_(blocks.size(), -1) {}
  /// Ranges that the last frame knows.
  void take_ranges(const KnownVolumes& known) {
    if (!known.last_range || known.last_range->empty()) return;
    for (std::size_t b = 0; b < range_.size(); ++b)
      if (!known.stale[b]) range_[b] = (*known.last_range)[known.before[b]];
  }
  std::vector<Range> ranges() && { return std::move(range_); }
  Real operator()(float shift) {
    find_ranges([](std::size_t) { return true; });
    return parallel_sum(
        blocks_.size(), Real{0}, [&](std::size_t b) { return of_block(b, shift); }, 32);
  }
  /// At a shift in steps; blocks that the last frame knows are not looked at.
  Real operator()(int steps, KnownVolumes& known) {
    const std::vector<Real>* last = nullptr;
    if (known.last)
      if (const auto at = known.last->find(steps); at != known.last->end()) last = &at->second;
    const auto asked = [&](std::size_t b) { return !last || known.stale[b]; };
    find_ranges(asked);
    std::vector<Real>& now = known.now[steps];
    now.resize(blocks_.size());
    const float shift = static_cast<float>(steps) / kShiftSteps;
    return parallel_sum(
        blocks_.size(), Real{0}, [&](std::size_t b) { return now[b] = asked(b) ? of_block(b, shift) : (*last)[known.before[b]]; }, 32);
  }

 private:
  static constexpr std::size_t kBeyond[7] = {14, 16, 17, 22, 23, 25, 26};  // where a block's cells reach

  /// Of the blocks asked for and those that their cells reach into.
  template <class Asked>
  void find_ranges(Asked&& asked) {
    std::vector<std::uint8_t> wanted(blocks_.size(), 0);
    for (std::size_t b = 0; b < wanted.size(); ++b) {
      if (!asked(b)) continue;
      wanted[b] = 1;
      for (const std::size_t slot : kBeyond)
        if (const Index other = blocks_.around(b)[slot]; other != kNone) wanted[other] = 1;
    }
    parallel_for(
        wanted.size(),
        [&](std::size_t b) {
          if (!wanted[b] || range_[b].low <= range_[b].high) return;
          const auto [low, high] = std::minmax_element(&phi_[b * kVoxels], &phi_[b * kVoxels] + kVoxels);
          range_[b] = {*low, *high};
        },
        64);
  }

  /// Of the cells that begin at the block's voxels.
  Real of_block(std::size_t b, float shift) {
    Range range = range_[b];
    for (const std::size_t slot : kBeyond) {
      const Index other = blocks_.around(b)[slot];
      const Range beyond = other == kNone ? Range{outside_, outside_} : range_[other];
      range = {std::min(range.low, beyond.low), std::max(range.high, beyond.high)};
    }
    if (range.low >= shift) return 0;
    const bool whole = range.high < shift;
    if (whole && above_.empty()) return kVoxels;
    if (whole && full_[b] >= 0) return full_[b];
    float p[1000], inside[1000], open[1000];
    blocks_.padded(phi_, outside_, b, p);
    for (std::size_t v = 0; v < 1000; ++v) inside[v] = p[v] < shift ? 1.0f : 0.0f;
    corner_sums(inside);
    if (!above_.empty()) {
      blocks_.padded(above_, 1, b, open);
      corner_sums(open);
    }
    float sum = 0;  // at most 512, of terms at most 1
    for (int i = 1; i <= kSide; ++i)
      for (int j = 1; j <= kSide; ++j)
        for (int k = 1; k <= kSide; ++k) {
          const int at = i * 100 + j * 10 + k;
          if (inside[at] == 0) continue;
          const float share = inside[at] == 8 ? 1 : negative_share_of_cell(p + at, shift);
          sum += above_.empty() ? share : share * open[at] / 8;
        }
    if (whole) full_[b] = sum;
    return static_cast<Real>(sum);
  }

  const Blocks& blocks_;
  float outside_;
  const Field &phi_, &above_;
  std::vector<Range> range_;  // of each block's values
  std::vector<float> full_;   // a block's volume when all of it is inside; -1: not asked yet
};

}  // namespace

Real enclosed(const Blocks& blocks, float outside, const Field& phi, const Field& above, float shift) {
  return Enclosed(blocks, outside, phi, above)(shift);
}

Real enclosed(const Blocks& blocks, float outside, const Field& phi, const Field& above, KnownVolumes& known) {
  return Enclosed(blocks, outside, phi, above)(0, known);
}

Shift matching_shift(const Blocks& blocks, float outside, const Field& phi, const Field& above, Real target, float most, KnownVolumes& known) {
  ZONE("skin.match_volume");
  Enclosed volume(blocks, outside, phi, above);
  volume.take_ranges(known);
  std::map<int, Real> found;
  const auto excess = [&](int k) {
    const auto at = found.find(k);
    return at != found.end() ? at->second : found[k] = volume(k, known) / target - 1;
  };
  // The volume rises with the shift (it may jump: pieces, thin sheets), so there is one pair of neighbouring steps between which it passes
  // the target, wherever the search begins. Out by steps that double until the target lies between, then regula falsi with the
  // weight of an end that stays halved (Illinois).
  const int end = static_cast<int>(most * kShiftSteps);
  int first = std::clamp(known.guess, -end, end);
  // From two steps that the last frame knows, cheap ones, to where the target should lie: others have to be looked for in all blocks.
  if (known.last && known.last->contains(first))
    for (const int beside : {first + 1, first - 1}) {
      if (!known.last->contains(beside)) continue;
      const Real slope = (excess(beside) - excess(first)) * (beside - first);
      if (slope > 0) first = static_cast<int>(std::clamp<Real>(first + std::floor(-excess(first) / slope), -end, end));
      break;
    }
  int low = first, high = first;
  Real at_low = excess(first), at_high = at_low;
  const bool outward = at_low < 0;
  for (int step = known.last ? 1 : std::max(1, end / 8); outward ? at_high < 0 && high < end : at_low >= 0 && low > -end; step *= 2) {
    if (outward) {
      low = high;
      at_low = at_high;
      high = std::min(end, high + step);
      at_high = excess(high);
    } else {
      high = low;
      at_high = at_low;
      low = std::max(-end, low - step);
      at_low = excess(low);
    }
  }
  Real weight_low = at_low, weight_high = at_high;
  int stayed = 0;
  while (high - low > 1 && at_low < 0 && at_high >= 0) {
    const int middle = std::clamp(static_cast<int>(std::floor(low - weight_low * (high - low) / (weight_high - weight_low))), low + 1, high - 1);
    const Real at_middle = excess(middle);
    if (at_middle < 0) {
      low = middle;
      weight_low = at_low = at_middle;
      if (stayed > 0) weight_high /= 2;
      stayed = 1;
    } else {
      high = middle;
      weight_high = at_high = at_middle;
      if (stayed < 0) weight_low /= 2;
      stayed = -1;
    }
  }
  const bool lower = at_low >= 0 || (at_high >= 0 && -at_low <= at_high);
  // Steps beside these are kept known: the next frame may want them.
  if (known.last)
    for (const auto& [k, of_blocks] : *known.last)
      if (k >= low - 1 && k <= high + 1 && !known.now.contains(k)) volume(k, known);
  known.range = std::move(volume).ranges();
  const Real exact = high > low && at_low < 0 && at_high >= 0 ? low - at_low / (at_high - at_low) * (high - low) : lower ? low : high;
  return {lower ? low : high, exact, ((lower ? at_low : at_high) + 1) * target};
}

Real volume_above_ground(const LevelSet& surface, const geometry::Terrain* terrain) {
  if (surface.empty()) return 0;
  const LevelSet::Impl& s = surface.impl();
  const Field above = terrain ? sample_ground(s.blocks, s.particles.origin(), s.voxel, *terrain, 2).above : Field{};
  return enclosed(s.blocks, s.outside, s.phi, above, 0) * s.voxel * s.voxel * s.voxel;
}

}  // namespace effuse::skin
