#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "geometry/base/types.h"

namespace effuse::importers {

/// What a look over a mesh file found before assimp parses it.
struct MeshCheck {
  /// To be parsed in place of the file: with positions relative to origin, when they lie so far out that
  /// assimp's floats would lose millimetres (map coordinates); without what its parser stumbles over.
  std::optional<std::string> rewritten;
  Vec3 origin = Vec3::Zero();        ///< to be added to what is parsed
  std::optional<std::size_t> faces;  ///< how many the file has
  std::vector<std::string> notes;
};

// assimp takes broken text for what it can make of it, or hangs on what a header promises. These refuse it
// first. Throw InputError (place: name, line): a position that is no number or not finite, a face with fewer
// than three corners or more than kMaxCorners, an index out of range, counts that do not fit the file.

/// Wavefront OBJ.
MeshCheck check_obj(std::string_view bytes, const std::string& name);
/// STL, ASCII and binary; also a solid without facets, or a facet without three vertices.
MeshCheck check_stl(std::string_view bytes, const std::string& name);
/// Object File Format, ASCII; always rewritten (assimp loses faces after comments and blank lines).
MeshCheck check_off(std::string_view bytes, const std::string& name);

}  // namespace effuse::importers
