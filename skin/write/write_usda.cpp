#include "skin/write/write_usda.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/write/mesh_arrays.h"
#include "skin/write/usda_text_internal.h"

namespace effuse::skin {

using geometry::TriMesh;
using geometry::VertexAttribute;

namespace {

constexpr std::size_t kGrain = 8192;  // tuples a task turns into text

/// "[(1, 2, 3), (4, 5, 6)]": tuple(out, i) appends one, joined in order whatever the threads.
template <class Tuple>
std::string list(std::size_t n, Tuple&& tuple) {
  std::vector<std::string> parts((n + kGrain - 1) / kGrain);
  parallel_for(parts.size(), [&](std::size_t p) {
    fmt::memory_buffer out;
    for (std::size_t i = p * kGrain; i < std::min(n, (p + 1) * kGrain); ++i) {
      if (i > 0) fmt::format_to(std::back_inserter(out), ", ");
      tuple(out, i);
    }
    parts[p] = fmt::to_string(out);
  }, 1);
  std::string all = "[";
  for (const std::string& part : parts) all += part;
  return all + "]";
}

std::string list(const std::vector<Vec3>& vectors) {
  return list(vectors.size(), [&](fmt::memory_buffer& out, std::size_t i) {
    const Eigen::Vector3f v = vectors[i].cast<float>();
    fmt::format_to(std::back_inserter(out), "({}, {}, {})", v[0], v[1], v[2]);
  });
}

std::string list(const VertexAttribute& attribute, float scale = 1) {
  const auto width = static_cast<std::size_t>(attribute.width);
  return list(attribute.values.size() / width, [&](fmt::memory_buffer& out, std::size_t i) {
    if (width > 1) out.push_back('(');
    for (std::size_t k = 0; k < width; ++k) fmt::format_to(std::back_inserter(out), "{}{}", k > 0 ? ", " : "", scale * attribute.values[width * i + k]);
    if (width > 1) out.push_back(')');
  });
}

/// Particles have other names for the same.
bool is_points(const TriMesh& mesh) { return mesh.triangles.empty() && !mesh.positions.empty(); }

const char* type_of(const std::string& name, int width) {
  if (width == 3) return name == "glow" ? "color3f[]" : "float3[]";
  return width == 1 ? "float[]" : width == 2 ? "float2[]" : "float4[]";
}

UsdaAttribute declared(const std::string& name, int width, bool points) {
  if (name == "color" && width == 3) return {"color3f[]", "primvars:displayColor", "vertex"};
  if (name == "velocity" && width == 3) return {"vector3f[]", "velocities", ""};
  if (points && name == "radius" && width == 1) return {"float[]", "widths", "vertex"};
  if (points && name == "id" && width == 1) return {"int64[]", "ids", ""};
  return {type_of(name, width), "primvars:" + usda_identifier(name), "vertex"};
}

struct Value {
  UsdaAttribute attribute;
  std::string text;
};

/// All that varies of a mesh, as text.
std::vector<Value> values_of(const TriMesh& mesh, Real velocity_scale) {
  const bool points = is_points(mesh);
  std::vector<Value> all;
  Box3 box;
  for (const Vec3& x : mesh.positions) box.extend(x);
  if (mesh.positions.empty()) box.extend(Vec3(0, 0, 0));
  all.push_back({{"float3[]", "extent", ""}, list(std::vector<Vec3>{box.min(), box.max()})});
  if (!points) {
    all.push_back({{"int[]", "faceVertexCounts", ""}, list(mesh.triangles.size(), [](fmt::memory_buffer& out, std::size_t) { out.push_back('3'); })});
    all.push_back({{"int[]", "faceVertexIndices", ""}, list(mesh.triangles.size(), [&](fmt::memory_buffer& out, std::size_t i) {
                     fmt::format_to(std::back_inserter(out), "{}, {}, {}", mesh.triangles[i][0], mesh.triangles[i][1], mesh.triangles[i][2]);
                   })});
  }
  all.push_back({{"point3f[]", "points", ""}, list(mesh.positions)});
  if (!points) all.push_back({{"normal3f[]", "normals", "vertex"}, list(unit_normals(mesh))});
  for (const auto& [name, attribute] : mesh.attributes) {
    if (attribute.width > 4) throw InputError({name}, fmt::format("is {} wide, USD's vectors hold at most 4", attribute.width));
    const UsdaAttribute as = declared(name, attribute.width, points);
    if (as.name == "ids") {
      all.push_back({as, list(attribute.values.size(), [&](fmt::memory_buffer& out, std::size_t i) { fmt::format_to(std::back_inserter(out), "{}", std::llround(attribute.values[i])); })});
    } else {
      all.push_back({as, list(attribute, as.name == "velocities" ? static_cast<float>(velocity_scale) : as.name == "widths" ? 2.0f : 1.0f)});
    }
  }
  return all;
}

/// The file of one prim. frame: its time code; absent: values are defaults.
std::string prim_file(const TriMesh& mesh, const std::string& prim, const UsdaTime* time, const Metadata& metadata) {
  const std::string name = usda_identifier(prim);
  std::string out = usda_header(name, time ? time->fps : 0, time ? time->frame : 0, time ? time->frame : 0, metadata);
  out += fmt::format("\ndef {} \"{}\"\n{{\n", is_points(mesh) ? "Points" : "Mesh", name);
  if (!is_points(mesh)) out += "    uniform token subdivisionScheme = \"none\"\n";
  if (!time && !find_color(mesh)) out += "    color3f[] primvars:displayColor = [(0.085, 0.08, 0.05)] (interpolation = \"constant\")\n";
  for (const Value& value : values_of(mesh, time ? time->velocity_scale : 1)) {
    if (!time) {
      out += fmt::format("    {} {} = {}{}\n", value.attribute.type, value.attribute.name, value.text, usda_interpolation(value.attribute));
      continue;
    }
    if (!value.attribute.interpolation.empty()) out += usda_declaration(value.attribute);
    out += fmt::format("    {} {}.timeSamples = {{\n        {}: {},\n    }}\n", value.attribute.type, value.attribute.name, time->frame, value.text);
  }
  return out + "}\n";
}

}  // namespace

std::vector<UsdaAttribute> usda_attributes(const TriMesh& mesh) {
  const bool points = is_points(mesh);
  std::vector<UsdaAttribute> all = {{"float3[]", "extent", ""}, {"point3f[]", "points", ""}};
  if (!points) all.insert(all.end(), {{"int[]", "faceVertexCounts", ""}, {"int[]", "faceVertexIndices", ""}, {"normal3f[]", "normals", "vertex"}});
  for (const auto& [name, attribute] : mesh.attributes) all.push_back(declared(name, attribute.width, points));
  return all;
}

void write_usda_frame(const std::filesystem::path& file, const TriMesh& mesh, const std::string& prim, const UsdaTime& time, const Metadata& metadata) {
  ZONE("write.usda");
  require_well_formed(file.string(), mesh);
  write_file(file, prim_file(mesh, prim, &time, metadata));
}

void write_usda_still(const std::filesystem::path& file, const TriMesh& mesh, const std::string& prim, const Metadata& metadata) {
  ZONE("write.usda");
  require_well_formed(file.string(), mesh);
  write_file(file, prim_file(mesh, prim, nullptr, metadata));
}

}  // namespace effuse::skin
