#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/zones.h"
#include "geometry/terrain/triangulate.h"

namespace effuse::geometry {

namespace {

constexpr Real kOnEdge = 2e-4;  // [posts]: posts on edges belong to both triangles, also where files hold positions as float

/// The field, asked in posts: u, v count from its corner.
class Grid {
 public:
  explicit Grid(const HeightField& field) : field_(field) {}
  Vec3 in_posts(const Vec3& p) const {
    return {(p.x() - field_.corner().x()) / field_.spacing().x(), (p.y() - field_.corner().y()) / field_.spacing().y(), p.z()};
  }
  /// Height of the cell that the middle of a short piece lies in.
  Real height(const Vec2& middle, const Vec2& p) const {
    const int i = std::clamp(static_cast<int>(std::floor(middle.x())), 0, field_.nx() - 2), j = std::clamp(static_cast<int>(std::floor(middle.y())), 0, field_.ny() - 2);
    const Real u = p.x() - i, v = p.y() - j;
    const Real south = field_.post(i, j) + u * (field_.post(i + 1, j) - field_.post(i, j));
    const Real north = field_.post(i, j + 1) + u * (field_.post(i + 1, j + 1) - field_.post(i, j + 1));
    return south + v * (north - south);
  }

 private:
  const HeightField& field_;
};

/// Largest |difference| along the edge a -> b (in posts).
Real along_edge(const Grid& grid, const Vec3& a, const Vec3& b) {
  // Where it meets the grid's lines.
  std::vector<Real> cuts = {0, 1};
  for (const int axis : {0, 1}) {
    const Real d = b[axis] - a[axis];
    if (d == 0) continue;
    const auto low = static_cast<long>(std::ceil(std::min(a[axis], b[axis]))), high = static_cast<long>(std::floor(std::max(a[axis], b[axis])));
    for (long line = low; line <= high; ++line) cuts.push_back(std::clamp((static_cast<Real>(line) - a[axis]) / d, Real{0}, Real{1}));
  }
  std::sort(cuts.begin(), cuts.end());
  Real largest = 0;
  for (std::size_t k = 0; k + 1 < cuts.size(); ++k) {
    const Real t0 = cuts[k], t1 = cuts[k + 1], tm = (t0 + t1) / 2;
    if (t1 - t0 < 1e-12) continue;
    const Vec2 middle = (a + tm * (b - a)).head<2>();
    const auto difference = [&](Real t) {
      const Vec3 p = a + t * (b - a);
      return p.z() - grid.height(middle, p.head<2>());
    };
    // A parabola through three values: its ends, and its summit where that lies between.
    const Real f0 = difference(t0), fm = difference(tm), f1 = difference(t1);
    const Real curvature = f0 - 2 * fm + f1, slope = (f1 - f0) / 2;
    for (const Real f : {f0, f1})
      if (!std::isnan(f)) largest = std::max(largest, std::abs(f));
    if (curvature != 0 && std::abs(slope) < std::abs(curvature)) largest = std::max(largest, std::abs(fm - slope * slope / (2 * curvature)));
  }
  return largest;
}

}  // namespace

VerticalError vertical_error(const HeightField& field, const TriMesh& mesh) {
  ZONE("terrain.vertical_error");
  const Grid grid(field);
  VerticalError error;
  std::vector<char> covered(field.posts().size(), 0);
  for (const auto& [ia, ib, ic] : mesh.triangles) {
    CHECK(ia < mesh.positions.size() && ib < mesh.positions.size() && ic < mesh.positions.size());
    const Vec3 a = grid.in_posts(mesh.positions[ia]), b = grid.in_posts(mesh.positions[ib]), c = grid.in_posts(mesh.positions[ic]);
    const Real det = (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
    if (det == 0) continue;
    // Barycentric coordinates change by a side's length over the area with each post.
    const Real slack_b = kOnEdge * (c - a).head<2>().norm() / std::abs(det), slack_c = kOnEdge * (b - a).head<2>().norm() / std::abs(det), slack_a = kOnEdge * (c - b).head<2>().norm() / std::abs(det);
    const int i0 = std::max(0, static_cast<int>(std::ceil(std::min({a.x(), b.x(), c.x()}) - kOnEdge))), i1 = std::min(field.nx() - 1, static_cast<int>(std::floor(std::max({a.x(), b.x(), c.x()}) + kOnEdge)));
    const int j0 = std::max(0, static_cast<int>(std::ceil(std::min({a.y(), b.y(), c.y()}) - kOnEdge))), j1 = std::min(field.ny() - 1, static_cast<int>(std::floor(std::max({a.y(), b.y(), c.y()}) + kOnEdge)));
    for (int j = j0; j <= j1; ++j)
      for (int i = i0; i <= i1; ++i) {
        const Real wb = ((i - a.x()) * (c.y() - a.y()) - (j - a.y()) * (c.x() - a.x())) / det;
        const Real wc = ((b.x() - a.x()) * (j - a.y()) - (b.y() - a.y()) * (i - a.x())) / det;
        if (wb < -slack_b || wc < -slack_c || wb + wc > 1 + slack_a) continue;
        const Real difference = std::abs(a.z() + wb * (b.z() - a.z()) + wc * (c.z() - a.z()) - field.post(i, j));
        if (std::isnan(difference)) continue;
        covered[static_cast<std::size_t>(j) * static_cast<std::size_t>(field.nx()) + static_cast<std::size_t>(i)] = 1;
        if (difference <= error.at_posts) continue;
        error.at_posts = difference;
        error.where = field.corner() + Vec2(i * field.spacing().x(), j * field.spacing().y());
      }
    // Each edge once: a border's own triangle has it alone.
    for (const auto& [p, q] : {std::pair{&a, &b}, {&b, &c}, {&c, &a}}) error.between = std::max(error.between, along_edge(grid, *p, *q));
  }
  error.between = std::max(error.between, error.at_posts);
  for (int j = 0; j + 1 < field.ny(); ++j)
    for (int i = 0; i + 1 < field.nx(); ++i) {
      if (!field.whole(i, j)) continue;
      for (const std::size_t post : {static_cast<std::size_t>(j) * static_cast<std::size_t>(field.nx()) + static_cast<std::size_t>(i)})
        for (const std::size_t of : {post, post + 1, post + static_cast<std::size_t>(field.nx()), post + static_cast<std::size_t>(field.nx()) + 1}) {
          error.uncovered += !covered[of];
          covered[of] = 1;
        }
    }
  return error;
}

Real twist_error(const HeightField& field) {
  Real largest = 0;
  for (int j = 0; j + 1 < field.ny(); ++j)
    for (int i = 0; i + 1 < field.nx(); ++i)
      if (field.whole(i, j)) largest = std::max(largest, std::abs(field.post(i, j) - field.post(i + 1, j) - field.post(i, j + 1) + field.post(i + 1, j + 1)) / 4);
  return largest;
}

}  // namespace effuse::geometry
