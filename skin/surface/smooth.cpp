#include <algorithm>
#include <cmath>

#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/surface/level_set_impl.h"

namespace effuse::skin {

void smooth(const Blocks& blocks, float outside, float time, const Field& weight, float lone, float sheet, Field& phi) {
  ZONE("skin.smooth");
  constexpr float kLongestStep = 1.0f / 6;  // stable below 1/4 (the flow diffuses in the two tangential directions)
  constexpr float kBand = 2;                // only near the surface: farther in the field has kinks that mean nothing
  const int steps = static_cast<int>(std::ceil(time / kLongestStep - 1e-4f));
  const float dt = steps > 0 ? time / static_cast<float>(steps) : 0;
  const float from = 1.2f * lone, to = std::max(1.5f * lone, 0.75f * sheet);

  Field next(phi.size());
  for (int step = 0; step < steps; ++step) {
    parallel_for(
        blocks.size(),
        [&](std::size_t b) {
          float p[1000];
          const float* old = &phi[b * kVoxels];
          float* out = &next[b * kVoxels];
          std::copy_n(old, kVoxels, out);
          if (std::none_of(old, old + kVoxels, [](float v) { return std::abs(v) < kBand; })) return;
          blocks.padded(phi, outside, b, p);
          for (int i = 0; i < kSide; ++i)
            for (int j = 0; j < kSide; ++j)
              for (int k = 0; k < kSide; ++k) {
                const std::size_t v = voxel_index(i, j, k);
                if (std::abs(old[v]) >= kBand) continue;
                const float ramp = std::clamp((weight[b * kVoxels + v] - from) / (to - from), 0.0f, 1.0f);
                if (ramp <= 0) continue;
                const float* c = p + ((i + 1) * 10 + j + 1) * 10 + k + 1;
                constexpr int X = 100, Y = 10, Z = 1;
                const float x = (c[X] - c[-X]) / 2, y = (c[Y] - c[-Y]) / 2, z = (c[Z] - c[-Z]) / 2;
                const float xx = c[X] - 2 * c[0] + c[-X], yy = c[Y] - 2 * c[0] + c[-Y], zz = c[Z] - 2 * c[0] + c[-Z];
                const float xy = (c[X + Y] - c[X - Y] - c[Y - X] + c[-X - Y]) / 4;
                const float xz = (c[X + Z] - c[X - Z] - c[Z - X] + c[-X - Z]) / 4;
                const float yz = (c[Y + Z] - c[Y - Z] - c[Z - Y] + c[-Y - Z]) / 4;
                const float g2 = x * x + y * y + z * z;
                if (g2 < 0.04f) continue;
                // kappa |grad phi| = laplacian - second derivative along the normal
                const float change =
                    xx + yy + zz - (x * x * xx + y * y * yy + z * z * zz + 2 * (x * y * xy + x * z * xz + y * z * yz)) / g2;
                out[v] = old[v] + ramp * ramp * (3 - 2 * ramp) * dt * std::clamp(change, -1.5f, 1.5f);
              }
        },
        16);
    phi.swap(next);
  }
}

}  // namespace effuse::skin
