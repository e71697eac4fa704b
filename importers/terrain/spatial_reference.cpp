#include "importers/terrain/spatial_reference.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "importers/terrain/gdal_internal.h"

namespace effuse::importers {

namespace {

struct Release {
  void operator()(OGRSpatialReferenceH srs) const { gdal().OSRRelease(srs); }
};
using Srs = std::unique_ptr<std::remove_pointer_t<OGRSpatialReferenceH>, Release>;

Srs new_srs() {
  Srs srs(gdal().OSRNewSpatialReference(nullptr));
  CHECK(srs != nullptr);
  gdal().OSRSetAxisMappingStrategy(srs.get(), OAMS_TRADITIONAL_GIS_ORDER);
  return srs;
}

std::string text_of(char* taken) {
  std::string text = taken ? taken : "";
  gdal().VSIFree(taken);
  return text;
}

std::string wkt_of(OGRSpatialReferenceH srs) {
  char* wkt = nullptr;
  if (gdal().OSRExportToWkt(srs, &wkt) != OGRERR_NONE) wkt = nullptr;
  return text_of(wkt);
}

std::string attribute(OGRSpatialReferenceH srs, const char* node) {
  const char* value = gdal().OSRGetAttrValue(srs, node, 0);
  return value ? value : "";
}

Crs describe(OGRSpatialReferenceH srs, const std::string& place) {
  Crs crs;
  char* unit = nullptr;
  if (gdal().OSRIsProjected(srs)) {
    crs.kind = Crs::Kind::kProjected;
    crs.unit = gdal().OSRGetLinearUnits(srs, &unit);
    crs.title = attribute(srs, "PROJCS");
  } else if (gdal().OSRIsGeographic(srs)) {
    crs.kind = Crs::Kind::kGeographic;
    crs.unit = gdal().OSRGetAngularUnits(srs, &unit) * 180 / kPi;
    if (std::abs(crs.unit - 1) < 1e-9) crs.unit = 1;
    crs.title = attribute(srs, "GEOGCS");
  } else if (gdal().OSRIsLocal(srs)) {
    crs.kind = Crs::Kind::kLocal;
    crs.unit = gdal().OSRGetLinearUnits(srs, &unit);
    crs.title = attribute(srs, "LOCAL_CS");
  } else {
    throw InputError({place}, fmt::format("'{}' is no coordinate system of a map: wanted a projected one, or degrees", printable(wkt_of(srs), 60)));
  }
  crs.unit_name = unit ? unit : "";
  if (!(crs.unit > 0) || !std::isfinite(crs.unit)) throw InputError({place}, fmt::format("the coordinate system '{}' has units of {} m", printable(crs.title, 60), crs.unit));
  const char* authority = gdal().OSRGetAuthorityName(srs, nullptr);
  const char* code = gdal().OSRGetAuthorityCode(srs, nullptr);
  if (authority && code && std::string(authority) == "EPSG") crs.epsg = std::atoi(code);
  crs.wkt = wkt_of(srs);
  if (crs.title.empty()) crs.title = "unnamed";
  return crs;
}

/// The code of the one system of EPSG's that this is, if its .prj has left it out.
int known_code(OGRSpatialReferenceH srs) {
  int count = 0;
  int* confidence = nullptr;
  OGRSpatialReferenceH* matches = gdal().OSRFindMatches(srs, nullptr, &count, &confidence);
  int code = 0;
  if (count > 0 && confidence[0] >= 90 && (count == 1 || confidence[1] < confidence[0])) {
    const char* authority = gdal().OSRGetAuthorityName(matches[0], nullptr);
    const char* number = gdal().OSRGetAuthorityCode(matches[0], nullptr);
    if (authority && number && std::string(authority) == "EPSG") code = std::atoi(number);
  }
  gdal().OSRFreeSRSArray(matches);
  gdal().VSIFree(confidence);
  return code;
}

Crs from_epsg(int code) {
  const Srs srs = new_srs();
  const GdalComplaints complaints;
  if (gdal().OSRImportFromEPSG(srs.get(), code) != OGRERR_NONE) throw InputError(Place{}, fmt::format("EPSG:{}: {}", code, complaints.last("not a coordinate system that PROJ knows")));
  return describe(srs.get(), fmt::format("EPSG:{}", code));
}

Srs srs_of(const Crs& crs) {
  Srs srs = new_srs();
  const GdalComplaints complaints;
  CHECK(gdal().OSRSetFromUserInput(srs.get(), crs.wkt.c_str()) == OGRERR_NONE);
  return srs;
}

}  // namespace

Crs read_crs(const std::string& text, const std::string& place) {
  if (text.empty()) return {};
  Srs srs = new_srs();
  const GdalComplaints complaints;
  // Not files and addresses, which GDAL would open too.
  const std::string start = lower(std::string_view(text).substr(std::min(text.find_first_not_of(" \t\r\n"), text.size()), 40));
  const bool named = start.starts_with("epsg:") || start.starts_with("esri:") || start.starts_with("+proj") || start.starts_with("+init") || start.starts_with("ogc:") ||
                     start.starts_with("urn:ogc:") || start.find_first_of("[({") != std::string::npos || start == "wgs84" || start == "nad83";
  const char* advice = "wanted an EPSG code as in EPSG:32616, WKT or a PROJ string";
  if (!named) throw InputError({place}, fmt::format("{} is no coordinate system: {}", quote(utf8(text)), advice));
  if (gdal().OSRSetFromUserInput(srs.get(), utf8(text).c_str()) != OGRERR_NONE)
    throw InputError({place}, fmt::format("{} is no coordinate system ({}): {}", quote(utf8(text)), complaints.last("not understood"), advice));
  double vertical = 0;
  if (gdal().OSRIsCompound(srs.get()) || gdal().OSRIsVertical(srs.get())) {
    vertical = gdal().OSRGetTargetLinearUnits(srs.get(), "VERT_CS", nullptr);
    if (gdal().OSRIsCompound(srs.get())) gdal().OSRStripVertical(srs.get());
  }
  Crs crs = describe(srs.get(), place);
  crs.vertical_unit = vertical;
  if (crs.epsg == 0 && crs.kind != Crs::Kind::kLocal)
    if (const int code = known_code(srs.get()); code > 0) {
      crs = from_epsg(code);
      crs.vertical_unit = vertical;
    }
  return crs;
}

std::string to_string(const Crs& crs) {
  if (crs.wkt.empty()) return "unknown";
  return crs.epsg > 0 ? fmt::format("{} (EPSG:{})", utf8(crs.title), crs.epsg) : utf8(crs.title);
}

Crs in_metres(const Crs& crs) {
  CHECK(crs.kind != Crs::Kind::kGeographic);
  if (crs.unit == 1) return crs;
  Crs metric = crs;
  metric.unit = 1;
  metric.unit_name = "metre";
  if (crs.wkt.empty()) return metric;
  const Srs srs = srs_of(crs);
  const GdalComplaints complaints;
  gdal().OSRSetLinearUnitsAndUpdateParameters(srs.get(), "metre", 1.0);
  const double vertical = crs.vertical_unit;
  metric = describe(srs.get(), crs.title);
  metric.vertical_unit = vertical;
  metric.title = crs.title + ", in metres";
  return metric;
}

Crs utm_of(const Vec2& degrees, const Crs& geographic) {
  const double east = degrees.x() - 360 * std::floor((degrees.x() + 180) / 360), north = degrees.y();
  if (!(std::abs(north) <= 90) || !std::isfinite(east)) throw InputError(Place{}, fmt::format("there is no place at {} degrees east, {} degrees north", degrees.x(), degrees.y()));
  if (north > 84) return from_epsg(32661);
  if (north < -80) return from_epsg(32761);
  int zone = std::clamp(static_cast<int>(std::floor((east + 180) / 6)) + 1, 1, 60);
  if (north >= 56 && north < 64 && east >= 3 && east < 12) zone = 32;
  if (north >= 72 && east >= 0 && east < 42) zone = east < 9 ? 31 : east < 21 ? 33 : east < 33 ? 35 : 37;
  if (north >= 0 && geographic.epsg == 4258 && zone >= 28 && zone <= 38) return from_epsg(25800 + zone);
  if (north >= 0 && geographic.epsg == 4269 && zone <= 23) return from_epsg(26900 + zone);
  return from_epsg((north < 0 ? 32700 : 32600) + zone);
}

Vec2 degrees_at(const Crs& crs, const Vec2& place) { return CrsTransform(crs, from_epsg(4326))(place); }

Vec2 stretch_at(const Crs& crs, const Vec2& place) {
  CHECK(crs.kind == Crs::Kind::kProjected && crs.metric());
  constexpr double kAxis = 6378137, kSquaredEccentricity = 0.00669437999014, kHalf = 50;  // WGS 84 [m]; half a short line on the map [m]
  const CrsTransform to_degrees(crs, from_epsg(4326));
  const double latitude = to_degrees(place).y() * kPi / 180, w = 1 - kSquaredEccentricity * std::sin(latitude) * std::sin(latitude);
  const double along_parallel = kAxis * std::cos(latitude) / std::sqrt(w), along_meridian = kAxis * (1 - kSquaredEccentricity) / (w * std::sqrt(w));  // [m/rad]
  Vec2 stretch;
  for (int axis = 0; axis < 2; ++axis) {
    Vec2 step = to_degrees(place + kHalf * Vec2::Unit(axis)) - to_degrees(place - kHalf * Vec2::Unit(axis));
    step.x() -= 360 * std::round(step.x() / 360);
    stretch[axis] = 2 * kHalf / (step.cwiseProduct(Vec2(along_parallel, along_meridian)) * kPi / 180).norm();
  }
  return stretch;
}

struct CrsTransform::Impl {
  OGRCoordinateTransformationH transform = nullptr;
  ~Impl() { gdal().OCTDestroyCoordinateTransformation(transform); }
};

CrsTransform::CrsTransform(const Crs& from, const Crs& to) : impl_(std::make_unique<Impl>()) {
  const Srs a = srs_of(from), b = srs_of(to);
  const GdalComplaints complaints;
  impl_->transform = gdal().OCTNewCoordinateTransformation(a.get(), b.get());
  if (!impl_->transform)
    throw InputError(Place{}, fmt::format("there is no way from {} to {}: {}", to_string(from), to_string(to), complaints.last("PROJ knows none")));
}
CrsTransform::~CrsTransform() = default;
CrsTransform::CrsTransform(CrsTransform&&) noexcept = default;
CrsTransform& CrsTransform::operator=(CrsTransform&&) noexcept = default;

void CrsTransform::operator()(std::span<Vec2> points) const {
  constexpr std::size_t kAtOnce = 4096;
  const GdalComplaints complaints;
  std::vector<double> x(std::min(points.size(), kAtOnce)), y(x.size());
  std::vector<int> good(x.size());
  for (std::size_t begin = 0; begin < points.size(); begin += kAtOnce) {
    const std::size_t n = std::min(kAtOnce, points.size() - begin);
    for (std::size_t i = 0; i < n; ++i) x[i] = points[begin + i].x(), y[i] = points[begin + i].y();
    gdal().OCTTransformEx(impl_->transform, static_cast<int>(n), x.data(), y.data(), nullptr, good.data());
    for (std::size_t i = 0; i < n; ++i) {
      const bool there = good[i] && std::isfinite(x[i]) && std::isfinite(y[i]);
      points[begin + i] = there ? Vec2(x[i], y[i]) : Vec2(Vec2::Constant(std::numeric_limits<double>::quiet_NaN()));
    }
  }
}

Vec2 CrsTransform::operator()(const Vec2& point) const {
  Vec2 moved = point;
  (*this)(std::span<Vec2>(&moved, 1));
  return moved;
}

}  // namespace effuse::importers
