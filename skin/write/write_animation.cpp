#include "skin/write/write_animation.h"

#include <algorithm>
#include <map>

#include "geometry/base/check.h"
#include "geometry/base/files.h"
#include "geometry/base/zones.h"
#include "skin/write/glb_builder_internal.h"
#include "skin/write/mesh_arrays.h"

namespace effuse::skin {

namespace {

/// The rotation in axes (x, z, -y), as glTF writes it: x y z w. The same side of the sphere as `before`, so that
/// what is linear between goes the short way.
Eigen::Vector4f turned(const Quat& q, const Eigen::Vector4f& before) {
  const Eigen::Vector4f v = Eigen::Vector4d(q.x(), q.z(), -q.y(), q.w()).normalized().cast<float>();
  return v.dot(before) < 0 ? Eigen::Vector4f(-v) : v;
}

int add_mesh(GlbBuilder& glb, const std::filesystem::path& file, const MovingMesh& thing) {
  require_well_formed(file.string() + ", " + thing.name, *thing.mesh);
  Json attributes;
  attributes["POSITION"] = add_positions(glb, thing.mesh->positions);
  attributes["NORMAL"] = add_normals(glb, unit_normals(*thing.mesh));
  if (const geometry::VertexAttribute* color = find_color(*thing.mesh)) attributes["COLOR_0"] = add_colors(glb, *color);
  const int indices = add_triangles(glb, *thing.mesh);
  glb.json["meshes"].push_back({{"name", thing.name}, {"primitives", Json::array({{{"attributes", attributes}, {"indices", indices}, {"material", 0}}})}});
  return static_cast<int>(glb.json["meshes"].size()) - 1;
}

}  // namespace

void write_animated_glb(const std::filesystem::path& file, std::span<const MovingMesh> things, std::span<const Real> times, const Metadata& metadata) {
  ZONE("write.animation");
  CHECK_GE(times.size(), 1u);
  GlbBuilder glb;
  glb.json["asset"] = {{"version", "2.0"}, {"generator", "effuse"}};
  for (const auto& [key, value] : metadata) glb.json["asset"]["extras"][key] = value;
  glb.json["scene"] = 0;
  Json nodes = Json::array(), roots = Json::array(), channels = Json::array(), samplers = Json::array();
  std::map<const geometry::TriMesh*, int> meshes;
  int input = -1;
  for (const MovingMesh& thing : things) {
    CHECK_EQ(thing.poses.size(), times.size());
    if (thing.mesh->triangles.empty()) continue;
    if (!meshes.contains(thing.mesh)) meshes[thing.mesh] = add_mesh(glb, file, thing);

    std::vector<Eigen::Vector3f> positions;
    std::vector<Eigen::Vector4f> turns;
    for (const geometry::RigidPose& pose : thing.poses) {
      positions.push_back(y_up(pose.position));
      turns.push_back(turned(pose.orientation, turns.empty() ? Eigen::Vector4f::Zero() : turns.back()));
    }
    const auto number = static_cast<int>(nodes.size());
    const Eigen::Vector3f& p = positions.front();
    const Eigen::Vector4f& q = turns.front();
    nodes.push_back({{"name", thing.name}, {"mesh", meshes[thing.mesh]}, {"translation", {p[0], p[1], p[2]}}, {"rotation", {q[0], q[1], q[2], q[3]}}});
    roots.push_back(number);

    const auto animate = [&](const char* path, const std::string& bytes, const char* type) {
      if (input < 0) {
        std::vector<float> seconds(times.begin(), times.end());
        input = glb.add_accessor(bytes_of(seconds), 0, kFloat, seconds.size(), "SCALAR", {{"min", {seconds.front()}}, {"max", {seconds.back()}}});
      }
      channels.push_back({{"sampler", samplers.size()}, {"target", {{"node", number}, {"path", path}}}});
      samplers.push_back({{"input", input}, {"output", glb.add_accessor(bytes, 0, kFloat, times.size(), type)}, {"interpolation", "LINEAR"}});
    };
    if (std::any_of(positions.begin(), positions.end(), [&](const auto& other) { return other != p; })) animate("translation", bytes_of(positions), "VEC3");
    if (std::any_of(turns.begin(), turns.end(), [&](const auto& other) { return other != q; })) animate("rotation", bytes_of(turns), "VEC4");
  }
  if (nodes.empty()) {
    glb.json["scenes"] = Json::array({{{"name", file.stem().string()}}});  // no empty arrays: the specification forbids them
  } else {
    glb.json["scenes"] = Json::array({{{"name", file.stem().string()}, {"nodes", roots}}});
    glb.json["nodes"] = nodes;
    glb.json["materials"] = Json::array({{{"name", "solid"}, {"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 0.85}}}}});
    if (!channels.empty()) glb.json["animations"] = Json::array({{{"name", "film"}, {"channels", channels}, {"samplers", samplers}}});
  }
  write_file(file, glb.file(file));
}

}  // namespace effuse::skin
