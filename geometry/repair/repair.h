#pragma once

#include <string>
#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "geometry/mesh/validate.h"

namespace effuse::geometry {

/// What repair() may do. Lengths in the mesh's own unit, metres as a rule.
struct RepairOptions {
  Real stitch = -1;      ///< border vertices no farther apart than this become one; < 0: kStitch of the box's diagonal
  Real fill_holes = 0;   ///< holes whose border fits into a box of this diagonal are filled; infinity: every one, a sheet's outer rim, too

  /// Positions that were equal before a program rounded them to floats of its own: eight steps of a float.
  static constexpr Real kStitch = 1e-6;
};

/// Every change, counted.
struct RepairReport {
  MeshReport before, after;
  std::size_t welded_vertices = 0;      ///< at exactly the place of another
  std::size_t stitched_vertices = 0;    ///< on a border, within the stitch of another
  std::size_t unused_vertices = 0;      ///< dropped
  std::size_t collapsed_triangles = 0;  ///< dropped: two corners were, or became, one
  std::size_t flat_triangles = 0;       ///< of no area, dropped; the neighbour on the long side was cut at the middle corner
  std::size_t duplicate_triangles = 0;  ///< dropped: another has the same corners
  std::size_t inner_walls = 0;          ///< dropped: pairs back to back, between two solids that share them
  std::size_t parted_edges = 0;         ///< had three triangles or more
  std::size_t split_vertices = 0;       ///< added, at the places of others: sheets that touch have each their own
  std::size_t midpoint_vertices = 0;    ///< added in the middle of edges that one sheet runs along twice
  std::size_t cut_edges = 0;            ///< opened, because no winding suits both sides (a Moebius strip)
  std::size_t turned_triangles = 0;     ///< wound the other way than in the input
  std::size_t inward_shells = 0;        ///< closed, left facing inward because they lie within another: rooms
  std::size_t filled_holes = 0, hole_triangles = 0, hole_vertices = 0;
  std::size_t open_holes = 0;           ///< left: larger than asked, or not to be filled without a fold
  Real largest_hole = 0;                ///< of those [m], diagonal of the border's box
  bool dropped_normals = false;         ///< vertex normals did not fit the new mesh and went

  bool changed() const;
};

/// The report's changes, one line each, for people; empty when nothing changed.
std::vector<std::string> to_lines(const RepairReport& report);

/// Manifold, oriented, no degenerate triangle, no vertex unused: closed or not.
bool sound(const MeshReport& report);

/// Makes a mesh sound: welds vertices at equal positions and borders a hair apart; drops degenerate and duplicate triangles;
/// parts edges and vertices where more than one sheet meets, so that what was solid stays solid (around an edge, a
/// triangle goes on to the next one behind its back); winds each component one way, closed ones outward unless they lie
/// in another (or else as most of their area was); fills holes up to a size.
///
/// A mesh that is sound, welded and faces outward is left alone to the bit, its vertices' order, too. Vertices that are split
/// take their attributes along. Self-intersections stay (self_intersections.h). Indices must be in range and positions
/// finite (validate() says; InputError). O(n log n), holes aside: their triangulation takes up to the square of their vertices (CGAL, Liepa 2003,
/// Filling holes in meshes); holes of more than kLargestHole stay open. The same bits on any number of threads.
RepairReport repair(TriMesh& mesh, const RepairOptions& options = {});

inline constexpr std::size_t kLargestHole = 5000;  ///< border vertices

}  // namespace effuse::geometry
