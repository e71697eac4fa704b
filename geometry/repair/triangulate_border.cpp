#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/triangulate_hole.h>
#include <CGAL/Random.h>
#include <CGAL/utility.h>

#include <algorithm>
#include <exception>

#include "geometry/repair/repair_internal.h"

namespace effuse::geometry {

std::vector<Triangle> triangulate_border(const std::vector<Vec3>& border) {
  using Point = CGAL::Exact_predicates_inexact_constructions_kernel::Point_3;
  // Points at one place would be told apart by where they lie in memory.
  std::vector<Vec3> places = border;
  std::sort(places.begin(), places.end(), [](const Vec3& a, const Vec3& b) { return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end()); });
  if (std::adjacent_find(places.begin(), places.end()) != places.end()) return {};
  std::vector<Point> points;
  for (const Vec3& p : border) points.emplace_back(p.x(), p.y(), p.z());
  std::vector<CGAL::Triple<int, int, int>> found;
  // All triangulations are compared where that is quick; else those among the edges of the Delaunay tetrahedra, whose way through points at one
  // place, or on one sphere, takes random turns: the same ones each time, from the same seed.
  constexpr std::size_t kCompareAll = 200;
  CGAL::get_default_random() = CGAL::Random(0);
  try {
    CGAL::Polygon_mesh_processing::triangulate_hole_polyline(points, std::back_inserter(found), CGAL::parameters::use_delaunay_triangulation(points.size() > kCompareAll));
  } catch (const std::exception&) {
    return {};  // borders that touch themselves: the caller has another way
  }
  std::vector<Triangle> triangles;
  for (const auto& t : found) triangles.push_back({static_cast<Index>(t.first), static_cast<Index>(t.second), static_cast<Index>(t.third)});
  return triangles;
}

}  // namespace effuse::geometry
