#include "geometry/collide/convex_contact.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/query/closest_point.h"

namespace effuse::geometry {
namespace {

constexpr Real kInfinity = std::numeric_limits<Real>::infinity();

/// An axis along which the two are this far apart (negative: overlap), and what carries it.
struct Axis {
  Real separation = -kInfinity;
  Vec3 normal = Vec3::UnitZ();
  Index first = 0, second = 0;  ///< face; or edge of A, edge of B
};

/// The face of `of` that `other` stands furthest outside of. Stops at one further off than margin.
Axis best_face(const ConvexHull& of, const ConvexHull& other, Real margin) {
  Axis best;
  for (Index f = 0; f < of.faces.size(); ++f) {
    const ConvexHull::Face& face = of.faces[f];
    Real nearest = kInfinity;
    for (const Vec3& v : other.vertices) nearest = std::min(nearest, face.normal.dot(v));
    const Real separation = nearest - face.offset;
    if (separation > best.separation) best = {separation, face.normal, f, 0};
    if (separation > margin) break;
  }
  return best;
}

/// The pair of edges whose planes are furthest apart, of those that are faces of the Minkowski difference.
Axis best_edges(const ConvexHull& a, const ConvexHull& b, Real margin) {
  constexpr Real kParallel = 1e-6;  // squared sine: below it one of the faces does as well
  Axis best;
  for (Index i = 0; i < a.edges.size(); ++i) {
    const ConvexHull::Edge& ea = a.edges[i];
    const Vec3& pa = a.vertices[ea.vertices[0]];
    const Vec3 da = a.vertices[ea.vertices[1]] - pa;
    const Vec3 &na = a.faces[ea.faces[0]].normal, &nb = a.faces[ea.faces[1]].normal;
    for (Index j = 0; j < b.edges.size(); ++j) {
      const ConvexHull::Edge& eb = b.edges[j];
      // The arcs (na, nb) and (-nc, -nd) on the unit sphere cross: b x a is along -da, d x c along -db.
      const Vec3 &nc = b.faces[eb.faces[0]].normal, &nd = b.faces[eb.faces[1]].normal;
      const Real c_side = nc.dot(da), d_side = nd.dot(da);
      if (c_side * d_side >= 0) continue;
      const Vec3& pb = b.vertices[eb.vertices[0]];
      const Vec3 db = b.vertices[eb.vertices[1]] - pb;
      const Real a_side = -na.dot(db), b_side = -nb.dot(db);
      if (a_side * b_side >= 0 || c_side * b_side <= 0) continue;
      Vec3 n = da.cross(db);
      const Real square = n.squaredNorm();
      if (square < kParallel * da.squaredNorm() * db.squaredNorm()) continue;
      n /= std::sqrt(square);
      if (n.dot(pa - a.centre) < 0) n = -n;
      const Real separation = n.dot(pb - pa);
      if (separation > best.separation) best = {separation, n, i, j};
      if (separation > margin) return best;
    }
  }
  return best;
}

/// Points of the two lines nearest to each other, kept on the edges.
ManifoldPoint between_edges(const Vec3& p, const Vec3& d, const Vec3& q, const Vec3& e, const Vec3& normal) {
  const Vec3 r = p - q;
  const Real dd = d.squaredNorm(), ee = e.squaredNorm(), de = d.dot(e), f = e.dot(r), c = d.dot(r);
  const Real s = std::clamp((de * f - c * ee) / (dd * ee - de * de), Real{0}, Real{1});
  const Real t = std::clamp((de * s + f) / ee, Real{0}, Real{1});
  ManifoldPoint point{p + s * d, q + t * e, 0, 0.5};
  point.separation = normal.dot(point.on_b - point.on_a);
  return point;
}

/// A corner of the face that is clipped, or of the cut.
struct Corner {
  Vec3 p;
  bool own;
};

/// The part of polygon inside the plane n . x <= offset (Sutherland & Hodgman 1974).
void clip(const std::vector<Corner>& polygon, const Vec3& n, Real offset, std::vector<Corner>& out) {
  out.clear();
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const Corner& c = polygon[k];
    const Vec3 &p = c.p, &q = polygon[(k + 1) % polygon.size()].p;
    const Real dp = n.dot(p) - offset, dq = n.dot(q) - offset;
    if (dp <= 0) out.push_back(c);
    if ((dp < 0 && dq > 0) || (dp > 0 && dq < 0)) out.push_back({p + (dp / (dp - dq)) * (q - p), false});
  }
}

/// Of the faces round the vertex of `other` that lies deepest, the one that looks most against the reference face: cut to what lies
/// over that, and of it what is nearer than margin. (Of all faces that one may lie elsewhere. On the axis of least overlap the deepest
/// vertex stands over the reference face: something is left.)
void clip_faces(const ConvexHull& of, Index reference, const ConvexHull& other, Real margin, std::vector<ManifoldPoint>& out) {
  const ConvexHull::Face& face = of.faces[reference];
  const Index deepest = other.support(-face.normal);
  Index incident = 0;
  Real most_against = kInfinity;
  for (Index f = 0; f < other.faces.size(); ++f) {
    const auto loop = other.loop(other.faces[f]);
    const Real along = other.faces[f].normal.dot(face.normal);
    if (along < most_against && std::find(loop.begin(), loop.end(), deepest) != loop.end()) most_against = along, incident = f;
  }
  std::vector<Corner> polygon, next;
  polygon.reserve(16);
  next.reserve(16);
  for (const Index i : other.loop(other.faces[incident])) polygon.push_back({other.vertices[i], true});
  const auto loop = of.loop(face);
  for (std::size_t k = 0; k < loop.size() && !polygon.empty(); ++k) {
    const Vec3 &p = of.vertices[loop[k]], &q = of.vertices[loop[(k + 1) % loop.size()]];
    const Vec3 outward = (q - p).cross(face.normal);
    clip(polygon, outward, outward.dot(p), next);
    polygon.swap(next);
  }
  out.clear();
  for (const Corner& c : polygon) {
    const Real separation = face.normal.dot(c.p) - face.offset;
    if (separation <= margin) out.push_back({c.p - separation * face.normal, c.p, separation, c.own ? Real{0} : Real{0.5}});
  }
}

}  // namespace

