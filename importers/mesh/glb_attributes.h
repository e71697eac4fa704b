#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::importers {

/// One primitive of a glTF mesh with attributes of its own making (_TEMPERATURE, ...), which assimp drops.
struct GlbPrimitive {
  std::string mesh_name;  ///< "" when the mesh has none
  std::size_t vertices = 0;
  std::map<std::string, geometry::VertexAttribute> attributes;  ///< _TEMPERATURE as "temperature"
};

/// The primitives of a GLB file, in the order of its meshes. Accessors that are sparse, or that lie outside
/// the file's binary chunk, are left out with a note.
/// Throws InputError when the container or its JSON is broken, nested so deeply that a reader may crash, or requires an extension that
/// changes what positions are.
std::vector<GlbPrimitive> read_glb_primitives(std::string_view bytes, const std::string& name, std::vector<std::string>& notes);

/// The file with its JSON chunk filled up to a multiple of four bytes, as the standard wants and assimp insists on;
/// "" when it is so already. bytes must have passed read_glb_primitives.
std::string aligned_glb(std::string_view bytes);

/// Refuses JSON nested deeper than a recursive parser bears, node trees deeper than a recursive reader, and required extensions as above.
void check_gltf_json(std::string_view json, const std::string& name);

}  // namespace effuse::importers
