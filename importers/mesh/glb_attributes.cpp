#include "importers/mesh/glb_attributes.h"

#include <fmt/format.h>

#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>

#include "geometry/base/error.h"
#include "importers/input_file.h"

namespace effuse::importers {

using Json = nlohmann::json;

namespace {

constexpr int kJsonDepth = 200;
constexpr int kNodeDepth = 1000;

std::uint32_t little32(std::string_view bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t b = 4; b-- > 0;) value = (value << 8) | static_cast<unsigned char>(bytes[at + b]);
  return value;
}

/// Member of an object as an unsigned number; fallback when absent, nullopt when it is something else.
std::optional<std::uint64_t> unsigned_member(const Json& object, const char* key, std::optional<std::uint64_t> fallback = std::nullopt) {
  if (!object.is_object() || !object.contains(key)) return fallback;
  const Json& value = object[key];
  if (!value.is_number_unsigned()) return std::nullopt;
  return value.get<std::uint64_t>();
}

/// Element n of the root's array key; nullptr when there is none.
const Json* element(const Json& root, const char* key, std::uint64_t n) {
  if (!root.contains(key) || !root[key].is_array() || n >= root[key].size() || !root[key][n].is_object()) return nullptr;
  return &root[key][n];
}

Json parse_json(std::string_view text, const std::string& name) {
  int depth = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') ++i;
      if (c == '"') in_string = false;
    } else if (c == '"') {
      in_string = true;
    } else if (c == '[' || c == '{') {
      if (++depth > kJsonDepth) throw InputError({name}, "its JSON is nested too deeply");
    } else if (c == ']' || c == '}') {
      --depth;
    }
  }
  try {
    Json json = Json::parse(text.begin(), text.end());
    if (!json.is_object()) throw InputError({name}, "its JSON is not an object");
    return json;
  } catch (const Json::exception& error) {
    throw InputError({name}, "its JSON is broken: " + printable(error.what()));
  }
}

/// Throws when nodes form chains that a recursive reader may not survive, or rings.
void check_nodes(const Json& root, const std::string& name) {
  if (!root.contains("nodes") || !root["nodes"].is_array()) return;
  const Json& nodes = root["nodes"];
  std::vector<std::size_t> parents(nodes.size(), 0);
  std::vector<std::vector<std::size_t>> children(nodes.size());
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    if (!nodes[n].is_object() || !nodes[n].contains("children") || !nodes[n]["children"].is_array()) continue;
    for (const Json& child : nodes[n]["children"]) {
      if (!child.is_number_unsigned() || child.get<std::uint64_t>() >= nodes.size())
        throw InputError({name}, fmt::format("node {} has a child that does not exist", n));
      children[n].push_back(child.get<std::size_t>());
      if (++parents[child.get<std::size_t>()] > 1)
        throw InputError({name}, fmt::format("node {} has two parents", child.get<std::size_t>()));
    }
  }
  // Trees from their roots down; what is not reached stands in a ring.
  std::vector<std::size_t> level;
  for (std::size_t n = 0; n < nodes.size(); ++n)
    if (parents[n] == 0) level.push_back(n);
  std::size_t reached = 0;
  for (int depth = 1; !level.empty(); ++depth) {
    if (depth > kNodeDepth) throw InputError({name}, fmt::format("its nodes are nested deeper than {}", kNodeDepth));
    reached += level.size();
    std::vector<std::size_t> below;
    for (std::size_t n : level) below.insert(below.end(), children[n].begin(), children[n].end());
    level = std::move(below);
  }
  if (reached < nodes.size()) throw InputError({name}, "its nodes form a ring");
}

