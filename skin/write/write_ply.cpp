#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <set>
#include <span>

#include "geometry/base/check.h"
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

/// Ids of regions as words of 32 bits, one or two for each.
struct RegionWords {
  std::vector<std::uint32_t> words;  // words_each for each region
  std::size_t words_each = 0;
  bool beyond_float = false;

  explicit RegionWords(const RegionLabels* labels) {
    if (!labels || labels->id.empty()) {
      words_each = labels ? 1 : 0;
      return;
    }
    const std::uint64_t largest = *std::max_element(labels->id.begin(), labels->id.end());
    beyond_float = largest > 1u << 24;
    words_each = largest >> 32 ? 2 : 1;
    for (const std::uint64_t id : labels->id)
      for (std::size_t k = 0; k < words_each; ++k) words.push_back(static_cast<std::uint32_t>(id >> (32 * k)));
  }
  std::size_t bytes() const { return words_each * sizeof(std::uint32_t); }
  const std::uint32_t* of(Index region) const { return words.data() + words_each * region; }
};

void check_labels(const RegionLabels& labels, const TriMesh& mesh) {
  CHECK_EQ(labels.of_vertex.size(), mesh.positions.size());
  if (!labels.of_triangle.empty()) CHECK_EQ(labels.of_triangle.size(), mesh.triangles.size());
  CHECK_EQ(labels.id.size(), labels.particle.size());
  for (const std::vector<Index>* of : {&labels.of_vertex, &labels.of_triangle})
    if (!of->empty()) CHECK_LT(std::size_t{*std::max_element(of->begin(), of->end())}, labels.id.size());
}

constexpr const char* kRegionNames[] = {"region", "region_high"};

void write(const std::filesystem::path& file, const TriMesh& mesh, const RegionLabels* labels, const Metadata& metadata, bool exact) {
  ZONE("write.ply");
  require_well_formed(file.string(), mesh);
  if (labels) check_labels(*labels, mesh);
  const RegionWords regions(labels);
  const bool faces_too = labels && !labels->of_triangle.empty();
  const std::size_t n = mesh.positions.size();
  const std::vector<Vec3> normals = unit_normals(mesh);

  // Header.
  Layout layout;
  std::string out = "ply\nformat binary_little_endian 1.0\ncomment effuse, metres, z up\n";
  for (const auto& [key, value] : metadata) out += fmt::format("comment {}: {}\n", one_line(key), one_line(value));
  if (regions.beyond_float) out += "comment region: whole numbers above 2^24, which readers that keep them as float round\n";
  out += fmt::format("element vertex {}\n", n);
  std::set<std::string> taken;
  for (const std::string name : {"x", "y", "z", "nx", "ny", "nz"}) {
    out += fmt::format("property {} {}\n", exact && name.size() == 1 ? "double" : "float", name);
    taken.insert(name);
  }
  if (exact) layout.stride += 3 * (sizeof(double) - sizeof(float));
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
  std::string region_properties;
  for (std::size_t k = 0; k < regions.words_each; ++k) {
    if (!taken.insert(kRegionNames[k]).second)
      throw InputError({file.string()}, fmt::format("an attribute would be a second property \"{}\" of the PLY file", kRegionNames[k]));
    region_properties += fmt::format("property uint {}\n", kRegionNames[k]);
  }
  layout.stride += regions.bytes();
  out += region_properties;
  out += fmt::format("element face {}\nproperty list uchar uint vertex_indices\n{}end_header\n", mesh.triangles.size(), faces_too ? region_properties : "");

  // Vertices, then faces, each into its own place.
  constexpr std::size_t kCorners = 3 * sizeof(std::uint32_t);
  const std::size_t face = 1 + kCorners + (faces_too ? regions.bytes() : 0);
  const std::size_t vertices_at = out.size(), faces_at = vertices_at + n * layout.stride;
  out.resize(faces_at + mesh.triangles.size() * face);
  const SrgbEncoder srgb;
  parallel_for(n, [&](std::size_t i) {
    char* to = out.data() + vertices_at + i * layout.stride;
    const auto put = [&to](const void* from, std::size_t size) {
      std::memcpy(to, from, size);
      to += size;
    };
    const Eigen::Vector3f position = mesh.positions[i].cast<float>(), normal = normals[i].cast<float>();
    if (exact) put(mesh.positions[i].data(), 3 * sizeof(double));
    else put(position.data(), 3 * sizeof(float));
    put(normal.data(), 3 * sizeof(float));
    if (layout.color)
      for (std::size_t k = 0; k < 3; ++k) *to++ = static_cast<char>(srgb(layout.color->values[3 * i + k]));
    for (const VertexAttribute* scalar : layout.scalars) {
      const std::size_t width = static_cast<std::size_t>(scalar->width);
      put(scalar->values.data() + width * i, width * sizeof(float));
    }
    if (labels) put(regions.of(labels->of_vertex[i]), regions.bytes());
  });
  parallel_for(mesh.triangles.size(), [&](std::size_t i) {
    char* to = out.data() + faces_at + i * face;
    *to = 3;
    std::memcpy(to + 1, mesh.triangles[i].data(), kCorners);
    if (faces_too) std::memcpy(to + 1 + kCorners, regions.of(labels->of_triangle[i]), regions.bytes());
  });
  write_file(file, out);
}

}  // namespace

void write_ply(const std::filesystem::path& file, const TriMesh& mesh, const Metadata& metadata) { write(file, mesh, nullptr, metadata, false); }

void write_exact_ply(const std::filesystem::path& file, const TriMesh& mesh, const Metadata& metadata) { write(file, mesh, nullptr, metadata, true); }

void write_skin_ply(const std::filesystem::path& file, const TriMesh& mesh, const RegionLabels& labels, const Metadata& metadata) {
  write(file, mesh, &labels, metadata, false);
}

}  // namespace effuse::skin
