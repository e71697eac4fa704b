#include "importers/terrain/resample.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::importers {

namespace {

constexpr Real kNaN = std::numeric_limits<Real>::quiet_NaN();
constexpr Real kKnotDistance = 200;  // [m]: over it, a map's curvature moves a point by d^2 / (8 * 6400 km) = 1 mm
constexpr Real kOnBorder = 1e-6;     // [cells]: rounding of a transform there and back

int step_for(Real spacing, int n) { return std::clamp(static_cast<int>(kKnotDistance / spacing), 1, std::max(1, n - 1)); }

/// Heights of a window by the raster's own columns and rows.
class Sampler {
 public:
  Sampler(const RasterCells& cells, const RasterFrame& frame) : cells_(cells), frame_(frame) {}

  Real value(int c, int r) const {
    const int column = c - cells_.window.column, row = r - cells_.window.row;
    if (column < 0 || row < 0 || column >= cells_.window.columns || row >= cells_.window.rows) return kNaN;
    return cells_.values[static_cast<std::size_t>(row) * static_cast<std::size_t>(cells_.window.columns) + static_cast<std::size_t>(column)];
  }
  bool inside(const Vec2& p) const {
    return p.x() >= -kOnBorder && p.y() >= -kOnBorder && p.x() <= frame_.columns - 1 + kOnBorder && p.y() <= frame_.rows - 1 + kOnBorder;
  }
  Real nearest(const Vec2& p) const { return value(static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y()))); }
  Real bilinear(const Vec2& p) const {
    const auto [c, u] = split(p.x(), frame_.columns);
    const auto [r, v] = split(p.y(), frame_.rows);
    const Real top = mix(value(c, r), u > 0 ? value(c + 1, r) : 0, u);
    return mix(top, v > 0 ? mix(value(c, r + 1), u > 0 ? value(c + 1, r + 1) : 0, u) : 0, v);
  }
  Real cubic(const Vec2& p) const {
    const auto [c, u] = split(p.x(), frame_.columns);
    const auto [r, v] = split(p.y(), frame_.rows);
    const std::array<Real, 4> wu = weights(u), wv = weights(v);
    Real sum = 0;
    for (int k = 0; k < 4; ++k)
      for (int l = 0; l < 4; ++l) sum += wv[static_cast<std::size_t>(k)] * wu[static_cast<std::size_t>(l)] * value(c + l - 1, r + k - 1);
    return std::isnan(sum) ? bilinear(p) : sum;
  }
  /// Mean of the bilinear surface over a square of that many cells.
  Real average(const Vec2& p, Real width) const {
    const int n = std::max(1, static_cast<int>(std::ceil(width)));
    if (std::isnan(bilinear(p))) return kNaN;
    Real sum = 0;
    int count = 0;
    for (int k = 0; k < n; ++k)
      for (int l = 0; l < n; ++l) {
        const Vec2 at(p.x() + width * ((l + 0.5) / n - 0.5), p.y() + width * ((k + 0.5) / n - 0.5));
        if (!inside(at)) continue;
        const Real z = bilinear(at);
        if (!std::isnan(z)) sum += z, ++count;
      }
    return count > 0 ? sum / count : bilinear(p);
  }

 private:
  struct Split {
    int cell;
    Real fraction;
  };
  static Split split(Real x, int n) {
    x = std::clamp(x, Real{0}, Real(n - 1));
    // A post that falls on a cell's centre takes its height, whatever its neighbours are.
    const Real whole = std::round(x);
    if (std::abs(x - whole) < kOnBorder) return {static_cast<int>(whole), 0};
    return {static_cast<int>(std::floor(x)), x - std::floor(x)};
  }
  static Real mix(Real a, Real b, Real t) { return t > 0 ? a + t * (b - a) : a; }
  static std::array<Real, 4> weights(Real t) {
    const Real t2 = t * t, t3 = t2 * t;
    return {(-t3 + 2 * t2 - t) / 2, (3 * t3 - 5 * t2 + 2) / 2, (-3 * t3 + 4 * t2 + t) / 2, (t3 - t2) / 2};
  }

  const RasterCells& cells_;
  const RasterFrame& frame_;
};

}  // namespace

