#include "geometry/terrain/triangulate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <queue>
#include <utility>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/base/zones.h"
#include "geometry/terrain/delaunay_internal.h"

namespace effuse::geometry {

namespace {

using Point = Delaunay::Point;

std::int64_t floor_div(std::int64_t a, std::int64_t b) {  // b > 0
  const std::int64_t q = a / b;
  return q - (a % b < 0);
}
std::int64_t ceil_div(std::int64_t a, std::int64_t b) { return -floor_div(-a, b); }

/// Calls visit(j, i0, i1) for every row j of posts in the closed triangle abc (in any order of corners), columns i0..i1.
template <class Visit>
void for_rows(Point a, Point b, Point c, Visit&& visit) {
  if (a.y > b.y) std::swap(a, b);
  if (b.y > c.y) std::swap(b, c);
  if (a.y > b.y) std::swap(a, b);
  // On the long side a -> c and the two short ones, x = x0 + (j - y0) dx / dy.
  const bool bulges_left = std::int64_t{c.x - a.x} * (b.y - a.y) - std::int64_t{c.y - a.y} * (b.x - a.x) > 0;
  for (std::int32_t j = a.y; j <= c.y; ++j) {
    const Point& p = j < b.y || b.y == c.y ? a : b;
    const Point& q = j < b.y || b.y == c.y ? b : c;
    if (c.y == a.y) continue;  // no area
    const std::int64_t long_dy = c.y - a.y, long_at = std::int64_t{a.x} * long_dy + std::int64_t{j - a.y} * (c.x - a.x);
    const std::int64_t short_dy = q.y - p.y;
    std::int64_t i0, i1;
    if (short_dy == 0) {  // the row of a flat side: its ends bound it
      i0 = std::min(p.x, q.x), i1 = std::max(p.x, q.x);
    } else {
      const std::int64_t short_at = std::int64_t{p.x} * short_dy + std::int64_t{j - p.y} * (q.x - p.x);
      i0 = bulges_left ? ceil_div(short_at, short_dy) : ceil_div(long_at, long_dy);
      i1 = bulges_left ? floor_div(long_at, long_dy) : floor_div(short_at, short_dy);
    }
    if (i0 <= i1) visit(j, static_cast<int>(i0), static_cast<int>(i1));
  }
}

/// A height for every place: z + a (i - i0) + b (j - j0).
struct Plane {
  Real i0, j0, z, a, b;
  Plane(const std::array<Point, 3>& p, const std::array<Real, 3>& heights) : i0(p[0].x), j0(p[0].y), z(heights[0]) {
    const Real ux = p[1].x - p[0].x, uy = p[1].y - p[0].y, vx = p[2].x - p[0].x, vy = p[2].y - p[0].y;
    const Real det = ux * vy - uy * vx, du = heights[1] - z, dv = heights[2] - z;
    a = (du * vy - dv * uy) / det;
    b = (ux * dv - vx * du) / det;
  }
  Real operator()(Real i, Real j) const { return z + a * (i - i0) + b * (j - j0); }
};

/// The post that a triangle misses most.
struct Worst {
  Real error = 0;
  Point at{0, 0};
};

class Greedy {
 public:
  Greedy(const HeightField& field, Real max_error) : field_(field), max_error_(max_error), mesh_(field.nx() - 1, field.ny() - 1) {}

  TriMesh run() {
    add_rims();
    // Every triangle's worst post; from here on only of those that change.
    worst_.resize(static_cast<std::size_t>(mesh_.triangles()));
    parallel_for(worst_.size(), [&](std::size_t t) { worst_[t] = worst_of(static_cast<std::int32_t>(t)); }, 16);
    stamp_.assign(worst_.size(), 0);
    for (std::size_t t = 0; t < worst_.size(); ++t) push(static_cast<std::int32_t>(t));
    std::vector<std::int32_t> touched;
    while (!heap_.empty()) {
      const Entry top = heap_.top();
      heap_.pop();
      if (top.stamp != stamp_[static_cast<std::size_t>(top.triangle)]) continue;  // it has changed since
      touched.clear();
      mesh_.insert(worst_[static_cast<std::size_t>(top.triangle)].at, top.triangle, touched);
      std::sort(touched.begin(), touched.end());
      touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
      worst_.resize(static_cast<std::size_t>(mesh_.triangles()));
      stamp_.resize(worst_.size(), 0);
      for (const std::int32_t t : touched) {
        worst_[static_cast<std::size_t>(t)] = worst_of(t);
        ++stamp_[static_cast<std::size_t>(t)];
        push(t);
      }
    }
    return result();
  }

 private:
  struct Entry {
    Real error;
    std::int32_t triangle;
    std::uint32_t stamp;
    bool operator<(const Entry& other) const { return error != other.error ? error < other.error : triangle > other.triangle; }
  };

  void push(std::int32_t t) {
    const Worst& worst = worst_[static_cast<std::size_t>(t)];
    if (worst.error > max_error_) heap_.push({worst.error, t, stamp_[static_cast<std::size_t>(t)]});
  }

