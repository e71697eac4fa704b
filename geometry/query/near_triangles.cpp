#include "geometry/query/near_triangles.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::geometry {

namespace {

std::size_t slot_of(std::uint64_t key, std::size_t size) {
  key ^= key >> 31;
  key *= 0x9e3779b97f4a7c15ull;
  return static_cast<std::size_t>(key >> 20) & (size - 1);
}

}  // namespace

std::uint64_t NearTriangles::key_of(const Vec3& p) const {
  std::uint64_t key = 0;
  for (int k = 0; k < 3; ++k) {
    const Real at = (p[k] - box_.min()[k]) / cell_;
    if (!(at >= 0 && at < static_cast<Real>(cells_[static_cast<std::size_t>(k)]))) return kNoCell;
    key = key * cells_[static_cast<std::size_t>(k)] + static_cast<std::uint64_t>(at);
  }
  return key;
}

std::optional<NearTriangles> NearTriangles::build(std::span<const Vec3> positions, std::span<const Triangle> triangles, Real reach) {
  ZONE("mesh.near");
  CHECK(std::isfinite(reach) && reach > 0);
  NearTriangles near;
  near.reach_ = reach;
  Real area = 0;
  std::size_t solid = 0;
  for (const Triangle& t : triangles) {
    for (const Index v : t) CHECK_LT(v, positions.size());
    near.corners_.push_back({positions[t[0]], positions[t[1]], positions[t[2]]});
    const Corners& c = near.corners_.back();
    CHECK(c.a.allFinite() && c.b.allFinite() && c.c.allFinite());
    const Real twice = (c.b - c.a).cross(c.c - c.a).norm();
    area += twice / 2;
    solid += twice > 0;
    for (const Vec3& p : {c.a, c.b, c.c}) near.box_.extend(p);
  }
  if (solid == 0) return std::nullopt;
  // About a triangle wide: some ten candidates each. Where the reach is larger, there are layers of cells.
  const Real usual = std::sqrt(area / static_cast<Real>(solid));
  if (reach > kMostTriangles * usual) return std::nullopt;
  near.cell_ = 0.8 * usual;
  const Real cell = near.cell_, half = std::sqrt(3.0) / 2 * cell, slack = 1e-9 * (cell + near.box_.diagonal().norm());
  near.box_.min() -= Vec3::Constant(reach + cell);
  near.box_.max() += Vec3::Constant(reach + cell);
  Real all = 1;
  for (int k = 0; k < 3; ++k) {
    const Real count = std::ceil(near.box_.sizes()[k] / cell) + 1;
    all *= count;
    if (!(all < 9e18)) return std::nullopt;
    near.cells_[static_cast<std::size_t>(k)] = static_cast<std::uint64_t>(count);
  }

  // Cells whose middle a triangle may be nearest to: within the reach and half a cell. Counted first, as an upper bound.
  const auto cells_about = [&](std::size_t t) {
    const Corners& c = near.corners_[t];
    std::array<std::array<std::int64_t, 2>, 3> range{};
    for (int k = 0; k < 3; ++k) {
      const Real low = std::min({c.a[k], c.b[k], c.c[k]}) - reach - slack, high = std::max({c.a[k], c.b[k], c.c[k]}) + reach + slack;
      range[static_cast<std::size_t>(k)] = {static_cast<std::int64_t>(std::floor((low - near.box_.min()[k]) / cell)), static_cast<std::int64_t>(std::floor((high - near.box_.min()[k]) / cell))};
    }
    return range;
  };
  Real bound = 0;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    Real cells = 1;
    for (const auto& [low, high] : cells_about(t)) cells *= static_cast<Real>(high - low + 1);
    bound += cells;
  }
  if (!(bound <= kMostCells)) return std::nullopt;

  struct Entry {
    std::uint64_t key;
    Index triangle;
    float distance;  // of the cell's middle, rounded up
  };
  constexpr std::size_t kGrain = 1024;
  std::vector<std::vector<Entry>> parts((triangles.size() + kGrain - 1) / kGrain);
  parallel_ranges(triangles.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    std::vector<Entry>& part = parts[begin / kGrain];
    for (std::size_t t = begin; t < end; ++t) {
      const Corners& c = near.corners_[t];
      if (!((c.b - c.a).cross(c.c - c.a).norm() > 0)) continue;
      const auto range = cells_about(t);
      for (std::int64_t i = range[0][0]; i <= range[0][1]; ++i)
        for (std::int64_t j = range[1][0]; j <= range[1][1]; ++j)
          for (std::int64_t k = range[2][0]; k <= range[2][1]; ++k) {
            const Vec3 middle = near.box_.min() + cell * Vec3(static_cast<Real>(i) + 0.5, static_cast<Real>(j) + 0.5, static_cast<Real>(k) + 0.5);
            const Real distance = (closest_point_on_triangle(middle, c.a, c.b, c.c).point - middle).norm();
            if (distance > reach + half + slack) continue;
            const std::uint64_t key = (static_cast<std::uint64_t>(i) * near.cells_[1] + static_cast<std::uint64_t>(j)) * near.cells_[2] + static_cast<std::uint64_t>(k);
            part.push_back({key, static_cast<Index>(t), static_cast<float>(distance)});
          }
    }
  });
  std::vector<Entry> entries;
  for (std::vector<Entry>& part : parts) {
    entries.insert(entries.end(), part.begin(), part.end());
    std::vector<Entry>().swap(part);
  }
  std::sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) { return a.key != b.key ? a.key < b.key : a.triangle < b.triangle; });

  // Nearest to some point of a cell is only what is no farther from its middle than the nearest and a cell's diagonal. Floats round by 1e-7.
  std::vector<Cell> cells;
  for (std::size_t begin = 0, end; begin < entries.size(); begin = end) {
    float least = entries[begin].distance;
    for (end = begin; end < entries.size() && entries[end].key == entries[begin].key; ++end) least = std::min(least, entries[end].distance);
    const auto first = static_cast<std::uint32_t>(near.candidates_.size());
    for (std::size_t k = begin; k < end; ++k)
      if (entries[k].distance <= (least + 2 * half + slack) * (1 + 1e-6)) near.candidates_.push_back(entries[k].triangle);
    cells.push_back({entries[begin].key, first, static_cast<std::uint32_t>(near.candidates_.size())});
  }
  if (near.candidates_.size() > 0xffffffffu) return std::nullopt;
  near.candidates_.shrink_to_fit();
  near.table_.resize(std::bit_ceil(2 * cells.size() + 1));
  for (const Cell& c : cells) {
    std::size_t slot = slot_of(c.key, near.table_.size());
    while (near.table_[slot].key != kNoCell) slot = (slot + 1) & (near.table_.size() - 1);
    near.table_[slot] = c;
  }
  return near;
}

std::optional<MeshTree::Nearest> NearTriangles::nearest(const Vec3& p, Real reach) const {
  CHECK_LE(reach, reach_);
  const std::uint64_t key = key_of(p);  // NaN is in no cell
  if (key == kNoCell) return std::nullopt;
  std::size_t slot = slot_of(key, table_.size());
  while (table_[slot].key != key) {
    if (table_[slot].key == kNoCell) return std::nullopt;
    slot = (slot + 1) & (table_.size() - 1);
  }
  MeshTree::Nearest best{0, {}, std::numeric_limits<Real>::infinity()};
  for (std::uint32_t k = table_[slot].begin; k < table_[slot].end; ++k) {
    const Corners& c = corners_[candidates_[k]];
    const TrianglePoint at = closest_point_on_triangle(p, c.a, c.b, c.c);
    const Real distance = (p - at.point).norm();
    if (distance < best.distance) best = {candidates_[k], at, distance};
  }
  if (!(best.distance <= reach)) return std::nullopt;
  return best;
}

std::size_t NearTriangles::bytes() const { return corners_.size() * sizeof(Corners) + candidates_.size() * sizeof(Index) + table_.size() * sizeof(Cell); }

}  // namespace effuse::geometry
