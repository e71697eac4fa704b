#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "skin/write/emission_ramp.h"

/// A binary glTF 2.0 file as it grows: what write_glb, write_animated_glb and Flipbook have in common.
namespace effuse::skin {

using Json = nlohmann::ordered_json;

// glTF's names for numbers (specification 5.1.3, 5.11.5, 5.26).
enum : int { kUnsignedShort = 5123, kUnsignedInt = 5125, kFloat = 5126 };
enum : int { kVertexData = 34962, kIndexData = 34963 };
enum : int { kLinear = 9729, kClampToEdge = 33071 };

/// Our z up to glTF's y up.
inline Eigen::Vector3f y_up(const Vec3& v) { return Vec3(v.x(), v.z(), -v.y()).cast<float>(); }

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

  std::uint64_t bytes() const { return bin_.size(); }

  /// The whole file: header, JSON chunk padded with blanks, binary chunk (left out when empty) with zeros.
  /// Throws InputError when it would be longer than GLB can be.
  std::string file(const std::filesystem::path& name);

 private:
  std::string bin_;
};

/// Accessors of a mesh's vertices, turned to y up; positions not empty. Colours: three wide, linear.
int add_positions(GlbBuilder& glb, const std::vector<Vec3>& positions);
int add_normals(GlbBuilder& glb, const std::vector<Vec3>& normals);
int add_colors(GlbBuilder& glb, const geometry::VertexAttribute& color);
int add_triangles(GlbBuilder& glb, const geometry::TriMesh& mesh);

/// Attributes of a primitive: POSITION, NORMAL, COLOR_0 and all others in upper case, but "glow" of width 3, which becomes *glow and a ramp.
/// Throws InputError (name) for those that glTF cannot hold. The mesh is well formed and has triangles.
Json add_vertices(GlbBuilder& glb, const std::string& name, const geometry::TriMesh& mesh, const geometry::VertexAttribute** glow);

/// TEXCOORD_0 of vertices with these places on a ramp.
int add_ramp_coordinates(GlbBuilder& glb, const std::vector<float>& u);
/// The ramp as the file's image, texture and sampler, and as what the material gives off; its strength is > 0.
void add_ramp(GlbBuilder& glb, const EmissionRamp& ramp, Json& material);

/// What lies in memory.
template <class V>
std::string bytes_of(const std::vector<V>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(V)};
}

}  // namespace effuse::skin