int reduce_manifold(std::span<ManifoldPoint> points, const Vec3& normal) {
  if (points.size() <= static_cast<std::size_t>(Manifold::kMost)) return static_cast<int>(points.size());
  const auto bring = [&](std::size_t to, auto&& measure) {
    std::size_t best = to;
    for (std::size_t k = to + 1; k < points.size(); ++k)
      if (measure(points[k]) > measure(points[best])) best = k;
    std::swap(points[to], points[best]);
  };
  bring(0, [](const ManifoldPoint& p) { return -p.separation; });
  bring(1, [&](const ManifoldPoint& p) { return (p.on_a - points[0].on_a).squaredNorm(); });
  const auto area = [&](const ManifoldPoint& p) {
    return normal.dot((points[1].on_a - points[0].on_a).cross(p.on_a - points[0].on_a));
  };
  bring(2, [&](const ManifoldPoint& p) { return std::abs(area(p)); });
  const Real side = area(points[2]) > 0 ? 1 : -1;
  // The fourth: what adds most to the triangle, beyond any of its sides.
  bring(3, [&](const ManifoldPoint& p) {
    const auto beyond = [&](const ManifoldPoint& s, const ManifoldPoint& t) {
      return -side * normal.dot((t.on_a - s.on_a).cross(p.on_a - s.on_a));
    };
    return std::max({beyond(points[0], points[1]), beyond(points[1], points[2]), beyond(points[2], points[0])});
  });
  return 4;
}

