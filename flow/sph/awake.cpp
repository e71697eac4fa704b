#include "flow/sph/awake.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_map>

#include "geometry/base/check.h"
#include "geometry/base/zones.h"

namespace effuse::flow::sph {

namespace {
using Key = std::uint64_t;
constexpr std::int64_t kHalf = std::int64_t{1} << 20;  // cells to either side of the origin

Key key(const Vec3& x, Real cell, int dx = 0, int dy = 0, int dz = 0) {
  const auto part = [&](Real v, int d) { return static_cast<Key>((static_cast<std::int64_t>(std::floor(v / cell)) + d + kHalf) & (2 * kHalf - 1)); };
  return part(x.x(), dx) << 42 | part(x.y(), dy) << 21 | part(x.z(), dz);
}
}  // namespace

void AwakeSet::find(std::span<const Vec3> x, std::span<const std::uint8_t> asleep, Real cell) {
  ZONE("sph.awake");
  CHECK_EQ(asleep.size(), x.size());
  const std::size_t n = x.size();
  particles.clear();
  for (std::size_t i = 0; i < n; ++i)
    if (!asleep[i]) particles.push_back(static_cast<Index>(i));
  awake = particles.size();
  drowsy = 0;
  if (awake == n || awake == 0) return;

  // Cells by their distance, in cells, from one with somebody awake in it: at most 2.
  std::unordered_map<Key, int> near;
  for (std::size_t k = 0; k < awake; ++k) near.emplace(key(x[particles[k]], cell), 0);
  std::vector<Key> cells;
  cells.reserve(near.size());
  for (const auto& [cell_key, distance] : near) cells.push_back(cell_key);
  const auto move = [](Key k, int dx, int dy, int dz) {
    const auto part = [](Key v, int d) { return (v + static_cast<Key>(d + 2 * kHalf)) & static_cast<Key>(2 * kHalf - 1); };
    return part(k >> 42, dx) << 42 | part(k >> 21 & (2 * kHalf - 1), dy) << 21 | part(k & (2 * kHalf - 1), dz);
  };
  for (const Key center : cells)
    for (int dx = -2; dx <= 2; ++dx)
      for (int dy = -2; dy <= 2; ++dy)
        for (int dz = -2; dz <= 2; ++dz) {
          const int distance = std::max({std::abs(dx), std::abs(dy), std::abs(dz)});
          const auto [place, fresh] = near.emplace(move(center, dx, dy, dz), distance);
          if (!fresh) place->second = std::min(place->second, distance);
        }
  std::vector<Index> still;
  for (std::size_t i = 0; i < n; ++i) {
    if (!asleep[i]) continue;
    const auto found = near.find(key(x[i], cell));
    if (found == near.end()) continue;
    if (found->second <= 1) particles.push_back(static_cast<Index>(i));
    else still.push_back(static_cast<Index>(i));
  }
  drowsy = particles.size() - awake;
  particles.insert(particles.end(), still.begin(), still.end());
}

}  // namespace effuse::flow::sph
