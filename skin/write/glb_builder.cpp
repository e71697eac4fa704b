#include "skin/write/glb_builder_internal.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>

#include "geometry/base/error.h"
#include "skin/write/mesh_arrays.h"
#include "skin/write/png.h"

namespace effuse::skin {

using geometry::VertexAttribute;

std::string GlbBuilder::file(const std::filesystem::path& name) {
  if (!bin_.empty()) {
    bin_.resize((bin_.size() + 3) / 4 * 4, '\0');
    json["buffers"] = Json::array({{{"byteLength", bin_.size()}}});
  }
  std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const std::size_t total = 12 + 8 + text.size() + (bin_.empty() ? 0 : 8 + bin_.size());
  if (total > std::numeric_limits<std::uint32_t>::max())
    throw InputError({name.string()}, fmt::format("would be {} bytes, GLB holds at most 4294967295", total));
  const auto u32 = [](std::size_t n) { return static_cast<std::uint32_t>(n); };
  std::string out;
  out.reserve(total);
  append_bytes(out, std::uint32_t{0x46546C67});  // "glTF"
  append_bytes(out, std::uint32_t{2});
  append_bytes(out, u32(total));
  append_bytes(out, u32(text.size()));
  append_bytes(out, std::uint32_t{0x4E4F534A});  // "JSON"
  out += text;
  if (!bin_.empty()) {
    append_bytes(out, u32(bin_.size()));
    append_bytes(out, std::uint32_t{0x004E4942});  // "BIN"
    out += bin_;
  }
  return out;
}

int add_positions(GlbBuilder& glb, const std::vector<Vec3>& positions) {
  std::vector<Eigen::Vector3f> turned(positions.size());
  std::transform(positions.begin(), positions.end(), turned.begin(), y_up);
  Eigen::Vector3f low = turned.front(), high = turned.front();
  for (const Eigen::Vector3f& p : turned) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const auto list = [](const Eigen::Vector3f& v) { return Json::array({v.x(), v.y(), v.z()}); };
  return glb.add_accessor(bytes_of(turned), kVertexData, kFloat, turned.size(), "VEC3", {{"min", list(low)}, {"max", list(high)}});
}

int add_normals(GlbBuilder& glb, const std::vector<Vec3>& normals) {
  std::vector<Eigen::Vector3f> turned(normals.size());
  std::transform(normals.begin(), normals.end(), turned.begin(), y_up);
  return glb.add_accessor(bytes_of(turned), kVertexData, kFloat, turned.size(), "VEC3");
}

/// Four shorts: alpha keeps readers right that expect four, and rows a multiple of four bytes long.
int add_colors(GlbBuilder& glb, const VertexAttribute& color) {
  const std::size_t n = color.values.size() / 3;
  std::vector<std::uint16_t> shorts(4 * n, 65535);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t k = 0; k < 3; ++k)
      shorts[4 * i + k] = static_cast<std::uint16_t>(std::clamp(color.values[3 * i + k], 0.0f, 1.0f) * 65535.0f + 0.5f);
  return glb.add_accessor({reinterpret_cast<const char*>(shorts.data()), shorts.size() * sizeof(std::uint16_t)}, kVertexData,
                          kUnsignedShort, n, "VEC4", {{"normalized", true}});
}

int add_triangles(GlbBuilder& glb, const geometry::TriMesh& mesh) { return glb.add_accessor(bytes_of(mesh.triangles), kIndexData, kUnsignedInt, 3 * mesh.triangles.size(), "SCALAR"); }

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

}  // namespace

Json add_vertices(GlbBuilder& glb, const std::string& name, const geometry::TriMesh& mesh, const VertexAttribute** glow) {
  Json attributes;
  attributes["POSITION"] = add_positions(glb, mesh.positions);
  attributes["NORMAL"] = add_normals(glb, unit_normals(mesh));
  const VertexAttribute* color = find_color(mesh);
  if (color) attributes["COLOR_0"] = add_colors(glb, *color);
  for (const auto& [key, attribute] : mesh.attributes) {
    if (&attribute == color) continue;
    if (key == "glow" && attribute.width == 3) {
      *glow = &attribute;
      continue;
    }
    const std::string semantic = attribute_name(key);
    if (attribute.width > 4) throw InputError({name}, fmt::format("attribute \"{}\" is {} wide, glTF holds at most 4", key, attribute.width));
    if (attributes.contains(semantic)) throw InputError({name}, fmt::format("attribute \"{}\" would be a second {} of the glTF file", key, semantic));
    attributes[semantic] = add_attribute(glb, attribute);
  }
  return attributes;
}

int add_ramp_coordinates(GlbBuilder& glb, const std::vector<float>& u) {
  std::vector<float> uv;
  uv.reserve(2 * u.size());
  for (const float each : u) uv.insert(uv.end(), {each, 0.5f});
  return glb.add_accessor(bytes_of(uv), kVertexData, kFloat, u.size(), "VEC2");
}

void add_ramp(GlbBuilder& glb, const EmissionRamp& ramp, Json& material) {
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

}  // namespace effuse::skin