/// Throws when the file asks for more than a reader of plain glTF 2 knows, or has positions that are no floats: assimp 5.2 takes no
/// notice of extensions, and whole numbers for the bits of floats.
void check_meaning(const Json& root, const std::string& name) {
  constexpr const char* kAdvice = "export the mesh again without compression and quantization";
  if (root.contains("extensionsRequired") && root["extensionsRequired"].is_array())
    for (const Json& extension : root["extensionsRequired"]) {
      const std::string what = extension.is_string() ? extension.get<std::string>() : "";
      // Of looks, which are not used here; draco is assimp's to unpack.
      const bool harmless = what == "KHR_draco_mesh_compression" || what.starts_with("KHR_materials_") || what.starts_with("KHR_texture_") || what.starts_with("KHR_lights_") ||
                            what.starts_with("EXT_texture_") || what == "MSFT_texture_dds";
      if (!harmless) throw InputError({name}, fmt::format("cannot be read without the glTF extension {}, which is not known here: {}", quote(what), kAdvice));
    }
  if (!root.contains("meshes") || !root["meshes"].is_array()) return;
  for (const Json& mesh : root["meshes"]) {
    if (!mesh.is_object() || !mesh.contains("primitives") || !mesh["primitives"].is_array()) continue;
    for (const Json& primitive : mesh["primitives"]) {
      if (!primitive.is_object() || !primitive.contains("attributes")) continue;
      const auto position = unsigned_member(primitive["attributes"], "POSITION");
      const Json* accessor = position ? element(root, "accessors", *position) : nullptr;
      if (accessor && unsigned_member(*accessor, "componentType", 5126) != std::uint64_t{5126})
        throw InputError({name}, fmt::format("its positions are no floats (accessor {}): {}", *position, kAdvice));
    }
  }
}

/// The numbers of an accessor in the GLB's own binary chunk; nullopt when they are not there to be read.
std::optional<geometry::VertexAttribute> read_accessor(const Json& root, std::uint64_t number, std::string_view binary) {
  const Json* accessor = element(root, "accessors", number);
  if (!accessor || accessor->contains("sparse") || !accessor->contains("type") || !(*accessor)["type"].is_string()) return std::nullopt;
  const auto view_number = unsigned_member(*accessor, "bufferView"), type = unsigned_member(*accessor, "componentType");
  const auto count = unsigned_member(*accessor, "count"), offset = unsigned_member(*accessor, "byteOffset", 0);
  if (!view_number || !type || !count || !offset) return std::nullopt;
  const Json* view = element(root, "bufferViews", *view_number);
  if (!view) return std::nullopt;
  const std::string shape = (*accessor)["type"].get<std::string>();
  const std::uint64_t width = shape == "SCALAR" ? 1 : shape == "VEC2" ? 2 : shape == "VEC3" ? 3 : shape == "VEC4" ? 4 : 0;
  const std::uint64_t size = *type == 5126 || *type == 5125   ? 4
                             : *type == 5122 || *type == 5123 ? 2
                             : *type == 5120 || *type == 5121 ? 1
                                                              : 0;
  const auto start = unsigned_member(*view, "byteOffset", 0), length = unsigned_member(*view, "byteLength");
  const auto stride = unsigned_member(*view, "byteStride", width * size), buffer = unsigned_member(*view, "buffer");
  if (width == 0 || size == 0 || !start || !length || !stride || *stride < width * size || buffer != std::uint64_t{0}) return std::nullopt;
  const Json* source = element(root, "buffers", 0);
  if (!source || source->contains("uri")) return std::nullopt;
  // Everything inside the chunk; numbers this small cannot overflow below.
  const std::uint64_t limit = binary.size();
  if (*start > limit || *length > limit - *start || *offset > *length || *count == 0 || *count > limit || *stride > limit)
    return std::nullopt;
  if ((*count - 1) * *stride + width * size > *length - *offset) return std::nullopt;
  const bool normalized =
      accessor->contains("normalized") && (*accessor)["normalized"].is_boolean() && (*accessor)["normalized"].get<bool>();

  geometry::VertexAttribute attribute;
  attribute.width = static_cast<int>(width);
  attribute.values.reserve(*count * width);
  for (std::uint64_t v = 0; v < *count; ++v) {
    for (std::uint64_t c = 0; c < width; ++c) {
      const char* at = binary.data() + *start + *offset + v * *stride + c * size;
      const auto as = [&](auto value, float scale) {
        std::memcpy(&value, at, sizeof value);
        return normalized && scale > 0 ? std::max(static_cast<float>(value) / scale, -1.f) : static_cast<float>(value);
      };
      float value = 0;
      switch (*type) {
        case 5120:
          value = as(std::int8_t{}, 127.f);
          break;
        case 5121:
          value = as(std::uint8_t{}, 255.f);
          break;
        case 5122:
          value = as(std::int16_t{}, 32767.f);
          break;
        case 5123:
          value = as(std::uint16_t{}, 65535.f);
          break;
        case 5125:
          value = as(std::uint32_t{}, 0.f);
          break;
        default:
          value = as(float{}, 0.f);
      }
      attribute.values.push_back(value);
    }
  }
  return attribute;
}

}  // namespace

