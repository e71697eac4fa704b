#pragma once

#include <optional>
#include <vector>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::skin {

/// Each triangle in four at its edges' middles. Shape, closedness, orientation and Euler characteristic stay; attributes
/// and normals (made unit again) are the means of an edge's ends. Two triangles an edge at most, or the mesh stays
/// shared along it all the same: a vertex an edge. Vertices: the old ones first, then edges by rising ends.
geometry::TriMesh refine(const geometry::TriMesh& mesh);

/// Mean edge length over triangles' edges [m]; 0 without triangles.
Real mean_edge(const geometry::TriMesh& mesh);

/// Who looks, and how finely.
struct View {
  Vec3 eye = Vec3::Zero();     ///< [m]
  Real pixel_angle = 7e-4;     ///< [rad] that a pixel covers: field of view / height of the picture
  Real pixels = 3;             ///< edges as long as this many pixels will do
  /// What lies farther than half_angle [rad] from the direction of sight is not seen, and `unseen` times coarser. kPi: all is seen.
  Vec3 direction = Vec3::UnitX();
  Real half_angle = kPi, unseen = 8;
  /// Edge length that will do at x [m].
  Real edge_at(const Vec3& x) const;
};

struct RefineOptions {
  Real edge = 0;             ///< [m] edges longer than this are cut, > 0
  std::optional<View> view;  ///< where its edge_at is more, that counts
  bool curved = true;        ///< new vertices on a smooth surface; false: on the edges
  std::size_t most_triangles = 20'000'000;  ///< stops before it has more
};

struct RefineToReport {
  int rounds = 0;
  bool enough = true;         ///< false: most_triangles stood in the way, or edges of a mesh of very thin triangles stayed long
  std::vector<Index> parent;  ///< for each triangle that of the first mesh which it is a part of; regions go with it
};

/// Cuts edges in the middle until none is longer than asked for at its middle. An edge is cut or not by its own two ends, so that
/// the two triangles on it always agree: no crack opens between fine and coarse. Triangles with one, two or three cut edges
/// become two, three or four, those with none stay. Smallest angles stay above half the first mesh's or so (measured).
///
/// A new vertex lies on the cubic through the edge's ends p, q that leaves them at right angles to their normals m, n:
///
///   x = (p + q) / 2 + (((q - p) . n) n - ((q - p) . m) m) / 8
///
/// (the edge of a PN triangle), its normal is the mean of m and n made perpendicular to that cubic; where normals differ by more
/// than a right angle: the middle. From there it is taken onto the SmoothSurface of the first mesh, as the first vertices are,
/// so that nothing shows where triangles met; those of a mesh that is fine enough, too, so that one edge more or less from frame
/// to frame does not show.
///
///   mesh  closed or not; normals computed when it has none. Attributes: means of an edge's ends
/// 2 us a new vertex. Same bits on any number of threads.
/// Source: Vlachos, Peters, Boyd & Mitchell 2001, Curved PN triangles.
RefineToReport refine_to(geometry::TriMesh& mesh, const RefineOptions& options);

}  // namespace effuse::skin
