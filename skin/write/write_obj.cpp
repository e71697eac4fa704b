#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

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

/// Numbers with a fixed count of decimals, through integers: five times as fast as the shortest decimal of a double.
/// |x| * 10^decimals must stay below 2^63.
class FixedPoint {
 public:
  explicit FixedPoint(int decimals) : decimals_(decimals) {
    for (int k = 0; k < decimals; ++k) unit_ *= 10;
  }
  char* write(char* to, Real x) const {
    const std::int64_t scaled = std::llround(x * static_cast<Real>(unit_));
    const std::uint64_t size = static_cast<std::uint64_t>(scaled < 0 ? -scaled : scaled);
    if (scaled < 0) *to++ = '-';
    to = std::to_chars(to, to + 20, size / unit_).ptr;
    std::uint64_t rest = size % unit_;
    if (rest == 0) return to;
    *to++ = '.';
    int left = decimals_;
    for (; rest % 10 == 0; rest /= 10) --left;  // no trailing zeros
    for (int k = left - 1; k >= 0; --k, rest /= 10) to[k] = static_cast<char>('0' + rest % 10);
    return to + left;
  }

 private:
  int decimals_;
  std::uint64_t unit_ = 1;
};

/// Decimals that give nine digits to the largest coordinate, 9 at most.
int decimals_for(const std::vector<Vec3>& positions) {
  const Real largest = parallel_max(positions.size(), 0, [&](std::size_t i) { return positions[i].cwiseAbs().maxCoeff(); });
  const int before_point = largest >= 1 ? static_cast<int>(std::floor(std::log10(largest))) + 1 : 0;
  return std::clamp(9 - before_point, 0, 9);
}

/// Appends line(i, to) for i in [0, n), each at most most_bytes, written in parallel and joined in order.
template <class Line>
void append_lines(std::string& out, std::size_t n, std::size_t most_bytes, Line&& line) {
  constexpr std::size_t kGrain = 4096;
  std::vector<std::string> parts((n + kGrain - 1) / kGrain);
  parallel_ranges(n, kGrain, [&](std::size_t begin, std::size_t end) {
    std::string& part = parts[begin / kGrain];
    part.resize((end - begin) * most_bytes);
    char* to = part.data();
    for (std::size_t i = begin; i < end; ++i) to = line(i, to);
    part.resize(static_cast<std::size_t>(to - part.data()));
  });
  std::size_t total = out.size();
  for (const std::string& part : parts) total += part.size();
  out.reserve(total);
  for (const std::string& part : parts) out += part;
}

}  // namespace

void write_obj(const std::filesystem::path& file, const TriMesh& mesh, const Metadata& metadata) {
  ZONE("write.obj");
  require_well_formed(file.string(), mesh);
  const std::size_t n = mesh.positions.size();
  const std::vector<Vec3> normals = unit_normals(mesh);
  const VertexAttribute* color = find_color(mesh);

  std::string out = "# effuse, metres, z up\n";
  for (const auto& [key, value] : metadata) out += fmt::format("# {}: {}\n", one_line(key), one_line(value));

  // Positions beyond 1e9 m (nobody's, but finite) would overflow the integers of FixedPoint.
  const int decimals = decimals_for(mesh.positions);
  const FixedPoint position(decimals), unit(6), shade(4);
  const bool huge = parallel_max(n, 0, [&](std::size_t i) { return mesh.positions[i].cwiseAbs().maxCoeff(); }) > 1e9;
  const SrgbEncoder srgb;
  append_lines(out, n, 2 + 3 * 26 + 3 * 8, [&](std::size_t i, char* to) {
    *to++ = 'v';
    for (const Real x : mesh.positions[i]) {
      *to++ = ' ';
      to = huge ? std::to_chars(to, to + 24, x, std::chars_format::general, 9).ptr : position.write(to, x);
    }
    if (color)
      for (std::size_t k = 0; k < 3; ++k) {
        *to++ = ' ';
        to = shade.write(to, srgb(color->values[3 * i + k]) / 255.0);
      }
    *to++ = '\n';
    return to;
  });
  append_lines(out, n, 3 + 3 * 10 + 1, [&](std::size_t i, char* to) {
    *to++ = 'v';
    *to++ = 'n';
    for (const Real x : normals[i]) {
      *to++ = ' ';
      to = unit.write(to, x);
    }
    *to++ = '\n';
    return to;
  });
  append_lines(out, mesh.triangles.size(), 2 + 3 * 23, [&](std::size_t i, char* to) {
    *to++ = 'f';
    for (const Index vertex : mesh.triangles[i]) {
      const std::uint64_t number = std::uint64_t{vertex} + 1;  // OBJ counts from 1
      *to++ = ' ';
      to = std::to_chars(to, to + 10, number).ptr;
      *to++ = '/';
      *to++ = '/';
      to = std::to_chars(to, to + 10, number).ptr;
    }
    *to++ = '\n';
    return to;
  });
  write_file(file, out);
}

}  // namespace effuse::skin
