#include "importers/terrain/gdal_raster.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <memory>
#include <optional>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/zones.h"
#include "importers/terrain/gdal_internal.h"

namespace effuse::importers {

namespace fs = std::filesystem;

// No VRT, which names other files and addresses to open; no network.
constexpr std::array kDrivers = {"GTiff", "SRTMHGT", "USGSDEM", "SDTS", "DTED", "EHdr", "ENVI", "HFA", "netCDF", "PNG", "GSAG", "GSBG", "GS7BG", "BT", "Leveller", "Terragen"};
constexpr std::array kExtensions = {".tif", ".tiff", ".gtiff", ".hgt", ".dem", ".ddf", ".flt", ".bil", ".bip", ".bsq", ".hdr", ".img", ".nc", ".png", ".dt0", ".dt1", ".dt2", ".grd", ".bt", ".ter"};
constexpr const char* kExtensionList = "tif tiff gtiff hgt dem ddf flt bil bip bsq hdr img nc png dt0 dt1 dt2 grd bt ter";

namespace {

constexpr double kLargestBlock = 512e6;  // bytes

struct CloseDataset {
  void operator()(GDALDatasetH dataset) const { gdal().GDALClose(dataset); }
};
using Dataset = std::unique_ptr<std::remove_pointer_t<GDALDatasetH>, CloseDataset>;

/// GDAL opens what lies beside a file (masks, overviews) by any driver it has: a mask that is a VRT names files and addresses.
void forget_other_drivers() {
  for (int k = gdal().GDALGetDriverCount(); k-- > 0;) {
    const GDALDriverH driver = gdal().GDALGetDriver(k);
    const std::string_view name = gdal().GDALGetDriverShortName(driver);
    if (std::find(kDrivers.begin(), kDrivers.end(), name) == kDrivers.end()) gdal().GDALDeregisterDriver(driver);
  }
}

Dataset open_named(const std::string& name) {
  forget_other_drivers();
  std::vector<const char*> drivers(kDrivers.begin(), kDrivers.end());
  drivers.push_back(nullptr);
  return Dataset(gdal().GDALOpenEx(name.c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY, drivers.data(), nullptr, nullptr));
}

std::string hgt_advice(const fs::path& file) {
  std::error_code error;
  const std::uintmax_t bytes = fs::file_size(file, error);
  if (bytes == 1201u * 1201 * 2 || bytes == 3601u * 3601 * 2 || bytes == 1801u * 3601 * 2)
    return "an SRTM tile is placed by its name alone, that of its south-west corner: N10W085.hgt";
  return fmt::format("an SRTM tile has 1201 x 1201 or 3601 x 3601 heights of two bytes, this file has {} bytes", bytes);
}

/// Of a file with several grids, the one of heights.
std::string height_grid(GDALDatasetH dataset, const std::string& name) {
  char** list = gdal().GDALGetMetadata(dataset, "SUBDATASETS");
  std::vector<std::string> grids;
  for (int k = 1;; ++k) {
    const char* grid = gdal().CSLFetchNameValue(list, fmt::format("SUBDATASET_{}_NAME", k).c_str());
    if (!grid) break;
    grids.emplace_back(grid);
  }
  std::string names;
  for (const std::string& grid : grids) names += (names.empty() ? "" : ", ") + printable(grid.substr(grid.rfind(':') + 1), 30);
  for (const char* wanted : {"elevation", "elev", "height", "topo", "dem", "z", "altitude", "band1", "orog"})
    for (const std::string& grid : grids)
      if (lower(grid.substr(grid.rfind(':') + 1)) == wanted) return grid;
  if (grids.size() == 1) return grids.front();
  throw InputError({name}, grids.empty() ? "holds no raster" : fmt::format("holds several grids ({}), none of them called elevation, height, topo, dem or z: extract the one of heights", names));
}

Dataset open_raster(const fs::path& given) {
  prepare_gdal();
  const std::string name = given.string();
  fs::path file = given;
  std::error_code ignored;
  // The header of a raw grid: the grid lies beside it.
  if (lower_extension(given) == ".hdr")
    for (const char* extension : {".flt", ".bil", ".bip", ".bsq", ".img", ".FLT", ".BIL"})
      if (fs::path beside = fs::path(given).replace_extension(extension); fs::is_regular_file(beside, ignored)) file = beside;
  const GdalComplaints complaints;
  Dataset dataset = open_named(file.string());
  if (!dataset) {
    std::string why = complaints.last("");
    if (lower_extension(file) == ".hgt") why = hgt_advice(file);
    else if (const std::string e = lower_extension(file); e == ".flt" || e == ".bil" || e == ".bip" || e == ".bsq")
      why = fs::exists(fs::path(file).replace_extension(".hdr"), ignored) ? why : "its header, " + fs::path(file).replace_extension(".hdr").filename().string() + ", is missing";
    throw InputError({name}, why.empty() || why.find("not recognized as") != std::string::npos ? "is no raster that can be read: its first bytes are none of a format known here" : "cannot be read as a raster: " + why);
  }
  if (gdal().GDALGetRasterCount(dataset.get()) == 0) {
    const std::string grid = height_grid(dataset.get(), name);
    dataset = open_named(grid);
    if (!dataset || gdal().GDALGetRasterCount(dataset.get()) == 0) throw InputError({name}, "its grid cannot be read: " + complaints.last("no band"));
  }
  return dataset;
}


/// A band of heights, not of a photograph's colours.
void check_band(GDALDatasetH dataset, const std::string& name, std::vector<std::string>& notes) {
  GDALRasterBandH band = gdal().GDALGetRasterBand(dataset, 1);
  const GDALDataType type = gdal().GDALGetRasterDataType(band);
  if (gdal().GDALDataTypeIsComplex(type)) throw InputError({name}, fmt::format("holds complex numbers ({}), wanted heights", gdal().GDALGetDataTypeName(type)));
  const GDALColorInterp colour = gdal().GDALGetRasterColorInterpretation(band);
  if (colour == GCI_PaletteIndex) throw InputError({name}, "holds colours from a palette, wanted heights: it is a picture of a map");
  int bands = gdal().GDALGetRasterCount(dataset), others = 0;
  for (int b = 2; b <= bands; ++b) others += gdal().GDALGetRasterColorInterpretation(gdal().GDALGetRasterBand(dataset, b)) != GCI_AlphaBand;
  if (colour == GCI_RedBand && others >= 2) throw InputError({name}, "holds red, green and blue, wanted heights: it is a picture of a map");
  if (others > 0) notes.push_back(fmt::format("has {} bands: the first is taken for the heights", bands));
  int width = 0, height = 0;
  gdal().GDALGetBlockSize(band, &width, &height);
  const double block = static_cast<double>(width) * height * gdal().GDALGetDataTypeSizeBytes(type);
  if (block > kLargestBlock) throw InputError({name}, fmt::format("must be read in blocks of {:.0f} MB, at most {:.0f} MB are: write it in tiles (gdal_translate -co TILED=YES)", block / 1e6, kLargestBlock / 1e6));
}

/// Nodata values as a band's own type holds them: a float band's -3.4028e+38 may be declared with fewer digits.
class Nodata {
 public:
  explicit Nodata(GDALRasterBandH band) {
    const GDALDataType type = gdal().GDALGetRasterDataType(band);
    int has = 0;
    const double value = gdal().GDALGetRasterNoDataValue(band, &has);
    if (has && type != GDT_Int64 && type != GDT_UInt64) declared_ = value;
    float_ = type == GDT_Float32;
  }
  bool is(double value) const {
    return declared_ && (value == *declared_ || (float_ && static_cast<float>(value) == static_cast<float>(*declared_)));
  }

