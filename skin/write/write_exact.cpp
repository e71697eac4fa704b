#include "skin/write/write_exact.h"

#include <fmt/format.h>

#include <iterator>

#include "geometry/base/files.h"
#include "geometry/base/zones.h"
#include "skin/write/mesh_arrays.h"

namespace effuse::skin {

namespace {
std::string comments(const Metadata& metadata) {
  std::string out = "# effuse, metres, z up\n";
  for (const auto& [key, value] : metadata) out += fmt::format("# {}: {}\n", one_line(key), one_line(value));
  return out;
}
}  // namespace

void write_off(const std::filesystem::path& file, const geometry::TriMesh& mesh, const Metadata& metadata) {
  ZONE("write.off");
  require_well_formed(file.string(), mesh);
  std::string out = "OFF\n" + comments(metadata);
  const auto to = std::back_inserter(out);
  fmt::format_to(to, "{} {} 0\n", mesh.positions.size(), mesh.triangles.size());
  for (const Vec3& p : mesh.positions) fmt::format_to(to, "{} {} {}\n", p.x(), p.y(), p.z());
  for (const auto& [a, b, c] : mesh.triangles) fmt::format_to(to, "3 {} {} {}\n", a, b, c);
  write_file(file, out);
}

void write_exact_obj(const std::filesystem::path& file, const geometry::TriMesh& mesh, const Metadata& metadata) {
  ZONE("write.obj");
  require_well_formed(file.string(), mesh);
  std::string out = comments(metadata);
  const auto to = std::back_inserter(out);
  for (const Vec3& p : mesh.positions) fmt::format_to(to, "v {} {} {}\n", p.x(), p.y(), p.z());
  for (const auto& [a, b, c] : mesh.triangles) fmt::format_to(to, "f {} {} {}\n", std::uint64_t{a} + 1, std::uint64_t{b} + 1, std::uint64_t{c} + 1);
  write_file(file, out);
}

}  // namespace effuse::skin
