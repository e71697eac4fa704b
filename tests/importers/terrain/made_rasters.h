#pragma once

#include <cpl_error.h>
#include <cpl_string.h>
#include <gdal.h>
#include <gtest/gtest.h>
#include <ogr_srs_api.h>

#include <array>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

/// Rasters that tests make with GDAL itself.
namespace effuse::importers {

struct MadeRaster {
  int columns = 0, rows = 0;
  std::vector<double> values;                            ///< north row first
  std::array<double, 6> transform = {0, 1, 0, 0, 0, -1};  ///< GDAL's: corner of the first cell
  std::string crs;                                        ///< what OSRSetFromUserInput takes; empty: none
  GDALDataType type = GDT_Float32;
  std::vector<std::string> options;                       ///< "TILED=YES"
  std::function<void(GDALDatasetH)> more;                 ///< nodata, units, scale, masks
};

inline std::string wkt_of(const std::string& crs) {
  OGRSpatialReferenceH srs = OSRNewSpatialReference(nullptr);
  char* wkt = nullptr;
  EXPECT_EQ(OSRSetFromUserInput(srs, crs.c_str()), OGRERR_NONE) << crs;
  OSRExportToWkt(srs, &wkt);
  const std::string text = wkt ? wkt : "";
  CPLFree(wkt);
  OSRRelease(srs);
  return text;
}

/// Writes it with the named driver; those that only copy get it by way of memory.
inline std::filesystem::path make_raster(const std::filesystem::path& file, const std::string& driver_name, const MadeRaster& made) {
  GDALAllRegister();
  char** options = nullptr;
  for (const std::string& option : made.options) options = CSLAddString(options, option.c_str());
  GDALDriverH driver = GDALGetDriverByName(driver_name.c_str()), memory = GDALGetDriverByName("MEM");
  EXPECT_NE(driver, nullptr) << driver_name;
  const bool creates = GDALGetMetadataItem(driver, GDAL_DCAP_CREATE, nullptr) != nullptr;
  GDALDatasetH dataset = GDALCreate(creates ? driver : memory, creates ? file.string().c_str() : "", made.columns, made.rows, 1, made.type, creates ? options : nullptr);
  EXPECT_NE(dataset, nullptr) << file << ": " << CPLGetLastErrorMsg();
  GDALSetGeoTransform(dataset, const_cast<double*>(made.transform.data()));
  if (!made.crs.empty()) GDALSetProjection(dataset, wkt_of(made.crs).c_str());
  std::vector<double> values = made.values;
  if (!values.empty()) {
    EXPECT_EQ(GDALRasterIO(GDALGetRasterBand(dataset, 1), GF_Write, 0, 0, made.columns, made.rows, values.data(), made.columns, made.rows, GDT_Float64, 0, 0), CE_None);
  }
  if (made.more) made.more(dataset);
  if (!creates) {
    GDALDatasetH copy = GDALCreateCopy(driver, file.string().c_str(), dataset, FALSE, options, nullptr, nullptr);
    EXPECT_NE(copy, nullptr) << file << ": " << CPLGetLastErrorMsg();
    GDALClose(copy);
  }
  GDALClose(dataset);
  CSLDestroy(options);
  return file;
}

/// Heights that tell every row and column apart: a tilted plane with a bump, whole numbers of centimetres.
inline double sample_height(int column, int row) { return 100 + 3 * column - 2 * row + ((column * 7 + row * 13) % 5) * 0.25; }

inline MadeRaster sample_raster(int columns = 23, int rows = 17) {
  MadeRaster made;
  made.columns = columns, made.rows = rows;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) made.values.push_back(sample_height(c, r));
  made.transform = {500000, 10, 0, 4000000, 0, -10};
  made.crs = "EPSG:32633";
  return made;
}

}  // namespace effuse::importers
