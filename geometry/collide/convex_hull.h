#pragma once

#include <array>
#include <span>
#include <vector>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::geometry {

/// A convex solid with flat faces: what the contact of two blocks is computed from.
///
///   vertices  [m]
///   faces     n . x <= offset inside; vertices from `first`, `count` of them in `loops`, counter-clockwise from outside
///   edges     ends and the two faces beside it
///   centre    mean of the vertices: inside
struct ConvexHull {
  struct Face {
    Vec3 normal = Vec3::UnitZ();
    Real offset = 0;
    Index first = 0, count = 0;
  };
  struct Edge {
    std::array<Index, 2> vertices{}, faces{};
  };
  std::vector<Vec3> vertices;
  std::vector<Face> faces;
  std::vector<Index> loops;
  std::vector<Edge> edges;
  Vec3 centre = Vec3::Zero();

  std::span<const Index> loop(const Face& face) const { return {loops.data() + face.first, face.count}; }
  /// The vertex furthest along d; the first of several.
  Index support(const Vec3& d) const {
    Index best = 0;
    Real most = vertices[0].dot(d);
    for (Index k = 1; k < vertices.size(); ++k)
      if (const Real h = vertices[k].dot(d); h > most) most = h, best = k;
    return best;
  }
};

/// The hull of points, by CGAL; triangles of one plane (to `flatness` of the size) become one face, and points on its
/// inside or along its sides are left out. Throws InputError for points that are not finite or do not span a volume.
///   max_vertices  >= 8: a hull with more is replaced by that of the vertices extreme along max_vertices even
///                 directions, which lies inside it (contact of two hulls costs the product of their edges)
ConvexHull make_convex_hull(std::span<const Vec3> points, std::size_t max_vertices = 64, Real flatness = 1e-6);

/// The box from -half to half, half > 0 (checked).
ConvexHull make_box_hull(const Vec3& half);

/// hull turned by the rotation R, then moved by t.
ConvexHull transformed(const ConvexHull& hull, const Mat3& R, const Vec3& t);
/// The same into memory that is there already: nothing is allocated when `out` held a hull of this size.
void transform_into(const ConvexHull& hull, const Mat3& R, const Vec3& t, ConvexHull& out);

/// Its surface as triangles, counter-clockwise from outside: closed.
TriMesh mesh_of(const ConvexHull& hull);

}  // namespace effuse::geometry
