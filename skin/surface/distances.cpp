#include <algorithm>
#include <cmath>

#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/surface/level_set_impl.h"

namespace effuse::skin {

namespace {

/// Distance from the nearest of each axis' two neighbours, a <= b <= c:  sum over used axes (u - a)^2 = 1.
float eikonal(float a, float b, float c) {
  if (a > b) std::swap(a, b);
  if (b > c) std::swap(b, c);
  if (a > b) std::swap(a, b);
  float u = a + 1;
  if (u <= b) return u;
  u = (a + b + std::sqrt(std::max(0.0f, 2 - (a - b) * (a - b)))) / 2;
  if (u <= c) return u;
  const float sum = a + b + c;
  return (sum + std::sqrt(std::max(0.0f, sum * sum - 3 * (a * a + b * b + c * c - 1)))) / 3;
}

constexpr int kAxis[3] = {100, 10, 1};  // strides of a padded block

}  // namespace

Field distances(const Blocks& blocks, float outside, const Field& phi, float band) {
  ZONE("skin.distances");
  Field distance(phi.size());
  std::vector<std::uint8_t> fixed(phi.size(), 0);

  // Voxels with a neighbour across the surface. Where an edge along axis a crosses at c_a, a plane with normal n is c_a |n_a|
  // away; the crossings of an edge's two ends add up to it, so that the zero level stays. Axes that the plane crosses squarely
  // count most.
  parallel_for(
      blocks.size(),
      [&](std::size_t b) {
        float p[1000];
        blocks.padded(phi, outside, b, p);
        for (std::size_t v = 0; v < kVoxels; ++v) {
          const float* c = p + ((v >> 6) + 1) * 100 + (((v >> 3) & 7) + 1) * 10 + (v & 7) + 1;
          const bool inside = c[0] < 0;
          constexpr float kNoCrossing = 2;
          float crossing[3], slope[3], nearest = kNoCrossing, slope2 = 1e-6f;
          for (std::size_t a = 0; a < 3; ++a) {
            crossing[a] = kNoCrossing;
            for (const float q : {c[kAxis[a]], c[-kAxis[a]]})
              if ((q < 0) != inside) crossing[a] = std::min(crossing[a], c[0] / (c[0] - q));
            nearest = std::min(nearest, crossing[a]);
            slope[a] = std::abs(c[kAxis[a]] - c[-kAxis[a]]) / 2;
            slope2 += slope[a] * slope[a];
          }
          const std::size_t at = b * kVoxels + v;
          fixed[at] = nearest <= 1;
          float size = band;
          if (fixed[at]) {
            float sum = 0, weights = 0;
            for (std::size_t a = 0; a < 3; ++a)
              if (crossing[a] <= 1) {
                sum += slope[a] * slope[a] * crossing[a] * slope[a] / std::sqrt(slope2);
                weights += slope[a] * slope[a];
              }
            size = weights > 0.01f * slope2 ? std::min(nearest, sum / weights) : nearest;
          }
          distance[at] = inside ? -size : size;
        }
      },
      16);

  // Outwards from those, a voxel a pass and direction; a few more passes let corners settle.
  Field next(phi.size());
  for (int pass = 0; pass < static_cast<int>(std::ceil(2 * band)); ++pass) {
    parallel_for(
        blocks.size(),
        [&](std::size_t b) {
          float p[1000];
          blocks.padded(distance, band, b, p);
          for (std::size_t v = 0; v < kVoxels; ++v) {
            const std::size_t at = b * kVoxels + v;
            next[at] = distance[at];
            if (fixed[at]) continue;
            const float* c = p + ((v >> 6) + 1) * 100 + (((v >> 3) & 7) + 1) * 10 + (v & 7) + 1;
            const float sign = distance[at] < 0 ? -1.0f : 1.0f;
            float near[3];
            // A neighbour across the surface cannot be: this voxel would be fixed.
            for (int a = 0; a < 3; ++a) near[a] = std::min(sign * c[kAxis[a]], sign * c[-kAxis[a]]);
            next[at] = sign * std::min(std::abs(distance[at]), eikonal(near[0], near[1], near[2]));
          }
        },
        16);
    distance.swap(next);
  }
  return distance;
}

}  // namespace effuse::skin
