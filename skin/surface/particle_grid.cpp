#include "skin/surface/particle_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/surface/clones.h"

namespace effuse::skin {

namespace {
constexpr int kMostCarried = 12;
constexpr Real kFarthest = 1 << 20;  // [voxels] from end to end: column and block numbers fit 21 bits, floats resolve 1/16 voxel

/// That holds the points.
Box3 checked_box(const geometry::Points& points, Real voxel) {
  const std::size_t n = points.size();
  CHECK_EQ(points.radius.size(), n);
  Box3 box;
  for (std::size_t i = 0; i < n; ++i) {
    if (!points.position[i].allFinite()) throw InputError(Place{"particles"}, fmt::format("particle {}: its position is not finite", i));
    if (!(points.radius[i] > 0) || !std::isfinite(points.radius[i]))
      throw InputError(Place{"particles"}, fmt::format("particle {}: radius {} m, wanted a finite number above 0", i, points.radius[i]));
    box.extend(points.position[i]);
  }
  if (n > 0 && box.sizes().maxCoeff() > kFarthest * voxel)
    throw InputError(Place{"particles"},
                     fmt::format("spread over {:.4g} m: more than {:.0f} voxels of {:.4g} m. Wanted a larger voxel, or particles "
                                 "closer together (is one astray?)",
                                 box.sizes().maxCoeff(), kFarthest, voxel));
  return box;
}
}  // namespace

ParticleGrid::ParticleGrid(const geometry::Points& points, Real voxel, Real side, const ParticleGrid* last) {
  ZONE("skin.sort");
  const auto data = std::make_shared<Data>();
  data_ = data;
  data->voxel = voxel;
  data->side = side;
  const std::size_t n = points.size();
  const Box3 box = checked_box(points, voxel);
  if (n == 0) return;
  CHECK_LT(n, std::size_t{kNone});
  const Real block = 512 * voxel;
  const Vec3 origin = data->origin = block * (box.center() / block).array().round().matrix();
  const auto local = [&](std::size_t i) -> Vec3 { return (points.position[i] - origin) / voxel; };
  const auto radius_of = [&](std::size_t i) { return static_cast<float>(points.radius[i] / voxel); };

  // Of particles that are where they were, as large as they were: their column in `last`.
  const Data* before = last && last->data_->voxel == voxel && last->data_->side == side && last->data_->origin == origin ? last->data_.get() : nullptr;
  std::vector<Index> stays(before ? n : 0, kNone), staying(before ? before->columns.size() : 0, 0);
  if (before)
    parallel_for(
        before->columns.size(),
        [&](std::size_t c) {
          for (Index s = before->columns[c].begin; s < before->columns[c].end; ++s) {
            const Index i = before->point[s];
            if (i >= n || local(i) != before->x[s] || radius_of(i) != before->radius[s]) continue;
            stays[i] = static_cast<Index>(c);
            ++staying[c];
          }
        },
        64);

  // Columns in the order of their first particle, their particles counted.
  std::vector<Index> column(n), now_at(staying.size(), kNone), was_at;  // columns of `last` here, and these there
  std::vector<Column>& columns = data->columns;
  // Their numbers are looked up in a table as wide as all of them where that is no waste.
  const Vec3 lowest = (box.min() - origin) / voxel, highest = (box.max() - origin) / voxel;
  const int x0 = column_of(lowest.x()), y0 = column_of(lowest.y());
  const std::size_t wide = static_cast<std::size_t>(column_of(highest.y()) - y0) + 1, deep = static_cast<std::size_t>(column_of(highest.x()) - x0) + 1;
  std::vector<Index> numbers(wide * deep <= 4 * n ? wide * deep : 0, kNone);
  const auto number = [&](int cx, int cy) {
    Index* known = numbers.empty() ? nullptr : &numbers[static_cast<std::size_t>(cx - x0) * wide + static_cast<std::size_t>(cy - y0)];
    if (known && *known != kNone) return *known;
    const Index c = data->table.number(pack(cx, cy, 0));
    if (c == columns.size()) {
      columns.push_back({cx, cy, 0, 0});
      was_at.push_back(kNone);
    }
    if (known) *known = c;
    return c;
  };
  for (std::size_t i = 0; i < n; ++i) {
    Index current;
    if (before && stays[i] != kNone) {
      Index& there = now_at[stays[i]];
      if (there == kNone) {
        there = number(before->columns[stays[i]].x, before->columns[stays[i]].y);
        was_at[there] = stays[i];
      }
      current = there;
    } else {
      const Vec3 p = local(i);
      current = number(column_of(p.x()), column_of(p.y()));
    }
    column[i] = current;
    ++columns[current].end;
  }
  Index sum = 0;
  for (Column& c : columns) {
    const Index count = c.end;
    c.begin = c.end = sum;
    sum += count;
  }
  const auto count_of = [&](std::size_t c) { return (c + 1 < columns.size() ? columns[c + 1].begin : sum) - columns[c].begin; };
  // Columns with the same particles as before.
  std::vector<std::uint8_t> same(columns.size(), 0);
  for (std::size_t c = 0; c < columns.size(); ++c) {
    if (was_at[c] == kNone) continue;
    const Column& was = before->columns[was_at[c]];
    same[c] = was.end - was.begin == staying[was_at[c]] && staying[was_at[c]] == count_of(c);
  }
  struct Placed {
    Vec3 x;
    Index point;
  };
  std::vector<Placed> placed(n);
  for (std::size_t i = 0; i < n; ++i)
    if (!same[column[i]]) placed[columns[column[i]].end++] = {local(i), static_cast<Index>(i)};
  for (std::size_t c = 0; c < columns.size(); ++c) columns[c].end = columns[c].begin + count_of(c);

  data->x.resize(n);
  data->radius.resize(n);
  data->point.resize(n);
  // By height inside a column; the other coordinates decide between equals, so that the points' order does not matter.
  parallel_for(
      columns.size(),
      [&](std::size_t c) {
        const Index begin = columns[c].begin, end = columns[c].end;
        if (same[c]) {
          const Index from = before->columns[was_at[c]].begin;
          std::copy_n(&before->x[from], end - begin, &data->x[begin]);
          std::copy_n(&before->radius[from], end - begin, &data->radius[begin]);
          std::copy_n(&before->point[from], end - begin, &data->point[begin]);
        } else {
          const auto first = placed.begin() + begin, past = placed.begin() + end;
          const auto lower = [](const Placed& a, const Placed& b) {
            if (a.x.z() != b.x.z()) return a.x.z() < b.x.z();
            if (a.x.x() != b.x.x()) return a.x.x() < b.x.x();
            if (a.x.y() != b.x.y()) return a.x.y() < b.x.y();
            return a.point < b.point;
          };
          if (!std::is_sorted(first, past, lower)) std::sort(first, past, lower);  // particles born in rows are
          for (Index s = begin; s < end; ++s) {
            data->x[s] = placed[s].x;
            data->point[s] = placed[s].point;
            data->radius[s] = radius_of(placed[s].point);
          }
        }
      },
      64);
  take_carried(points, *data);
}

void ParticleGrid::take_carried(const geometry::Points& points, Data& data) {
  const std::size_t n = points.size();
  Carried& carried = data.carried;
  const auto carry = [&](std::size_t size, int width) {
    if (size == 0) return -1;
    CHECK_EQ(size, n);
    const int offset = carried.width;
    carried.width += width;
    return offset;
  };
  carried.temperature = carry(points.temperature.size(), 1);
  carried.velocity = carry(points.velocity.size(), 3);
  carried.crust = carry(points.crust.size(), 1);
  carried.age = carry(points.age.size(), 1);
  carried.rest = carry(points.rest.size(), 3);
  carried.rest2 = carry(points.rest2.size(), 3);
  CHECK_LE(carried.width, kMostCarried);
  if (carried.width == 0) return;
  data.values.resize(n * static_cast<std::size_t>(carried.width));
  parallel_for(
      n,
      [&](std::size_t s) {
        const std::size_t i = data.point[s];
        float* v = data.values.data() + s * static_cast<std::size_t>(carried.width);
        const auto put = [&](int offset, std::span<const Real> value) {
          if (offset >= 0) v[offset] = static_cast<float>(value[i]);
        };
        const auto put3 = [&](int offset, std::span<const Vec3> value) {
          for (int a = 0; a < 3; ++a)
            if (offset >= 0) v[offset + a] = static_cast<float>(value[i][a]);
        };
        put(carried.temperature, points.temperature);
        put3(carried.velocity, points.velocity);
        put(carried.crust, points.crust);
        put(carried.age, points.age);
        put3(carried.rest, points.rest);
        put3(carried.rest2, points.rest2);
      },
      2048);
}

int ParticleGrid::column_of(Real v) const {
  const Real columns = v / data_->side;
  const int towards_zero = static_cast<int>(columns);  // std::floor is a call, this one of the program's hottest
  return towards_zero - (columns < towards_zero);
}

Index ParticleGrid::first_above(const Column& column, Real z) const {
  const std::vector<Vec3>& x = data_->x;
  const auto first = std::upper_bound(x.begin() + column.begin, x.begin() + column.end, z, [](Real height, const Vec3& p) { return height < p.z(); });
  return static_cast<Index>(first - x.begin());
}

namespace {

using Carry = std::array<float, kMostCarried>;

/// Particles near a group of points: coordinates from the group's corner, numbers as differences from the first one's (so that
/// float does for coordinates far from the origin).
struct Nearby {
  std::vector<float> x, y, z;
  std::vector<Carry> values;
  void clear() {
    x.clear();
    y.clear();
    z.clear();
    values.clear();
  }
};

/// Weighted mean of the nearby numbers at (x, y, z); false when none is within reach. chosen: scratch, larger than nearby.
EFFUSE_CLONES bool weighted_mean(const Nearby& near, float x, float y, float z, float reach, std::vector<std::pair<Index, float>>& chosen,
                                 Carry& mean) {
  const float inverse = 1 / (reach * reach);
  std::size_t n = 0;
  for (std::size_t i = 0; i < near.x.size(); ++i) {
    const float dx = near.x[i] - x, dy = near.y[i] - y, dz = near.z[i] - z;
    const float t = 1 - (dx * dx + dy * dy + dz * dz) * inverse;
    chosen[n] = {static_cast<Index>(i), t};
    n += t > 0;
  }
  mean.fill(0);
  float weight = 0;
  for (std::size_t c = 0; c < n; ++c) {
    const float t = chosen[c].second, w = t * t * t;
    const Carry& v = near.values[chosen[c].first];
    weight += w;
    for (std::size_t a = 0; a < kMostCarried; ++a) mean[a] += w * v[a];
  }
  if (!(weight > 0)) return false;
  for (float& m : mean) m /= weight;
  return true;
}

}  // namespace

void ParticleGrid::average(std::span<const Vec3> points, Real reach, std::span<float> out) const {
  const std::size_t width = static_cast<std::size_t>(carried().width);
  const std::vector<Vec3>& x = data_->x;
  CHECK_EQ(out.size(), points.size() * width);
  if (width == 0 || points.empty()) return;
  CHECK(size() > 0);

  // Points in groups by cubes of 4 voxels.
  KeyTable table;
  std::vector<Index> group(points.size()), begin(1, 0);
  for (std::size_t p = 0; p < points.size(); ++p) {
    const auto cube = [&](int axis) { return static_cast<int>(std::floor(points[p][axis] / 4)); };
    group[p] = table.number(pack(cube(0), cube(1), cube(2)));
    if (table.size() == begin.size()) begin.push_back(0);
    ++begin[group[p] + 1];
  }
  for (std::size_t g = 1; g < begin.size(); ++g) begin[g] += begin[g - 1];
  std::vector<Index> filled(begin.begin(), begin.end() - 1), members(points.size());
  for (std::size_t p = 0; p < points.size(); ++p) members[filled[group[p]]++] = static_cast<Index>(p);

  parallel_ranges(table.size(), 16, [&](std::size_t from_group, std::size_t to_group) {
    Nearby near;
    std::vector<std::pair<Index, float>> chosen;
    for (std::size_t g = from_group; g < to_group; ++g) {
      const std::span<const Index> mine = std::span(members).subspan(begin[g], begin[g + 1] - begin[g]);
      Box3 box;
      for (const Index p : mine) box.extend(points[p]);
      const Vec3 low = box.min();
      std::size_t missing = mine.size();
      std::vector<std::uint8_t> found(mine.size(), 0);
      // The reach doubles for points that find nothing; it ends, there are particles somewhere.
      for (Real r = reach; missing > 0; r *= 2) {
        near.clear();
        Index first = kNone;
        runs(low - Vec3::Constant(r), box.max() + Vec3::Constant(r), [&](Index from, Index to) {
          for (Index i = from; i < to; ++i) {
            if (box.squaredExteriorDistance(x[i]) >= r * r) continue;
            if (first == kNone) first = i;
            near.x.push_back(static_cast<float>(x[i].x() - low.x()));
            near.y.push_back(static_cast<float>(x[i].y() - low.y()));
            near.z.push_back(static_cast<float>(x[i].z() - low.z()));
            Carry& v = near.values.emplace_back();
            for (std::size_t a = 0; a < width; ++a) v[a] = values(i)[a] - values(first)[a];
          }
        });
        chosen.resize(near.x.size() + 1);
        Carry mean;
        for (std::size_t m = 0; m < mine.size(); ++m) {
          if (found[m]) continue;
          const Vec3 p = points[mine[m]] - low;
          if (!weighted_mean(near, static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()), static_cast<float>(r),
                             chosen, mean))
            continue;
          found[m] = 1;
          --missing;
          for (std::size_t a = 0; a < width; ++a) out[mine[m] * width + a] = values(first)[a] + mean[a];
        }
      }
    }
  });
}

}  // namespace effuse::skin
