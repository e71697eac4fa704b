#include "geometry/collide/convex_hull.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/convex_hull_3.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "geometry/base/check.h"
#include "geometry/base/error.h"

namespace effuse::geometry {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;

/// No flatter than this, as a share of the extent, are solids we take.
constexpr Real kLeastThickness = 1e-7;

/// Throws unless four of the points span a volume; returns the extent.
Real check_spans_volume(std::span<const Vec3> points) {
  for (std::size_t i = 0; i < points.size(); ++i)
    if (!points[i].allFinite()) throw InputError(Place{}, fmt::format("point {} of a convex hull is not finite", i));
  if (points.size() < 4) throw InputError(Place{}, fmt::format("a convex hull needs four points or more, found {}", points.size()));
  const auto furthest = [&](auto&& measure) {
    return *std::max_element(points.begin(), points.end(), [&](const Vec3& p, const Vec3& q) { return measure(p) < measure(q); });
  };
  const Vec3 a = furthest([&](const Vec3& p) { return (p - points[0]).squaredNorm(); });
  const Vec3 b = furthest([&](const Vec3& p) { return (p - a).squaredNorm(); });
  const Real size = (b - a).norm();
  const Vec3 along = size > 0 ? Vec3((b - a) / size) : Vec3::UnitX();
  const Vec3 c = furthest([&](const Vec3& p) { return (p - a).cross(along).squaredNorm(); });
  const Vec3 n = (c - a).cross(along);
  const Real width = n.norm();
  const Vec3 up = width > 0 ? Vec3(n / width) : Vec3::UnitZ();
  const Vec3 d = furthest([&](const Vec3& p) { return std::abs((p - a).dot(up)); });
  const Real height = std::abs((d - a).dot(up));
  if (!(width > kLeastThickness * size && height > kLeastThickness * size))
    throw InputError(Place{}, fmt::format("the points of a convex hull span no volume: {:.3g} x {:.3g} x {:.3g} m", size, width, height));
  return size;
}

/// Triangles of the hull over its own vertices.
void hull_triangles(std::span<const Vec3> points, std::vector<Vec3>& vertices, std::vector<Triangle>& triangles) {
  std::vector<Point> input;
  input.reserve(points.size());
  for (const Vec3& p : points) input.emplace_back(p.x(), p.y(), p.z());
  CGAL::Surface_mesh<Point> mesh;
  CGAL::convex_hull_3(input.begin(), input.end(), mesh);
  // CGAL's order, and how it cuts flat faces into triangles, may hang on addresses: vertices come by coordinates here, faces (below) by
  // vertices, so that the same points give the same hull.
  vertices.clear();
  triangles.clear();
  std::vector<std::pair<std::array<Real, 3>, std::size_t>> order;
  for (const auto v : mesh.vertices()) order.push_back({{mesh.point(v).x(), mesh.point(v).y(), mesh.point(v).z()}, static_cast<std::size_t>(v)});
  std::sort(order.begin(), order.end());
  std::vector<Index> number(order.size());
  for (const auto& [p, v] : order) {
    number[v] = static_cast<Index>(vertices.size());
    vertices.emplace_back(p[0], p[1], p[2]);
  }
  for (const auto f : mesh.faces()) {
    std::vector<Index> loop;
    for (const auto v : mesh.vertices_around_face(mesh.halfedge(f))) loop.push_back(number[static_cast<std::size_t>(v)]);
    std::rotate(loop.begin(), std::min_element(loop.begin(), loop.end()), loop.end());
    for (std::size_t k = 1; k + 1 < loop.size(); ++k) triangles.push_back({loop[0], loop[k], loop[k + 1]});
  }
  std::sort(triangles.begin(), triangles.end());
}

/// Of the vertices, those extreme along `count` directions spread evenly (a Fibonacci lattice on the sphere).
std::vector<Vec3> extreme_points(const std::vector<Vec3>& vertices, std::size_t count) {
  std::vector<std::size_t> chosen;
  for (std::size_t k = 0; k < count; ++k) {
    const Real z = 1 - (2 * static_cast<Real>(k) + 1) / static_cast<Real>(count), r = std::sqrt(1 - z * z);
    const Real turn = static_cast<Real>(k) * kPi * (3 - std::sqrt(Real{5}));
    const Vec3 d(r * std::cos(turn), r * std::sin(turn), z);
    std::size_t best = 0;
    for (std::size_t i = 1; i < vertices.size(); ++i)
      if (vertices[i].dot(d) > vertices[best].dot(d)) best = i;
    chosen.push_back(best);
  }
  std::sort(chosen.begin(), chosen.end());
  chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
  std::vector<Vec3> points;
  for (const std::size_t i : chosen) points.push_back(vertices[i]);
  return points;
}

/// The outer loops of groups of coplanar triangles.
std::vector<std::vector<Index>> flat_faces(const std::vector<Vec3>& v, const std::vector<Triangle>& triangles, Real tolerance) {
  std::map<std::pair<Index, Index>, std::size_t> beside;  // directed edge -> its triangle
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) beside[{triangles[t][k], triangles[t][(k + 1) % 3]}] = t;
  const auto normal = [&](std::size_t t) {
    return Vec3((v[triangles[t][1]] - v[triangles[t][0]]).cross(v[triangles[t][2]] - v[triangles[t][0]]));
  };

