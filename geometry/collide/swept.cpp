#include "geometry/collide/swept.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/base/check.h"
#include "geometry/collide/swept_internal.h"

namespace effuse::geometry {

namespace {

constexpr Real kInfinity = std::numeric_limits<Real>::infinity();

/// Where p + t d, t >= 0, enters the ball of radius r about c; it starts outside. +infinity: never.
Real enters_ball(const Vec3& p, const Vec3& d, const Vec3& c, Real r) {
  const Real d2 = d.squaredNorm(), towards = (c - p).dot(d);
  if (!(towards > 0)) return kInfinity;
  // From the closest approach back by half the chord: no difference of large numbers.
  const Real nearest = towards / d2;
  const Real half2 = r * r - (p + nearest * d - c).squaredNorm();
  return half2 >= 0 ? std::max(Real{0}, nearest - std::sqrt(half2 / d2)) : kInfinity;
}

/// The same for the round of radius r about the segment from a to b, without its ends' balls.
Real enters_tube(const Vec3& p, const Vec3& d, const Vec3& a, const Vec3& b, Real r) {
  const Vec3 axis = b - a;
  const Real length2 = axis.squaredNorm();
  const Vec3 across = d - d.dot(axis) / length2 * axis, from = p - a, from_across = from - from.dot(axis) / length2 * axis;
  const Real across2 = across.squaredNorm();
  if (!(across2 > 1e-30 * d.squaredNorm())) return kInfinity;  // along the axis: through an end's ball, if at all
  const Real nearest = -from_across.dot(across) / across2;
  const Real half2 = r * r - (from_across + nearest * across).squaredNorm();
  if (!(half2 >= 0)) return kInfinity;
  const Real t = nearest - std::sqrt(half2 / across2);
  if (!(t >= 0)) return kInfinity;
  const Real along = (from + t * d).dot(axis);
  return along >= 0 && along <= length2 ? t : kInfinity;
}

/// A point against a triangle. Signs of the three volumes are those of the sides alone, the same from both of its
/// triangles but for the sign: no point passes between two that share a side.
std::optional<Real> point_meets(const Vec3& p, const Vec3& d, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 pa = a - p, pb = b - p, pc = c - p;
  const Real u = d.dot(pb.cross(pc)), v = d.dot(pc.cross(pa)), w = d.dot(pa.cross(pb));
  if (!((u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0))) return std::nullopt;
  const Vec3 normal = (b - a).cross(c - a);
  const Real speed = normal.dot(d), height = normal.dot(pa);
  if (speed == 0) return std::nullopt;  // along the plane: it has no side to come from
  const Real t = height / speed;
  // From the plane itself it may leave to either side.
  return t > 0 && t <= 1 ? std::optional(t) : std::nullopt;
}

/// As sweep_triangle, r > 0. within_is_met: who overlaps at the start is met at once, even if it leaves.
std::optional<Real> ball_meets(const Vec3& p, const Vec3& d, Real r, const Vec3& a, const Vec3& b, const Vec3& c, bool within_is_met) {
  const Vec3 cross = (b - a).cross(c - a);
  const Real twice_area = cross.norm();
  const Vec3 normal = cross / twice_area;
  const Real height = normal.dot(p - a), speed = normal.dot(d);
  const Real above = std::abs(height), approach = height > 0 ? -speed : speed;
  // Never near enough to the plane.
  if (above > r && above - approach > r) return std::nullopt;
  if (above > r) {
    const Real t = (above - r) / approach;
    const Vec3 q = p + t * d;
    if (cross.dot((b - a).cross(q - a)) >= 0 && cross.dot((c - b).cross(q - b)) >= 0 && cross.dot((a - c).cross(q - c)) >= 0) return t;
  } else {
    // The distance from a triangle is convex along a line: who does not approach now never will.
    const Vec3 offset = p - closest_point_on_triangle(p, a, b, c).point;
    if (offset.squaredNorm() <= r * r) return within_is_met || offset.dot(d) < 0 ? std::optional(Real{0}) : std::nullopt;
  }
  Real first = std::min({enters_ball(p, d, a, r), enters_ball(p, d, b, r), enters_ball(p, d, c, r)});
  first = std::min({first, enters_tube(p, d, a, b, r), enters_tube(p, d, b, c, r), enters_tube(p, d, c, a, r)});
  return first <= 1 ? std::optional(first) : std::nullopt;
}

struct Hit {
  Real t = kInfinity;
  Index triangle = CollisionMesh::Impl::kNobody;
  bool any() const { return triangle != CollisionMesh::Impl::kNobody; }
};

/// First triangle met on the straight way p + t d, t in [0, 1], in the mesh's frame.
Hit sweep_straight(const CollisionMesh::Impl& mesh, const Vec3& p, const Vec3& d, Real rho, bool within_is_met = false) {
  Hit hit;
  mesh.tree.segment(p, d, rho, 1, [&](Index triangle, Real& t_max) {
    const auto& [a, b, c] = mesh.corners[triangle];
    // A point comes into a solid through its front: at a silhouette it must not be held by the back.
    if (rho == 0 && mesh.solid_at(triangle) && mesh.face_normal[triangle].dot(d) > 0) return;
    const std::optional<Real> t = rho == 0 ? point_meets(p, d, a, b, c) : ball_meets(p, d, rho, a, b, c, within_is_met);
    if (!t || *t > hit.t || (*t == hit.t && triangle > hit.triangle)) return;
    hit = {*t, triangle};
    t_max = *t;
  });
  return hit;
}

bool anything_within(const CollisionMesh::Impl& mesh, const Vec3& p, const Vec3& d, Real rho) {
  bool any = false;
  mesh.tree.segment(p, d, rho, 1, [&](Index triangle, Real& t_max) {
    const auto& [a, b, c] = mesh.corners[triangle];
    if (!any && ball_meets(p, d, rho, a, b, c, true)) any = true;
    if (any) t_max = -1;
  });
  return any;
}

/// The impact at q = the centre in the mesh's frame, that came along `way` there; nullopt: from inside of a solid.
std::optional<Impact> impact_at(const CollisionMesh::Impl& mesh, const RigidMotion& motion, Real s, const Vec3& q, const Vec3& way, Index triangle) {
  const auto& [a, b, c] = mesh.corners[triangle];
  const TrianglePoint at = closest_point_on_triangle(q, a, b, c);
  const Vec3 offset = q - at.point, outward = mesh.pseudonormal(triangle, at);
  const Real distance = offset.norm();
  const bool touching = distance <= mesh.on_surface;
  const Vec3 face = mesh.face_normal[triangle];
  const Vec3 normal = touching ? (face.dot(way) <= 0 ? face : Vec3(-face)) : Vec3(offset / distance);
  if (mesh.solid_at(triangle) && (touching ? face.dot(way) > 0 : outward.dot(offset) < 0)) return std::nullopt;
  const RigidPose pose = motion.pose(s);
  return Impact{.time = s, .point = pose.world(at.point), .normal = pose.orientation * normal, .triangle = triangle};
}

/// Bounds on how curved a path is as the mesh sees it, over [begin, 1].
struct Curve {
  const CollisionMesh& mesh;
  const RigidMotion& motion;
  const Path& path;
  Real rho, chord;    // chord: how far a chord may be from the curve [m]
  Real speed = 0, bend = 0;

