#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "geometry/query/closest_point.h"

namespace effuse::geometry {

/// A tree of boxes over triangles (CGAL's AABB tree, exact predicates): nearest triangle, rays, vertical lines.
/// Triangles of no area are left out. An empty tree answers with nothing. Const queries from many threads.
class MeshTree {
 public:
  /// Positions must be finite and indices in range (checked). Positions and triangles are copied.
  MeshTree(std::span<const Vec3> positions, std::span<const Triangle> triangles);
  ~MeshTree();
  MeshTree(MeshTree&&) noexcept;
  MeshTree& operator=(MeshTree&&) noexcept;

  struct Nearest {
    std::size_t triangle;  ///< as numbered in the constructor
    TrianglePoint at;
    Real distance;  ///< [m], >= 0
  };
  /// The nearest triangle within reach [m] of p. A small reach costs less.
  std::optional<Nearest> nearest(const Vec3& p, Real reach = std::numeric_limits<Real>::infinity()) const;

  struct Crossing {
    Real t;
    std::size_t triangle;
  };
  /// Least t in (0, t_max] where p + t d meets a triangle, from either side.
  std::optional<Crossing> ray(const Vec3& p, const Vec3& d, Real t_max) const;
  /// Every crossing of the vertical line through (x, y), t = its z [m], from the top down; a shared edge or vertex
  /// is met once per triangle, a vertical triangle at both ends of the stretch along it.
  std::vector<Crossing> vertical(Real x, Real y) const;

  std::size_t size() const;  ///< triangles in the tree

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace effuse::geometry
