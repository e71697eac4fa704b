#pragma once

#include <string>
#include <string_view>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::importers {

enum class UpAxis { kUnknown, kX, kY, kZ };

/// What a mesh file says of its coordinates: by its format's standard, or by metadata.
struct MeshFrame {
  UpAxis up = UpAxis::kUnknown;
  Real metres_per_unit = 0;     ///< 0: it does not say
  Vec3 origin = Vec3::Zero();   ///< on the map [m], of files that effuse wrote in a local frame: to be added to positions
  std::string crs;              ///< of that map
  std::string source;           ///< who says it: "glTF's standard", "its comment"; empty: nobody
};

/// What stands in PLY comments, OBJ comments, STL headers and glTF's asset.extras of files that effuse wrote; nothing of others.
/// extension as lower_extension gives it (".ply"); the first kilobytes are looked at, of GLB its JSON.
MeshFrame frame_of_own_file(std::string_view bytes, const std::string& extension);

/// The axis an open surface looks along on the whole, if it does: the ground's up. Unknown for closed ones and for crumpled ones.
UpAxis guess_up(const geometry::TriMesh& mesh);

/// Positions and normals turned so that `up` becomes z: x to y to z to x once or twice, no mirror. Unknown counts as z.
void turn_up(geometry::TriMesh& mesh, UpAxis up);

/// "x", "y", "z"; "" when unknown.
const char* name_of(UpAxis up);

}  // namespace effuse::importers
