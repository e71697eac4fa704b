#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <nlohmann/json.hpp>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/zones.h"
#include "skin/write/emission_ramp.h"
#include "skin/write/mesh_arrays.h"
#include "skin/write/png.h"
#include "skin/write/write_mesh.h"

namespace effuse::skin {

using geometry::TriMesh;
using geometry::VertexAttribute;
using Json = nlohmann::ordered_json;

namespace {

// glTF's names for numbers (specification 5.1.3, 5.11.5, 5.26).
enum : int { kUnsignedShort = 5123, kUnsignedInt = 5125, kFloat = 5126 };
enum : int { kVertexData = 34962, kIndexData = 34963 };
enum : int { kLinear = 9729, kClampToEdge = 33071 };

/// Our z up to glTF's y up.
Eigen::Vector3f y_up(const Vec3& v) { return Vec3(v.x(), v.z(), -v.y()).cast<float>(); }

/// The JSON and the binary chunk, growing together.
class GlbBuilder {
 public:
  Json json;

  /// Appends bytes as a buffer view, 4-byte aligned; its index. target 0: none (pictures).
  int add_view(const std::string& bytes, int target) {
    bin_.resize((bin_.size() + 3) / 4 * 4, '\0');
    Json view{{"buffer", 0}, {"byteOffset", bin_.size()}, {"byteLength", bytes.size()}};
    if (target != 0) view["target"] = target;
    bin_ += bytes;
    json["bufferViews"].push_back(std::move(view));
    return static_cast<int>(json["bufferViews"].size()) - 1;
  }
  int add_accessor(const std::string& bytes, int target, int component, std::size_t count, const char* type, Json more = Json::object()) {
    Json accessor{{"bufferView", add_view(bytes, target)}, {"componentType", component}, {"count", count}, {"type", type}};
    accessor.update(more);
    json["accessors"].push_back(std::move(accessor));
    return static_cast<int>(json["accessors"].size()) - 1;
  }

  /// The whole file: header, JSON chunk padded with blanks, binary chunk (left out when empty) with zeros.
  std::string file(const std::filesystem::path& name) {
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

 private:
  std::string bin_;
};

std::string bytes_of(const std::vector<Eigen::Vector3f>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(Eigen::Vector3f)};
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