  Curve(const CollisionMesh& m, const RigidMotion& mo, const Path& pa, Real r, Real most) : mesh(m), motion(mo), path(pa), rho(r), chord(most) {
    // In the world:  x' = V + W x (R q) + R q',  x'' = W x (W x R q) + 2 W x R q'.
    const Real left = 1 - path.begin, turn = path.frame.turn().norm();
    const Real furthest = std::max(path.start.norm(), (path.start + left * path.way).norm());
    speed = (path.frame.shift() - motion.shift()).norm() + turn * furthest + path.way.norm();
    bend = turn * turn * furthest + 2 * turn * path.way.norm();
  }
  Vec3 local(Real s) const { return motion.pose(s).body(path.at(s)); }
  /// How far the curve from s0 to s1 may be from its chord:  h^2 / 8 max |q''|,  |q''| <= |x''| + 2 w |y'| + w^2 |y|.
  Real deviation(Real s0, const Vec3& q0, Real s1, const Vec3& q1) const {
    const Real h = s1 - s0, w = motion.turn().norm();
    const Real furthest = std::min(q0.norm(), q1.norm()) + speed * h;
    return h * h / 8 * (bend + 2 * w * speed + w * w * furthest);
  }
  std::optional<Impact> first(Real s0, const Vec3& q0, Real s1, const Vec3& q1, bool& from_inside) const {
    const Real off = deviation(s0, q0, s1, q1);
    const Vec3 way = q1 - q0;
    const Real h = s1 - s0;
    if (off > chord && h > 1e-9) {
      // Where nothing is near the long chord, nothing is near the curve.
      if (!anything_within(mesh.impl(), q0, way, rho + off)) return std::nullopt;
      const Real middle = s0 + h / 2;
      const Vec3 q = local(middle);
      if (auto hit = first(s0, q0, middle, q, from_inside); hit || from_inside) return hit;
      return first(middle, q, s1, q1, from_inside);
    }
    // Who is within the grown radius may leave along the chord and yet come nearer along the curve.
    const Hit hit = sweep_straight(mesh.impl(), q0, way, rho + off, true);
    if (!hit.any()) return std::nullopt;
    const Real s = std::min(s1, s0 + hit.t * h);
    auto impact = impact_at(mesh.impl(), motion, s, off > 0 ? local(s) : Vec3(q0 + hit.t * way), way, hit.triangle);
    from_inside = !impact;
    return impact;
  }
};

}  // namespace

std::optional<Real> sweep_triangle(const Vec3& p, const Vec3& d, Real r, const Vec3& a, const Vec3& b, const Vec3& c) {
  return r == 0 ? point_meets(p, d, a, b, c) : ball_meets(p, d, r, a, b, c, false);
}

Box3 Path::box(Real r) const {
  const Real left = 1 - begin, turn = frame.turn().norm();
  const Real furthest = std::max(start.norm(), (start + left * way).norm());
  const Real grow = r + left * left / 8 * (turn * turn * furthest + 2 * turn * way.norm());
  Box3 box(at(begin));
  box.extend(at(1));
  return {box.min() - Vec3::Constant(grow), box.max() + Vec3::Constant(grow)};
}

std::optional<Impact> sweep_path(const CollisionMesh& mesh, const RigidMotion& motion, const Path& path, Real rho) {
  const Real least = 1e-3 * mesh.bounds().sizes().norm();
  const Curve curve(mesh, motion, path, rho, kChord * (rho > 0 ? rho : least));
  bool from_inside = false;
  if (motion.turns() || path.frame.turns()) {
    // Carried by this very mesh, the way is straight to it.
    const bool carried = path.frame.from().position == motion.from().position && path.frame.from().orientation.coeffs() == motion.from().orientation.coeffs() &&
                         path.frame.shift() == motion.shift() && path.frame.turn() == motion.turn();
    if (!carried) return curve.first(path.begin, curve.local(path.begin), 1, curve.local(1), from_inside);
    const Real left = 1 - path.begin;
    const Hit hit = sweep_straight(mesh.impl(), path.start, left * path.way, rho);
    if (!hit.any()) return std::nullopt;
    return impact_at(mesh.impl(), motion, path.begin + hit.t * left, path.start + hit.t * left * path.way, path.way, hit.triangle);
  }
  const Vec3 q0 = curve.local(path.begin), way = curve.local(1) - q0;
  const Hit hit = sweep_straight(mesh.impl(), q0, way, rho);
  if (!hit.any()) return std::nullopt;
  return impact_at(mesh.impl(), motion, path.begin + hit.t * (1 - path.begin), q0 + hit.t * way, way, hit.triangle);
}

std::optional<Impact> sweep(const CollisionMesh& mesh, const RigidMotion& motion, const Vec3& a, const Vec3& b, Real r) {
  CHECK(a.allFinite() && b.allFinite());
  CHECK_GE(r, 0.0);
  // Nothing is asked of the start when the whole way stays clear of the mesh.
  const Path path{.frame = {}, .start = a, .way = b - a, .begin = 0};
  if (!path.box(r).intersects(motion.swept_box(mesh.bounds()))) return std::nullopt;
  const auto nearest = mesh.nearest(motion.from().body(a), r);
  Real rho = r;
  if (nearest) {
    if (nearest->distance < 0 && nearest->distance < -mesh.impl().on_surface) return std::nullopt;
    // A little less than the distance it has: rounding shall not hold it, nor shall a chord.
    rho = std::min(r, std::max(Real{0}, nearest->distance) * (motion.turns() ? 1 / (1 + 1.01 * kChord) : 1 - 1e-9));
  }
  return sweep_path(mesh, motion, path, rho);
}

std::optional<Impact> sweep(const CollisionMesh& mesh, const Vec3& a, const Vec3& b, Real r) { return sweep(mesh, RigidMotion(), a, b, r); }

}  // namespace effuse::geometry
