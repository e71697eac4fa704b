#include "skin/page/page_bytes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "skin/color/lava_color.h"
#include "skin/color/srgb.h"

namespace effuse::skin {

using geometry::TriMesh;
using geometry::VertexAttribute;

namespace {

const VertexAttribute* find(const TriMesh& mesh, const char* name, int width) {
  const auto found = mesh.attributes.find(name);
  if (found == mesh.attributes.end() || found->second.width != width) return nullptr;
  CHECK_EQ(found->second.values.size(), static_cast<std::size_t>(width) * mesh.positions.size());
  return &found->second;
}

Vec3 at(const VertexAttribute& attribute, std::size_t v) {
  return Vec3(attribute.values[3 * v], attribute.values[3 * v + 1], attribute.values[3 * v + 2]);
}

Real brightness(const Vec3& light) { return light.dot(Vec3(0.2126, 0.7152, 0.0722)); }

/// Brightness of each byte of "glow": rising.
std::array<Real, 256> glow_brightness() {
  std::array<Real, 256> table{};
  for (int b = 0; b < 256; ++b) table[static_cast<std::size_t>(b)] = brightness(glow_of_byte(b));
  return table;
}

void add_plane(PageBytes& bytes, const char* name, const std::vector<float>& values, float low, float high) {
  BytePlane plane{name, std::vector<std::uint8_t>(values.size())};
  const float scale = high > low ? 255 / (high - low) : 0;
  parallel_for(values.size(), [&](std::size_t v) { plane.values[v] = static_cast<std::uint8_t>(std::lround(std::clamp((values[v] - low) * scale, 0.0f, 255.0f))); });
  bytes.planes.push_back(std::move(plane));
}

void add_ranged(PageBytes& bytes, const char* name, const std::vector<float>& values) {
  if (values.empty()) return;
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  bytes.ranges[name] = {*low, *high};
  add_plane(bytes, name, values, *low, *high);
}

Real nearly_all(std::vector<float> values) {
  if (values.empty()) return 0;
  const auto place = values.begin() + static_cast<std::ptrdiff_t>(0.995 * static_cast<Real>(values.size() - 1));
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

/// "red green blue" of reflected light, linear, 0..1.
template <class Light>
void add_color(PageBytes& bytes, std::size_t n, Light&& light) {
  const SrgbEncoder encode;
  std::array<BytePlane, 3> planes{BytePlane{"red", {}}, BytePlane{"green", {}}, BytePlane{"blue", {}}};
  for (BytePlane& plane : planes) plane.values.resize(n);
  parallel_for(n, [&](std::size_t v) {
    const Vec3 c = light(v);
    for (std::size_t k = 0; k < 3; ++k) planes[k].values[v] = encode(static_cast<float>(c[static_cast<Eigen::Index>(k)]));
  });
  for (BytePlane& plane : planes) bytes.planes.push_back(std::move(plane));
}

}  // namespace

Vec3 glow_of_byte(int b) {
  constexpr Real kFrom = 800, kTo = 1800;  // [K]: lava_emission begins at the first; beyond the second all is white
  return b == 0 ? Vec3(Vec3::Zero()) : lava_emission(kFrom + (kTo - kFrom) * b / 255.0);
}

PageBytes lava_bytes(const TriMesh& lava) {
  const VertexAttribute *color = find(lava, "color", 3), *glow = find(lava, "glow", 3);
  if ((!color || !glow) && find(lava, "temperature", 1)) {
    TriMesh colored = lava;
    colored.attributes.erase("color");
    color_lava(colored);
    return lava_bytes(colored);
  }
  PageBytes bytes;
  const std::size_t n = lava.positions.size();
  add_color(bytes, n, [&](std::size_t v) -> Vec3 {
    if (!color) return lava_albedo(300, 1);
    return glow ? Vec3((at(*color, v) - display_emission(at(*glow, v))).cwiseMax(0)) : at(*color, v);
  });
  if (glow) {
    const std::array<Real, 256> table = glow_brightness();
    BytePlane plane{"glow", std::vector<std::uint8_t>(n)};
    parallel_for(n, [&](std::size_t v) {
      const Real light = brightness(at(*glow, v).cwiseMax(0));
      const auto above = std::upper_bound(table.begin() + 1, table.end(), light);  // first that is brighter
      const std::size_t b = static_cast<std::size_t>(above - table.begin());
      const bool lower = b == 256 || light - table[b - 1] < table[b] - light;
      plane.values[v] = static_cast<std::uint8_t>(lower ? b - 1 : b);
    });
    bytes.planes.push_back(std::move(plane));
  }
  if (const VertexAttribute* temperature = find(lava, "temperature", 1)) add_ranged(bytes, "temperature", temperature->values);
  if (const VertexAttribute* velocity = find(lava, "velocity", 3)) {
    std::vector<float> speed(n);
    parallel_for(n, [&](std::size_t v) { speed[v] = static_cast<float>(at(*velocity, v).norm()); });
    add_ranged(bytes, "speed", speed);
    bytes.fast = nearly_all(std::move(speed));
  }
  if (const VertexAttribute* crust = find(lava, "crust", 1)) add_plane(bytes, "crust", crust->values, 0, 1);
  if (const VertexAttribute* thickness = find(lava, "thickness", 1)) {
    add_ranged(bytes, "thickness", thickness->values);
    bytes.thick = nearly_all(thickness->values);
  }
  return bytes;
}

PageBytes other_bytes(const TriMesh& mesh) {
  PageBytes bytes;
  const VertexAttribute* color = find(mesh, "color", 3);
  add_color(bytes, mesh.positions.size(), [&](std::size_t v) -> Vec3 { return color ? at(*color, v) : Vec3(Vec3::Constant(0.25)); });
  return bytes;
}

}  // namespace effuse::skin
