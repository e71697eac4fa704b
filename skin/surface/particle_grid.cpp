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

ParticleGrid::ParticleGrid(const geometry::Points& points, Real voxel, Real side) {
  ZONE("skin.sort");
  const auto data = std::make_shared<Data>();
  data_ = data;
  data->side = side;
  const std::size_t n = points.size();
  const Box3 box = checked_box(points, voxel);
  if (n == 0) return;
  CHECK_LT(n, std::size_t{kNone});
  const Real block = 512 * voxel;
  const Vec3 origin = data->origin = block * (box.center() / block).array().round().matrix();

  // Columns in the order of their first particle, their particles counted, then placed.
  const auto local = [&](const Vec3& p) -> Vec3 { return (p - origin) / voxel; };
  std::vector<Index> column(n);
  std::vector<Column>& columns = data->columns;
  // Their numbers are looked up in a table as wide as all of them where that is no waste.
  const Vec3 lowest = local(box.min()), highest = local(box.max());
  const int x0 = column_of(lowest.x()), y0 = column_of(lowest.y());
  const std::size_t wide = static_cast<std::size_t>(column_of(highest.y()) - y0) + 1, deep = static_cast<std::size_t>(column_of(highest.x()) - x0) + 1;
  std::vector<Index> numbers(wide * deep <= 4 * n ? wide * deep : 0, kNone);
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3 p = local(points.position[i]);
    const int cx = column_of(p.x()), cy = column_of(p.y());
    Index current;
    if (numbers.empty()) {
      current = data->table.number(pack(cx, cy, 0));
    } else {
      Index& known = numbers[static_cast<std::size_t>(cx - x0) * wide + static_cast<std::size_t>(cy - y0)];
      if (known == kNone) known = data->table.number(pack(cx, cy, 0));
      current = known;
    }
    if (current == columns.size()) columns.push_back({cx, cy, 0, 0});
    column[i] = current;
    ++columns[current].end;
  }
  Index sum = 0;
  for (Column& c : columns) {
    const Index count = c.end;
    c.begin = c.end = sum;
    sum += count;
  }
  struct Placed {
    Vec3 position;
    Index point;
  };
  std::vector<Placed> placed(n);
  for (std::size_t i = 0; i < n; ++i) placed[columns[column[i]].end++] = {points.position[i], static_cast<Index>(i)};

  const auto carry = [&](std::size_t size, int width) {
    if (size == 0) return -1;
    CHECK_EQ(size, n);
    const int offset = data->carried.width;
    data->carried.width += width;
    return offset;
  };
  Carried& carried = data->carried;
  carried.temperature = carry(points.temperature.size(), 1);
  carried.velocity = carry(points.velocity.size(), 3);
  carried.crust = carry(points.crust.size(), 1);
  carried.age = carry(points.age.size(), 1);
  carried.rest = carry(points.rest.size(), 3);
  carried.rest2 = carry(points.rest2.size(), 3);
  CHECK_LE(carried.width, kMostCarried);

  data->x.resize(n);
  data->radius.resize(n);
  data->values.resize(n * static_cast<std::size_t>(carried.width));
  const auto take = [&](std::size_t s) {
    const std::size_t i = placed[s].point;
    data->x[s] = local(placed[s].position);
    data->radius[s] = static_cast<float>(points.radius[i] / voxel);
    float* v = data->values.data() + s * static_cast<std::size_t>(carried.width);
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
  };
  // By height inside a column; the other coordinates decide between equals, so that the points' order does not matter.
  parallel_for(
      columns.size(),
      [&](std::size_t c) {
        const auto first = placed.begin() + columns[c].begin, end = placed.begin() + columns[c].end;
        const auto lower = [](const Placed& a, const Placed& b) {
          const Vec3 &p = a.position, &q = b.position;
          if (p.z() != q.z()) return p.z() < q.z();
          if (p.x() != q.x()) return p.x() < q.x();
          if (p.y() != q.y()) return p.y() < q.y();
          return a.point < b.point;
        };
        if (!std::is_sorted(first, end, lower)) std::sort(first, end, lower);  // particles born in rows are
        for (std::size_t s = columns[c].begin; s < columns[c].end; ++s) take(s);
      },
      64);
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
