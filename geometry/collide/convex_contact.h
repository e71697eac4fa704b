#pragma once

#include <array>
#include <limits>
#include <span>

#include "geometry/collide/convex_hull.h"

/// Where two convex solids touch, or nearly do: manifolds for rigid bodies. Everything in one frame, that of A.
namespace effuse::geometry {

/// One place of a contact: where it is on each of the two, and how far apart they are there along the normal.
struct ManifoldPoint {
  Vec3 on_a = Vec3::Zero(), on_b = Vec3::Zero();  ///< [m]
  Real separation = 0;                            ///< [m], negative in overlap
  Real of_a = 0.5;  ///< 1: a corner of A, and goes with it while the two slide; 0: of B; 1/2: of neither, or both
};

/// Up to four places that share a normal: enough to hold a flat contact up (three would rattle).
///   normal  unit, from A to B
struct Manifold {
  static constexpr int kMost = 4;
  Vec3 normal = Vec3::UnitZ();
  int count = 0;
  std::array<ManifoldPoint, kMost> points;
  std::span<const ManifoldPoint> all() const { return {points.data(), static_cast<std::size_t>(count)}; }
};

/// Keeps at most four of the points: the deepest, that furthest from it, and the two that span the largest area on
/// either side. Ties: the first. points are reordered; returns how many stay, in front.
int reduce_manifold(std::span<ManifoldPoint> points, const Vec3& normal);

/// Polyhedron against polyhedron by separating axes: the faces of both, and the pairs of edges whose arcs cross on the
/// Gauss map (Gregorius 2013, GDC: the separating axis test between convex polyhedra). The axis of least overlap
/// carries the manifold: side face clipped by side face, or the one place where two edges pass. A face is preferred
/// to a pair of edges that is better by less than `slop`, so that a flat contact stays one.
///   margin  [m] >= 0: places up to so far apart are given, for contacts to come
///   slop    [m] > 0: a length nobody sees, 1e-3 of the smaller one is a good one
/// No point: further apart than margin. Apart, separation is that between parallel planes: at most the true distance.
Manifold hull_contact(const ConvexHull& a, const ConvexHull& b, Real margin, Real slop);

/// Sphere B (centre c, radius r >= 0 [m]) against polyhedron A: exact.
Manifold hull_sphere_contact(const ConvexHull& a, const Vec3& c, Real r, Real margin);

/// Sphere against sphere: exact. Concentric ones part along +z.
Manifold sphere_contact(const Vec3& a, Real radius_a, const Vec3& b, Real radius_b, Real margin);

/// Signed distance [m] to the hull's surface, the nearest point on it and the outward direction there. Outside by
/// the nearest face, edge or vertex, exact; inside by the nearest face plane.
struct HullPoint {
  Real distance = 0;
  Vec3 point = Vec3::Zero(), normal = Vec3::UnitZ();
};
HullPoint nearest_on_hull(const ConvexHull& hull, const Vec3& p);

}  // namespace effuse::geometry
