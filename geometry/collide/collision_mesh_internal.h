#pragma once

#include <array>
#include <limits>
#include <span>
#include <vector>

#include "geometry/collide/box_tree.h"
#include "geometry/collide/collision_mesh.h"
#include "geometry/query/closest_point.h"

/// What a CollisionMesh holds. For geometry/collide only.
namespace effuse::geometry {

struct CollisionMesh::Impl {
  static constexpr Index kNobody = std::numeric_limits<Index>::max();

  TriMesh mesh;
  CollisionReport report;
  Box3 bounds;
  Real on_surface = 0;  ///< nearer than this is on the surface: what rounding of the coordinates may cost [m]

  // Triangles in the tree come first; after them those of no area, which only say who is whose neighbour.
  std::vector<Triangle> triangles;
  std::vector<Vec3> face_normal;             ///< unit; of one without area: its neighbour's across the longest side
  std::vector<std::array<Index, 3>> across;  ///< per side: 3 * triangle + side of the neighbour, or kNobody
  std::vector<std::array<Index, 3>> fan;     ///< per corner: which of fan_normal
  std::vector<Vec3> fan_normal;              ///< angle-weighted sum over triangles joined round a vertex; unit or zero
  std::vector<std::array<Vec3, 3>> corners;  ///< of those in the tree
  std::vector<Index> part;                   ///< per triangle
  std::vector<char> is_solid;                ///< per part
  std::vector<Index> turned_parts;           ///< solids that faced inward
  BoxTree tree;
  bool hollow = true;            ///< some edge is, or there are several parts: several surfaces may stand around a point
  std::vector<char> smooth;      ///< per triangle: its sides and corners are seen by none before a neighbour's face is

  /// A solid that other parts may reach into.
  struct Crossing {
    Box3 box;
    Index part = 0;
    std::vector<Index> members;  ///< triangles, by the tree's numbers
    BoxTree tree;
  };
  std::vector<Crossing> crossing;

  struct Found {
    Index triangle = kNobody;
    TrianglePoint at;
    Real distance2 = std::numeric_limits<Real>::infinity();
  };
  /// Of the whole mesh.
  Found find(const Vec3& p, Real reach) const;
  /// Angle-weighted pseudonormal at a point of a triangle; unit, out of a solid.
  Vec3 pseudonormal(Index triangle, const TrianglePoint& at) const;
  bool solid_at(Index triangle) const { return is_solid[part[triangle]] != 0; }

  std::optional<Nearest> nearest(const Vec3& p, Real reach) const;
  std::size_t surroundings(const Vec3& p, Real reach, std::span<Nearest> out) const;

 private:
  friend class CollisionMesh;
  void prepare(const TriMesh& input);
  std::vector<Triangle> standing_walls(std::span<const Triangle> walls) const;
  void find_parts();
  void orient_parts();
  void renumber_sides();
  void find_cavities();
  void make_normals();
  void follow(std::span<const Vec3> positions);
  void make_trees();
  void find_hollows();
  Vec3 normal_across(Index triangle, int side, const Vec3& at) const;
  Nearest answer(const Found& found, const Vec3& p, bool inside) const;
  /// Signed distance to one crossing solid, and where.
  Real depth(const Crossing& solid, const Vec3& p, Found& found) const;
  /// Index of a crossing solid that holds p deeper than rounding, the least deep of them; -1: none.
  int holder(const Vec3& p, Found& found) const;
  Nearest way_out(const Vec3& p) const;
};

}  // namespace effuse::geometry
