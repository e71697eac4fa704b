#include "geometry/terrain/height_field.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/base/error.h"
#include "geometry/base/parallel.h"

namespace effuse::geometry {

namespace {

constexpr Real kNaN = std::numeric_limits<Real>::quiet_NaN();

/// Derivative along one direction at a post, from its neighbours before and after (NaN: none there).
Real difference(Real before, Real here, Real after, Real spacing) {
  const Real central = (after - before) / (2 * spacing);
  if (central == central) return central;
  const Real forward = (after - here) / spacing, backward = (here - before) / spacing;
  return forward == forward ? forward : backward == backward ? backward : 0;
}

/// Values at posts that have none become the mean of those of their eight neighbours that have one, ring after ring.
void fill_from_neighbours(int nx, int ny, std::vector<char>& known, std::vector<Vec2>& value) {
  const auto at = [&](int i, int j) { return static_cast<std::size_t>(j) * nx + i; };
  const auto neighbours = [&](std::size_t post, auto&& visit) {
    const int i = static_cast<int>(post % nx), j = static_cast<int>(post / nx);
    for (int dj = -1; dj <= 1; ++dj)
      for (int di = -1; di <= 1; ++di)
        if (i + di >= 0 && i + di < nx && j + dj >= 0 && j + dj < ny) visit(at(i + di, j + dj));
  };
  std::vector<char> queued(known);
  std::vector<std::size_t> ring, next;
  for (std::size_t post = 0; post < known.size(); ++post) {
    if (known[post]) continue;
    bool beside = false;
    neighbours(post, [&](std::size_t other) { beside |= known[other] != 0; });
    if (beside) ring.push_back(post), queued[post] = 1;
  }
  for (; !ring.empty(); ring.swap(next)) {
    for (std::size_t post : ring) {
      Vec2 sum = Vec2::Zero();
      int count = 0;
      neighbours(post, [&](std::size_t other) {
        if (known[other]) sum += value[other], ++count;
      });
      value[post] = sum / count;
    }
    next.clear();
    for (std::size_t post : ring) known[post] = 1;
    for (std::size_t post : ring)
      neighbours(post, [&](std::size_t other) {
        if (!queued[other]) next.push_back(other), queued[other] = 1;
      });
  }
}

}  // namespace

HeightField::HeightField(const Vec2& corner, const Vec2& spacing, int nx, int ny, std::vector<Real> z)
    : corner_(corner), spacing_(spacing), per_spacing_(spacing.cwiseInverse()), nx_(nx), ny_(ny), z_(std::move(z)) {
  std::vector<Fault> faults;
  const auto fault = [&](const std::string& message) { faults.push_back({Place{}, message}); };
  if (nx < 2 || ny < 2) fault(fmt::format("the grid has {} x {} posts, wanted at least 2 x 2", nx, ny));
  if (!corner.allFinite()) fault(fmt::format("the grid's corner is at ({}, {}), wanted finite numbers", corner.x(), corner.y()));
  if (!(spacing.x() > 0 && spacing.y() > 0) || !spacing.allFinite())
    fault(fmt::format("the posts are {} by {} m apart, wanted more than 0", spacing.x(), spacing.y()));
  if (nx >= 2 && ny >= 2 && z_.size() != static_cast<std::size_t>(nx) * static_cast<std::size_t>(ny))
    fault(fmt::format("{} heights for {} x {} posts, wanted {}", z_.size(), nx, ny, static_cast<std::size_t>(nx) * static_cast<std::size_t>(ny)));
  const auto infinite = std::find_if(z_.begin(), z_.end(), [](Real h) { return std::isinf(h); });
  if (infinite != z_.end()) fault(fmt::format("height {} is infinite, wanted a number or NaN for a hole", infinite - z_.begin()));
  if (!faults.empty()) throw InputError(std::move(faults));
  far_corner_ = {corner.x() + (nx - 1) * spacing.x(), corner.y() + (ny - 1) * spacing.y()};

  // Which posts carry ground, how far it reaches, how steep it is.
  std::vector<char> ground(z_.size(), 0);
  Real steepest2 = 0;
  for (int j = 0; j + 1 < ny; ++j) {
    for (int i = 0; i + 1 < nx; ++i) {
      if (!whole(i, j)) {
        ++holes_;
        continue;
      }
      for (int dj = 0; dj <= 1; ++dj) {
        for (int di = 0; di <= 1; ++di) {
          ground[static_cast<std::size_t>(j + dj) * nx + i + di] = 1;
          bounds_.extend(Vec3(corner.x() + (i + di) * spacing.x(), corner.y() + (j + dj) * spacing.y(), post(i + di, j + dj)));
          // |grad h|^2 is convex in a bilinear cell: its largest value is at a corner.
          const Real along_x = (post(i + 1, j + dj) - post(i, j + dj)) / spacing.x(), along_y = (post(i + di, j + 1) - post(i + di, j)) / spacing.y();
          steepest2 = std::max(steepest2, along_x * along_x + along_y * along_y);
        }
      }
    }
  }
  if (bounds_.isEmpty()) throw InputError(Place{}, fmt::format("none of the {} x {} posts stand four together with a height: there is no ground", nx, ny));
  max_slope_ = std::sqrt(steepest2);

  slope_.resize(z_.size(), Vec2::Zero());
  parallel_for(static_cast<std::size_t>(ny), [&](std::size_t row) {
    const int j = static_cast<int>(row);
    for (int i = 0; i < nx; ++i) {
      if (!ground[row * nx + i]) continue;
      slope_[row * nx + i] = {difference(i > 0 ? post(i - 1, j) : kNaN, post(i, j), i + 1 < nx ? post(i + 1, j) : kNaN, spacing_.x()),
                              difference(j > 0 ? post(i, j - 1) : kNaN, post(i, j), j + 1 < ny ? post(i, j + 1) : kNaN, spacing_.y())};
    }
  }, 16);
  if (holes_ > 0) fill_from_neighbours(nx, ny, ground, slope_);
}

std::optional<HeightField::Cell> HeightField::cell_beside_hole(Real u, Real v, int i, int j) const {
  // A point on the line between cells may lie in another one; which side it falls on is up to rounding.
  constexpr Real kOnLine = 1e-9;  // [cells], far above the rounding of u and v
  const int line_i = static_cast<int>(std::lround(u)), line_j = static_cast<int>(std::lround(v));
  const int i_low = std::abs(u - line_i) <= kOnLine ? std::max(line_i - 1, 0) : i, i_high = std::abs(u - line_i) <= kOnLine ? std::min(line_i, nx_ - 2) : i;
  const int j_low = std::abs(v - line_j) <= kOnLine ? std::max(line_j - 1, 0) : j, j_high = std::abs(v - line_j) <= kOnLine ? std::min(line_j, ny_ - 2) : j;
  for (int jj = j_high; jj >= j_low; --jj)
    for (int ii = i_high; ii >= i_low; --ii)
      if (whole(ii, jj)) return Cell{ii, jj};
  return std::nullopt;
}

Real HeightField::height(Real x, Real y) const {
  const auto c = cell(x, y);
  return c ? height(*c, x, y) : kNaN;
}

Vec3 HeightField::normal(Real x, Real y) const { return covers(x, y) ? extended_normal(x, y) : Vec3(Vec3::Constant(kNaN)); }

bool HeightField::splits_rising(int i, int j) const {
  return std::abs(post(i + 1, j + 1) - post(i, j)) <= std::abs(post(i, j + 1) - post(i + 1, j));
}

TriMesh HeightField::mesh() const {
  TriMesh mesh;
  constexpr Index kUnused = std::numeric_limits<Index>::max();
  std::vector<Index> vertex(z_.size(), kUnused);
  const auto at = [&](int i, int j) {
    Index& index = vertex[static_cast<std::size_t>(j) * nx_ + i];
    if (index == kUnused) {
      const Real x = corner_.x() + i * spacing_.x(), y = corner_.y() + j * spacing_.y();
      index = static_cast<Index>(mesh.positions.size());
      mesh.positions.emplace_back(x, y, post(i, j));
      mesh.normals.push_back(Vec3(-slope_[static_cast<std::size_t>(j) * nx_ + i].x(), -slope_[static_cast<std::size_t>(j) * nx_ + i].y(), 1).normalized());
    }
    return index;
  };
  for (int j = 0; j + 1 < ny_; ++j) {
    for (int i = 0; i + 1 < nx_; ++i) {
      if (!whole(i, j)) continue;
      const Index sw = at(i, j), se = at(i + 1, j), nw = at(i, j + 1), ne = at(i + 1, j + 1);
      if (splits_rising(i, j)) {
        mesh.triangles.push_back({sw, se, ne});
        mesh.triangles.push_back({sw, ne, nw});
      } else {
        mesh.triangles.push_back({sw, se, nw});
        mesh.triangles.push_back({se, ne, nw});
      }
    }
  }
  return mesh;
}

}  // namespace effuse::geometry
