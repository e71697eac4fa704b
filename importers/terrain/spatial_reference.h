#pragma once

#include <memory>
#include <span>
#include <string>

#include "geometry/base/types.h"

namespace effuse::importers {

/// What a coordinate system is, as far as putting heights on a map goes.
struct Crs {
  enum class Kind { kUnknown, kProjected, kGeographic, kLocal };
  Kind kind = Kind::kUnknown;
  double unit = 1;                  ///< of its plane coordinates [m]; of geographic ones [degrees]
  std::string unit_name;            ///< "metre", "US survey foot"
  double vertical_unit = 0;         ///< of its heights [m]; 0: it says nothing of heights
  std::string title;                ///< "WGS 84 / UTM zone 16N"
  int epsg = 0;                     ///< 0: none known
  std::string wkt;                  ///< WKT 1 of its horizontal part; empty: unknown

  bool metric() const { return kind != Kind::kGeographic && unit == 1; }
};

/// A coordinate system by its EPSG code ("EPSG:2193"), WKT 1 or 2, ESRI's WKT or a PROJ string; an empty text is an
/// unknown one in metres. Of a compound system the horizontal part, and the unit of its heights. place names who says
/// so, for the InputError when it is none of these, or a geocentric one.
Crs read_crs(const std::string& text, const std::string& place);

/// "WGS 84 / UTM zone 16N (EPSG:32616)", "unknown".
std::string to_string(const Crs& crs);

/// The same projection counted in metres: of State Plane in feet, State Plane in metres. Exact: positions are those of
/// crs times crs.unit. A metric system comes back as it is. Geographic: not allowed (CHECK).
Crs in_metres(const Crs& crs);

/// The projection in metres that suits a place [degrees east, degrees north]: its UTM zone (the wider ones of Norway and
/// Spitsbergen, too), beyond 84 N and 80 S the polar stereographic one. In the datum of the geographic system where
/// UTM has it (ETRS89, NAD83), else of WGS 84.
Crs utm_of(const Vec2& degrees, const Crs& geographic);

/// How long a metre of the ground, east and north, is on the map at a place of it: 1 in a projection made for the place, 1.5 in Web
/// Mercator at 48 degrees. NaN where there is no such place. Only for projected systems in metres (checked). To a millionth.
Vec2 stretch_at(const Crs& crs, const Vec2& place);

/// A place on the map in degrees, longitude first, of WGS 84; NaN where there is none.
Vec2 degrees_at(const Crs& crs, const Vec2& place);

/// Positions of one system in another, x east and y north in both, geographic ones in degrees, longitude first
/// whatever the authority's order of axes. By PROJ, without its network. One thread at a time.
class CrsTransform {
 public:
  CrsTransform(const Crs& from, const Crs& to);
  ~CrsTransform();
  CrsTransform(CrsTransform&&) noexcept;
  CrsTransform& operator=(CrsTransform&&) noexcept;
  /// In place; NaN where there is no such place.
  void operator()(std::span<Vec2> points) const;
  Vec2 operator()(const Vec2& point) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace effuse::importers
