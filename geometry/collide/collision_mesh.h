#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::geometry {

/// What was found in a mesh, and what was done to it. Triangles are counted after what stands before.
struct CollisionReport {
  std::size_t merged_vertices = 0;  ///< at exactly equal positions
  std::size_t dropped = 0;          ///< triangles without area
  std::size_t doubled = 0;          ///< triangles on the same three vertices as another: copies, and walls between solids
  std::size_t triangles = 0;        ///< that remain
  std::size_t parts = 0, solids = 0, sheets = 0;  ///< parts = solids + sheets
  std::size_t flipped = 0;   ///< triangles turned over so that a closed part's run the same way round
  std::size_t turned = 0;    ///< solids that faced inward as a whole, turned outward
  std::size_t cavities = 0;  ///< closed parts that face inward, wholly within a solid: room in it, counted with it
  std::size_t crossing = 0;  ///< solids that other parts may reach into: asked one by one
};

/// One line for people: "1,250 triangles: 3 solids (1 turned outward), 1 sheet; 4 triangles without area dropped".
std::string to_string(const CollisionReport& report);

/// Any mesh as an obstacle: clean, messy, thin, open. Immutable and cheap to copy (shared); const queries from many
/// threads. Everything in the mesh's own frame.
///
/// Vertices at equal positions are one. Triangles are joined into parts across edges that just two of them share. A
/// part that is then closed, can be oriented and encloses a volume is a *solid* (its triangles are turned to face
/// outward); every other is a *sheet*, of no thickness and with two sides alike. Inside is what is inside any solid:
/// of nested solids the inner one makes no cavity, unless it faces inward, and neither touches nor cuts another part. (A part that cuts through itself keeps its distances; inside it, beside
/// the cut, the sign is that of the nearest sheet.)
///
/// Candidates are found in a tree of boxes that FCL builds (BVHModel); what is answered is computed in double from the
/// triangles themselves. One thread, points within 0.1 m of a torus of radii 3 m and 1 m: about 2 M answers a second at
/// 10 k triangles, 0.9 M at 100 k, 0.3 M at 1 M.
class CollisionMesh {
 public:
  /// Throws InputError when the mesh is not well formed (validate.h) or has no triangle of area > 0.
  explicit CollisionMesh(const TriMesh& mesh);

  /// The surface as seen from a point.
  ///   point     nearest on the surface [m]
  ///   normal    unit: (p - point) / |p - point| outside, the reverse inside; on the surface itself (within 1e-12 of
  ///             the coordinates) the angle-weighted pseudonormal of the face, edge or vertex (Baerentzen & Aanaes 2005)
  ///   distance  [m]; negative inside a solid, never at a sheet
  ///   triangle  of mesh() that point is on; of several the answer is always the same one
  ///   solid     false: a sheet
  struct Nearest {
    Vec3 point = Vec3::Zero();
    Vec3 normal = Vec3::UnitZ();
    Real distance = std::numeric_limits<Real>::infinity();
    Index triangle = 0;
    bool solid = false;
  };

  /// The surface within reach [m] of p, on either side; nullopt: none (or p is not finite). Exact to rounding.
  ///
  /// Inside solids that other parts reach into (report().crossing) the answer is a way out of all of them: the point
  /// is on the surface of one and in no other. Not always the shortest way, but never longer than leaving them by
  /// turns. A small reach costs less.
  std::optional<Nearest> nearest(const Vec3& p, Real reach = std::numeric_limits<Real>::infinity()) const;

  /// The surfaces around a point that stand apart, nearest first: in the corner of a room its walls and its floor. Places within
  /// reach whose distance is least among their surroundings, that face p (of solids) and lie before the planes of nearer ones,
  /// with normals that differ from theirs by at least kApart. Inside a solid: the way out alone. How many were found.
  /// Where no edge is hollow that is nearest(), and costs as much.
  static constexpr Real kApart = 30 * kPi / 180;
  std::size_t surroundings(const Vec3& p, Real reach, std::span<Nearest> out) const;

  /// Barycentric coordinates of a point of a triangle of mesh(); of another point those of the place in the triangle's plane below it.
  Vec3 weights(Index triangle, const Vec3& p) const;

  /// Distance [m], negative inside a solid; +infinity when nothing is within reach.
  Real signed_distance(const Vec3& p, Real reach = std::numeric_limits<Real>::infinity()) const;
  /// Inside a solid, not on its surface.
  bool inside(const Vec3& p) const;

  /// Its vertices stand elsewhere now: positions [m], one for each of mesh()'s, in their order. The tree is refitted, nothing is welded, dropped
  /// or turned anew: a solid that folds through itself, or a triangle that loses its area, is for the caller to avoid. Copies made before
  /// keep what they had. False, and nothing done, where that is not enough: the mesh has several parts, or triangles without area.
  bool follow(std::span<const Vec3> positions);

  /// As it is used: welded, without what was dropped, solids facing outward.
  const TriMesh& mesh() const;
  const Box3& bounds() const;
  const CollisionReport& report() const;
  /// Whether every part is a solid.
  bool solid() const;

  struct Impl;
  const Impl& impl() const { return *impl_; }  ///< for geometry/collide only

 private:
  std::shared_ptr<const Impl> impl_;
};

}  // namespace effuse::geometry
