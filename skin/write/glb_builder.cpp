#include "skin/write/glb_builder_internal.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "geometry/base/error.h"
#include "skin/write/mesh_arrays.h"

namespace effuse::skin {

using geometry::VertexAttribute;

std::string GlbBuilder::file(const std::filesystem::path& name) {
  if (!bin_.empty()) {
    bin_.resize((bin_.size() + 3) / 4 * 4, '\0');
    json["buffers"] = Json::array({{{"byteLength", bin_.size()}}});
  }
  std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const std::size_t total = 12 + 8 + text.size() + (bin_.empty() ? 0 : 8 + bin_.size());
  if (total > std::numeric_limits<std::uint32_t>::max())
    throw InputError({name.string()}, fmt::format("would be {} bytes, GLB holds at most 4294967295", total));
  const auto u32 = [](std::size_t n) { return static_cast<std::uint32_t>(n); };
  std::string out;
  out.reserve(total);
  append_bytes(out, std::uint32_t{0x46546C67});  // "glTF"
  append_bytes(out, std::uint32_t{2});
  append_bytes(out, u32(total));
  append_bytes(out, u32(text.size()));
  append_bytes(out, std::uint32_t{0x4E4F534A});  // "JSON"
  out += text;
  if (!bin_.empty()) {
    append_bytes(out, u32(bin_.size()));
    append_bytes(out, std::uint32_t{0x004E4942});  // "BIN"
    out += bin_;
  }
  return out;
}

namespace {
std::string bytes_of(const std::vector<Eigen::Vector3f>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(Eigen::Vector3f)};
}
}  // namespace

int add_positions(GlbBuilder& glb, const std::vector<Vec3>& positions) {
  std::vector<Eigen::Vector3f> turned(positions.size());
  std::transform(positions.begin(), positions.end(), turned.begin(), y_up);
  Eigen::Vector3f low = turned.front(), high = turned.front();
  for (const Eigen::Vector3f& p : turned) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const auto list = [](const Eigen::Vector3f& v) { return Json::array({v.x(), v.y(), v.z()}); };
  return glb.add_accessor(bytes_of(turned), kVertexData, kFloat, turned.size(), "VEC3", {{"min", list(low)}, {"max", list(high)}});
}

int add_normals(GlbBuilder& glb, const std::vector<Vec3>& normals) {
  std::vector<Eigen::Vector3f> turned(normals.size());
  std::transform(normals.begin(), normals.end(), turned.begin(), y_up);
  return glb.add_accessor(bytes_of(turned), kVertexData, kFloat, turned.size(), "VEC3");
}

/// Four shorts: alpha keeps readers right that expect four, and rows a multiple of four bytes long.
int add_colors(GlbBuilder& glb, const VertexAttribute& color) {
  const std::size_t n = color.values.size() / 3;
  std::vector<std::uint16_t> shorts(4 * n, 65535);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t k = 0; k < 3; ++k)
      shorts[4 * i + k] = static_cast<std::uint16_t>(std::clamp(color.values[3 * i + k], 0.0f, 1.0f) * 65535.0f + 0.5f);
  return glb.add_accessor({reinterpret_cast<const char*>(shorts.data()), shorts.size() * sizeof(std::uint16_t)}, kVertexData,
                          kUnsignedShort, n, "VEC4", {{"normalized", true}});
}

}  // namespace effuse::skin
