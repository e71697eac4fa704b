#pragma once

#include <span>
#include <vector>

#include "geometry/fracture/cell_layout.h"
#include "geometry/fracture/convex_clip.h"
#include "geometry/mesh/mass_properties.h"
#include "geometry/mesh/tri_mesh.h"

/// A closed body cut into cells along which it may break.
namespace effuse::geometry {

/// A flat face of a cell: corners counter-clockwise from outside, and the cell behind it (kOuterFace: the body's own surface).
struct CellFace {
  std::vector<Index> loop;
  Index beyond = kOuterFace;
};

struct FractureCell {
  std::vector<CellFace> faces;
  MassProperties mass;   ///< at density 1
  Index region = 0;      ///< the region it was cut from; a region of a hollow body may give several cells
  bool convex = true;
};

/// Where two cells meet. All its polygons lie in one plane.
struct CellInterface {
  Index a = 0, b = 0;              ///< a < b
  Real area = 0;                   ///< [m^2]
  Vec3 centre = Vec3::Zero();      ///< of area [m]
  Vec3 normal = Vec3::UnitZ();     ///< unit, from a to b
  Mat3 second = Mat3::Zero();      ///< integral of r r^T over the area, r from the centre [m^4]
  std::vector<Vec3> rim;           ///< its corners [m]
};

/// Cells fill the body and meet at shared vertices: what one face ends at, so does its neighbour.
struct FracturedBody {
  std::vector<Vec3> vertices;
  std::vector<FractureCell> cells;
  std::vector<CellInterface> interfaces;   ///< by a, then b
  std::vector<CellRegion> regions;
  Real volume = 0;                         ///< of the body [m^3]

  /// The cell a point of the body lies in, or the nearest by its region's sides.
  Index cell_at(const Vec3& p) const;
};

/// Cuts a closed mesh along regions that fill space. Convex bodies are cut polygon by polygon, all others by CGAL's corefinement with
/// exact predicates. Cells' volumes add up to the body's within 1e-9 of it (checked; more is an InputError), and every cell's surface is
/// closed. Throws InputError, one sentence, for a mesh that is open, cuts through itself or has solids inside one another.
/// The same bits on any number of threads. Convex bodies: about 10 us a face of a cell; CGAL: some 5 ms a cell and thousand triangles.
FracturedBody fracture(const TriMesh& body, std::span<const CellRegion> regions);

/// The surface of some of its cells together: faces between two of them are left out. Corners are not shared between faces; at the same
/// place they have the same bits. Attribute "inner": 1 on faces that breaking has made, 0 on the body's own surface.
/// Normals are the faces'. which: rising.
TriMesh surface_of(const FracturedBody& body, std::span<const Index> which);

/// Of some cells together, at density 1.
MassProperties mass_of(const FracturedBody& body, std::span<const Index> which);

}  // namespace effuse::geometry
