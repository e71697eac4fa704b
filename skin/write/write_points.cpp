#include "skin/write/write_points.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/write/mesh_arrays.h"

namespace effuse::skin {

using geometry::Points;

namespace {

/// A quantity under its name in one format.
struct Quantity {
  const char* name;
  std::span<const Real> scalar;
  std::span<const Vec3> vector;
  bool empty() const { return scalar.empty() && vector.empty(); }
  std::size_t width() const { return vector.empty() ? 1 : 3; }
  float operator()(std::size_t i, std::size_t k) const {
    return static_cast<float>(vector.empty() ? scalar[i] : vector[i][static_cast<Eigen::Index>(k)]);
  }
};

/// What the points have, besides positions and ids.
std::vector<Quantity> quantities(const Points& p, const char* radius, const char* velocity) {
  std::vector<Quantity> all = {{radius, p.radius, {}}, {velocity, {}, p.velocity}, {"temperature", p.temperature, {}}, {"crust", p.crust, {}},
                               {"age", p.age, {}},     {"opacity", p.opacity, {}}, {"rest", {}, p.rest},       {"rest2", {}, p.rest2}};
  std::erase_if(all, [](const Quantity& q) { return q.empty(); });
  return all;
}

void require_well_formed(const std::filesystem::path& file, const Points& points) {
  const std::size_t n = points.size();
  if (n >= std::numeric_limits<std::int32_t>::max()) throw InputError({file.string()}, fmt::format("{} particles are too many for it", n));
  if (!points.id.empty() && points.id.size() != n) throw InputError({file.string()}, fmt::format("{} ids for {} particles", points.id.size(), n));
  std::vector<Quantity> all = quantities(points, "radius", "velocity");
  all.push_back({"position", {}, points.position});
  for (const Quantity& q : all) {
    const std::size_t size = q.scalar.size() + q.vector.size();
    if (size != n) throw InputError({file.string()}, fmt::format("\"{}\" has {} values for {} particles", q.name, size, n));
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t k = 0; k < q.width(); ++k)
        if (!std::isfinite(q(i, k))) throw InputError({file.string()}, fmt::format("\"{}\" of particle {} is not finite in single precision", q.name, i));
  }
}

std::uint64_t largest_id(const Points& points) { return points.id.empty() ? 0 : *std::max_element(points.id.begin(), points.id.end()); }
bool ids_fit(const Points& points, std::uint64_t most) { return largest_id(points) <= most; }

/// Throws unless double holds them all.
void require_exact_ids(const std::filesystem::path& file, const Points& points) {
  if (!ids_fit(points, std::uint64_t{1} << 53)) throw InputError({file.string()}, fmt::format("id {} does not fit: it is not exact beyond 2^53", largest_id(points)));
}

/// The bytes of a value at to, most significant first; returns what follows them.
template <class T>
char* put_big_endian(char* to, T value) {
  static_assert(std::endian::native == std::endian::little);
  const char* from = reinterpret_cast<const char*>(&value);
  return std::reverse_copy(from, from + sizeof value, to);
}

template <class T>
char* put(char* to, T value) {
  static_assert(std::endian::native == std::endian::little, "the files are little-endian");
  std::memcpy(to, &value, sizeof value);
  return to + sizeof value;
}

template <class T>
void append_big_endian(std::string& out, T value) {
  char bytes[sizeof value];
  put_big_endian(bytes, value);
  out.append(bytes, sizeof value);
}

}  // namespace

void write_points_ply(const std::filesystem::path& file, const Points& points, const Metadata& metadata) {
  ZONE("write.points");
  require_well_formed(file, points);
  require_exact_ids(file, points);
  const std::size_t n = points.size();
  const std::vector<Quantity> all = quantities(points, "radius", "velocity");
  const bool short_ids = ids_fit(points, std::numeric_limits<std::uint32_t>::max());

  std::string out = "ply\nformat binary_little_endian 1.0\ncomment effuse particles, metres, seconds, kelvin\n";
  for (const auto& [key, value] : metadata) out += fmt::format("comment {}: {}\n", one_line(key), one_line(value));
  out += fmt::format("element vertex {}\nproperty float x\nproperty float y\nproperty float z\n", n);
  std::size_t stride = 3 * sizeof(float);
  for (const Quantity& q : all) {
    if (q.width() == 1) out += fmt::format("property float {}\n", q.name);
    else
      for (const char c : {'x', 'y', 'z'}) out += fmt::format("property float {}_{}\n", q.name, c);
    stride += sizeof(float) * q.width();
  }
  if (!points.id.empty()) {
    out += short_ids ? "property uint id\n" : "property double id\n";
    stride += short_ids ? 4 : 8;
  }
  out += "end_header\n";

  const std::size_t begin = out.size();
  out.resize(begin + n * stride);
  parallel_for(n, [&](std::size_t i) {
    char* to = out.data() + begin + i * stride;
    for (const Real x : points.position[i]) to = put(to, static_cast<float>(x));
    for (const Quantity& q : all)
      for (std::size_t k = 0; k < q.width(); ++k) to = put(to, q(i, k));
    if (points.id.empty()) return;
    if (short_ids) put(to, static_cast<std::uint32_t>(points.id[i]));
    else put(to, static_cast<double>(points.id[i]));
  });
  write_file(file, out);
}

