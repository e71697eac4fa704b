#include "samples/effuse/air_look.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

#include "flow/particles/density_grid.h"
#include "geometry/procedural/primitives.h"
#include "skin/color/lava_color.h"

namespace effuse {

using flow::NamedCloud;

namespace {
constexpr std::size_t kMostCells = 2'000'000;
constexpr Real kFlame = 0.35;  // light of a tongue of fire, beside that of rock as hot: soot is thin
}  // namespace

void add_cloud(skin::Air& air, const NamedCloud& cloud, Real exposure) {
  if (cloud.look == NamedCloud::Look::kPuffs) {
    flow::particles::DensityGridOptions options;
    options.most_cells = kMostCells;
    add_volume(air, flow::particles::density_grid(cloud.x, cloud.radius, cloud.opacity, cloud.temperature, options), cloud.color);
    return;
  }
  const bool glows = cloud.look == NamedCloud::Look::kGlow;
  for (std::size_t i = 0; i < cloud.x.size(); ++i) {
    if (cloud.opacity[i] <= 0) continue;
    skin::Speck s;
    s.position = cloud.x[i];
    s.streak = exposure * cloud.v[i];
    s.radius = cloud.radius[i];
    s.color = cloud.color;
    s.opacity = cloud.opacity[i];
    if (glows) {
      s.glow = skin::lava_emission(cloud.temperature[i]);
      // What is see-through is a flame, whose light adds up; else a clot.
      s.soft = cloud.soft;
      if (s.soft) s.glow *= kFlame, s.streak.setZero();
      if (s.soft && s.glow.isZero()) continue;
    }
    air.specks.push_back(s);
  }
}

void add_volume(skin::Air& air, geometry::GridVolume volume, const Vec3& color) {
  if (volume.size() > 0) air.clouds.push_back({std::move(volume), color});
}

skin::Metadata with_color(skin::Metadata about, const Vec3& color) {
  about.emplace_back("color", fmt::format("{} {} {}", color.x(), color.y(), color.z()));
  return about;
}

skin::Metadata with_look(skin::Metadata about, const NamedCloud& cloud) {
  about.emplace_back("look", cloud.look == NamedCloud::Look::kPuffs ? "puffs" : cloud.soft ? "flames" : cloud.look == NamedCloud::Look::kGlow ? "glow" : "grains");
  return with_color(std::move(about), cloud.color);
}

std::optional<Vec3> color_of(const skin::Metadata& about) {
  Vec3 color;
  for (const auto& [name, text] : about)
    if (name == "color" && std::sscanf(text.c_str(), "%lf %lf %lf", &color.x(), &color.y(), &color.z()) == 3) return color;
  return std::nullopt;
}

bool take_look(const skin::Metadata& about, NamedCloud& cloud) {
  const std::optional<Vec3> color = color_of(about);
  const auto look = std::find_if(about.begin(), about.end(), [](const auto& one) { return one.first == "look"; });
  if (!color || look == about.end()) return false;
  cloud.color = *color;
  cloud.soft = look->second == "flames";
  cloud.look = look->second == "puffs" ? NamedCloud::Look::kPuffs : cloud.soft || look->second == "glow" ? NamedCloud::Look::kGlow : NamedCloud::Look::kGrains;
  return true;
}

geometry::TriMesh spheres_of(const NamedCloud& cloud) {
  const geometry::TriMesh ball = geometry::make_sphere(Vec3::Zero(), 1, 0);
  geometry::TriMesh all;
  geometry::VertexAttribute &color = all.attributes["color"], &temperature = all.attributes["temperature"], &velocity = all.attributes["velocity"], &age = all.attributes["age"];
  color.width = velocity.width = 3;
  temperature.width = age.width = 1;
  for (std::size_t i = 0; i < cloud.x.size(); ++i) {
    const auto first = static_cast<Index>(all.positions.size());
    for (const geometry::Triangle& t : ball.triangles) all.triangles.push_back({first + t[0], first + t[1], first + t[2]});
    for (const Vec3& p : ball.positions) {
      all.positions.push_back(cloud.x[i] + cloud.radius[i] * p);
      all.normals.push_back(p);
      temperature.values.push_back(static_cast<float>(cloud.temperature[i]));
      age.values.push_back(static_cast<float>(cloud.age[i]));
      for (int c = 0; c < 3; ++c) {
        color.values.push_back(static_cast<float>(cloud.color[c]));
        velocity.values.push_back(static_cast<float>(cloud.v[i][c]));
      }
    }
  }
  return all;
}

void append_to_picture(geometry::TriMesh& all, const geometry::TriMesh& mesh) {
  constexpr float kGrey = 0.4f;
  const auto only = [](const geometry::TriMesh& from) {
    geometry::TriMesh kept;
    kept.positions = from.positions;
    kept.triangles = from.triangles;
    kept.normals = from.normals;
    for (const char* name : {"color", "glow", "water"}) {
      const auto found = from.attributes.find(name);
      if (found != from.attributes.end()) kept.attributes[name] = found->second;
    }
    return kept;
  };
  const auto require = [](geometry::TriMesh& m, const char* name, int width, float value) {
    geometry::VertexAttribute& attribute = m.attributes[name];
    if (!attribute.values.empty()) return;
    attribute.width = width;
    attribute.values.assign(m.positions.size() * static_cast<std::size_t>(width), value);
  };
  geometry::TriMesh more = only(mesh);
  if (more.positions.empty()) return;
  if (all.positions.empty()) {
    all = std::move(more);
    return;
  }
  all = only(all);
  for (const auto& [name, width, value] : {std::tuple{"color", 3, kGrey}, std::tuple{"glow", 3, 0.0f}, std::tuple{"water", 1, 0.0f}}) {
    if (!all.attributes.contains(name) && !more.attributes.contains(name)) continue;
    require(all, name, width, value);
    require(more, name, width, value);
  }
  geometry::append(all, more);
}

}  // namespace effuse
