#pragma once

#include <optional>

#include "geometry/collide/collision_mesh.h"
#include "geometry/collide/rigid_pose.h"

/// When a moving sphere first touches a surface. Nothing is sampled, so nothing is jumped over, at any speed.
namespace effuse::geometry {

/// First touch.
///   time    share of the way, 0 .. 1
///   point   of the surface that is touched [m], at that time
///   normal  unit, from there to the sphere's centre; for a radius of 0 the touched triangle's, on the side the point
///           comes from
///   triangle  of the mesh
struct Impact {
  Real time = 0;
  Vec3 point = Vec3::Zero();
  Vec3 normal = Vec3::UnitZ();
  Index triangle = 0;
};

/// Sphere of radius r >= 0 whose centre goes straight from p to p + d, against the triangle (a, b, c), from both sides:
/// the earliest t in [0, 1] with |p + t d - triangle| <= r (face, three sides, three corners; closed form each).
/// nullopt: none. 0 when it overlaps at the start, unless it is moving away from the nearest point.
std::optional<Real> sweep_triangle(const Vec3& p, const Vec3& d, Real r, const Vec3& a, const Vec3& b, const Vec3& c);

/// Sphere of radius r >= 0 from a to b [m] against a mesh at rest, in the mesh's frame. nullopt: no touch.
///
/// A sphere that is nearer than r at the start keeps that distance as its radius: it may leave or slide along, but
/// comes no nearer. On a sheet itself (distance 0) it may leave to either side, and has none to be kept on.
/// A start inside a solid gives nothing: that is for contacts to settle (CollisionMesh::nearest).
std::optional<Impact> sweep(const CollisionMesh& mesh, const Vec3& a, const Vec3& b, Real r);

/// The same in the world, against a mesh that moves from motion.from() to motion.to() meanwhile. point and normal are
/// those in the world at the time of the touch.
///
/// With a mesh that only shifts: exact. With one that turns, the sphere's way in the mesh's frame is a curve, cut into
/// chords whose distance from the curve is at most kChord times the radius that is kept, and that much is added to
/// the radius: the touch may be found at up to (1 + 2 kChord) of it, never nearer than at it; and who starts nearer than
/// its radius keeps 1.01 kChord less than that distance. (At a radius of 0: kChord of 1e-3 of the mesh's size.)
inline constexpr Real kChord = 1.0 / 256;
std::optional<Impact> sweep(const CollisionMesh& mesh, const RigidMotion& motion, const Vec3& a, const Vec3& b, Real r);

}  // namespace effuse::geometry
