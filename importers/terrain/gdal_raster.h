#pragma once

#include <filesystem>
#include <string_view>

#include "importers/terrain/raster.h"

namespace effuse::importers {

/// Whether GDAL's drivers that we let it use claim a file of this ending: .tif .tiff .hgt .dem .ddf .flt .bil .bip .bsq .hdr .img
/// .nc .png .dt0 .dt1 .dt2 .grd .bt .jp2 ...
bool gdal_reads(const std::string& extension);

/// Whether bytes begin as TIFF or BigTIFF do, whatever the file is called.
bool looks_like_tiff(std::string_view bytes);

/// The extensions of gdal_reads(), separated by blanks, without points: as assimp wants them.
const char* gdal_extensions();

/// What a raster says of itself: GeoTIFF (strips, tiles, BigTIFF, COG, any compression GDAL has), SRTM HGT (placed by its
/// name), USGS DEM, SDTS, DTED, ESRI .flt/.bil with its header, ERDAS .img, netCDF, Surfer grids, PNG. Cells' centres are the posts:
/// PixelIsPoint files come out half a cell apart from PixelIsArea ones, as they should. Of netCDF files that hold several
/// grids, the one that sounds like heights.
///
/// Throws InputError naming the file: not a raster any of these drivers reads, no band, colours instead of heights, complex
/// numbers, a block of more than 512 MB to be read as a whole.
RasterFacts read_raster_facts(const std::filesystem::path& file);

/// Heights of a window of the raster's cells, band 1: scale and offset applied; nodata values, masks, and numbers that mark
/// missing data without having been declared become NaN and are counted. Memory for the window only. Throws InputError for
/// cells that cannot be read (a file cut short), and for heights that are infinite or beyond 100 km.
RasterCells read_raster_cells(const std::filesystem::path& file, const CellWindow& window);

}  // namespace effuse::importers
