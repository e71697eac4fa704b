#include <algorithm>
#include <array>
#include <cmath>

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

}  // namespace

Real enclosed(const Blocks& blocks, float outside, const Field& phi, const Field& above, float shift) {
  return parallel_sum(
      blocks.size(), Real{0},
      [&](std::size_t b) {
        float p[1000], inside[1000], open[1000];
        blocks.padded(phi, outside, b, p);
        bool any = false;
        for (std::size_t v = 0; v < 1000; ++v) {
          inside[v] = p[v] < shift ? 1.0f : 0.0f;
          any = any || p[v] < shift;
        }
        if (!any) return Real{0};
        corner_sums(inside);
        if (!above.empty()) {
          blocks.padded(above, 1, b, open);
          corner_sums(open);
        }
        float sum = 0;  // at most 512, of terms at most 1
        for (int i = 1; i <= kSide; ++i)
          for (int j = 1; j <= kSide; ++j)
            for (int k = 1; k <= kSide; ++k) {
              const int at = i * 100 + j * 10 + k;
              if (inside[at] == 0) continue;
              const float share = inside[at] == 8 ? 1 : negative_share_of_cell(p + at, shift);
              sum += above.empty() ? share : share * open[at] / 8;
            }
        return static_cast<Real>(sum);
      },
      32);
}

float matching_shift(const Blocks& blocks, float outside, const Field& phi, const Field& above, Real target, float most) {
  ZONE("skin.match_volume");
  const auto excess = [&](float shift) { return enclosed(blocks, outside, phi, above, shift) / target - 1; };
  constexpr Real kEnough = 1e-4;
  // Out from zero by steps that double until the target lies between (a first one usually does), then regula falsi with
  // the weight of an end that stays halved (Illinois): the volume rises with the shift, but may jump (pieces, thin sheets).
  float low = 0, high = 0;
  Real at_low = excess(0), at_high = at_low;
  if (std::abs(at_low) < kEnough) return 0;
  for (float step = most / 8; at_low > 0 || at_high < 0; step *= 2) {
    const bool outward = at_high < 0;
    if ((outward && high >= most) || (!outward && low <= -most)) return outward ? most : -most;
    if (outward) {
      low = high;
      at_low = at_high;
      high = std::min(most, high + step);
      at_high = excess(high);
    } else {
      high = low;
      at_high = at_low;
      low = std::max(-most, low - step);
      at_low = excess(low);
    }
  }
  int stayed = 0;
  for (int i = 0; i < 20; ++i) {
    const float middle = low + (high - low) * static_cast<float>(at_low / (at_low - at_high));
    const Real at_middle = excess(middle);
    if (std::abs(at_middle) < kEnough || high - low < 1e-4f) return middle;
    if (at_middle < 0) {
      low = middle;
      at_low = at_middle;
      if (stayed > 0) at_high /= 2;
      stayed = 1;
    } else {
      high = middle;
      at_high = at_middle;
      if (stayed < 0) at_low /= 2;
      stayed = -1;
    }
  }
  return (low + high) / 2;
}

Real volume_above_ground(const LevelSet& surface, const geometry::Terrain* terrain) {
  if (surface.empty()) return 0;
  const LevelSet::Impl& s = surface.impl();
  const Field above = terrain ? sample_ground(s, *terrain, 2).above : Field{};
  return enclosed(s.blocks, s.outside, s.phi, above, 0) * s.voxel * s.voxel * s.voxel;
}

}  // namespace effuse::skin
