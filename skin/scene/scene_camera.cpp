#include "skin/scene/scene_camera.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/error.h"

namespace effuse::skin {

using geometry::Curve;

namespace {

// Beyond, rays in single precision lose themselves; no map reaches as far.
constexpr Real kNearest = 1e-3, kFarthest = 1e7, kMapEdge = 1e8;  // [m]

bool off_the_map(const std::vector<Real>& at) { return std::max(std::abs(at[0]), std::abs(at[1])) > kMapEdge; }

bool needs_ground(const std::vector<Real>& point) { return point.size() == 2; }

/// A point of the map in the terrain's local frame: on the ground with two numbers; nothing beside a terrain whose height it would have.
std::optional<Vec3> placed(const std::vector<Real>& point, const geometry::Terrain& terrain) {
  const Vec3& origin = terrain.georeference().origin;
  const Vec2 at = Vec2(point[0], point[1]) - origin.head<2>();
  if (!needs_ground(point)) return Vec3(at.x(), at.y(), point[2] - origin.z());
  const std::optional<Real> z = terrain.height(at.x(), at.y());
  if (!z) return std::nullopt;
  return Vec3(at.x(), at.y(), *z);
}

std::optional<Vec3> placed(const Vec3& point, bool on_ground, const geometry::Terrain& terrain) {
  if (!on_ground) return Vec3(point - terrain.georeference().origin);
  std::optional<Vec3> at = placed(std::vector<Real>{point.x(), point.y()}, terrain);
  if (at) at->z() += point.z();
  return at;
}

void read_keys(flow::Parameters& preview, SceneCamera& c) {
  std::vector<flow::Parameters> tables = preview.tables("key", "where the camera stands at a moment of the film, and what it looks at");
  if (tables.empty()) return;
  c.place = preview.place("key");
  const std::size_t way = preview.choice("camera_motion", {"smooth", "linear", "hold"}, 0, "of the camera from key to key");
  c.between = way == 0 ? geometry::Between::kCatmullRom : way == 1 ? geometry::Between::kLinear : geometry::Between::kStep;
  for (flow::Parameters& p : tables) {
    SceneCamera::Stand stand;
    stand.place = p.place("");
    stand.time = p.number("time", "s", std::nullopt, {}, "of film");
    if (!c.keys.empty() && !(stand.time > c.keys.back().time)) p.fault("time", fmt::format("{:g} s does not come after the key before, at {:g} s", stand.time, c.keys.back().time));
    stand.on_ground = p.flag("on_ground", true, "z counts from the ground at x, y; false: as the map's heights");
    const auto point = [&](const char* key, const Vec3* before, const char* what) {
      const std::vector<Real> v = p.numbers(key, "m", 3, !before, what);
      if (v.size() != 3) return before ? *before : Vec3(0, 0, 0);
      if (off_the_map(v) || std::abs(v[2]) > kFarthest) p.fault(key, "lies more than 1e8 m from the origin of the map, or 1e7 m from sea level");
      return Vec3(v[0], v[1], v[2]);
    };
    const bool first = c.keys.empty();
    stand.position = point("position", first ? nullptr : &c.keys.back().position, "of the camera: x, y in the terrain's map coordinates, and z; absent: as before");
    stand.target = point("target", first ? nullptr : &c.keys.back().target, "what it looks at; absent: as before");
    c.keys.push_back(std::move(stand));
  }
  for (const char* other : {"view", "target", "distance", "azimuth", "elevation", "turn"})
    if (preview.has(other)) preview.fault(other, "found with [[preview.key]], wanted one or the other: keys say where the camera stands");
}

std::optional<Camera> keyed_camera(const SceneCamera& c, const geometry::Terrain& terrain, Real film_time) {
  std::vector<geometry::Key<Vec3>> eyes, targets;
  for (const SceneCamera::Stand& stand : c.keys) {
    const std::optional<Vec3> eye = placed(stand.position, stand.on_ground, terrain), target = placed(stand.target, stand.on_ground, terrain);
    if (!eye || !target) return std::nullopt;
    eyes.push_back({stand.time, *eye, c.between});
    targets.push_back({stand.time, *target, c.between});
  }
  return Camera{Curve<Vec3>(eyes).at(film_time), Curve<Vec3>(targets).at(film_time), c.field_of_view.at(film_time)};
}

Camera camera_at(const SceneCamera& c, const geometry::Terrain& terrain, Real film_time, Real aspect) {
  if (!c.keys.empty()) return keyed_camera(c, terrain, film_time).value_or(Camera{});
  const Real azimuth = c.azimuth.at(film_time) + film_time * c.turn, elevation = c.elevation.at(film_time);
  if (!c.target.empty()) {
    Camera camera;
    camera.field_of_view = c.field_of_view.at(film_time);
    camera.target = placed(c.target, terrain).value_or(terrain.bounds().center());
    camera.eye = camera.target + c.distance.at(film_time) * Vec3(std::cos(azimuth) * std::cos(elevation), std::sin(azimuth) * std::cos(elevation), std::sin(elevation));
    return camera;
  }
  Box3 box = terrain.bounds();
  if (c.view.size() == 3) {
    const Vec2 at = Vec2(c.view[0], c.view[1]) - terrain.georeference().origin.head<2>();
    const Real z = terrain.height(at.x(), at.y()).value_or(box.center().z()), r = c.view[2];
    // Flat: ground is wider than it is high.
    box = Box3(Vec3(at.x() - r, at.y() - r, z - r / 4), Vec3(at.x() + r, at.y() + r, z + r / 4));
  }
  return frame_camera(box, azimuth, elevation, aspect, 0.02, c.field_of_view.at(film_time));
}

}  // namespace

SceneCamera read_scene_camera(flow::Parameters& preview, const PreviewOptions& usual) {
  using flow::Parameters;
  SceneCamera c;
  c.azimuth = preview.curve("azimuth", "rad", -2.2, {}, "where the camera stands, counter-clockwise from east; as other numbers of the camera, or keys by seconds of film");
  c.elevation = preview.curve("elevation", "rad", 0.5, {-0.2, 1.5}, "of the camera above the horizon");
  c.turn = preview.number("turn", "rad/s", 0, {}, "of the camera round its target, by seconds of film");
  c.field_of_view = preview.curve("fov", "rad", 0.7, {0.02, 2.5}, "field of view from the picture's bottom to its top");
  c.view = preview.numbers("view", "m", 3, false, "x, y in the terrain's map coordinates and radius of what the camera frames; absent: target, or all the terrain");
  if (c.view.size() == 3) {
    if (!(c.view[2] >= kNearest && c.view[2] <= kFarthest)) preview.fault("view", fmt::format("the radius, third number, is {}, must be from 0.001 to 1e7 m", c.view[2]));
    if (off_the_map(c.view)) preview.fault("view", "lies more than 1e8 m from the origin of the map");
  }
  c.target = preview.numbers("target", "m", 0, false, "x, y in the terrain's map coordinates of what the camera looks at, on the ground, or x, y, z; goes with distance, not with view");
  c.place = preview.place("target");
  // Nothing stands for it: a resolved scene has it with its target only.
  c.distance = Curve<Real>(Real{0});
  if (preview.has("distance") || preview.has("target")) c.distance = preview.curve("distance", "m", std::nullopt, {kNearest, kFarthest}, "of the camera from its target");
  read_keys(preview, c);

  const Vec3 sun = usual.sun_direction.normalized();
  c.exposure = preview.curve("exposure", "", usual.exposure, {0, 1e6, true}, "");
  c.sun = preview.curve("sun", "", usual.sun, {0, 1e6}, "strength");
  c.sun_azimuth = preview.curve("sun_azimuth", "rad", std::atan2(sun.y(), sun.x()), {}, "where the sun stands, counter-clockwise from east");
  c.sun_elevation = preview.curve("sun_elevation", "rad", std::asin(sun.z()), {-1.5, 1.5}, "above the horizon: low is dusk, 0.6 is day");

  if (!c.keys.empty()) return c;
  if (!preview.has("target")) {
    if (preview.has("distance")) preview.fault("distance", "goes with target; with view the camera stands where it has all of that in the picture");
    return c;
  }
  if (preview.has("view")) preview.fault("target", "says what the camera looks at, and so does view: keep one of them");
  if (c.target.size() != 2 && c.target.size() != 3) {
    if (!c.target.empty()) preview.fault("target", fmt::format("has {} numbers, wanted [x, y] for a point of the ground, or [x, y, z]", c.target.size()));
    c.target.clear();
  } else if (off_the_map(c.target) || (c.target.size() == 3 && std::abs(c.target[2]) > kFarthest)) {
    preview.fault("target", "lies more than 1e8 m from the origin of the map, or 1e7 m from sea level");
  }
  return c;
}

void set_camera(PreviewOptions& picture, const SceneCamera& c, const geometry::Terrain& terrain, Real film_time) {
  picture.camera = camera_at(c, terrain, film_time, static_cast<Real>(picture.width) / picture.height);
  picture.exposure = c.exposure.at(film_time);
  picture.sun = c.sun.at(film_time);
  const Real azimuth = c.sun_azimuth.at(film_time), elevation = c.sun_elevation.at(film_time);
  picture.sun_direction = Vec3(std::cos(azimuth) * std::cos(elevation), std::sin(azimuth) * std::cos(elevation), std::sin(elevation));
}

void check_scene_camera(const SceneCamera& c, const geometry::Terrain& terrain, int frames, Real fps, Real aspect) {
  if (c.target.empty() && c.keys.empty()) return;
  const char* const key = c.keys.empty() ? "target" : "key";
  if (!c.target.empty() && !placed(c.target, terrain)) throw InputError(c.place, "preview.target: lies beside the terrain, which has no height there: give it a z, as [x, y, z]");
  for (const SceneCamera::Stand& stand : c.keys)
    if (!placed(stand.position, stand.on_ground, terrain) || !placed(stand.target, stand.on_ground, terrain))
      throw InputError(stand.place, "preview.key: position or target lies beside the terrain, which has no height there: on_ground = false, with heights of the map, would do");
  for (int frame = 1; frame <= frames; ++frame) {
    const Camera camera = camera_at(c, terrain, frame / fps, aspect);
    if (!((camera.target - camera.eye).norm() >= kNearest)) throw InputError(c.place, fmt::format("preview.{}: in frame {} the camera stands at what it looks at", key, frame));
    const Real over = terrain.signed_distance(camera.eye);
    if (over >= 0) continue;
    const Vec3 eye = camera.eye + terrain.georeference().origin;
    throw InputError(c.place, fmt::format("preview.{}: in frame {} the camera stands at {:.1f}, {:.1f}, which is {:.1f} m in the ground; {}", key, frame, eye.x(), eye.y(), -over,
                                          c.keys.empty() ? "more elevation, another azimuth or distance, or a higher target would do" : "a higher position would do, or one more key on the way"));
  }
}

}  // namespace effuse::skin
