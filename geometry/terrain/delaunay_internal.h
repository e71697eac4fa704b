#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace effuse::geometry {

/// A Delaunay triangulation of points with whole coordinates, grown point by point inside a rectangle. Exact.
///
/// Corner k of triangle t is half-edge e = 3 t + k, from vertex(e) to vertex(next(e)), counter-clockwise; twin(e) is the
/// same edge in the neighbour, kNone on the border. Triangles are never removed, only changed.
class Delaunay {
 public:
  struct Point {
    std::int32_t x, y;
  };
  static constexpr std::int32_t kNone = -1;

  /// Two triangles over (0, 0) .. (width, height), both >= 1 and < 2^20: vertices 0..3, counter-clockwise from the origin.
  Delaunay(std::int32_t width, std::int32_t height);

  /// Adds p, which lies in triangle t or on its border and is no vertex; t: any triangle, the search walks from there.
  /// touched receives every triangle that is new or changed, some of them twice. Returns its number.
  std::int32_t insert(Point p, std::int32_t t, std::vector<std::int32_t>& touched);

  std::int32_t triangles() const { return static_cast<std::int32_t>(corners_.size() / 3); }
  std::array<std::int32_t, 3> triangle(std::int32_t t) const {
    const auto e = static_cast<std::size_t>(3 * t);
    return {corners_[e], corners_[e + 1], corners_[e + 2]};
  }
  const Point& point(std::int32_t vertex) const { return points_[static_cast<std::size_t>(vertex)]; }
  std::int32_t vertices() const { return static_cast<std::int32_t>(points_.size()); }

 private:
  static std::int32_t next(std::int32_t e) { return e % 3 == 2 ? e - 2 : e + 1; }
  static std::int32_t previous(std::int32_t e) { return e % 3 == 0 ? e + 2 : e - 1; }
  std::int32_t& corner(std::int32_t e) { return corners_[static_cast<std::size_t>(e)]; }
  std::int32_t& twin(std::int32_t e) { return twins_[static_cast<std::size_t>(e)]; }
  void link(std::int32_t a, std::int32_t b) {
    if (a != kNone) twin(a) = b;
    if (b != kNone) twin(b) = a;
  }
  std::int32_t add_triangle(std::int32_t a, std::int32_t b, std::int32_t c);
  std::int32_t find(Point p, std::int32_t t);
  void split_inside(std::int32_t t, std::int32_t p, std::vector<std::int32_t>& touched);
  void split_edge(std::int32_t e, std::int32_t p, std::vector<std::int32_t>& touched);
  void flip_until_delaunay(std::vector<std::int32_t>& touched);

  std::vector<Point> points_;
  std::vector<std::int32_t> corners_, twins_;
  std::vector<std::int32_t> pending_;  // half-edges opposite the new point that may have to be flipped
};

}  // namespace effuse::geometry
