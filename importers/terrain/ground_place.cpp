#include "importers/terrain/ground_place.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <optional>

#include "geometry/base/error.h"
#include "importers/terrain/spatial_reference.h"

namespace effuse::importers {

namespace {

constexpr const char* kWgs84 = "EPSG:4326";

std::optional<Crs> known_crs(const geometry::Georeference& georeference) {
  const Crs crs = read_crs(georeference.crs, "the terrain");
  return crs.kind == Crs::Kind::kProjected ? std::optional(crs) : std::nullopt;
}

GroundPlace place_at(const geometry::HeightField& field, const geometry::Georeference& georeference, const std::optional<Crs>& crs, const Vec2& local) {
  GroundPlace place;
  place.map = georeference.origin.head<2>() + local;
  place.degrees = crs ? degrees_at(*crs, place.map) : Vec2::Constant(std::numeric_limits<Real>::quiet_NaN());
  place.height = field.height(local.x(), local.y());
  Vec2 gradient = Vec2::Zero();
  for (int j = -2; j <= 2; ++j)
    for (int i = -2; i <= 2; ++i) {
      const Vec3 n = field.extended_normal(local.x() + i * field.spacing().x(), local.y() + j * field.spacing().y());
      gradient -= n.head<2>() / n.z() / 25;
    }
  place.slope = std::atan(gradient.norm());
  if (gradient.norm() > 0) place.downhill = std::atan2(-gradient.y(), -gradient.x());
  return place;
}

}  // namespace

GroundPlace ground_place(const geometry::HeightField& field, const geometry::Georeference& georeference, const Vec2& wanted) {
  const Vec2 origin = georeference.origin.head<2>(), low = origin + field.bounds().min().head<2>(), high = origin + field.bounds().max().head<2>();
  const std::optional<Crs> crs = known_crs(georeference);
  const auto inside = [&](const Vec2& map) { return field.covers(map.x() - origin.x(), map.y() - origin.y()); };
  const auto from_degrees = [&](const Vec2& degrees) {
    const bool may_be = crs && std::abs(degrees.x()) <= 180 && std::abs(degrees.y()) <= 90;
    return may_be ? CrsTransform(read_crs(kWgs84, "degrees"), *crs)(degrees) : Vec2(Vec2::Constant(std::numeric_limits<Real>::quiet_NaN()));
  };
  Vec2 map = wanted;
  if (!inside(map)) map = from_degrees(wanted);
  if (!inside(map)) {
    std::string where = fmt::format("x {:.10g} to {:.10g}, y {:.10g} to {:.10g}", low.x(), high.x(), low.y(), high.y());
    if (crs) {
      const Vec2 west_south = degrees_at(*crs, low), east_north = degrees_at(*crs, high);
      where += fmt::format("; in degrees {:.6g} to {:.6g} east, {:.6g} to {:.6g} north", west_south.x(), east_north.x(), west_south.y(), east_north.y());
    }
    const Vec2 turned(wanted.y(), wanted.x());
    const std::string hint = inside(turned) || inside(from_degrees(turned)) ? fmt::format("; east comes first: {:.10g},{:.10g}", turned.x(), turned.y()) : "";
    throw InputError(Place{}, fmt::format("there is no ground at {:.10g}, {:.10g}: it covers {}{}", wanted.x(), wanted.y(), where, hint));
  }
  return place_at(field, georeference, crs, map - origin);
}

GroundPlace highest_place(const geometry::HeightField& field, const geometry::Georeference& georeference) {
  int top_i = 0, top_j = 0;
  Real top = -std::numeric_limits<Real>::infinity();
  for (int j = 0; j < field.ny(); ++j)
    for (int i = 0; i < field.nx(); ++i)
      if (const Real z = field.post(i, j); z > top) {
        top = z;
        top_i = i;
        top_j = j;
      }
  GroundPlace place = place_at(field, georeference, known_crs(georeference), field.corner() + Vec2(top_i * field.spacing().x(), top_j * field.spacing().y()));
  place.height = top;  // a lone post among holes is in no cell
  return place;
}

}  // namespace effuse::importers
