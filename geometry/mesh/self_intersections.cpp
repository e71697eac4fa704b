#include "geometry/mesh/self_intersections.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/box_intersection_d.h>
#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "geometry/mesh/weld.h"

namespace effuse::geometry {

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;

/// A triangle's bounds, as box_intersection_d wants them.
class Box {
 public:
  using NT = double;
  using ID = std::size_t;
  static int dimension() { return 3; }

  Box() = default;
  Box(const TriMesh& mesh, Index triangle) : triangle_(triangle) {
    for (int axis = 0; axis < 3; ++axis) {
      const auto x = [&](std::size_t corner) { return mesh.positions[mesh.triangles[triangle][corner]][axis]; };
      low_[static_cast<std::size_t>(axis)] = std::min({x(0), x(1), x(2)});
      high_[static_cast<std::size_t>(axis)] = std::max({x(0), x(1), x(2)});
    }
  }
  ID id() const { return triangle_; }
  Index triangle() const { return triangle_; }
  NT min_coord(int axis) const { return low_[static_cast<std::size_t>(axis)]; }
  NT max_coord(int axis) const { return high_[static_cast<std::size_t>(axis)]; }

 private:
  std::array<double, 3> low_{}, high_{};
  Index triangle_ = 0;
};

struct Enough {};  // ends a search

class Meeting {
 public:
  explicit Meeting(const TriMesh& mesh) : mesh_(mesh), first_(first_coincident(mesh.positions)) {}

  bool degenerate(Index t) const {
    const Triangle v = corners(t);
    return v[0] == v[1] || v[1] == v[2] || v[2] == v[0] || CGAL::collinear(point(v[0]), point(v[1]), point(v[2]));
  }

  bool operator()(Index s, Index t) const {
    const Triangle a = corners(s), b = corners(t);
    // Corners they share: of a, and which of b they are.
    std::array<std::size_t, 3> in_a{}, in_b{};
    std::size_t shared = 0;
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j)
        if (a[i] == b[j]) {
          in_a[shared] = i;
          in_b[shared++] = j;
        }
    switch (shared) {
      case 0:
        return CGAL::do_intersect(triangle(a), triangle(b));
      case 1:
        // Each has the shared corner; more in common means that the side opposite to it, of one of them, meets the other.
        return CGAL::do_intersect(triangle(b), opposite(a, in_a[0])) || CGAL::do_intersect(triangle(a), opposite(b, in_b[0]));
      case 2: {
        const Point p = point(a[in_a[0]]), q = point(a[in_a[1]]);
        const Point c = point(a[3 - in_a[0] - in_a[1]]), d = point(b[3 - in_b[0] - in_b[1]]);
        return CGAL::coplanar(p, q, c, d) && CGAL::coplanar_orientation(p, q, c, d) == CGAL::POSITIVE;
      }
      default:
        return true;
    }
  }

 private:
  Point point(Index v) const {
    const Vec3& x = mesh_.positions[v];
    return {x.x(), x.y(), x.z()};
  }
  Kernel::Triangle_3 triangle(const Triangle& t) const { return {point(t[0]), point(t[1]), point(t[2])}; }
  Kernel::Segment_3 opposite(const Triangle& t, std::size_t corner) const { return {point(t[(corner + 1) % 3]), point(t[(corner + 2) % 3])}; }

  /// Each the first vertex at its place.
  Triangle corners(Index t) const {
    const Triangle& v = mesh_.triangles[t];
    return {first_[v[0]], first_[v[1]], first_[v[2]]};
  }

  const TriMesh& mesh_;
  std::vector<Index> first_;
};

}  // namespace

std::vector<std::array<Index, 2>> self_intersections(const TriMesh& mesh, std::size_t at_most) {
  ZONE("mesh.self_intersections");
  for (const Vec3& x : mesh.positions) CHECK(x.allFinite());
  for (const Triangle& t : mesh.triangles)
    for (const Index v : t) CHECK_LT(v, mesh.positions.size());
  try {
    const Meeting meeting(mesh);
    std::vector<Box> boxes;
    boxes.reserve(mesh.triangles.size());
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
      if (!meeting.degenerate(static_cast<Index>(t))) boxes.emplace_back(mesh, static_cast<Index>(t));
    // Pairs whose boxes overlap, looked at so many at a time: there may be more than memory holds.
    constexpr std::size_t kAtOnce = 1 << 20;
    std::vector<std::array<Index, 2>> pairs, near;
    std::vector<std::uint8_t> meets;
    const auto look = [&] {
      meets.assign(near.size(), 0);
      parallel_for(
          near.size(), [&](std::size_t k) { meets[k] = meeting(near[k][0], near[k][1]); }, 4096);
      for (std::size_t k = 0; k < near.size() && pairs.size() < at_most; ++k)
        if (meets[k]) pairs.push_back(near[k]);
      near.clear();
      if (pairs.size() >= at_most) throw Enough{};
    };
    try {
      CGAL::box_self_intersection_d(boxes.begin(), boxes.end(), [&](const Box& a, const Box& b) {
        near.push_back({std::min(a.triangle(), b.triangle()), std::max(a.triangle(), b.triangle())});
        if (near.size() == kAtOnce) look();
      });
      look();
    } catch (const Enough&) {
    }
    std::sort(pairs.begin(), pairs.end());
    return pairs;
  } catch (const std::logic_error& error) {
    throw InputError(Place{}, fmt::format("the mesh cannot be searched for self-intersections: CGAL says {}", error.what()));
  }
}

}  // namespace effuse::geometry
