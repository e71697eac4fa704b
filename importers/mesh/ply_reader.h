#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::importers {

/// What stands in a PLY file: vertices, polygons, and what else the vertices carry.
struct PlyMesh {
  std::vector<Vec3> positions;  ///< as exact as the file: double properties stay double
  std::vector<Vec3> normals;    ///< nx ny nz, or empty
  std::map<std::string, geometry::VertexAttribute> attributes;
  std::vector<Index> corners;           ///< of all polygons, one after the other; each < positions.size()
  std::vector<std::size_t> face_start;  ///< into corners; one more than there are polygons
  std::vector<std::string> notes;
};

/// A PLY file: ascii, binary little and big endian; every scalar type by both its names; lists; elements and
/// properties in any order, unknown ones skipped; comments anywhere in the header; LF, CRLF or CR in it.
///
/// red green blue become "color" (linear light: integer types are taken for sRGB, float ones as they stand),
/// name_x name_y name_z become "name" of width 3, every other scalar of a vertex keeps its name (integers as
/// they stand, but alpha as 0..1).
/// Memory is bounded by the file's length, whatever its header promises.
///
/// Throws InputError (place: name and, in header and ascii data, the line): not a PLY file, a header that is
/// wrong or does not end, truncated data, not a number, an index out of range, a position that is not finite.
PlyMesh parse_ply(std::string_view bytes, const std::string& name);

/// Linear light from the sRGB curve, 0..1 -> 0..1 (IEC 61966-2-1).
float linear_from_srgb(float value);

/// Corners a polygon may have: cutting one into triangles takes the square of their number.
inline constexpr std::size_t kMaxCorners = 10000;

}  // namespace effuse::importers
