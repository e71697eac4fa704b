// Our heights beside GDAL's, and our distances beside PROJ's, on every grid there is here.

#include <fmt/format.h>
#include <gdal_alg.h>
#include <gdalwarper.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/base/random.h"
#include "importers/terrain/import_dem.h"
#include "importers/terrain/import_terrain.h"
#include "importers/terrain/spatial_reference.h"
#include "tests/importers/terrain/made_rasters.h"
#include "tests/importers/test_files.h"

namespace effuse::importers {
namespace {

namespace fs = std::filesystem;

/// A raster as GDAL reads it.
struct Raster {
  int columns = 0, rows = 0;
  std::array<double, 6> transform{};
  std::vector<double> values;
  std::string crs;

  explicit Raster(const fs::path& file) {
    GDALAllRegister();
    GDALDatasetH dataset = GDALOpen(file.string().c_str(), GA_ReadOnly);
    EXPECT_NE(dataset, nullptr) << file;
    columns = GDALGetRasterXSize(dataset), rows = GDALGetRasterYSize(dataset);
    GDALGetGeoTransform(dataset, transform.data());
    crs = GDALGetProjectionRef(dataset);
    values.resize(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
    GDALRasterBandH band = GDALGetRasterBand(dataset, 1);
    EXPECT_EQ(GDALRasterIO(band, GF_Read, 0, 0, columns, rows, values.data(), columns, rows, GDT_Float64, 0, 0), CE_None);
    int has = 0;
    const double nodata = GDALGetRasterNoDataValue(band, &has);
    for (double& z : values)
      if ((has && z == nodata) || z == -9999) z = std::nan("");
    GDALClose(dataset);
  }

  /// Bilinear between the centres of cells, as gdalwarp's kernel has it where all four have heights; NaN elsewhere.
  double bilinear(const Vec2& p) const {
    const double c = (p.x() - transform[0]) / transform[1] - 0.5, r = (p.y() - transform[3]) / transform[5] - 0.5;
    const int i = static_cast<int>(std::floor(c)), j = static_cast<int>(std::floor(r));
    if (i < 0 || j < 0 || i + 1 >= columns || j + 1 >= rows) return std::nan("");
    const auto z = [&](int x, int y) { return values[static_cast<std::size_t>(y) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(x)]; };
    const double u = c - i, v = r - j;
    return (1 - v) * ((1 - u) * z(i, j) + u * z(i + 1, j)) + v * ((1 - u) * z(i, j + 1) + u * z(i + 1, j + 1));
  }
};

/// What GDAL's own warper makes of the file on our posts, bilinear; NaN where it has nothing.
std::vector<double> warped(const fs::path& file, const DemGrid& grid) {
  GDALDatasetH source = GDALOpen(file.string().c_str(), GA_ReadOnly);
  MadeRaster frame;
  frame.columns = grid.nx, frame.rows = grid.ny;
  frame.type = GDT_Float64;
  frame.transform = {grid.corner.x() - grid.spacing.x() / 2, grid.spacing.x(), 0, grid.corner.y() + (grid.ny - 0.5) * grid.spacing.y(), 0, -grid.spacing.y()};
  GDALDatasetH target = GDALCreate(GDALGetDriverByName("MEM"), "", grid.nx, grid.ny, 1, GDT_Float64, nullptr);
  GDALSetGeoTransform(target, frame.transform.data());
  GDALSetProjection(target, grid.crs.c_str());
  GDALSetRasterNoDataValue(GDALGetRasterBand(target, 1), -1e9);
  GDALFillRaster(GDALGetRasterBand(target, 1), -1e9, 0);
  GDALWarpOptions* options = GDALCreateWarpOptions();
  options->hSrcDS = source;
  options->hDstDS = target;
  options->eResampleAlg = GRA_Bilinear;
  options->nBandCount = 1;
  // Its bilinear is of four cells where a post is as wide as a cell; else it takes more of them, to smooth. Four, here.
  options->papszWarpOptions = CSLSetNameValue(CSLSetNameValue(options->papszWarpOptions, "XSCALE", "1"), "YSCALE", "1");
  options->panSrcBands = static_cast<int*>(CPLMalloc(sizeof(int)));
  options->panDstBands = static_cast<int*>(CPLMalloc(sizeof(int)));
  options->panSrcBands[0] = options->panDstBands[0] = 1;
  int has = 0;
  const double nodata = GDALGetRasterNoDataValue(GDALGetRasterBand(source, 1), &has);
  if (has) GDALWarpInitSrcNoDataReal(options, nodata);
  GDALWarpInitDstNoDataReal(options, -1e9);
  options->pTransformerArg = GDALCreateGenImgProjTransformer(source, GDALGetProjectionRef(source), target, grid.crs.c_str(), FALSE, 0, 1);
  options->pfnTransformer = GDALGenImgProjTransform;
  GDALWarpOperationH operation = GDALCreateWarpOperation(options);
  EXPECT_NE(operation, nullptr);
  EXPECT_EQ(GDALChunkAndWarpImage(operation, 0, 0, grid.nx, grid.ny), CE_None);
  GDALDestroyWarpOperation(operation);
  GDALDestroyGenImgProjTransformer(options->pTransformerArg);
  GDALDestroyWarpOptions(options);
  std::vector<double> values(static_cast<std::size_t>(grid.nx) * static_cast<std::size_t>(grid.ny)), south(values.size());
  EXPECT_EQ(GDALRasterIO(GDALGetRasterBand(target, 1), GF_Read, 0, 0, grid.nx, grid.ny, values.data(), grid.nx, grid.ny, GDT_Float64, 0, 0), CE_None);
  GDALClose(target);
  GDALClose(source);
  for (int j = 0; j < grid.ny; ++j)
    for (int i = 0; i < grid.nx; ++i) {
      const double z = values[static_cast<std::size_t>(grid.ny - 1 - j) * static_cast<std::size_t>(grid.nx) + static_cast<std::size_t>(i)];
      south[static_cast<std::size_t>(j) * static_cast<std::size_t>(grid.nx) + static_cast<std::size_t>(i)] = z == -1e9 ? std::nan("") : z;
    }
  return south;
}

std::vector<fs::path> shared_grids() {
  const fs::path data = shared_data();
  std::vector<fs::path> grids;
  if (!data.empty())
    for (const char* name : {"arenal.tif", "avaAlr.tif", "avaHit.asc", "avaKot.asc", "luxembourg-elev.tif", "maunga-whau.asc"}) grids.push_back(data / "terrain" / name);
  return grids;
}

TEST(AgreementSharedData, AThousandPointsOfEachGridLieOnGdalsOwnBilinearSurface) {
  const std::vector<fs::path> grids = shared_grids();
  if (grids.empty()) GTEST_SKIP() << "no shared data on this machine (EFFUSE_SHARED_DATA)";
  for (const fs::path& file : grids) {
    const DemGrid grid = import_dem({file});
    const TerrainImport import = terrain_from_grid(grid, file.string());
    const geometry::HeightField& field = *import.terrain.height_field();
    const Vec2 origin = import.terrain.georeference().origin.head<2>();
    const Raster source(file);
    const bool moved = !source.crs.empty() && read_crs(source.crs, "source").kind == Crs::Kind::kGeographic;
    const std::vector<double> gdal = moved ? warped(file, grid) : std::vector<double>();
    std::optional<CrsTransform> back;
    if (moved) back.emplace(read_crs(grid.crs, "grid"), read_crs(source.crs, "source"));
    double worst = 0, worst_post = 0, apart = 0, apart2 = 0;
    int checked = 0;
    for (std::uint64_t k = 0; checked < 1000 && k < 20000; ++k) {
      const Vec2 p(random_uniform(7, 0, k) * (grid.nx - 1), random_uniform(7, 1, k) * (grid.ny - 1));
      const int i = std::min(static_cast<int>(p.x()), grid.nx - 2), j = std::min(static_cast<int>(p.y()), grid.ny - 2);
      const double u = p.x() - i, v = p.y() - j;
      const Vec2 on_map = grid.corner + p.cwiseProduct(grid.spacing);
      const double ours = field.height(on_map.x() - origin.x(), on_map.y() - origin.y());
      if (std::isnan(ours)) continue;
      double theirs;
      if (moved) {
        const auto z = [&](int x, int y) { return gdal[static_cast<std::size_t>(y) * static_cast<std::size_t>(grid.nx) + static_cast<std::size_t>(x)]; };
        theirs = (1 - v) * ((1 - u) * z(i, j) + u * z(i + 1, j)) + v * ((1 - u) * z(i, j + 1) + u * z(i + 1, j + 1));
        // The post itself, straight from the file's own cells, by PROJ.
        const Vec2 post = grid.corner + Vec2(i, j).cwiseProduct(grid.spacing);
        worst_post = std::max(worst_post, std::abs(grid.z[static_cast<std::size_t>(j) * static_cast<std::size_t>(grid.nx) + static_cast<std::size_t>(i)] - source.bilinear((*back)(post))));
        // Between posts a resampled surface is another one: how far, for the record.
        const double beside = ours - source.bilinear((*back)(on_map));
        if (!std::isnan(beside)) apart = std::max(apart, std::abs(beside)), apart2 += beside * beside;
      } else {
        theirs = source.bilinear(on_map);
      }
      ++checked;
      worst = std::max(worst, std::abs(ours - theirs));
    }
    EXPECT_EQ(checked, 1000) << file;
    EXPECT_LT(worst, 0.01) << file;
    EXPECT_LT(worst_post, 0.01) << file;
    fmt::print("{}: {:.2g} m from GDAL's, posts {:.2g} m from the file's cells, between posts {:.3g} m at most, {:.3g} m rms\n", file.filename().string(), worst, worst_post, apart, std::sqrt(apart2 / 1000));
  }
}

TEST(AgreementSharedData, DistancesInDegreesAreProjsToAThousandth) {
  const fs::path data = shared_data();
  if (data.empty()) GTEST_SKIP() << "no shared data on this machine (EFFUSE_SHARED_DATA)";
  const DemGrid grid = import_dem({data / "terrain/arenal.tif"});
  const CrsTransform to_degrees(read_crs(grid.crs, "grid"), read_crs("EPSG:4326", "test"));
  for (std::uint64_t k = 0; k < 200; ++k) {
    const Vec2 a = grid.corner + Vec2(random_uniform(3, 0, k) * 4900, random_uniform(3, 1, k) * 4100), b = grid.corner + Vec2(random_uniform(3, 2, k) * 4900, random_uniform(3, 3, k) * 4100);
    const Vec2 p = to_degrees(a), q = to_degrees(b);
    // Vincenty's inverse formula on WGS 84 (Vincenty 1975, Survey Review 23, 88-93): to 0.1 mm here.
    const double f = 1 / 298.257223563, major = 6378137, minor = major * (1 - f), deg = kPi / 180;
    const double U1 = std::atan((1 - f) * std::tan(p.y() * deg)), U2 = std::atan((1 - f) * std::tan(q.y() * deg)), L = (q.x() - p.x()) * deg;
    double lambda = L, sin_sigma = 0, cos_sigma = 0, sigma = 0, cos2_alpha = 0, cos_2m = 0;
    for (int turn = 0; turn < 50; ++turn) {
      sin_sigma = std::hypot(std::cos(U2) * std::sin(lambda), std::cos(U1) * std::sin(U2) - std::sin(U1) * std::cos(U2) * std::cos(lambda));
      cos_sigma = std::sin(U1) * std::sin(U2) + std::cos(U1) * std::cos(U2) * std::cos(lambda);
      sigma = std::atan2(sin_sigma, cos_sigma);
      const double sin_alpha = std::cos(U1) * std::cos(U2) * std::sin(lambda) / sin_sigma;
      cos2_alpha = 1 - sin_alpha * sin_alpha;
      cos_2m = cos_sigma - 2 * std::sin(U1) * std::sin(U2) / cos2_alpha;
      const double C = f / 16 * cos2_alpha * (4 + f * (4 - 3 * cos2_alpha));
      lambda = L + (1 - C) * f * sin_alpha * (sigma + C * sin_sigma * (cos_2m + C * cos_sigma * (2 * cos_2m * cos_2m - 1)));
    }
    const double u2 = cos2_alpha * (major * major - minor * minor) / (minor * minor), A = 1 + u2 / 16384 * (4096 + u2 * (-768 + u2 * (320 - 175 * u2))), B = u2 / 1024 * (256 + u2 * (-128 + u2 * (74 - 47 * u2)));
    const double ds = B * sin_sigma * (cos_2m + B / 4 * (cos_sigma * (2 * cos_2m * cos_2m - 1) - B / 6 * cos_2m * (4 * sin_sigma * sin_sigma - 3) * (4 * cos_2m * cos_2m - 3)));
    const double geodesic = minor * A * (sigma - ds);
    if (geodesic < 100) continue;
    EXPECT_NEAR((a - b).norm() / geodesic, 1, 1e-3);
  }
}

}  // namespace
}  // namespace effuse::importers
