#include "geometry/base/check.h"
#include "geometry/terrain/delaunay_internal.h"

namespace effuse::geometry {

namespace {

using Point = Delaunay::Point;
__extension__ using Wide = __int128;

/// > 0: c lies to the left of a -> b. Coordinates are below 2^20, products below 2^41.
std::int64_t orientation(Point a, Point b, Point c) {
  return std::int64_t{b.x - a.x} * (c.y - a.y) - std::int64_t{b.y - a.y} * (c.x - a.x);
}

/// Whether d lies inside the circle through a, b, c (counter-clockwise).
bool in_circle(Point a, Point b, Point c, Point d) {
  const std::int64_t ax = a.x - d.x, ay = a.y - d.y, bx = b.x - d.x, by = b.y - d.y, cx = c.x - d.x, cy = c.y - d.y;
  const std::int64_t a2 = ax * ax + ay * ay, b2 = bx * bx + by * by, c2 = cx * cx + cy * cy;
  return Wide{a2} * (bx * cy - by * cx) - Wide{b2} * (ax * cy - ay * cx) + Wide{c2} * (ax * by - ay * bx) > 0;
}

}  // namespace

Delaunay::Delaunay(std::int32_t width, std::int32_t height) {
  CHECK(width >= 1 && height >= 1 && width < (1 << 20) && height < (1 << 20));
  points_ = {{0, 0}, {width, 0}, {width, height}, {0, height}};
  add_triangle(0, 1, 2);
  add_triangle(0, 2, 3);
  link(2, 3);  // 2 -> 0 and 0 -> 2
}

std::int32_t Delaunay::add_triangle(std::int32_t a, std::int32_t b, std::int32_t c) {
  const std::int32_t t = triangles();
  corners_.insert(corners_.end(), {a, b, c});
  twins_.insert(twins_.end(), {kNone, kNone, kNone});
  return t;
}

std::int32_t Delaunay::find(Point p, std::int32_t t) {
  // Across any edge that p lies beyond; in a Delaunay triangulation this ends.
  for (std::int32_t first = 0;; first = (first + 1) % 3) {
    std::int32_t across = kNone;
    for (std::int32_t k = 0; k < 3 && across == kNone; ++k) {
      const std::int32_t e = 3 * t + (first + k) % 3;
      if (orientation(point(corner(e)), point(corner(next(e))), p) < 0) across = e;
    }
    if (across == kNone) return t;
    CHECK_NE(twin(across), kNone);  // outside the rectangle
    t = twin(across) / 3;
  }
}

std::int32_t Delaunay::insert(Point p, std::int32_t t, std::vector<std::int32_t>& touched) {
  t = find(p, t);
  const std::int32_t vertex = vertices();
  points_.push_back(p);
  std::int32_t on = kNone;
  for (std::int32_t e = 3 * t; e < 3 * t + 3; ++e) {
    const Point a = point(corner(e));
    CHECK(a.x != p.x || a.y != p.y);
    if (orientation(a, point(corner(next(e))), p) == 0) on = e;
  }
  if (on == kNone) split_inside(t, vertex, touched);
  else split_edge(on, vertex, touched);
  flip_until_delaunay(touched);
  return vertex;
}

void Delaunay::split_inside(std::int32_t t, std::int32_t p, std::vector<std::int32_t>& touched) {
  const std::int32_t e = 3 * t, a = corner(e), b = corner(e + 1), c = corner(e + 2), beyond_b = twin(e + 1), beyond_c = twin(e + 2);
  const std::int32_t u = 3 * add_triangle(b, c, p), v = 3 * add_triangle(c, a, p);
  corner(e + 2) = p;
  link(u, beyond_b);
  link(v, beyond_c);
  link(e + 1, u + 2);
  link(e + 2, v + 1);
  link(u + 1, v + 2);
  touched.insert(touched.end(), {t, u / 3, v / 3});
  pending_ = {e, u, v};
}

void Delaunay::split_edge(std::int32_t e, std::int32_t p, std::vector<std::int32_t>& touched) {
  // (a, b, c) becomes (a, p, c) and (p, b, c); its neighbour over a -> b, (b, a, d), becomes (b, p, d) and (p, a, d).
  const std::int32_t f = twin(e);
  const std::int32_t b = corner(next(e)), c = corner(previous(e)), beyond = twin(next(e));
  const std::int32_t u = 3 * add_triangle(p, b, c);
  corner(next(e)) = p;
  link(u + 1, beyond);
  link(next(e), u + 2);
  touched.insert(touched.end(), {e / 3, u / 3});
  pending_ = {u + 1, previous(e)};
  if (f == kNone) return;
  const std::int32_t a = corner(next(f)), d = corner(previous(f)), beyond_f = twin(next(f));
  const std::int32_t v = 3 * add_triangle(p, a, d);
  corner(next(f)) = p;
  link(v + 1, beyond_f);
  link(next(f), v + 2);
  link(e, v);
  link(f, u);
  touched.insert(touched.end(), {f / 3, v / 3});
  pending_.insert(pending_.end(), {v + 1, previous(f)});
}

void Delaunay::flip_until_delaunay(std::vector<std::int32_t>& touched) {
  while (!pending_.empty()) {
    const std::int32_t e = pending_.back();
    pending_.pop_back();
    const std::int32_t f = twin(e);
    if (f == kNone) continue;
    // e: a -> b seen from p, f: b -> a seen from d.
    const std::int32_t p = corner(previous(e)), a = corner(e), b = corner(next(e)), d = corner(previous(f));
    if (!in_circle(point(a), point(b), point(p), point(d))) continue;
    const std::int32_t beyond_p = twin(previous(e)), beyond_d = twin(previous(f));
    corner(e) = d;
    corner(f) = p;
    link(e, beyond_d);
    link(f, beyond_p);
    link(previous(e), previous(f));
    touched.insert(touched.end(), {e / 3, f / 3});
    pending_.insert(pending_.end(), {e, next(f)});
  }
}

}  // namespace effuse::geometry
