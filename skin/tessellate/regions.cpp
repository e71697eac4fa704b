#include "skin/tessellate/regions.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::skin {

namespace {

constexpr Real kSide = 1.0;               // [spacings] of a column's base
constexpr std::size_t kMostColumns = 32;  // a particle, on average
constexpr Index kDeep = 12;               // particles of a column worth searching for the lowest that matters
constexpr Real kFarthest = 1e6;           // [spacings] from end to end
constexpr Real kUsualReach = 0.75;        // [spacings] the nearest particle of a surface point is rarely farther,
constexpr Real kWideReach = 1.2;          // and hardly ever farther than this

}  // namespace

Regions::Regions(const geometry::Points& points, Real spacing) : spacing_(spacing), side_(kSide * spacing) {
  ZONE("skin.regions");
  CHECK(std::isfinite(spacing) && spacing > 0);
  const std::size_t n = points.size();
  CHECK_LT(n, std::size_t{kNone});
  if (!points.id.empty()) CHECK_EQ(points.id.size(), n);
  for (std::size_t i = 0; i < n; ++i) {
    if (!points.position[i].allFinite())
      throw InputError(effuse::Place{"particles"}, fmt::format("particle {}: its position is not finite", i));
    box_.extend(points.position[i]);
  }
  if (n == 0) return;
  if (box_.sizes().maxCoeff() > kFarthest * spacing)
    throw InputError(effuse::Place{"particles"},
                     fmt::format("spread over {:.4g} m: more than a million spacings of {:.4g} m", box_.sizes().maxCoeff(), spacing));

  // Rows of columns; wider ones where a few particles astray would make rows of nothing.
  const auto column_at = [&](std::size_t i, int axis) { return column_of(points.position[i][axis], box_.min()[axis]); };
  std::size_t columns;
  while (true) {
    rows_.assign(static_cast<std::size_t>(column_of(box_.max().x(), box_.min().x())) + 1, Row{});
    for (std::size_t i = 0; i < n; ++i) {
      Row& row = rows_[static_cast<std::size_t>(column_at(i, 0))];
      const int y = column_at(i, 1), end = std::max(row.first + row.count, y + 1);
      row.first = row.count == 0 ? y : std::min(row.first, y);
      row.count = row.count == 0 ? 1 : end - row.first;
    }
    columns = 0;
    for (Row& row : rows_) {
      row.begin = columns;
      columns += static_cast<std::size_t>(row.count);
    }
    if (columns + rows_.size() <= kMostColumns * n + 1000000) break;
    side_ *= 2;
  }
  std::vector<std::size_t> column(n);
  column_.assign(columns + 1, 0);
  for (std::size_t i = 0; i < n; ++i) {
    const Row& row = rows_[static_cast<std::size_t>(column_at(i, 0))];
    column[i] = row.begin + static_cast<std::size_t>(column_at(i, 1) - row.first);
    ++column_[column[i] + 1];
  }
  std::partial_sum(column_.begin(), column_.end(), column_.begin());
  std::vector<Index> filled(column_.begin(), column_.end() - 1);
  place_.resize(n);
  for (std::size_t i = 0; i < n; ++i) place_[filled[column[i]]++] = static_cast<Index>(i);

  // By height inside a column, then by what makes the order independent of the points' own.
  const auto id = [&](Index i) { return points.id.empty() ? 0 : points.id[i]; };
  parallel_for(
      columns,
      [&](std::size_t c) {
        std::sort(place_.begin() + column_[c], place_.begin() + column_[c + 1], [&](Index i, Index j) {
          const Vec3 &p = points.position[i], &q = points.position[j];
          if (p.z() != q.z()) return p.z() < q.z();
          if (id(i) != id(j)) return id(i) < id(j);
          if (p != q) return std::lexicographical_compare(p.begin(), p.end(), q.begin(), q.end());
          return i < j;
        });
      },
      64);
  x_.resize(n);
  id_.resize(n);
  sorted_.resize(n);
  for (Index s = 0; s < n; ++s) {
    x_[s] = points.position[place_[s]];
    id_[s] = id(place_[s]);
    sorted_[place_[s]] = s;
  }
}

