#pragma once

#include <array>
#include <string>
#include <string_view>

#include "geometry/base/error.h"
#include "importers/mesh/mesh_frame.h"
#include "importers/mesh/ply_reader.h"
#include "importers/mesh/text_meshes.h"
#include "importers/terrain/esri_ascii.h"
#include "importers/terrain/xyz_grid.h"

/// The parsers that are ours, from memory: what fuzz_parsers_test.cpp and libFuzzer (fuzz_target.cpp) feed.
namespace effuse::importers {

inline constexpr std::array<const char*, 6> kParsers = {".ply", ".obj", ".stl", ".off", ".asc", ".xyz"};

/// The parser of an ending reads bytes; true when it takes them. An InputError is a refusal, everything else is thrown on, and
/// what it hands out must hold together, or it is a fault that std::logic_error tells.
inline bool parse_with(std::string_view extension, std::string_view bytes) {
  const auto hold = [](bool condition, const char* what) {
    if (!condition) throw std::logic_error(what);
  };
  try {
    frame_of_own_file(bytes, std::string(extension));
    if (extension == ".ply") {
      const PlyMesh mesh = parse_ply(bytes, "fuzz");
      for (const Index i : mesh.corners) hold(i < mesh.positions.size(), "an index out of range");
      for (const Vec3& p : mesh.positions) hold(p.allFinite(), "a position that is not finite");
      hold(!mesh.face_start.empty() && mesh.face_start.back() == mesh.corners.size(), "faces that do not end with their corners");
      for (const auto& [name, attribute] : mesh.attributes) hold(attribute.values.size() == mesh.positions.size() * static_cast<std::size_t>(attribute.width), "an attribute of another length");
    } else if (extension == ".obj" || extension == ".stl" || extension == ".off") {
      const MeshCheck check = extension == ".obj" ? check_obj(bytes, "fuzz") : extension == ".stl" ? check_stl(bytes, "fuzz") : check_off(bytes, "fuzz");
      hold(check.origin.allFinite(), "an origin that is not finite");
      hold(!check.faces || *check.faces > 0, "no faces, and not refused");
      // What was written anew is taken again, and lies near the origin or as it was.
      if (check.rewritten && extension != ".stl") hold((extension == ".obj" ? check_obj(*check.rewritten, "again") : check_off(*check.rewritten, "again")).faces == check.faces, "written anew it has other faces");
    } else {
      const DemGrid grid = extension == ".asc" ? parse_esri_ascii(bytes, "fuzz") : parse_xyz(bytes, "fuzz");
      hold(grid.nx >= 2 && grid.ny >= 2 && grid.z.size() == static_cast<std::size_t>(grid.nx) * static_cast<std::size_t>(grid.ny), "a grid of another size");
      hold(grid.corner.allFinite() && grid.spacing.allFinite() && grid.spacing.minCoeff() > 0, "a grid without a place");
      hold(grid.z.size() <= 60 * bytes.size() + 1000, "a grid that its text cannot hold");
    }
    return true;
  } catch (const InputError&) {
    return false;
  }
}

}  // namespace effuse::importers
