#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "geometry/base/types.h"

namespace effuse::skin {

/// Values on a map's cells, for geographic information systems: each value is of the whole cell.
struct Raster {
  Vec2 corner = Vec2::Zero();  ///< south-west corner of the south-west cell [m], in crs
  Vec2 cell = Vec2::Ones();    ///< sides of a cell along east and north [m]
  int nx = 0, ny = 0;          ///< >= 1
  std::vector<float> values;   ///< nx * ny, i fastest, south row first; NaN: none
  std::string crs;             ///< "EPSG:27200", WKT, or empty: unknown. A projected system in metres.
  std::string unit;            ///< "m"; may be empty
  std::string description;     ///< one line for people; may be empty
};

/// Stands for a value that is not there, in both formats.
inline constexpr float kNoData = -9999;

/// The bytes of a GeoTIFF: baseline TIFF 6.0, little-endian, one band of 32 bit floats, north row first, strips of
/// about 64 kB, no compression; GeoTIFF 1.0 keys; GDAL's tags for nodata, unit and description.
///
/// The coordinate system by its EPSG code where crs is one or is a WKT that carries one (ProjectedCSTypeGeoKey);
/// any other WKT as a user-defined one with "ESRI PE String = WKT" as its citation, which GDAL and ArcGIS read back
/// (GDAL up to 2400 characters: blanks outside quotes are left out); a text that is neither only as a citation; none
/// without any.
///
/// Checked: sizes, cell > 0, corner finite, values finite or NaN, less than 4 GB.
/// Source: TIFF 6.0 (Adobe 1992); OGC 19-008r4; GDAL's GTiff driver for tags 42112 and 42113.
std::string encode_geotiff(const Raster& raster);

/// The text of an ESRI ASCII grid, north row first. Each number is the shortest that reads back to the same float.
/// cellsize, or dx and dy (which GDAL and effuse read, others may not) where a cell is no square. The same checks.
std::string encode_esri_ascii(const Raster& raster);

/// The EPSG code of a coordinate system: of "EPSG:27200", or of a projected system in WKT 1 or 2 that names its own.
std::optional<int> epsg_code(std::string_view crs);

/// Both write whole files or none, and throw InputError naming the file when its place cannot be written to, and
/// ResourceError when the disk is full.
void write_geotiff(const std::filesystem::path& file, const Raster& raster);
/// With the coordinate system beside it in FILE.prj, which holds WKT: crs itself, or that of the UTM zone (WGS 84,
/// ETRS89, NAD83) its code stands for. Any other code cannot be spelled out here: then there is no .prj, nor one of
/// an earlier grid of this name.
void write_esri_ascii(const std::filesystem::path& file, const Raster& raster);

}  // namespace effuse::skin
