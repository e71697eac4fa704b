#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <nlohmann/json.hpp>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/zones.h"
#include "skin/write/emission_ramp.h"
#include "skin/write/glb_builder_internal.h"
#include "skin/write/mesh_arrays.h"
#include "skin/write/png.h"
#include "skin/write/write_mesh.h"

namespace effuse::skin {

using geometry::TriMesh;
using geometry::VertexAttribute;

namespace {

int add_attribute(GlbBuilder& glb, const VertexAttribute& attribute) {
  constexpr std::array kTypes{"SCALAR", "VEC2", "VEC3", "VEC4"};
  std::vector<float> values = attribute.values;
  if (attribute.width == 3)
    for (std::size_t i = 0; i + 2 < values.size(); i += 3) {
      std::swap(values[i + 1], values[i + 2]);
      values[i + 2] = -values[i + 2];
    }
  const std::size_t width = static_cast<std::size_t>(attribute.width);
  return glb.add_accessor({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float)}, kVertexData, kFloat,
                          values.size() / width, kTypes[width - 1]);
}

/// "velocity" -> "_VELOCITY"; application attributes must begin with an underscore.
std::string attribute_name(const std::string& name) {
  std::string upper = "_";
  for (const char c : name) {
    if (c >= 'a' && c <= 'z')
      upper += static_cast<char>(c - 'a' + 'A');
    else
      upper += (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ? c : '_';
  }
  return upper;
}

/// The emissive texture and its place on each vertex; fills material and attributes. Nothing when nothing glows.
void add_glow(GlbBuilder& glb, const VertexAttribute& glow, Json& material, Json& attributes) {
  const EmissionRamp ramp = make_emission_ramp(glow);
  if (!(ramp.strength > 0)) return;
  std::vector<float> uv;
  uv.reserve(2 * ramp.coordinate.size());
  for (const float u : ramp.coordinate) uv.insert(uv.end(), {u, 0.5f});
  attributes["TEXCOORD_0"] = glb.add_accessor({reinterpret_cast<const char*>(uv.data()), uv.size() * sizeof(float)}, kVertexData, kFloat,
                                              ramp.coordinate.size(), "VEC2");
  const int picture = glb.add_view(encode_png(ramp.image), 0);
  glb.json["images"] = Json::array({{{"name", "glow"}, {"bufferView", picture}, {"mimeType", "image/png"}}});
  glb.json["samplers"] = Json::array({{{"magFilter", kLinear}, {"minFilter", kLinear}, {"wrapS", kClampToEdge}, {"wrapT", kClampToEdge}}});
  glb.json["textures"] = Json::array({{{"sampler", 0}, {"source", 0}}});
  material["emissiveTexture"] = {{"index", 0}, {"texCoord", 0}};
  const float factor = std::min(ramp.strength, 1.0f);
  material["emissiveFactor"] = {factor, factor, factor};
  if (ramp.strength > 1) {
    material["extensions"]["KHR_materials_emissive_strength"] = {{"emissiveStrength", ramp.strength}};
    glb.json["extensionsUsed"] = {"KHR_materials_emissive_strength"};
  }
}

}  // namespace

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
  Json attributes;
  attributes["POSITION"] = add_positions(glb, mesh.positions);
  attributes["NORMAL"] = add_normals(glb, unit_normals(mesh));
  Json material{{"name", stem}, {"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 0.85}}}};
  const VertexAttribute* color = find_color(mesh);
  if (color)
    attributes["COLOR_0"] = add_colors(glb, *color);
  else
    material["pbrMetallicRoughness"]["baseColorFactor"] = {0.3, 0.28, 0.26, 1};
  for (const auto& [name, attribute] : mesh.attributes) {
    if (&attribute == color) continue;
    if (name == "glow" && attribute.width == 3) {
      add_glow(glb, attribute, material, attributes);
      continue;
    }
    const std::string semantic = attribute_name(name);
    if (attribute.width > 4)
      throw InputError({file.string()}, fmt::format("attribute \"{}\" is {} wide, glTF holds at most 4", name, attribute.width));
    if (attributes.contains(semantic))
      throw InputError({file.string()}, fmt::format("attribute \"{}\" would be a second {} of the glTF file", name, semantic));
    attributes[semantic] = add_attribute(glb, attribute);
  }
  const int indices =
      glb.add_accessor({reinterpret_cast<const char*>(mesh.triangles.data()), mesh.triangles.size() * sizeof(geometry::Triangle)},
                       kIndexData, kUnsignedInt, 3 * mesh.triangles.size(), "SCALAR");
  glb.json["materials"] = Json::array({material});
  glb.json["meshes"] =
      Json::array({{{"name", stem}, {"primitives", Json::array({{{"attributes", attributes}, {"indices", indices}, {"material", 0}}})}}});
  write_file(file, glb.file(file));
}

}  // namespace effuse::skin
