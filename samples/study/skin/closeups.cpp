#include "samples/study/skin/closeups.h"

#include <algorithm>
#include <cmath>

#include "samples/study/skin/fill.h"
#include "skin/color/lava_color.h"
#include "skin/surface/level_set.h"

namespace effuse::study {

namespace {

Real slope_at(Real x) { return -LavaToe::kSlope * x; }

/// Depth of the toe over the slope: a half-ellipse across, blunt in front.
Real depth_at(Real x, Real y) {
  const Real s = x / LavaToe::kLength;
  if (s <= 0 || s >= 1) return 0;
  const Real width = LavaToe::kHalfWidth * std::sqrt(std::min(1.0, 4 * (1 - s))) * (0.75 + 0.25 * s);
  const Real across = 1 - (y / width) * (y / width);
  return across > 0 ? LavaToe::kDepth * std::min(1.0, std::sqrt(5 * (1 - s))) * std::pow(across, 0.4) : 0;
}

}  // namespace

LavaToe::LavaToe(const CoolingStage& stage) {
  const Box3 box(Vec3(0, -kHalfWidth, slope_at(kLength)), Vec3(kLength, kHalfWidth, kDepth));
  const auto distance = [](const Vec3& p) {
    const Real over = p.z() - slope_at(p.x());
    const Real depth = depth_at(p.x(), p.y());
    return depth < 1 ? 1 : std::max(-over, over - depth);
  };
  x = fill(box, distance, 0, Filling::kDisorder, 4);
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Vec3& p = x[i];
    const Real s = p.x() / kLength;
    velocity.emplace_back(1.4 * (1 - s), 0.02 * p.y(), -kSlope * 1.4 * (1 - s));
    rest.emplace_back(1.15 * p.x() + 100, p.y() / 1.25, p.z());
    radius.push_back(0.5);
    // Patches of a few spacings are colder than others.
    const Real patch = 0.15 * std::sin(0.9 * p.x() + 1.3 * std::sin(0.7 * p.y())) * std::sin(0.8 * p.y() + 0.5);
    const Real t = std::clamp(s + patch, 0.0, 1.0);
    temperature.push_back(stage.back + (stage.front - stage.back) * t);
    crust.push_back(stage.crust_back + (stage.crust_front - stage.crust_back) * t);
    id.push_back(i + 1);
  }
}

geometry::Points LavaToe::points() const {
  geometry::Points p;
  p.position = x;
  p.velocity = velocity;
  p.rest = rest;
  p.radius = radius;
  p.temperature = temperature;
  p.crust = crust;
  p.id = id;
  return p;
}

geometry::Terrain LavaToe::ground() const {
  constexpr std::size_t n = 61;
  constexpr Real cell = 1.5, from = -45;
  std::vector<Real> heights;
  for (std::size_t j = 0; j < n; ++j)
    for (std::size_t i = 0; i < n; ++i) heights.push_back(slope_at(from + cell * static_cast<Real>(i)));
  return geometry::Terrain::from_height_field(geometry::HeightField(Vec2(from, from), Vec2(cell, cell), n, n, std::move(heights)));
}

geometry::TriMesh skin_of_toe(const LavaToe& toe, const skin::SkinKind* kind, const skin::PreviewOptions& picture, Real pixels) {
  const geometry::Points points = toe.points();
  const geometry::Terrain ground = toe.ground();
  skin::LevelSetOptions how;
  how.spacing = 1;
  geometry::TriMesh mesh = skin::mesh_level_set(skin::build_level_set(points, static_cast<Real>(points.size()), &ground, how));
  if (kind) {
    skin::DisplaceOptions detail;
    detail.spacing = 1;
    detail.kind = *kind;
    detail.octaves = 6;
    detail.edge = 0.01;
    skin::View view;
    view.eye = picture.camera.eye;
    view.direction = picture.camera.target - picture.camera.eye;
    view.pixel_angle = picture.camera.field_of_view / picture.height;
    view.pixels = pixels;
    view.half_angle = 1.1 * std::atan(std::tan(picture.camera.field_of_view / 2) * std::hypot(1.0, static_cast<Real>(picture.width) / picture.height));
    detail.view = view;
    skin::displace(mesh, points, &ground, detail);
  }
  skin::color_lava(mesh);
  return mesh;
}

skin::PreviewOptions view_of_toe(int width, int height) {
  skin::PreviewOptions options;
  options.width = width;
  options.height = height;
  options.samples = 9;
  options.camera.eye = Vec3(34, -12.5, 5.2);
  options.camera.target = Vec3(18.5, -1.2, -1.6);
  options.camera.field_of_view = 0.5;
  options.sun_direction = Vec3(-0.25, -0.9, 0.55);
  options.sun = 5;
  options.haze = 0.3;
  return options;
}

}  // namespace effuse::study
