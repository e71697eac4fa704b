#pragma once

#include "geometry/mesh/tri_mesh.h"

/// Plain shapes as triangles, counter-clockwise from outside. Closed ones are solids for validate().
/// Sizes must be positive and counts at least the least that makes the shape (checked).
namespace effuse::geometry {

/// The box from low to high [m]: 8 vertices, 12 triangles.
TriMesh make_box(const Vec3& low, const Vec3& high);

/// An icosahedron whose triangles are split in four, subdivisions times, all vertices on the sphere:
/// 20 * 4^subdivisions triangles. Its volume falls short of the sphere's by about 40 % / 4^subdivisions.
TriMesh make_sphere(const Vec3& centre, Real radius, int subdivisions);

/// A ring about the z axis through centre: tube of the given radius along a circle of radius ring > tube [m];
/// around quads along the ring, across round the tube, both >= 3, split into triangles. Vertices lie on the torus.
TriMesh make_torus(const Vec3& centre, Real ring, Real tube, int around, int across);

/// Flat sheet at height corner.z facing up: nx by ny quads of the given size [m], each two triangles; open.
TriMesh make_grid(const Vec3& corner, const Vec2& quad, int nx, int ny);

/// Adds other to mesh: positions, triangles, and normals and attributes when both have the same ones (else they are dropped).
void append(TriMesh& mesh, const TriMesh& other);

}  // namespace effuse::geometry
