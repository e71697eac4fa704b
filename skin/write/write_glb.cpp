#include "geometry/base/files.h"
#include "geometry/base/zones.h"
#include "skin/write/glb_builder_internal.h"
#include "skin/write/mesh_arrays.h"
#include "skin/write/write_mesh.h"

namespace effuse::skin {

using geometry::TriMesh;
using geometry::VertexAttribute;

void write_glb(const std::filesystem::path& file, const TriMesh& mesh, const Metadata& metadata) {
  ZONE("write.glb");
  require_well_formed(file.string(), mesh);

  GlbBuilder glb;
  glb.json["asset"] = {{"version", "2.0"}, {"generator", "effuse"}};
  for (const auto& [key, value] : metadata) glb.json["asset"]["extras"][key] = value;
  glb.json["scene"] = 0;
  const std::string stem = file.stem().string();
  if (mesh.triangles.empty()) {
    // No empty arrays: the specification forbids them.
    glb.json["scenes"] = Json::array({{{"name", stem}}});
    write_file(file, glb.file(file));
    return;
  }
  glb.json["scenes"] = Json::array({{{"name", stem}, {"nodes", {0}}}});
  glb.json["nodes"] = Json::array({{{"name", stem}, {"mesh", 0}}});

  // Vertex data, then indices.
  const VertexAttribute* glow = nullptr;
  Json attributes = add_vertices(glb, file.string(), mesh, &glow);
  Json material{{"name", stem}, {"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 0.85}}}};
  if (!find_color(mesh)) material["pbrMetallicRoughness"]["baseColorFactor"] = {0.3, 0.28, 0.26, 1};
  if (glow)
    if (const EmissionRamp ramp = make_emission_ramp(*glow); ramp.strength > 0) {
      attributes["TEXCOORD_0"] = add_ramp_coordinates(glb, ramp.coordinate);
      add_ramp(glb, ramp, material);
    }
  const int indices = add_triangles(glb, mesh);
  glb.json["materials"] = Json::array({material});
  glb.json["meshes"] =
      Json::array({{{"name", stem}, {"primitives", Json::array({{{"attributes", attributes}, {"indices", indices}, {"material", 0}}})}}});
  write_file(file, glb.file(file));
}

}  // namespace effuse::skin
