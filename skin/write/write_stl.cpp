#include <fmt/format.h>

#include <cstdint>
#include <cstring>

#include "geometry/base/files.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/write/mesh_arrays.h"
#include "skin/write/write_mesh.h"

namespace effuse::skin {

void write_stl(const std::filesystem::path& file, const geometry::TriMesh& mesh, const Metadata& metadata) {
  ZONE("write.stl");
  require_well_formed(file.string(), mesh);
  constexpr std::size_t kHeader = 80, kTriangle = 12 * sizeof(float) + sizeof(std::uint16_t);
  std::string out = "effuse, metres, z up";
  for (const char* wanted : {"origin", "crs"})
    for (const auto& [key, value] : metadata)
      if (key == wanted && !value.empty()) out += fmt::format("; {} {}", key, one_line(value));
  out.resize(kHeader, ' ');
  append_bytes(out, static_cast<std::uint32_t>(mesh.triangles.size()));
  const std::size_t start = out.size();
  out.resize(start + mesh.triangles.size() * kTriangle, '\0');
  parallel_for(mesh.triangles.size(), [&](std::size_t t) {
    const auto& [a, b, c] = mesh.triangles[t];
    const Vec3 area = (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]);
    const Real length = area.norm();
    char* to = out.data() + start + t * kTriangle;
    const auto put = [&to](const Vec3& v) {
      const Eigen::Vector3f as_float = v.cast<float>();
      std::memcpy(to, as_float.data(), 3 * sizeof(float));
      to += 3 * sizeof(float);
    };
    put(length > 0 ? Vec3(area / length) : Vec3(Vec3::Zero()));
    for (const Index corner : {a, b, c}) put(mesh.positions[corner]);
  });
  write_file(file, out);
}

}  // namespace effuse::skin
