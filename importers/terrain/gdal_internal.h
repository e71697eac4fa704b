#pragma once

#include <cpl_conv.h>
#include <cpl_error.h>
#include <cpl_string.h>
#include <gdal.h>
#include <ogr_srs_api.h>

#include <string>

#include "importers/input_file.h"

// The functions of GDAL that we call.
#define EFFUSE_GDAL_FUNCTIONS(X) \
  X(CPLErrorReset) X(CPLGetLastErrorMsg) X(CPLPopErrorHandler) X(CPLPushErrorHandler) X(CPLQuietErrorHandler) X(CSLFetchNameValue) X(VSIFree) \
  X(GDALAllRegister) X(GDALClose) X(GDALDataTypeIsComplex) X(GDALDeregisterDriver) X(GDALGetBlockSize) X(GDALGetDataTypeName) \
  X(GDALGetDataTypeSizeBytes) X(GDALGetDriver) X(GDALGetDriverCount) X(GDALGetDriverShortName) \
  X(GDALGetDatasetDriver) X(GDALGetDriverLongName) X(GDALGetGCPCount) X(GDALGetGeoTransform) X(GDALGetMaskBand) X(GDALGetMaskFlags) \
  X(GDALGetMetadata) X(GDALGetRasterBand) X(GDALGetRasterColorInterpretation) X(GDALGetRasterCount) X(GDALGetRasterDataType) \
  X(GDALGetRasterNoDataValue) X(GDALGetRasterOffset) X(GDALGetRasterScale) X(GDALGetRasterUnitType) X(GDALGetRasterXSize) \
  X(GDALGetRasterYSize) X(GDALGetSpatialRef) X(GDALOpenEx) X(GDALRasterIO) X(GDALSetCacheMax64) \
  X(OCTDestroyCoordinateTransformation) X(OCTNewCoordinateTransformation) X(OCTTransformEx) \
  X(OSRExportToWkt) X(OSRExportToWktEx) X(OSRFindMatches) X(OSRFreeSRSArray) X(OSRGetAngularUnits) X(OSRGetAttrValue) \
  X(OSRGetAuthorityCode) X(OSRGetAuthorityName) X(OSRGetLinearUnits) X(OSRGetTargetLinearUnits) X(OSRImportFromEPSG) X(OSRIsCompound) \
  X(OSRIsGeographic) X(OSRIsLocal) X(OSRIsProjected) X(OSRIsVertical) X(OSRNewSpatialReference) X(OSRRelease) \
  X(OSRSetAxisMappingStrategy) X(OSRSetFromUserInput) X(OSRSetLinearUnitsAndUpdateParameters) X(OSRSetPROJEnableNetwork) X(OSRStripVertical)

namespace effuse::importers {

struct Gdal {
#define EFFUSE_GDAL_MEMBER(function) decltype(&::function) function;
  EFFUSE_GDAL_FUNCTIONS(EFFUSE_GDAL_MEMBER)
#undef EFFUSE_GDAL_MEMBER
};

/// GDAL, loaded by the first call: linked as usual it brings a hundred libraries, and costs every program that holds our
/// importers 37 ms at its start, most of which read no raster. PROJ's network is
/// switched off. Throws std::runtime_error if the library is missing.
const Gdal& gdal();

/// GDAL with its drivers registered and a cache of 64 MB instead of a twentieth of the machine's memory.
void prepare_gdal();

/// While it lives, what GDAL complains of on this thread is kept instead of printed.
class GdalComplaints {
 public:
  GdalComplaints() {
    gdal().CPLPushErrorHandler(gdal().CPLQuietErrorHandler);
    gdal().CPLErrorReset();
  }
  ~GdalComplaints() { gdal().CPLPopErrorHandler(); }
  GdalComplaints(const GdalComplaints&) = delete;
  GdalComplaints& operator=(const GdalComplaints&) = delete;

  /// The last one, fit to print; what it says without one.
  std::string last(const std::string& otherwise) const {
    const std::string words = gdal().CPLGetLastErrorMsg();
    return words.empty() ? otherwise : printable(words);
  }
};

}  // namespace effuse::importers