CellMap::CellMap(const PostLattice& posts, const RasterFrame& frame, const CrsTransform* raster_from_posts) : posts_(posts), frame_(frame) {
  CHECK(posts.nx >= 1 && posts.ny >= 1);
  step_x_ = step_for(posts.spacing.x(), posts.nx);
  step_y_ = step_for(posts.spacing.y(), posts.ny);
  // One knot beyond the last post where the steps do not come out even.
  knots_x_ = (posts.nx - 1 + step_x_ - 1) / step_x_ + 1;
  const int knots_y = (posts.ny - 1 + step_y_ - 1) / step_y_ + 1;
  knots_.reserve(static_cast<std::size_t>(knots_x_) * static_cast<std::size_t>(knots_y));
  for (int l = 0; l < knots_y; ++l)
    for (int k = 0; k < knots_x_; ++k) knots_.push_back(posts.at(k * step_x_, l * step_y_));
  if (raster_from_posts) (*raster_from_posts)(knots_);
  for (Vec2& knot : knots_) knot = frame.cell(knot);
}

Vec2 CellMap::operator()(int i, int j) const {
  const int k = i / step_x_, l = j / step_y_;
  const Real u = static_cast<Real>(i - k * step_x_) / step_x_, v = static_cast<Real>(j - l * step_y_) / step_y_;
  const Vec2* knot = knots_.data() + static_cast<std::size_t>(l) * static_cast<std::size_t>(knots_x_) + static_cast<std::size_t>(k);
  const Vec2 south = u > 0 ? Vec2(knot[0] + u * (knot[1] - knot[0])) : knot[0];
  if (!(v > 0)) return south;
  knot += knots_x_;
  const Vec2 north = u > 0 ? Vec2(knot[0] + u * (knot[1] - knot[0])) : knot[0];
  return south + v * (north - south);
}

std::optional<CellWindow> CellMap::window(int margin) const {
  Vec2 low = Vec2::Constant(std::numeric_limits<Real>::infinity()), high = -low;
  for (const Vec2& knot : knots_) {
    if (!knot.allFinite()) continue;
    low = low.cwiseMin(knot);
    high = high.cwiseMax(knot);
  }
  const auto from = [&](Real x, int n) { return static_cast<int>(std::clamp(std::floor(x) - margin, Real{0}, Real(n))); };
  const auto to = [&](Real x, int n) { return static_cast<int>(std::clamp(std::ceil(x) + margin + 1, Real{0}, Real(n))); };
  if (!(low.x() <= high.x())) return std::nullopt;
  const int c0 = from(low.x(), frame_.columns), c1 = to(high.x(), frame_.columns), r0 = from(low.y(), frame_.rows), r1 = to(high.y(), frame_.rows);
  if (c0 >= c1 || r0 >= r1) return std::nullopt;
  return CellWindow{c0, r0, c1 - c0, r1 - r0};
}

Resampled resample(const CellMap& map, const RasterCells& cells, Resampling method, Real cells_per_post) {
  ZONE("import.resample");
  const PostLattice& posts = map.posts();
  if (method == Resampling::kAuto) method = cells_per_post > 1.5 ? Resampling::kAverage : Resampling::kBilinear;
  const Sampler sampler(cells, map.frame());
  Resampled out;
  out.z.assign(posts.posts(), kNaN);
  out.beside.assign(posts.posts(), 0);
  std::vector<std::size_t> outside(static_cast<std::size_t>(posts.ny), 0);
  parallel_for(
      static_cast<std::size_t>(posts.ny),
      [&](std::size_t row) {
        const int j = static_cast<int>(row);
        for (int i = 0; i < posts.nx; ++i) {
          const Vec2 p = map(i, j);
          if (!p.allFinite() || !sampler.inside(p)) {
            ++outside[row];
            out.beside[row * static_cast<std::size_t>(posts.nx) + static_cast<std::size_t>(i)] = 1;
            continue;
          }
          Real& z = out.z[row * static_cast<std::size_t>(posts.nx) + static_cast<std::size_t>(i)];
          switch (method) {
            case Resampling::kNearest: z = sampler.nearest(p); break;
            case Resampling::kCubic: z = sampler.cubic(p); break;
            case Resampling::kAverage: z = sampler.average(p, cells_per_post); break;
            default: z = sampler.bilinear(p);
          }
        }
      },
      4);
  for (const std::size_t n : outside) out.outside += n;
  return out;
}

}  // namespace effuse::importers
