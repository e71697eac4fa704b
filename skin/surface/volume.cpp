#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <span>
#include <vector>

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

constexpr int kStrides = 8;            // between no shift and the farthest; the volume between two of them is nearly linear
constexpr Real kVolumeError = 5e-4;    // of the target: by so much a round shift may miss
constexpr Real kMostOff = 2;           // [steps] and by so much, lest it be seen to change

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
        blocks_.size(), Real{0},
        [&](std::size_t b) {
          Values values;
          return of_block(b, shift, values);
        },
        32);
  }
  /// At shifts in steps; blocks that the last frame knows are not looked at.
  std::vector<Real> operator()(std::span<const int> steps, KnownVolumes& known) {
    struct Asked {
      float shift;
      const std::vector<Real>* last;
      std::vector<Real>* now;
    };
    std::vector<Asked> asked;
    bool all = false;
    for (const int k : steps) {
      const bool is_known = known.last && known.last->contains(k);
      std::vector<Real>& now = known.now[k];
      now.resize(blocks_.size());
      asked.push_back({static_cast<float>(k) / kShiftSteps, is_known ? &known.last->at(k) : nullptr, &now});
      all = all || !is_known;
    }
    find_ranges([&](std::size_t b) { return all || known.stale[b]; });
    parallel_for(
        blocks_.size(),
        [&](std::size_t b) {
          Values values;
          for (const Asked& a : asked) (*a.now)[b] = a.last && !known.stale[b] ? (*a.last)[known.before[b]] : of_block(b, a.shift, values);
        },
        32);
    std::vector<Real> sums;
    for (const Asked& a : asked) sums.push_back(parallel_sum(blocks_.size(), Real{0}, [&](std::size_t b) { return (*a.now)[b]; }, 32));
    return sums;
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

  /// Of a block and those its cells reach into, once they are asked for; the share above ground eight times.
  struct Values {
    bool there = false;
    float p[1000], open[1000];
  };
  /// Of the cells that begin at the block's voxels.
  Real of_block(std::size_t b, float shift, Values& values) {
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
    if (!values.there) {
      blocks_.padded(phi_, outside_, b, values.p);
      if (!above_.empty()) {
        blocks_.padded(above_, 1, b, values.open);
        corner_sums(values.open);
      }
      values.there = true;
    }
    const float *p = values.p, *open = values.open;
    float inside[1000];
    for (std::size_t v = 0; v < 1000; ++v) inside[v] = p[v] < shift ? 1.0f : 0.0f;
    corner_sums(inside);
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
  return Enclosed(blocks, outside, phi, above)(std::array{0}, known).front();
}

namespace {

/// The number between a and b, a <= b, that the largest power of two divides.
int roundest(int a, int b) {
  if (a <= 0 && b >= 0) return 0;
  if (b < 0) return -roundest(-b, -a);
  int power = 1;
  while ((a + 2 * power - 1) / (2 * power) * 2 * power <= b) power *= 2;
  return (a + power - 1) / power * power;
}

}  // namespace

Shift matching_shift(const Blocks& blocks, float outside, const Field& phi, const Field& above, Real target, float most, KnownVolumes& known) {
  ZONE("skin.match_volume");
  Enclosed volume(blocks, outside, phi, above);
  volume.take_ranges(known);
  std::map<int, Real> found;
  std::set<int> asked;
  const auto look = [&](std::span<const int> steps) {
    const std::vector<Real> volumes = volume(steps, known);
    for (std::size_t k = 0; k < volumes.size(); ++k) found[steps[k]] = volumes[k] / target - 1;
  };
  const auto excess = [&](int k) {
    if (asked.insert(k).second && !found.contains(k)) look(std::array{k});
    return found[k];
  };
  // What the last frame knows is cheap, and most often enough.
  std::vector<int> cheap;
  if (known.last)
    for (const auto& [k, of_blocks] : *known.last) cheap.push_back(k);
  if (!cheap.empty()) look(cheap);

  // The volume rises with the shift (it may jump: pieces, thin sheets), so there is one pair of neighbours among the multiples of a number
  // between which it passes the target, wherever the search begins. Out by steps that double until the target lies between, then regula
  // falsi with the weight of an end that stays halved (Illinois).
  struct Between {
    int low, high;
    Real at_low, at_high;
    bool holds() const { return at_low < 0 && at_high >= 0; }
  };
  const auto narrowed = [&](Between b, int step) {
    Real weight_low = b.at_low, weight_high = b.at_high;
    int stayed = 0;
    while (b.high - b.low > step && b.holds()) {
      const int low = b.low / step, high = b.high / step;
      const int middle = step * std::clamp(static_cast<int>(std::floor(low - weight_low * (high - low) / (weight_high - weight_low))), low + 1, high - 1);
      const Real at_middle = excess(middle);
      if (at_middle < 0) {
        b.low = middle;
        weight_low = b.at_low = at_middle;
        if (stayed > 0) weight_high /= 2;
        stayed = 1;
      } else {
        b.high = middle;
        weight_high = b.at_high = at_middle;
        if (stayed < 0) weight_low /= 2;
        stayed = -1;
      }
    }
    return b;
  };
  const int stride = std::max(1, static_cast<int>(most * kShiftSteps) / kStrides), end = kStrides * stride;
  const int first = std::clamp(static_cast<int>(std::floor(static_cast<Real>(known.guess) / stride)) * stride, -end, end);
  Between b{first, first, excess(first), excess(first)};
  const bool outward = b.at_low < 0;
  for (int step = stride; outward ? b.at_high < 0 && b.high < end : b.at_low >= 0 && b.low > -end; step *= 2) {
    if (outward) {
      b.low = b.high;
      b.at_low = b.at_high;
      b.high = std::min(end, b.high + step);
      b.at_high = excess(b.high);
    } else {
      b.high = b.low;
      b.at_high = b.at_low;
      b.low = std::max(-end, b.low - step);
      b.at_low = excess(b.low);
    }
  }
  b = narrowed(b, stride);
  Shift shift;
  if (!b.holds()) {
    shift.steps = b.at_low >= 0 ? b.low : b.high;
    shift.exact = shift.steps;
  } else {
    const auto slope = [&] { return (b.at_high - b.at_low) / (b.high - b.low); };
    const Real off = std::min(kVolumeError / slope(), kMostOff);
    shift.exact = b.low - b.at_low / slope();
    bool found_round = false;
    for (int tries = 0; tries < 3 && off > 0.5 && !found_round; ++tries) {
      shift.steps = std::clamp(roundest(static_cast<int>(std::ceil(shift.exact - off)), static_cast<int>(std::floor(shift.exact + off))), -end, end);
      shift.exact = shift.steps - excess(shift.steps) / slope();
      found_round = std::abs(shift.exact - shift.steps) <= off;
    }
    if (!found_round) {
      // Of the two steps beside the target the nearer one.
      b = narrowed(b, 1);
      shift.steps = -b.at_low <= b.at_high ? b.low : b.high;
      shift.exact = b.low - b.at_low / slope();
    }
  }
  shift.volume = (excess(shift.steps) + 1) * target;
  std::erase_if(known.now, [&](const auto& of) { return !asked.contains(of.first); });
  known.range = std::move(volume).ranges();
  return shift;
}

Real volume_above_ground(const LevelSet& surface, const geometry::Terrain* terrain) {
  if (surface.empty()) return 0;
  const LevelSet::Impl& s = surface.impl();
  const Field above = terrain ? sample_ground(s.blocks, s.particles.origin(), s.voxel, *terrain, 2).above : Field{};
  return enclosed(s.blocks, s.outside, s.phi, above, 0) * s.voxel * s.voxel * s.voxel;
}

}  // namespace effuse::skin