Manifold hull_contact(const ConvexHull& a, const ConvexHull& b, Real margin, Real slop) {
  DCHECK(margin >= 0 && slop > 0);
  Manifold m;
  const Axis face_a = best_face(a, b, margin);
  if (face_a.separation > margin) return m;
  const Axis face_b = best_face(b, a, margin);
  if (face_b.separation > margin) return m;
  const Axis edges = best_edges(a, b, margin);
  if (edges.separation > margin) return m;

  const auto edge_contact = [&] {
    const ConvexHull::Edge &ea = a.edges[edges.first], &eb = b.edges[edges.second];
    const Vec3 &pa = a.vertices[ea.vertices[0]], &pb = b.vertices[eb.vertices[0]];
    m.normal = edges.normal;
    m.points[0] = between_edges(pa, a.vertices[ea.vertices[1]] - pa, pb, b.vertices[eb.vertices[1]] - pb, m.normal);
    m.count = m.points[0].separation <= margin ? 1 : 0;
  };
  if (edges.separation > std::max(face_a.separation, face_b.separation) + slop) {
    edge_contact();
    return m;
  }

  // The first body's face unless the second's is clearly better: a choice that does not change from look to look.
  const bool of_b = face_b.separation > face_a.separation + slop / 10;
  std::vector<ManifoldPoint> points;
  points.reserve(16);
  if (of_b)
    clip_faces(b, face_b.first, a, margin, points);
  else
    clip_faces(a, face_a.first, b, margin, points);
  m.normal = of_b ? Vec3(-face_b.normal) : face_a.normal;
  if (of_b)
    for (ManifoldPoint& p : points) {
      std::swap(p.on_a, p.on_b);
      p.of_a = 1 - p.of_a;
    }
  if (points.empty() && std::isfinite(edges.separation)) {  // nothing lies over the face: two edges pass beside it
    edge_contact();
    return m;
  }
  m.count = reduce_manifold(points, m.normal);
  std::copy_n(points.begin(), m.count, m.points.begin());
  return m;
}

HullPoint nearest_on_hull(const ConvexHull& hull, const Vec3& p) {
  HullPoint best{-kInfinity, p, Vec3::UnitZ()};
  for (const ConvexHull::Face& face : hull.faces) {
    const Real d = face.normal.dot(p) - face.offset;
    if (d > best.distance) best = {d, p - d * face.normal, face.normal};
  }
  if (best.distance <= 0) return best;

  // Outside: the nearest point of the faces that see p.
  Real nearest = kInfinity;
  Vec3 point = best.point;
  for (const ConvexHull::Face& face : hull.faces) {
    const Real d = face.normal.dot(p) - face.offset;
    if (d <= 0 || d * d >= nearest) continue;
    const Vec3 foot = p - d * face.normal;
    const auto loop = hull.loop(face);
    bool over = true;
    for (std::size_t k = 0; k < loop.size(); ++k) {
      const Vec3 &u = hull.vertices[loop[k]], &w = hull.vertices[loop[(k + 1) % loop.size()]];
      if ((w - u).cross(face.normal).dot(foot - u) <= 0) continue;
      over = false;
      const Vec3 at = closest_point_on_segment(p, u, w);
      if (const Real square = (p - at).squaredNorm(); square < nearest) nearest = square, point = at;
    }
    if (over) nearest = d * d, point = foot;
  }
  const Real distance = std::sqrt(nearest);
  if (distance > 0) best = {distance, point, (p - point) / distance};
  return best;
}

Manifold hull_sphere_contact(const ConvexHull& a, const Vec3& c, Real r, Real margin) {
  Manifold m;
  const HullPoint at = nearest_on_hull(a, c);
  if (at.distance - r > margin) return m;
  m.normal = at.normal;
  m.count = 1;
  m.points[0] = {at.point, c - r * at.normal, at.distance - r, 0};
  return m;
}

Manifold sphere_contact(const Vec3& a, Real radius_a, const Vec3& b, Real radius_b, Real margin) {
  Manifold m;
  const Vec3 d = b - a;
  const Real distance = d.norm();
  if (distance - radius_a - radius_b > margin) return m;
  m.normal = distance > 0 ? Vec3(d / distance) : Vec3::UnitZ();
  m.count = 1;
  m.points[0] = {a + radius_a * m.normal, b - radius_b * m.normal, distance - radius_a - radius_b, 0.5};
  return m;
}

}  // namespace effuse::geometry