void check_gltf_json(std::string_view json, const std::string& name) {
  const Json root = parse_json(json, name);
  check_nodes(root, name);
  check_meaning(root, name);
}

std::string aligned_glb(std::string_view bytes) {
  const std::size_t length = little32(bytes, 12), end = 20 + length;
  if (length % 4 == 0) return "";
  const std::string blanks(4 - length % 4, ' ');
  std::string out(bytes.substr(0, end));
  out += blanks;
  out += bytes.substr(end);
  const auto put = [&](std::size_t at, std::size_t value) {
    for (std::size_t b = 0; b < 4; ++b, value >>= 8) out[at + b] = static_cast<char>(value & 0xff);
  };
  put(8, out.size());
  put(12, length + blanks.size());
  return out;
}

std::vector<GlbPrimitive> read_glb_primitives(std::string_view bytes, const std::string& name, std::vector<std::string>& notes) {
  if (bytes.size() < 20 || !bytes.starts_with("glTF")) throw InputError({name}, "is not a GLB file: it does not begin with 'glTF'");
  if (little32(bytes, 4) != 2) throw InputError({name}, fmt::format("is glTF version {}, only 2 is read", little32(bytes, 4)));
  const std::uint64_t json_length = little32(bytes, 12);
  if (bytes.substr(16, 4) != "JSON") throw InputError({name}, "its first chunk is not JSON");
  if (json_length > bytes.size() - 20)
    throw InputError({name}, fmt::format("{} bytes of JSON are promised, {} are there: it is truncated", json_length, bytes.size() - 20));
  const Json root = parse_json(bytes.substr(20, json_length), name);
  check_nodes(root, name);
  check_meaning(root, name);

  std::string_view binary;
  const std::size_t next = 20 + json_length;
  if (bytes.size() >= next + 8) {
    const std::uint64_t length = little32(bytes, next);
    if (length > bytes.size() - next - 8)
      throw InputError({name},
                       fmt::format("{} bytes of data are promised, {} are there: it is truncated", length, bytes.size() - next - 8));
    binary = bytes.substr(next + 8, length);
  }

  std::vector<GlbPrimitive> primitives;
  if (!root.contains("meshes") || !root["meshes"].is_array()) return primitives;
  for (const Json& mesh : root["meshes"]) {
    if (!mesh.is_object() || !mesh.contains("primitives") || !mesh["primitives"].is_array()) continue;
    for (const Json& from : mesh["primitives"]) {
      GlbPrimitive& primitive = primitives.emplace_back();
      if (mesh.contains("name") && mesh["name"].is_string()) primitive.mesh_name = mesh["name"].get<std::string>();
      if (!from.is_object() || !from.contains("attributes") || !from["attributes"].is_object()) continue;
      if (const auto position = unsigned_member(from["attributes"], "POSITION"))
        if (const Json* accessor = element(root, "accessors", *position))
          primitive.vertices = unsigned_member(*accessor, "count", 0).value_or(0);
      for (const auto& [key, value] : from["attributes"].items()) {
        if (!key.starts_with('_') || key.size() < 2) continue;
        std::optional<geometry::VertexAttribute> attribute;
        if (value.is_number_unsigned()) attribute = read_accessor(root, value.get<std::uint64_t>(), binary);
        if (attribute && attribute->values.size() == primitive.vertices * static_cast<std::size_t>(attribute->width)) {
          primitive.attributes[lower(std::string_view(key).substr(1))] = std::move(*attribute);
        } else {
          notes.push_back(fmt::format("attribute {} could not be read", quote(key)));
        }
      }
    }
  }
  return primitives;
}

}  // namespace effuse::importers