 private:
  std::optional<double> declared_;
  bool float_ = false;
};

}  // namespace

bool gdal_reads(const std::string& extension) { return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end(); }
bool looks_like_tiff(std::string_view bytes) {
  constexpr std::array<std::string_view, 4> kStarts = {std::string_view("II*\0", 4), std::string_view("MM\0*", 4), std::string_view("II+\0", 4), std::string_view("MM\0+", 4)};
  return std::any_of(kStarts.begin(), kStarts.end(), [&](std::string_view start) { return bytes.starts_with(start); });
}
const char* gdal_extensions() { return kExtensionList; }

RasterFacts read_raster_facts(const fs::path& file) {
  ZONE("import.facts");
  const std::string name = file.string();
  const Dataset dataset = open_raster(file);
  const GdalComplaints complaints;
  RasterFacts facts;
  check_band(dataset.get(), name, facts.notes);
  GDALRasterBandH band = gdal().GDALGetRasterBand(dataset.get(), 1);
  facts.format = gdal().GDALGetDriverLongName(gdal().GDALGetDatasetDriver(dataset.get()));
  facts.type = gdal().GDALGetDataTypeName(gdal().GDALGetRasterDataType(band));
  facts.frame.columns = gdal().GDALGetRasterXSize(dataset.get());
  facts.frame.rows = gdal().GDALGetRasterYSize(dataset.get());

  std::array<double, 6> t{};
  facts.placed = gdal().GDALGetGeoTransform(dataset.get(), t.data()) == CE_None;
  if (!facts.placed) {
    if (gdal().GDALGetGCPCount(dataset.get()) > 0) throw InputError({name}, "is tied to the map by control points only: rectify it first (gdalwarp)");
    t = {0, 1, 0, 0, 0, -1};
  }
  for (const double number : t)
    if (!std::isfinite(number)) throw InputError({name}, "its place on the map is not made of finite numbers");
  if (t[1] * t[5] - t[2] * t[4] == 0) throw InputError({name}, "its cells have no area on the map");
  facts.frame.along_columns = Vec2(t[1], t[4]);
  facts.frame.along_rows = Vec2(t[2], t[5]);
  // GDAL's transform counts from the corner of the first cell, also for files whose own counts from its centre.
  facts.frame.first = Vec2(t[0], t[3]) + (facts.frame.along_columns + facts.frame.along_rows) / 2;

  if (OGRSpatialReferenceH srs = gdal().GDALGetSpatialRef(dataset.get())) {
    char* wkt = nullptr;
    const std::array options = {"FORMAT=WKT2_2018", static_cast<const char*>(nullptr)};
    if (gdal().OSRExportToWktEx(srs, &wkt, options.data()) == OGRERR_NONE && wkt) facts.crs = wkt;
    gdal().VSIFree(wkt);
  }
  facts.crs_place = name;
  const char* unit = gdal().GDALGetRasterUnitType(band);
  facts.height_unit = unit ? unit : "";
  const double scale = gdal().GDALGetRasterScale(band, nullptr), offset = gdal().GDALGetRasterOffset(band, nullptr);
  if (!std::isfinite(scale) || !std::isfinite(offset) || scale == 0) throw InputError({name}, fmt::format("its heights are scaled by {} and offset by {}", scale, offset));
  if (scale != 1 || offset != 0) facts.notes.push_back(fmt::format("heights are the file's numbers times {} plus {}", scale, offset));
  return facts;
}

RasterCells read_raster_cells(const fs::path& file, const CellWindow& window) {
  ZONE("import.cells");
  const std::string name = file.string();
  const Dataset dataset = open_raster(file);
  const GdalComplaints complaints;
  GDALRasterBandH band = gdal().GDALGetRasterBand(dataset.get(), 1);
  CHECK(window.column >= 0 && window.row >= 0 && window.columns >= 1 && window.rows >= 1);
  CHECK(window.column + window.columns <= gdal().GDALGetRasterXSize(dataset.get()) && window.row + window.rows <= gdal().GDALGetRasterYSize(dataset.get()));

  RasterCells cells;
  cells.window = window;
  cells.values.resize(static_cast<std::size_t>(window.columns) * static_cast<std::size_t>(window.rows));
  const Nodata nodata(band);
  const double scale = gdal().GDALGetRasterScale(band, nullptr), offset = gdal().GDALGetRasterOffset(band, nullptr);
  const bool masked = (gdal().GDALGetMaskFlags(band) & GMF_PER_DATASET) != 0;
  std::vector<unsigned char> mask(masked ? static_cast<std::size_t>(window.columns) : 0);
  Real largest = 0;
  for (int r = 0; r < window.rows; ++r) {
    const std::size_t row = static_cast<std::size_t>(r) * static_cast<std::size_t>(window.columns);
    if (gdal().GDALRasterIO(band, GF_Read, window.column, window.row + r, window.columns, 1, cells.values.data() + row, window.columns, 1, GDT_Float64, 0, 0) != CE_None)
      throw InputError({name}, fmt::format("row {} of {} cannot be read: {}", window.row + r + 1, gdal().GDALGetRasterYSize(dataset.get()), complaints.last("the file is cut short or damaged")));
    if (masked && gdal().GDALRasterIO(gdal().GDALGetMaskBand(band), GF_Read, window.column, window.row + r, window.columns, 1, mask.data(), window.columns, 1, GDT_Byte, 0, 0) != CE_None)
      throw InputError({name}, fmt::format("row {} of its mask cannot be read: {}", window.row + r + 1, complaints.last("damaged")));
    for (int c = 0; c < window.columns; ++c) {
      Real& z = cells.values[row + static_cast<std::size_t>(c)];
      const bool nan = std::isnan(z), none = nodata.is(z);
      if (masked && mask[static_cast<std::size_t>(c)] == 0) ++cells.missing.masked;
      else if (none) ++cells.missing.declared;
      else if (nan) ++cells.missing.nans;
      else if (std::isinf(z) || marks_missing(z)) ++cells.missing.undeclared[z];
      else {
        largest = std::max(largest, std::abs(z));
        z = scale * z + offset;
        continue;
      }
      z = std::numeric_limits<Real>::quiet_NaN();
    }
  }
  // Floats whose bytes stand the other way round are next to nothing, or beyond all heights.
  constexpr Real kNothing = 1e-30;
  if (largest > 0 && largest < kNothing) throw InputError({name}, fmt::format("has no height beyond {:.3g}: its bytes may stand in the other order (byteorder, in its header)", largest));
  return cells;
}

}  // namespace effuse::importers
