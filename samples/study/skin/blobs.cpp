#include "samples/study/skin/blobs.h"

#include <fmt/format.h>

#include <cmath>

#include "geometry/base/random.h"
#include "samples/study/skin/fill.h"

namespace effuse::study {

namespace {
std::vector<Vec3> ball(Real radius, std::uint64_t seed) {
  const Vec3 half = Vec3::Constant(radius + 1);
  return fill(Box3(-half, half), [&](const Vec3& p) { return p.norm() - radius; }, 0, Filling::kDisorder, seed);
}
}  // namespace

std::vector<Vec3> random_cluster(std::uint64_t seed, std::uint64_t n) {
  std::vector<Vec3> x;
  for (std::uint64_t i = 0; i < n; ++i) x.push_back(1.7 * Vec3(random_normal(seed, 0, i), random_normal(seed, 1, i), random_normal(seed, 2, i)));
  return x;
}

std::vector<Vec3> thin_sheet() {
  constexpr int kHalf = 7;
  std::vector<Vec3> x;
  std::uint64_t n = 0;
  for (int i = -kHalf; i < kHalf; ++i)
    for (int j = -kHalf; j < kHalf; ++j, ++n) {
      const Vec3 p(i + 0.5, j + 0.5, 0);
      if (p.norm() < kHalf) x.push_back(p + 0.5 * Vec3(random_uniform(1, 0, n) - 0.5, random_uniform(1, 1, n) - 0.5, 0));
    }
  return x;
}

std::vector<Vec3> merging_balls(Real share) {
  const Vec3 half((6.5 - 4.5 * share) / 2, 0, 0);
  std::vector<Vec3> x;
  for (const Vec3& p : ball(2.4, 1)) x.push_back(p + half);
  for (const Vec3& p : ball(2.4, 2)) x.push_back(p - half);
  return x;
}

std::vector<Vec3> parting_ball(Real share) {
  const Real stretch = 1 + 2.2 * share;
  std::vector<Vec3> x = ball(3.2, 3);
  for (Vec3& p : x) {
    const Real neck = 1 - 0.34 * (stretch - 1) * std::exp(-p.x() * p.x() / 4);
    p = Vec3(p.x() * stretch, p.y() * neck, p.z() * neck);
  }
  return x;
}

std::vector<std::pair<std::string, std::vector<Vec3>>> blobs(int step) {
  std::vector<std::pair<std::string, std::vector<Vec3>>> all;
  for (std::uint64_t seed = 1; seed <= kClusters; ++seed) all.emplace_back(fmt::format("cluster {}", seed), random_cluster(seed));
  all.emplace_back("sheet", thin_sheet());
  for (int f = 0; f < kMergingFrames; f += step) all.emplace_back(fmt::format("merging, frame {}", f), merging_balls(f / (kMergingFrames - 1.0)));
  for (int f = 0; f < kPartingFrames; f += step) all.emplace_back(fmt::format("parting, frame {}", f), parting_ball(f / (kPartingFrames - 1.0)));
  return all;
}

}  // namespace effuse::study