  bool whole(int i, int j) const { return i >= 0 && j >= 0 && i < field_.nx() - 1 && j < field_.ny() - 1 && field_.whole(i, j); }

  /// Posts where ground and holes meet become vertices, in an order that no walk or flip is long in.
  void add_rims() {
    if (field_.holes() == 0) return;
    std::vector<std::pair<std::uint64_t, Point>> rims;
    for (int j = 0; j < field_.ny(); ++j)
      for (int i = 0; i < field_.nx(); ++i) {
        int ground = 0, cells = 0;
        for (const int y : {j - 1, j})
          for (const int x : {i - 1, i}) {
            if (x < 0 || y < 0 || x >= field_.nx() - 1 || y >= field_.ny() - 1) continue;
            ++cells;
            ground += field_.whole(x, y);
          }
        const bool corner = (i == 0 || i == field_.nx() - 1) && (j == 0 || j == field_.ny() - 1);
        if (ground > 0 && ground < cells && !corner) rims.push_back({random_bits(1, 0, static_cast<std::uint64_t>(j) * static_cast<std::uint64_t>(field_.nx()) + static_cast<std::uint64_t>(i)), {i, j}});
      }
    std::sort(rims.begin(), rims.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    std::vector<std::int32_t> touched;
    std::int32_t near = 0;
    for (const auto& [key, post] : rims) {
      touched.clear();
      mesh_.insert(post, near, touched);
      near = touched.front();
    }
  }

  /// Whether a triangle lies on ground: then all of it does, since the rims of holes are edges.
  bool on_ground(const std::array<Point, 3>& p) const {
    // A cell it shares some area with: beside its first corner, towards the middle of the opposite side.
    const int dx = p[1].x + p[2].x - 2 * p[0].x, dy = p[1].y + p[2].y - 2 * p[0].y;
    const int i = dx > 0 || (dx == 0 && p[0].x == 0) ? p[0].x : p[0].x - 1, j = dy > 0 || (dy == 0 && p[0].y == 0) ? p[0].y : p[0].y - 1;
    return whole(i, j);
  }

  std::array<Point, 3> points_of(std::int32_t t) const {
    const auto v = mesh_.triangle(t);
    return {mesh_.point(v[0]), mesh_.point(v[1]), mesh_.point(v[2])};
  }

  Worst worst_of(std::int32_t t) const {
    const std::array<Point, 3> p = points_of(t);
    Worst worst;
    if (!on_ground(p)) return worst;
    const Plane plane(p, {field_.post(p[0].x, p[0].y), field_.post(p[1].x, p[1].y), field_.post(p[2].x, p[2].y)});
    for_rows(p[0], p[1], p[2], [&](int j, int i0, int i1) {
      const Real* z = field_.posts().data() + static_cast<std::size_t>(j) * static_cast<std::size_t>(field_.nx());
      const Real start = plane(0, j);
      for (int i = i0; i <= i1; ++i) {
        const Real error = std::abs(z[i] - (start + plane.a * i));
        if (error > worst.error) worst = {error, {i, j}};
      }
    });
    // A corner is no candidate: its error is rounding.
    for (const Point& corner : p)
      if (worst.at.x == corner.x && worst.at.y == corner.y) worst.error = 0;
    return worst;
  }

  TriMesh result() const {
    TriMesh mesh;
    constexpr Index kUnused = std::numeric_limits<Index>::max();
    std::vector<Index> number(static_cast<std::size_t>(mesh_.vertices()), kUnused);
    for (std::int32_t t = 0; t < mesh_.triangles(); ++t) {
      if (!on_ground(points_of(t))) continue;
      Triangle triangle{};
      const auto corners = mesh_.triangle(t);
      for (std::size_t k = 0; k < 3; ++k) {
        Index& index = number[static_cast<std::size_t>(corners[k])];
        if (index == kUnused) {
          index = static_cast<Index>(mesh.positions.size());
          const Point p = mesh_.point(corners[k]);
          const Real x = field_.corner().x() + p.x * field_.spacing().x(), y = field_.corner().y() + p.y * field_.spacing().y();
          mesh.positions.emplace_back(x, y, field_.post(p.x, p.y));
          mesh.normals.push_back(field_.extended_normal(x, y));
        }
        triangle[k] = index;
      }
      mesh.triangles.push_back(triangle);
    }
    return mesh;
  }

  const HeightField& field_;
  Real max_error_;
  Delaunay mesh_;
  std::vector<Worst> worst_;
  std::vector<std::uint32_t> stamp_;
  std::priority_queue<Entry> heap_;
};

}  // namespace

TriMesh triangulate(const HeightField& field, Real max_error) {
  ZONE("terrain.triangulate");
  CHECK(max_error >= 0 && std::isfinite(max_error));
  // Planes are worked out to rounding: a post that lies max_error off exactly, as those of whole metres do, may stay.
  const Real rounding = 1e-11 * (1 + std::max(std::abs(field.bounds().min().z()), std::abs(field.bounds().max().z())));
  return Greedy(field, max_error + rounding).run();
}

}  // namespace effuse::geometry