  // The largest triangles have the best planes: they gather the others.
  std::vector<std::size_t> order(triangles.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return normal(a).squaredNorm() > normal(b).squaredNorm(); });
  constexpr std::size_t kNone = ~std::size_t{0};
  std::vector<std::size_t> group(triangles.size(), kNone);
  std::vector<std::vector<Index>> loops;
  for (const std::size_t seed : order) {
    if (group[seed] != kNone) continue;
    const Vec3 n = normal(seed).normalized();
    const Real offset = n.dot(v[triangles[seed][0]]);
    std::vector<std::size_t> members{seed};
    group[seed] = seed;
    for (std::size_t m = 0; m < members.size(); ++m)
      for (int k = 0; k < 3; ++k) {
        const Triangle& tri = triangles[members[m]];
        const auto found = beside.find({tri[(k + 1) % 3], tri[k]});
        if (found == beside.end() || group[found->second] != kNone) continue;
        const Triangle& next = triangles[found->second];
        if (std::any_of(next.begin(), next.end(), [&](Index i) { return std::abs(n.dot(v[i]) - offset) > tolerance; })) continue;
        group[found->second] = seed;
        members.push_back(found->second);
      }
    std::map<Index, Index> next;  // along the border
    for (const std::size_t t : members)
      for (int k = 0; k < 3; ++k) {
        const Index a = triangles[t][k], b = triangles[t][(k + 1) % 3];
        const auto twin = beside.find({b, a});
        if (twin == beside.end() || group[twin->second] != seed) next[a] = b;
      }
    std::vector<Index> loop;
    for (Index at = next.begin()->first; loop.size() < next.size(); at = next.at(at)) loop.push_back(at);
    loops.push_back(std::move(loop));
  }
  std::sort(loops.begin(), loops.end());
  return loops;
}

/// Vertices in fewer than three faces lie inside one or along an edge: out.
void drop_needless(std::vector<std::vector<Index>>& loops, std::size_t vertices) {
  std::vector<int> faces(vertices, 0);
  for (const auto& loop : loops)
    for (const Index i : loop) ++faces[i];
  for (auto& loop : loops) std::erase_if(loop, [&](Index i) { return faces[i] < 3; });
  std::erase_if(loops, [](const auto& loop) { return loop.size() < 3; });
}

