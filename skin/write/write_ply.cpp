#include <fmt/format.h>

#include <cstring>
#include <set>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/color/srgb.h"
#include "skin/write/mesh_arrays.h"
#include "skin/write/write_mesh.h"

namespace effuse::skin {

using geometry::TriMesh;
using geometry::VertexAttribute;

namespace {

/// An attribute's name as one word; more than one number: name_x, name_y, ...
std::string property_name(const std::string& name, int width, int component) {
  std::string word = name;
  for (char& c : word)
    if (static_cast<unsigned char>(c) <= 0x20 || c == 0x7f) c = '_';
  if (width == 1) return word;
  if (width <= 4) return word + '_' + "xyzw"[component];
  return fmt::format("{}_{}", word, component);
}

/// What lies between two vertices of the file and where the floats of it come from.
struct Layout {
  std::vector<const VertexAttribute*> scalars;
  const VertexAttribute* color = nullptr;
  std::size_t stride = 6 * sizeof(float);
};

}  // namespace

void write_ply(const std::filesystem::path& file, const TriMesh& mesh, const Metadata& metadata) {
  ZONE("write.ply");
  require_well_formed(file.string(), mesh);
  const std::size_t n = mesh.positions.size();
  const std::vector<Vec3> normals = unit_normals(mesh);

  // Header.
  Layout layout;
  std::string out = "ply\nformat binary_little_endian 1.0\ncomment effuse, metres, z up\n";
  for (const auto& [key, value] : metadata) out += fmt::format("comment {}: {}\n", one_line(key), one_line(value));
  out += fmt::format("element vertex {}\n", n);
  std::set<std::string> taken;
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz"}) {
    out += fmt::format("property float {}\n", name);
    taken.insert(name);
  }
  layout.color = find_color(mesh);
  if (layout.color) {
    out += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    taken.insert({"red", "green", "blue"});
    layout.stride += 3;
  }
  for (const auto& [name, attribute] : mesh.attributes) {
    if (&attribute == layout.color) continue;
    for (int k = 0; k < attribute.width; ++k) {
      const std::string property = property_name(name, attribute.width, k);
      if (!taken.insert(property).second)
        throw InputError({file.string()},
                         fmt::format("attribute \"{}\" would be a second property \"{}\" of the PLY file", name, property));
      out += fmt::format("property float {}\n", property);
    }
    layout.scalars.push_back(&attribute);
    layout.stride += sizeof(float) * static_cast<std::size_t>(attribute.width);
  }
  out += fmt::format("element face {}\nproperty list uchar uint vertex_indices\nend_header\n", mesh.triangles.size());

  // Vertices, then faces, each into its own place.
  constexpr std::size_t kFace = 1 + 3 * sizeof(std::uint32_t);
  const std::size_t vertices_at = out.size(), faces_at = vertices_at + n * layout.stride;
  out.resize(faces_at + mesh.triangles.size() * kFace);
  const SrgbEncoder srgb;
  parallel_for(n, [&](std::size_t i) {
    char* to = out.data() + vertices_at + i * layout.stride;
    const auto put = [&to](const void* from, std::size_t size) {
      std::memcpy(to, from, size);
      to += size;
    };
    const Eigen::Vector3f position = mesh.positions[i].cast<float>(), normal = normals[i].cast<float>();
    put(position.data(), 3 * sizeof(float));
    put(normal.data(), 3 * sizeof(float));
    if (layout.color)
      for (std::size_t k = 0; k < 3; ++k) *to++ = static_cast<char>(srgb(layout.color->values[3 * i + k]));
    for (const VertexAttribute* scalar : layout.scalars) {
      const std::size_t width = static_cast<std::size_t>(scalar->width);
      put(scalar->values.data() + width * i, width * sizeof(float));
    }
  });
  parallel_for(mesh.triangles.size(), [&](std::size_t i) {
    char* to = out.data() + faces_at + i * kFace;
    *to = 3;
    std::memcpy(to + 1, mesh.triangles[i].data(), 3 * sizeof(std::uint32_t));
  });
  write_file(file, out);
}

}  // namespace effuse::skin
