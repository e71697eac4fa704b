#include "samples/effuse/views.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "geometry/base/error.h"

namespace effuse {

using nlohmann::json;
using nlohmann::ordered_json;

namespace {
bool same(const skin::UsdaView& a, const skin::UsdaView& b) {
  return a.camera.eye == b.camera.eye && a.camera.target == b.camera.target && a.camera.field_of_view == b.camera.field_of_view && a.sun_direction == b.sun_direction && a.light.sun == b.light.sun &&
         a.light.sky == b.light.sky && a.exposure == b.exposure;
}

ordered_json list(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

Vec3 vector(const json& list) { return {list.at(0).get<Real>(), list.at(1).get<Real>(), list.at(2).get<Real>()}; }
}  // namespace

std::vector<skin::UsdaView> film_views(const skin::SkinSettings& settings, const geometry::Terrain& terrain, int frames, Real fps) {
  std::vector<skin::UsdaView> views;
  for (int frame = 1; frame <= frames; ++frame) {
    const skin::PreviewOptions picture = skin::picture_at(settings, terrain, frame / fps);
    const skin::UsdaView view{frame, picture.camera, picture.sun_direction.normalized(), skin::daylight(picture), picture.exposure};
    if (views.empty() || !same(views.back(), view)) views.push_back(view);
  }
  return views;
}

std::string json_of(const std::vector<skin::UsdaView>& views) {
  ordered_json keys = ordered_json::array();
  for (const skin::UsdaView& v : views)
    keys.push_back({{"frame", v.frame}, {"eye", list(v.camera.eye)}, {"target", list(v.camera.target)}, {"fov", v.camera.field_of_view}, {"sun_direction", list(v.sun_direction)},
                    {"sun", list(v.light.sun)}, {"sky", list(v.light.sky)}, {"exposure", v.exposure}});
  return keys.dump();
}

std::vector<skin::UsdaView> views_of(const std::string& text) {
  std::vector<skin::UsdaView> views;
  try {
    const json keys = json::parse(text);
    for (const json& key : keys)
      views.push_back({key.at("frame").get<int>(), {vector(key.at("eye")), vector(key.at("target")), key.at("fov").get<Real>()}, vector(key.at("sun_direction")), {vector(key.at("sun")), vector(key.at("sky"))},
                       key.at("exposure").get<Real>()});
  } catch (const json::exception& error) {
    throw InputError({"manifest.json"}, fmt::format("camera: not as effuse writes it: {}", error.what()));
  }
  return views;
}

}  // namespace effuse
