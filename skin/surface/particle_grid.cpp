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

void check_input(const geometry::Points& points, Real voxel) {
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
}
}  // namespace

ParticleGrid::ParticleGrid(const geometry::Points& points, Real voxel, Real side) : side_(side) {
  ZONE("skin.sort");
  check_input(points, voxel);
  const std::size_t n = points.size();
  if (n == 0) return;
  CHECK_LT(n, std::size_t{kNone});

  Box3 box;
  for (const Vec3& p : points.position) box.extend(p);
  const Real block = 512 * voxel;
  origin_ = block * (box.center() / block).array().round().matrix();

  // Columns in the order of their first particle, their particles counted, then placed.
  const auto local = [&](std::size_t i) -> Vec3 { return (points.position[i] - origin_) / voxel; };
  std::vector<Index> column(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3 p = local(i);
    const int cx = column_of(p.x()), cy = column_of(p.y());
    column[i] = table_.number(pack(cx, cy, 0));
    if (column[i] == columns_.size()) columns_.push_back({cx, cy, 0, 0});
    ++columns_[column[i]].end;
  }
  Index sum = 0;
  for (Column& c : columns_) {
    const Index count = c.end;
    c.begin = c.end = sum;
    sum += count;
  }
  std::vector<Index> order(n);
  for (std::size_t i = 0; i < n; ++i) order[columns_[column[i]].end++] = static_cast<Index>(i);

  // By height inside a column; the other coordinates decide between equals, so that the points' order does not matter.
  parallel_for(
      columns_.size(),
      [&](std::size_t c) {
        std::sort(order.begin() + columns_[c].begin, order.begin() + columns_[c].end, [&](Index i, Index j) {
          const Vec3 &p = points.position[i], &q = points.position[j];
          if (p.z() != q.z()) return p.z() < q.z();
          if (p.x() != q.x()) return p.x() < q.x();
          if (p.y() != q.y()) return p.y() < q.y();
          return i < j;
        });
      },
      64);

  const auto carry = [&](std::size_t size, int width) {
    if (size == 0) return -1;
    CHECK_EQ(size, n);
    const int offset = carried_.width;
    carried_.width += width;
    return offset;
  };
  carried_.temperature = carry(points.temperature.size(), 1);
  carried_.velocity = carry(points.velocity.size(), 3);
  carried_.crust = carry(points.crust.size(), 1);
  carried_.age = carry(points.age.size(), 1);
  carried_.rest = carry(points.rest.size(), 3);
  carried_.rest2 = carry(points.rest2.size(), 3);
  CHECK_LE(carried_.width, kMostCarried);

  x_.resize(n);
  radius_.resize(n);
  values_.resize(n * static_cast<std::size_t>(carried_.width));
  parallel_for(n, [&](std::size_t s) {
    const std::size_t i = order[s];
    x_[s] = local(i);
    radius_[s] = static_cast<float>(points.radius[i] / voxel);
    float* v = values_.data() + s * static_cast<std::size_t>(carried_.width);
    const auto put = [&](int offset, Real value) {
      if (offset >= 0) v[offset] = static_cast<float>(value);
    };
    const auto put3 = [&](int offset, std::span<const Vec3> value) {
      for (int a = 0; a < 3; ++a)
        if (offset >= 0) v[offset + a] = static_cast<float>(value[i][a]);
    };
    put(carried_.temperature, carried_.temperature < 0 ? 0 : points.temperature[i]);
    put3(carried_.velocity, points.velocity);
    put(carried_.crust, carried_.crust < 0 ? 0 : points.crust[i]);
    put(carried_.age, carried_.age < 0 ? 0 : points.age[i]);
    put3(carried_.rest, points.rest);
    put3(carried_.rest2, points.rest2);
  });
}

int ParticleGrid::column_of(Real v) const { return static_cast<int>(std::floor(v / side_)); }

Index ParticleGrid::first_above(const Column& column, Real z) const {
  const auto first =
      std::upper_bound(x_.begin() + column.begin, x_.begin() + column.end, z, [](Real height, const Vec3& p) { return height < p.z(); });
  return static_cast<Index>(first - x_.begin());
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
  const std::size_t width = static_cast<std::size_t>(carried_.width);
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
            if (box.squaredExteriorDistance(x_[i]) >= r * r) continue;
            if (first == kNone) first = i;
            near.x.push_back(static_cast<float>(x_[i].x() - low.x()));
            near.y.push_back(static_cast<float>(x_[i].y() - low.y()));
            near.z.push_back(static_cast<float>(x_[i].z() - low.z()));
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