void write_points_vtk(const std::filesystem::path& file, const Points& points, const Metadata& metadata) {
  ZONE("write.points");
  require_well_formed(file, points);
  require_exact_ids(file, points);
  const std::size_t n = points.size();
  const std::vector<Quantity> all = quantities(points, "radius", "velocity");
  const bool short_ids = ids_fit(points, std::numeric_limits<std::uint32_t>::max());

  std::string title = "effuse particles, metres, seconds, kelvin";
  for (const auto& [key, value] : metadata) title += fmt::format("; {}: {}", one_line(key), one_line(value));
  std::string out = fmt::format("# vtk DataFile Version 3.0\n{}\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS {} float\n", title.substr(0, 255), n);
  // Room for an array's n * width values of size bytes, filled by fill(to, i).
  const auto array = [&](std::size_t bytes_each, const auto& fill) {
    const std::size_t begin = out.size();
    out.resize(begin + n * bytes_each + 1);
    parallel_for(n, [&](std::size_t i) { fill(out.data() + begin + i * bytes_each, i); });
    out.back() = '\n';
  };
  array(12, [&](char* to, std::size_t i) {
    for (const Real x : points.position[i]) to = put_big_endian(to, static_cast<float>(x));
  });
  out += fmt::format("CELLS {} {}\n", n, 2 * n);
  array(8, [&](char* to, std::size_t i) { put_big_endian(put_big_endian(to, std::int32_t{1}), static_cast<std::int32_t>(i)); });
  out += fmt::format("CELL_TYPES {}\n", n);
  array(4, [&](char* to, std::size_t) { put_big_endian(to, std::int32_t{1}); });  // VTK_VERTEX
  const std::size_t arrays = all.size() + (points.id.empty() ? 0 : 1);
  if (arrays > 0) out += fmt::format("POINT_DATA {}\nFIELD FieldData {}\n", n, arrays);
  for (const Quantity& q : all) {
    out += fmt::format("{} {} {} float\n", q.name, q.width(), n);
    array(4 * q.width(), [&](char* to, std::size_t i) {
      for (std::size_t k = 0; k < q.width(); ++k) to = put_big_endian(to, q(i, k));
    });
  }
  if (!points.id.empty()) {
    out += fmt::format("id 1 {} {}\n", n, short_ids ? "unsigned_int" : "double");
    array(short_ids ? 4 : 8, [&](char* to, std::size_t i) {
      if (short_ids) put_big_endian(to, static_cast<std::uint32_t>(points.id[i]));
      else put_big_endian(to, static_cast<double>(points.id[i]));
    });
  }
  write_file(file, out);
}

void write_points_bgeo(const std::filesystem::path& file, const Points& points) {
  ZONE("write.points");
  require_well_formed(file, points);
  const std::size_t n = points.size();
  const std::vector<Quantity> all = quantities(points, "pscale", "v");
  if (!ids_fit(points, std::numeric_limits<std::int32_t>::max()))
    throw InputError({file.string()}, fmt::format("id {} does not fit: the integers of a BGEO file end at 2147483647", largest_id(points)));

  std::string out = "BgeoV";
  append_big_endian(out, std::int32_t{5});
  const std::size_t attributes = all.size() + (points.id.empty() ? 0 : 1);
  for (const std::size_t count : {n, std::size_t{0}, std::size_t{0}, std::size_t{0}, attributes, std::size_t{0}, std::size_t{0}, std::size_t{0}})
    append_big_endian(out, static_cast<std::int32_t>(count));
  std::size_t record = 4;  // x y z w
  const auto define = [&](const char* name, std::size_t width, std::int32_t type) {
    append_big_endian(out, static_cast<std::uint16_t>(std::strlen(name)));
    out += name;
    append_big_endian(out, static_cast<std::uint16_t>(width));
    append_big_endian(out, type);
    out.append(4 * width, '\0');  // the default
    record += width;
  };
  constexpr std::int32_t kFloat = 0, kInteger = 1, kVector = 5;
  for (const Quantity& q : all) define(q.name, q.width(), q.width() == 3 ? kVector : kFloat);
  if (!points.id.empty()) define("id", 1, kInteger);

  const std::size_t begin = out.size();
  out.resize(begin + 4 * record * n);
  parallel_for(n, [&](std::size_t i) {
    char* to = out.data() + begin + 4 * record * i;
    for (const Real x : points.position[i]) to = put_big_endian(to, static_cast<float>(x));
    to = put_big_endian(to, 1.0f);
    for (const Quantity& q : all)
      for (std::size_t k = 0; k < q.width(); ++k) to = put_big_endian(to, q(i, k));
    if (!points.id.empty()) put_big_endian(to, static_cast<std::int32_t>(points.id[i]));
  });
  out += std::string("\0\xff", 2);  // beginning and end of what Houdini adds
  write_file(file, out);
}

}  // namespace effuse::skin
