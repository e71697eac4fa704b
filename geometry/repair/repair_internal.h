#pragma once

#include <array>
#include <limits>
#include <span>
#include <vector>

#include "geometry/repair/repair.h"

/// The steps of repair(), in order. Each keeps the order of the triangles and vertices that stay.
namespace effuse::geometry {

/// A side of a triangle: 3 * triangle + k runs from its corner k to the next.
using Side = std::size_t;
inline constexpr Side kNoSide = std::numeric_limits<Side>::max();

inline Side next_side(Side s) { return s % 3 == 2 ? s - 2 : s + 1; }
inline Index from_of(const TriMesh& mesh, Side s) { return mesh.triangles[s / 3][s % 3]; }
inline Index to_of(const TriMesh& mesh, Side s) { return mesh.triangles[s / 3][(s + 1) % 3 == 0 ? 0 : s % 3 + 1]; }

/// Sides grouped by their edge: those of edge e are sides[start[e]] to sides[start[e + 1]], by number; edges by their vertices.
struct EdgeList {
  std::vector<Side> sides;
  std::vector<std::size_t> start;
  std::size_t size() const { return start.size() - 1; }
  std::span<const Side> of(std::size_t e) const { return std::span(sides).subspan(start[e], start[e + 1] - start[e]); }
};
EdgeList edges_of(const TriMesh& mesh);

/// Appends a copy of vertex v, attributes and normal too; its number.
Index copy_vertex(TriMesh& mesh, Index v);
/// Appends a vertex at the mean of others.
Index mean_vertex(TriMesh& mesh, std::span<const Index> of);

/// Takes the last vertex back.
void drop_last_vertex(TriMesh& mesh);

/// Which triangle had which winding in the input: rotations and cuts keep it, turning changes it.
struct Turned {
  std::vector<char> triangle;
};

void stitch_borders(TriMesh& mesh, Real reach, RepairReport& report);
void drop_flat(TriMesh& mesh, RepairReport& report);
void drop_duplicates(TriMesh& mesh, RepairReport& report);
/// Links sides across edges, winds linked triangles alike, and gives each fan of triangles a vertex of its own.
void part_sheets(TriMesh& mesh, Turned& turned, RepairReport& report);
void fill_holes(TriMesh& mesh, Real largest, Turned& turned, RepairReport& report);
/// Closed components outward.
void face_outward(TriMesh& mesh, Turned& turned, RepairReport& report);

/// Triangles of a hole's border, its corners in order: three numbers each into border; CGAL. Empty when it finds none.
std::vector<Triangle> triangulate_border(const std::vector<Vec3>& border);

}  // namespace effuse::geometry
