#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/surface/clones.h"
#include "skin/surface/level_set_impl.h"

namespace effuse::skin {

namespace {

constexpr float kBand = 2;  // only near the surface: farther in the field has kinks that mean nothing

using Row = float __attribute__((vector_size(kSide * sizeof(float))));

/// One step of a block: padded values in, `rate` (how far each voxel may go) times the flow added to out. Rows along z.
EFFUSE_CLONES void flow_step(const float* padded, const float* rate, float* out) {
  constexpr int X = 100, Y = 10, Z = 1;
  const Row zero{}, one = zero + 1, band = zero + kBand, most = zero + 1.5f, flat = zero + 0.04f;
  for (int i = 0; i < kSide; ++i)
    for (int j = 0; j < kSide; ++j) {
      const float* at = padded + (i + 1) * X + (j + 1) * Y + 1;
      const auto load = [](const float* from, Row& to) { std::memcpy(&to, from, sizeof(Row)); };
      Row c, x0, x1, y0, y1, z0, z1, r;
      load(at, c);
      load(rate + (i * kSide + j) * kSide, r);
      Row moves = c < band ? r : zero;
      moves = c > -band ? moves : zero;
      float any = 0;
      for (int k = 0; k < kSide; ++k) any += moves[k];
      if (any == 0) continue;
      load(at - X, x0), load(at + X, x1), load(at - Y, y0), load(at + Y, y1), load(at - Z, z0), load(at + Z, z1);
      const auto mixed = [&](int a, int b, Row& to) {
        Row pp, pm, mp, mm;
        load(at + a + b, pp), load(at + a - b, pm), load(at - a + b, mp), load(at - a - b, mm);
        to = (pp - pm - mp + mm) * 0.25f;
      };
      const Row x = (x1 - x0) * 0.5f, y = (y1 - y0) * 0.5f, z = (z1 - z0) * 0.5f;
      const Row xx = x1 - 2 * c + x0, yy = y1 - 2 * c + y0, zz = z1 - 2 * c + z0;
      Row xy, xz, yz;
      mixed(X, Y, xy), mixed(X, Z, xz), mixed(Y, Z, yz);
      const Row g2 = x * x + y * y + z * z;
      // kappa |grad phi| = laplacian - second derivative along the normal
      Row change = xx + yy + zz - (x * x * xx + y * y * yy + z * z * zz + 2 * (x * y * xy + x * z * xz + y * z * yz)) / (g2 > flat ? g2 : one);
      change = g2 >= flat ? change : zero;
      change = change < -most ? -most : change;
      change = change > most ? most : change;
      c += moves * change;
      std::memcpy(out + (i * kSide + j) * kSide, &c, sizeof c);
    }
}

}  // namespace

int smoothing_steps(float time) {
  constexpr float kLongestStep = 0.225f;  // stable below 1/4 (the flow diffuses in the two tangential directions)
  return static_cast<int>(std::ceil(time / kLongestStep - 1e-4f));
}

float smoothing_share(const FieldRule& rule, float W) {
  const float from = 1.2f * rule.lone, to = std::max(1.5f * rule.lone, 0.75f * rule.sheet);
  const float ramp = std::clamp((W - from) / (to - from), 0.0f, 1.0f);
  return ramp * ramp * (3 - 2 * ramp);
}

void smooth(const Blocks& blocks, float outside, const FieldRule& rule, const Field& weight, Field& phi, std::span<const std::uint8_t> wanted) {
  ZONE("skin.smooth");
  CHECK(wanted.empty() || wanted.size() == blocks.size());
  const int steps = smoothing_steps(rule.smoothing);
  const float dt = steps > 0 ? rule.smoothing / static_cast<float>(steps) : 0;
  // Rows that a wanted block feels in the steps after the first, across x and y.
  const auto rows_of = [&](std::size_t b) {
    RowSet rows = wanted.empty() || wanted[b] || steps > kSide ? ~RowSet{0} : 0;
    const int unfelt = std::max(0, kSide + 1 - steps);  // of a block's eight layers
    const auto felt = [&](std::size_t step) { return step == 0 ? 255u >> unfelt : step == 1 ? 255u : 255u << unfelt & 255u; };
    for (std::size_t slot = 0; slot < 27 && ~rows != 0; ++slot) {
      const Index other = blocks.around(b)[slot];
      if (other == kNone || !wanted[other]) continue;
      for (int i = 0; i < kSide; ++i)
        if (felt(slot / 9) >> i & 1u) rows |= RowSet{felt(slot / 3 % 3)} << (kSide * i);
    }
    return rows;
  };

  if (steps == 0) return;

  const std::unique_ptr<float[]> rate = std::make_unique_for_overwrite<float[]>(phi.size());  // of blocks that have rows
  Field next = phi;
  std::vector<RowSet> rows(blocks.size());
  std::vector<std::uint8_t> rated(blocks.size(), 0);
  for (int step = 0; step < steps; ++step) {
    parallel_for(
        blocks.size(),
        [&](std::size_t b) {
          const float* old = &phi[b * kVoxels];
          if (step == 0) rows[b] = rows_of(b);
          if (rows[b] == 0) return;
          // A block without the band is the same in both fields.
          if (std::none_of(old, old + kVoxels, [](float v) { return std::abs(v) < kBand; })) return;
          if (!rated[b])
            for (std::size_t v = 0; v < kVoxels; ++v) rate[b * kVoxels + v] = rows[b] >> (v / kSide) & 1u ? smoothing_share(rule, weight[b * kVoxels + v]) * dt : 0;
          rated[b] = 1;
          float p[1000];
          blocks.padded(phi, outside, b, p);
          std::memcpy(&next[b * kVoxels], old, kVoxels * sizeof(float));
          flow_step(p, &rate[b * kVoxels], &next[b * kVoxels]);
        },
        16);
    phi.swap(next);
  }
}

}  // namespace effuse::skin