bool Regions::goes_first(Index a, Index b) const {
  if (id_[a] != id_[b]) return id_[a] < id_[b];
  if (x_[a] != x_[b]) return std::lexicographical_compare(x_[a].begin(), x_[a].end(), x_[b].begin(), x_[b].end());
  return place_[a] < place_[b];
}

int Regions::column_of(Real v, Real origin) const { return static_cast<int>(std::floor((v - origin) / side_)); }

/// f(i) for every sorted particle within radius of x and some more, always in the same order.
template <class F>
void Regions::each_near(const Vec3& x, Real radius, F&& f) const {
  const Vec3 low = (x.array() - radius).max(box_.min().array()), high = (x.array() + radius).min(box_.max().array());
  if ((low.array() > high.array()).any()) return;
  const int x0 = column_of(low.x(), box_.min().x()), x1 = column_of(high.x(), box_.min().x());
  const int y0 = column_of(low.y(), box_.min().y()), y1 = column_of(high.y(), box_.min().y());
  for (int cx = x0; cx <= x1; ++cx) {
    const Row& row = rows_[static_cast<std::size_t>(cx)];
    const int first = std::max(y0 - row.first, 0), last = std::min(y1 - row.first, row.count - 1);
    for (int cy = first; cy <= last; ++cy) {
      const std::size_t c = row.begin + static_cast<std::size_t>(cy);
      Index i = column_[c];
      const Index end = column_[c + 1];
      if (end - i > kDeep)
        i = static_cast<Index>(
            std::lower_bound(x_.begin() + i, x_.begin() + end, low.z(), [](const Vec3& p, Real z) { return p.z() < z; }) - x_.begin());
      for (; i < end && x_[i].z() <= high.z(); ++i) f(i);
    }
  }
}

Index Regions::nearest_within(const Vec3& x, Real reach, Real& squared) const {
  Index best = kNone;
  squared = reach * reach;
  each_near(x, reach, [&](Index i) {
    const Real d = (x - x_[i]).squaredNorm();
    if (d > squared || (d == squared && best != kNone && !goes_first(i, best))) return;
    squared = d;
    best = i;
  });
  return best;
}

Index Regions::nearest_sorted(const Vec3& x, Real& squared) const {
  if (x_.empty() || !x.allFinite()) return kNone;
  for (const Real reach : {kUsualReach, kWideReach, kReach})
    if (const Index near = nearest_within(x, reach * spacing_, squared); near != kNone) return near;
  return kNone;
}

Index Regions::nearest(const Vec3& x, Index hint) const {
  Real squared;
  Index i;
  // A little more than the hint's distance, so that rounding does not lose it.
  const Real reach = hint == kNone ? kReach * spacing_ : (x - x_[sorted_[hint]]).norm() * (1 + 1e-12);
  if (reach < kWideReach * spacing_)
    i = nearest_within(x, reach, squared);
  else
    i = nearest_sorted(x, squared);
  return i == kNone ? kNone : place_[i];
}

Regions::Place Regions::at(const Vec3& x, Real width) const {
  CHECK_GT(width, 0);
  Place place;
  Real d2;
  const Index i = nearest_sorted(x, d2);
  if (i == kNone) return place;
  const Real w = width * spacing_, reach = std::sqrt(d2) + 2 * w;
  place.particle = place_[i];
  place.inside = 1;
  place.border = w;

  // b_j < w needs |x - x_j| < |x - x_i| + 2 w, because |x_j - x_i| <= |x - x_i| + |x - x_j|.
  Index neighbor = kNone;
  each_near(x, reach, [&](Index j) {
    const Real e2 = (x - x_[j]).squaredNorm();
    if (e2 >= reach * reach || j == i) return;
    const Real apart = (x_[j] - x_[i]).norm();
    if (apart == 0) return;
    const Real b = (e2 - d2) / (2 * apart);
    if (b >= w) return;
    const Real t = b / w;
    place.inside *= t * t * (3 - 2 * t);
    if (b > place.border || (b == place.border && (neighbor == kNone || !goes_first(j, neighbor)))) return;
    place.border = b;
    neighbor = j;
  });
  if (neighbor != kNone) place.neighbor = place_[neighbor];
  return place;
}

}  // namespace effuse::skin