ConvexHull assemble(const std::vector<Vec3>& vertices, const std::vector<std::vector<Index>>& loops) {
  ConvexHull hull;
  constexpr Index kNone = ~Index{0};
  std::vector<Index> number(vertices.size(), kNone);
  std::map<std::pair<Index, Index>, Index> beside;
  for (const auto& loop : loops) {
    ConvexHull::Face face;
    face.first = static_cast<Index>(hull.loops.size());
    face.count = static_cast<Index>(loop.size());
    const Index which = static_cast<Index>(hull.faces.size());
    Vec3 n = Vec3::Zero();  // Newell's
    for (std::size_t k = 0; k < loop.size(); ++k) {
      const Index i = loop[k], j = loop[(k + 1) % loop.size()];
      n += (vertices[i] - vertices[loop[0]]).cross(vertices[j] - vertices[loop[0]]);
      if (number[i] == kNone) {
        number[i] = static_cast<Index>(hull.vertices.size());
        hull.vertices.push_back(vertices[i]);
      }
      hull.loops.push_back(number[i]);
    }
    face.normal = n.normalized();
    face.offset = -std::numeric_limits<Real>::infinity();
    for (const Index i : loop) face.offset = std::max(face.offset, face.normal.dot(vertices[i]));
    hull.faces.push_back(face);
    const auto own = hull.loop(face);
    for (std::size_t k = 0; k < own.size(); ++k) beside[{own[k], own[(k + 1) % own.size()]}] = which;
  }
  for (const auto& [edge, face] : beside) {
    if (edge.first > edge.second) continue;
    const auto twin = beside.find({edge.second, edge.first});
    if (twin != beside.end()) hull.edges.push_back({{edge.first, edge.second}, {face, twin->second}});
  }
  for (const Vec3& p : hull.vertices) hull.centre += p;
  hull.centre /= static_cast<Real>(hull.vertices.size());
  return hull;
}

}  // namespace

ConvexHull make_convex_hull(std::span<const Vec3> points, std::size_t max_vertices, Real flatness) {
  CHECK_GE(max_vertices, 8u);
  CHECK_GE(flatness, 0);
  const Real size = check_spans_volume(points);
  std::vector<Vec3> vertices;
  std::vector<Triangle> triangles;
  hull_triangles(points, vertices, triangles);
  std::vector<std::vector<Index>> loops = flat_faces(vertices, triangles, flatness * size);
  drop_needless(loops, vertices.size());
  ConvexHull hull = assemble(vertices, loops);
  if (hull.vertices.size() > max_vertices) {
    const std::vector<Vec3> fewer = extreme_points(hull.vertices, max_vertices);
    return make_convex_hull(fewer, max_vertices, flatness);
  }
  return hull;
}

ConvexHull make_box_hull(const Vec3& half) {
  CHECK(half.allFinite());
  CHECK_GT(half.minCoeff(), 0);
  std::vector<Vec3> v;
  for (int k = 0; k < 8; ++k) v.emplace_back((k & 1 ? 1 : -1) * half.x(), (k & 2 ? 1 : -1) * half.y(), (k & 4 ? 1 : -1) * half.z());
  return assemble(v, {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}});
}

ConvexHull transformed(const ConvexHull& hull, const Mat3& R, const Vec3& t) {
  ConvexHull out;
  transform_into(hull, R, t, out);
  return out;
}

void transform_into(const ConvexHull& hull, const Mat3& R, const Vec3& t, ConvexHull& out) {
  out.vertices.resize(hull.vertices.size());
  out.faces = hull.faces;
  out.loops = hull.loops;
  out.edges = hull.edges;
  for (std::size_t k = 0; k < hull.vertices.size(); ++k) out.vertices[k] = R * hull.vertices[k] + t;
  for (ConvexHull::Face& face : out.faces) {
    face.normal = R * face.normal;
    face.offset += face.normal.dot(t);
  }
  out.centre = R * hull.centre + t;
}

TriMesh mesh_of(const ConvexHull& hull) {
  TriMesh mesh;
  mesh.positions = hull.vertices;
  for (const ConvexHull::Face& face : hull.faces) {
    const auto loop = hull.loop(face);
    for (std::size_t k = 1; k + 1 < loop.size(); ++k) mesh.triangles.push_back({loop[0], loop[k], loop[k + 1]});
  }
  return mesh;
}

}  // namespace effuse::geometry
