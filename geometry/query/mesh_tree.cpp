#include "geometry/query/mesh_tree.h"

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/error.h"

namespace effuse::geometry {

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using Triangles = std::vector<Kernel::Triangle_3>;
using Primitive = CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>;
using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>>;

Point to_cgal(const Vec3& x) { return {x.x(), x.y(), x.z()}; }
Vec3 from_cgal(const Point& x) { return {x.x(), x.y(), x.z()}; }

/// What CGAL throws becomes an error of ours.
template <class Body>
auto guarded(const char* what, Body&& body) {
  try {
    return body();
  } catch (const std::logic_error& error) {
    throw InputError(Place{}, fmt::format("the mesh cannot be used for {}: CGAL says {}", what, error.what()));
  }
}

/// visit(point, index of the triangle) for every triangle that query meets; both ends where
/// query runs along one.
template <class Query, class Visit>
void for_each_crossing(const Tree& tree, const Triangles& triangles, const Query& query, Visit&& visit) {
  using Crossing = typename Tree::template Intersection_and_primitive_id<Query>::Type;
  std::vector<Crossing> crossings;
  tree.all_intersections(query, std::back_inserter(crossings));
  for (const Crossing& crossing : crossings) {
    const auto triangle = static_cast<std::size_t>(crossing.second - triangles.cbegin());
    if (const Point* point = boost::get<Point>(&crossing.first)) {
      visit(from_cgal(*point), triangle);
    } else if (const Kernel::Segment_3* along = boost::get<Kernel::Segment_3>(&crossing.first)) {
      visit(from_cgal(along->source()), triangle);
      visit(from_cgal(along->target()), triangle);
    }
  }
}

}  // namespace

struct MeshTree::Impl {
  Triangles triangles;
  std::vector<std::size_t> number;  // of the triangles, as the caller counts
  Tree tree;
  Real usual_size = 0;  // [m], root of the mean area
};

MeshTree::MeshTree(std::span<const Vec3> positions, std::span<const Triangle> triangles) : impl_(std::make_unique<Impl>()) {
  for (const Vec3& x : positions) CHECK(x.allFinite());
  Real area = 0;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (Index i : triangles[t]) CHECK_LT(i, positions.size());
    const Vec3 &a = positions[triangles[t][0]], &b = positions[triangles[t][1]], &c = positions[triangles[t][2]];
    const Kernel::Triangle_3 triangle(to_cgal(a), to_cgal(b), to_cgal(c));
    if (triangle.is_degenerate() || (b - a).cross(c - a).squaredNorm() == 0) continue;
    impl_->triangles.push_back(triangle);
    impl_->number.push_back(t);
    area += (b - a).cross(c - a).norm() / 2;
  }
  if (!impl_->triangles.empty()) impl_->usual_size = std::sqrt(area / static_cast<Real>(impl_->triangles.size()));
  guarded("a tree", [&] {
    impl_->tree.insert(impl_->triangles.cbegin(), impl_->triangles.cend());
    impl_->tree.build();
    // Now, not at the first query: building is lazy and not safe from several threads.
    if (!impl_->tree.empty()) impl_->tree.accelerate_distance_queries();
  });
}

MeshTree::~MeshTree() = default;
MeshTree::MeshTree(MeshTree&&) noexcept = default;
MeshTree& MeshTree::operator=(MeshTree&&) noexcept = default;

std::size_t MeshTree::size() const { return impl_->triangles.size(); }

std::optional<MeshTree::Nearest> MeshTree::nearest(const Vec3& p, Real reach) const {
  if (impl_->tree.empty() || !p.allFinite() || !(reach > 0)) return std::nullopt;
  const auto found = guarded("closest points", [&] {
    // A first guess bounds the search. Within a triangle's size: a point just out of reach, on no triangle, so that
    // nothing farther is looked at. Beyond: the nearest of the sample points CGAL keeps, if that is in reach.
    const Point query = to_cgal(p);
    const Real radius = reach * (1 + 1e-9) + 1e-12 * p.cwiseAbs().maxCoeff();
    if (!(reach < impl_->usual_size)) {
      const auto sample = impl_->tree.best_hint(query);
      if (!((from_cgal(sample.first) - p).norm() > radius)) return impl_->tree.closest_point_and_primitive(query, sample).second;
    }
    return impl_->tree.closest_point_and_primitive(query, {to_cgal(p + Vec3(radius, 0, 0)), impl_->triangles.cend()}).second;
  });
  if (found == impl_->triangles.cend()) return std::nullopt;

  Nearest nearest;
  nearest.triangle = impl_->number[static_cast<std::size_t>(found - impl_->triangles.cbegin())];
  nearest.at = closest_point_on_triangle(p, from_cgal(found->vertex(0)), from_cgal(found->vertex(1)), from_cgal(found->vertex(2)));
  nearest.distance = (p - nearest.at.point).norm();
  if (nearest.distance > reach) return std::nullopt;
  return nearest;
}

std::optional<MeshTree::Crossing> MeshTree::ray(const Vec3& p, const Vec3& d, Real t_max) const {
  if (impl_->tree.empty() || !p.allFinite() || !d.allFinite() || d.isZero(0) || !(t_max > 0)) return std::nullopt;
  std::optional<Crossing> first;
  const auto keep = [&](const Vec3& point, std::size_t triangle) {
    const Real t = (point - p).dot(d) / d.squaredNorm();
    if (t > 0 && t <= t_max && (!first || t < first->t)) first = Crossing{t, impl_->number[triangle]};
  };
  guarded("rays", [&] {
    const Vec3 end = p + t_max * d;
    if (end.allFinite() && end != p)
      for_each_crossing(impl_->tree, impl_->triangles, Kernel::Segment_3(to_cgal(p), to_cgal(end)), keep);
    else
      for_each_crossing(impl_->tree, impl_->triangles, Kernel::Ray_3(to_cgal(p), Kernel::Vector_3(d.x(), d.y(), d.z())), keep);
  });
  return first;
}

std::vector<MeshTree::Crossing> MeshTree::vertical(Real x, Real y) const {
  std::vector<Crossing> crossings;
  if (impl_->tree.empty() || !std::isfinite(x) || !std::isfinite(y)) return crossings;
  guarded("heights", [&] {
    const Kernel::Line_3 line(Point(x, y, 0), Kernel::Vector_3(0, 0, 1));
    for_each_crossing(impl_->tree, impl_->triangles, line,
                      [&](const Vec3& point, std::size_t triangle) { crossings.push_back({point.z(), impl_->number[triangle]}); });
  });
  std::sort(crossings.begin(), crossings.end(), [](const Crossing& a, const Crossing& b) { return a.t != b.t ? a.t > b.t : a.triangle < b.triangle; });
  return crossings;
}

}  // namespace effuse::geometry
