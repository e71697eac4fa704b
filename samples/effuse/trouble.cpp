#include "samples/effuse/trouble.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/unstable_at.h"
#include "geometry/procedural/primitives.h"
#include "importers/scene/scene_file.h"
#include "skin/preview/preview.h"
#include "skin/write/write_points.h"

namespace effuse {

namespace fs = std::filesystem;

namespace {

constexpr Real kNear = 6;  // spacings

/// The fastest particle over the ground; those that fall beyond its border are hidden in pictures.
std::size_t fastest(const geometry::Points& points, const geometry::Terrain& terrain) {
  std::size_t worst = 0;
  Real most = -1;
  for (std::size_t i = 0; i < points.velocity.size(); ++i) {
    const Vec3& x = points.position[i];
    if (const Real v = points.velocity[i].norm(); x.allFinite() && std::isfinite(v) && v > most && terrain.height(x.x(), x.y())) most = v, worst = i;
  }
  return worst;
}

/// A ball for each particle: red for those near, grey for the others round about.
geometry::TriMesh balls(const geometry::Points& points, const Vec3& where, Real spacing) {
  const geometry::TriMesh ball = geometry::make_sphere(Vec3::Zero(), 0.5 * spacing, 1);
  geometry::TriMesh all;
  geometry::VertexAttribute& color = all.attributes["color"];
  color.width = 3;
  for (const Vec3& x : points.position) {
    const Real far = (x - where).norm();
    if (!(far < 6 * kNear * spacing)) continue;
    const auto first = static_cast<Index>(all.positions.size());
    for (const geometry::Triangle& t : ball.triangles) all.triangles.push_back({first + t[0], first + t[1], first + t[2]});
    for (const Vec3& p : ball.positions) {
      all.positions.push_back(x + p);
      all.normals.push_back(p.normalized());
      if (far < kNear * spacing) color.values.insert(color.values.end(), {0.8f, 0.05f, 0.03f});
      else color.values.insert(color.values.end(), {0.25f, 0.25f, 0.25f});
    }
  }
  return all;
}

/// From where the place is seen over the ground: round about, and higher up where hills hide it.
Vec3 eye_on(const Vec3& where, Real spacing, const geometry::Terrain& terrain) {
  const Vec3 top = where + spacing * Vec3::UnitZ();
  for (const Real rise : {0.5, 0.9, 1.3})
    for (int k = 0; k < 8; ++k) {
      const Real turn = -kPi / 3 + k * kPi / 4;
      const Vec3 way(std::cos(rise) * std::cos(turn), std::cos(rise) * std::sin(turn), std::sin(rise));
      if (!terrain.ray(top, way, 30 * spacing)) return top + 24 * spacing * way;
    }
  return top + 24 * spacing * Vec3(0.1, 0, 1).normalized();
}

/// "lava.toml:12: [lava] max_step: 0.1 s would do more safely". A key that the scene does not have is told at its table's line.
std::string advice(const flow::Node& scene, const fs::path& file, const std::string& table, const std::string& key, const std::string& what) {
  int line = 0;
  if (const flow::Node* found = scene.find(table)) {
    line = found->place.line;
    if (const flow::Node* value = found->find(key)) line = value->place.line;
  }
  return fmt::format("{}{}: {}.{}: {}", file.string(), line > 0 ? fmt::format(":{}", line) : "", table, key, what);
}

}  // namespace

std::vector<std::string> write_trouble(const fs::path& folder, const fs::path& file, const LoadedScene& loaded, const UnstableError& error) {
  std::vector<std::string> told;
  try {
    for (const auto& effect : loaded.simulation->effects()) {
      const geometry::Points points = effect->points();
      if (points.position.empty() || effect->spacing() <= 0) continue;
      const auto* at = dynamic_cast<const UnstableAt*>(&error);
      const Vec3 where = at && at->where().allFinite() ? at->where() : points.position[fastest(points, *loaded.terrain)];
      std::vector<Vec3> x, v;
      std::vector<Real> temperature;
      std::vector<std::uint64_t> id;
      for (std::size_t i = 0; i < points.position.size(); ++i) {
        if (!((points.position[i] - where).norm() < kNear * effect->spacing())) continue;
        x.push_back(points.position[i]);
        if (!points.velocity.empty()) v.push_back(points.velocity[i]);
        if (!points.temperature.empty()) temperature.push_back(points.temperature[i]);
        if (!points.id.empty()) id.push_back(points.id[i]);
      }
      geometry::Points near;
      near.position = x, near.velocity = v, near.temperature = temperature, near.id = id;
      skin::write_points_ply(folder / "trouble" / "particles.ply", near, {{"error", error.what()}});
      skin::PreviewOptions picture;
      picture.sun_direction = Vec3(-0.5, -0.4, 0.8);
      picture.camera.target = where;
      picture.camera.eye = eye_on(where, effect->spacing(), *loaded.terrain);
      skin::write_png(folder / "trouble" / "picture.png", skin::Preview(loaded.terrain->mesh()).render(balls(points, where, effect->spacing()), picture));
      told.push_back(fmt::format("{} particles where it happened: {}; a picture of them: {}", x.size(), (folder / "trouble" / "particles.ply").string(), (folder / "trouble" / "picture.png").string()));
      break;
    }
    if (told.empty() || file.extension() == ".w") return told;
    const flow::Node scene = importers::read_scene_file(file);
    const flow::Node resolved = importers::read_scene_text(loaded.resolved, "scene");
    const flow::Node* lava = resolved.find("lava");
    const auto value = [&](const char* key) { return lava && lava->find(key) ? lava->find(key) : nullptr; };
    if (const flow::Node* step = value("max_step")) told.push_back(advice(scene, file, "lava", "max_step", "is " + step->text + "; a half of it is the first thing to try"));
    if (const flow::Node* least = value("min_step"); least && std::string(error.what()).find("min_step") != std::string::npos)
      told.push_back(advice(scene, file, "lava", "min_step", "is " + least->text + "; a tenth of it lets steps be as short as they must"));
    if (const flow::Node* courant = value("courant")) told.push_back(advice(scene, file, "lava", "courant", fmt::format("is {:g}; 0.2 is the second", courant->real)));
  } catch (const std::exception&) {  // of a full disk, say: the checkpoint and the message count
  }
  return told;
}

}  // namespace effuse
