// Every raster format, each made by GDAL with the same heights: the same grid comes out of all.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "importers/terrain/import_dem.h"
#include "importers/terrain/xyz_grid.h"
#include "tests/importers/terrain/made_rasters.h"
#include "tests/importers/test_files.h"

namespace effuse::importers {
namespace {

namespace fs = std::filesystem;

std::string notes_of(const DemGrid& grid) { return fmt::format("{}", fmt::join(grid.notes, "\n")); }

/// Posts of the sample, north row of the file on top.
void expect_sample(const DemGrid& grid, double tolerance, const std::string& what) {
  ASSERT_EQ(grid.nx, 23) << what;
  ASSERT_EQ(grid.ny, 17) << what;
  EXPECT_NEAR(grid.corner.x(), 500005, 1e-6) << what;
  EXPECT_NEAR(grid.corner.y(), 4000000 - 165, 1e-6) << what;
  EXPECT_NEAR(grid.spacing.x(), 10, 1e-9) << what;
  EXPECT_NEAR(grid.spacing.y(), 10, 1e-9) << what;
  for (int j = 0; j < grid.ny; ++j)
    for (int i = 0; i < grid.nx; ++i)
      ASSERT_NEAR(grid.z[static_cast<std::size_t>(j * grid.nx + i)], sample_height(i, grid.ny - 1 - j), tolerance) << what << " post " << i << ", " << j;
}

struct Dialect {
  std::string name, driver;
  GDALDataType type;
  std::vector<std::string> options;
  double tolerance;  // of the type and format
};

class Formats : public testing::TestWithParam<Dialect> {};

TEST_P(Formats, GiveTheSameGrid) {
  const Dialect& dialect = GetParam();
  const TestFolder folder;
  MadeRaster made = sample_raster();
  made.type = dialect.type;
  made.options = dialect.options;
  expect_sample(import_dem({make_raster(folder.path() / dialect.name, dialect.driver, made)}), dialect.tolerance, dialect.name);
}

INSTANTIATE_TEST_SUITE_P(
    All, Formats,
    testing::Values(Dialect{"strips.tif", "GTiff", GDT_Float32, {}, 1e-5}, Dialect{"one_strip.tif", "GTiff", GDT_Float64, {"BLOCKYSIZE=17"}, 0},
                    Dialect{"tiles.tif", "GTiff", GDT_Float32, {"TILED=YES", "BLOCKXSIZE=16", "BLOCKYSIZE=16"}, 1e-5}, Dialect{"big.tif", "GTiff", GDT_Float64, {"BIGTIFF=YES"}, 0},
                    Dialect{"big_endian.tif", "GTiff", GDT_Float32, {"ENDIANNESS=BIG"}, 1e-5}, Dialect{"cog.tif", "COG", GDT_Float32, {}, 1e-5}, Dialect{"lzw.tif", "GTiff", GDT_Float32, {"COMPRESS=LZW", "PREDICTOR=3"}, 1e-5},
                    Dialect{"deflate.tif", "GTiff", GDT_Float64, {"COMPRESS=DEFLATE", "TILED=YES"}, 0}, Dialect{"zstd.tiff", "GTiff", GDT_Float32, {"COMPRESS=ZSTD"}, 1e-5},
                    Dialect{"lerc.tif", "GTiff", GDT_Float32, {"COMPRESS=LERC"}, 1e-5}, Dialect{"int16.tif", "GTiff", GDT_Int16, {}, 0.5}, Dialect{"uint32.tif", "GTiff", GDT_UInt32, {"COMPRESS=LZW"}, 0.5},
                    Dialect{"raw.flt", "EHdr", GDT_Float32, {}, 1e-5}, Dialect{"raw.bil", "EHdr", GDT_Int16, {}, 0.5}, Dialect{"imagine.img", "HFA", GDT_Float64, {}, 0}, Dialect{"grid.nc", "netCDF", GDT_Float64, {}, 1e-6},
                    Dialect{"surfer.grd", "GS7BG", GDT_Float64, {}, 0}, Dialect{"envi.bsq", "ENVI", GDT_Float32, {}, 1e-5}),
    [](const auto& tested) {
      std::string name = tested.param.name;
      std::replace(name.begin(), name.end(), '.', '_');
      return name;
    });

TEST(GridFormats, ScaleAndOffsetAreApplied) {
  const TestFolder folder;
  MadeRaster made = sample_raster();
  for (double& z : made.values) z = (z - 50) * 4;  // whole numbers
  made.type = GDT_Int16;
  made.more = [](GDALDatasetH d) {
    GDALSetRasterScale(GDALGetRasterBand(d, 1), 0.25);
    GDALSetRasterOffset(GDALGetRasterBand(d, 1), 50);
  };
  const DemGrid grid = import_dem({make_raster(folder.path() / "scaled.tif", "GTiff", made)});
  expect_sample(grid, 1e-9, "scaled");
  EXPECT_NE(notes_of(grid).find("times 0.25 plus 50"), std::string::npos) << notes_of(grid);
}

TEST(GridFormats, MasksMakeHoles) {
  const TestFolder folder;
  MadeRaster made = sample_raster();
  made.options = {"TILED=YES"};
  made.more = [](GDALDatasetH d) {
    CPLSetThreadLocalConfigOption("GDAL_TIFF_INTERNAL_MASK", "YES");
    EXPECT_EQ(GDALCreateDatasetMaskBand(d, GMF_PER_DATASET), CE_None);
    std::vector<unsigned char> mask(23 * 17, 255);
    mask[5] = mask[6] = 0;
    EXPECT_EQ(GDALRasterIO(GDALGetMaskBand(GDALGetRasterBand(d, 1)), GF_Write, 0, 0, 23, 17, mask.data(), 23, 17, GDT_Byte, 0, 0), CE_None);
    CPLSetThreadLocalConfigOption("GDAL_TIFF_INTERNAL_MASK", nullptr);
  };
  const DemGrid grid = import_dem({make_raster(folder.path() / "masked.tif", "GTiff", made)});
  EXPECT_EQ(grid.nodata, 2u);
  EXPECT_TRUE(std::isnan(grid.z[16 * 23 + 5]));
  EXPECT_NE(notes_of(grid).find("2 cells are masked out"), std::string::npos) << notes_of(grid);
}

TEST(GridFormats, AnSrtmTileIsPlacedByItsName) {
  const TestFolder folder;
  // Big-endian shorts, 1201 x 1201, posts on whole degrees: heights say their row.
  std::string bytes(2u * 1201 * 1201, '\0');
  for (std::size_t r = 0; r < 1201; ++r)
    for (std::size_t c = 0; c < 1201; ++c) {
      const int z = static_cast<int>(r) + static_cast<int>(c % 100);
      bytes[2 * (1201 * r + c)] = static_cast<char>(z >> 8), bytes[2 * (1201 * r + c) + 1] = static_cast<char>(z & 0xff);
    }
  DemOptions options;
  options.crop = {-84.51, 10.49, -84.49, 10.51};
  const DemGrid grid = import_dem({folder.write("N10W085.hgt", bytes)}, options);
  EXPECT_NE(notes_of(grid).find("EPSG:32616"), std::string::npos) << notes_of(grid);
  // 10.5 N 84.5 W is row 600, column 600; its place in UTM 16 N by gdaltransform (PROJ 9.1.1).
  const Vec2 p(773641.163, 1161783.541);
  const int i = static_cast<int>(std::lround((p.x() - grid.corner.x()) / grid.spacing.x())), j = static_cast<int>(std::lround((p.y() - grid.corner.y()) / grid.spacing.y()));
  ASSERT_TRUE(i >= 0 && i < grid.nx && j >= 0 && j < grid.ny);
  EXPECT_NEAR(grid.z[static_cast<std::size_t>(j * grid.nx + i)], 600, 1.1) << "half a cell beside it is another row and column";
  EXPECT_TRUE(contains(refusal([&] { import_dem({folder.write("mountain.hgt", bytes)}); }), "N10W085.hgt"));
  EXPECT_TRUE(contains(refusal([&] { import_dem({folder.write("N10W086.hgt", bytes.substr(100))}); }), "3601"));
}

TEST(GridFormats, AUsgsDemIsRead) {
  const TestFolder folder;
  MadeRaster made = sample_raster(40, 40);
  made.type = GDT_Int16;
  for (double& z : made.values) z = std::floor(z);
  made.options = {"PRODUCT=DEFAULT"};
  const DemGrid grid = import_dem({make_raster(folder.path() / "quad.dem", "USGSDEM", made)});
  // GDAL's writer adds a row in the south without data, half a cell beside the others.
  EXPECT_EQ(grid.nx, 40);
  ASSERT_EQ(grid.ny, 41);
  EXPECT_EQ(grid.nodata, 40u);
  for (int j = 1; j <= 40; ++j)
    for (int i = 0; i < 40; ++i) ASSERT_EQ(grid.z[static_cast<std::size_t>(40 * j + i)], std::floor(sample_height(i, 40 - j))) << i << ", " << j;
}

TEST(GridFormats, AnImageNeedsItsSizeAndItsHeights) {
  const TestFolder folder;
  MadeRaster made;
  made.columns = 5, made.rows = 3;
  made.type = GDT_UInt16;
  for (int k = 0; k < 15; ++k) made.values.push_back(k * 65535 / 14.0);
  const fs::path file = make_raster(folder.path() / "map.png", "PNG", made);
  fs::remove(folder.path() / "map.png.aux.xml");
  EXPECT_TRUE(contains(refusal([&] { import_dem({file}); }), "size = "));
  DemOptions options;
  options.size = {400, 100};
  EXPECT_TRUE(contains(refusal([&] { import_dem({file}, options); }), "range = "));
  options.range = {-50, 90};
  const DemGrid grid = import_dem({file}, options);
  EXPECT_EQ(grid.spacing, Vec2(100, 50));
  EXPECT_EQ(grid.corner, Vec2(0, 0));
  EXPECT_NEAR(grid.z[10], -50, 1e-9) << "black, in the north-west";
  EXPECT_NEAR(grid.z[4], 90, 1e-9) << "white, in the south-east";
  EXPECT_NEAR(grid.z[0], 50, 2e-3) << "two steps of 140 m / 65535";
}

TEST(GridFormats, APhotographIsNoTerrain) {
  const TestFolder folder;
  GDALAllRegister();
  GDALDatasetH memory = GDALCreate(GDALGetDriverByName("MEM"), "", 8, 8, 3, GDT_Byte, nullptr);
  for (int b = 1; b <= 3; ++b) GDALSetRasterColorInterpretation(GDALGetRasterBand(memory, b), static_cast<GDALColorInterp>(GCI_RedBand + b - 1));
  const fs::path file = folder.path() / "photo.png";
  GDALClose(GDALCreateCopy(GDALGetDriverByName("PNG"), file.string().c_str(), memory, FALSE, nullptr, nullptr, nullptr));
  GDALClose(memory);
  EXPECT_TRUE(contains(refusal([&] { import_dem({file}); }), "red, green and blue"));
}

std::string xyz_of(const std::vector<int>& order, const std::string& separator, bool comma = false) {
  std::string text;
  for (const int k : order) {
    std::string line = fmt::format("{:.1f}{}{:.1f}{}{:.2f}\n", 500005.0 + 10 * (k % 23), separator, 4000000 - 5.0 - 10 * (k / 23), separator, sample_height(k % 23, k / 23));
    if (comma) std::replace(line.begin(), line.end(), '.', ',');
    text += line;
  }
  return text;
}

TEST(Xyz, OrderedShuffledWithTitlesAndWithEverySeparatorIsTheSameGrid) {
  const TestFolder folder;
  std::vector<int> order(23 * 17);
  for (int k = 0; k < 23 * 17; ++k) order[static_cast<std::size_t>(k)] = k;
  expect_sample(import_dem({folder.write("a.xyz", xyz_of(order, " "))}), 1e-9, "ordered");
  for (std::size_t k = order.size() - 1; k > 0; --k) std::swap(order[k], order[(k * 7919) % (k + 1)]);
  expect_sample(import_dem({folder.write("b.xyz", xyz_of(order, "\t"))}), 1e-9, "shuffled");
  expect_sample(import_dem({folder.write("c.csv", "x,y,z\n" + xyz_of(order, ","))}), 1e-9, "csv");
  expect_sample(import_dem({folder.write("d.txt", "# survey\n\"E\";\"N\";\"H\"\n" + xyz_of(order, ";", true))}), 1e-9, "decimal commas");
  expect_sample(import_dem({folder.write("e.xyz", xyz_of(order, " ", true))}), 1e-9, "decimal commas and blanks");
}

TEST(Xyz, PlacesLeftOutAreHoles) {
  std::vector<int> order;
  for (int k = 0; k < 23 * 17; ++k)
    if (k % 7 != 3) order.push_back(k);
  const DemGrid grid = parse_xyz(xyz_of(order, " "), "gaps.xyz");
  EXPECT_EQ(grid.nx * grid.ny, 23 * 17);
  EXPECT_EQ(grid.nodata, 23u * 17 - order.size());
}

TEST(Xyz, WhatIsNoGridIsRefusedWithItsLine) {
  const auto told = [](const std::string& text) { return refusal([&] { parse_xyz(text, "t.xyz"); }); };
  EXPECT_TRUE(contains(told("0 0 1\n1 0 2\n0 1\n1 1 4\n"), "t.xyz:3"));
  EXPECT_TRUE(contains(told("0 0 1\n1 0 x\n"), "t.xyz:2"));
  EXPECT_TRUE(contains(told("0 0 1\n1 0 2\n0 1 3\n1.4 1.3 4\n2 2 2\n3 2 1\n"), "beside the grid")) << told("0 0 1\n1 0 2\n0 1 3\n1.4 1.3 4\n2 2 2\n3 2 1\n");
  std::string cloud;
  for (int k = 0; k < 300; ++k) cloud += fmt::format("{} {} 1\n", std::fmod(k * 0.754877666, 1), std::fmod(k * 0.569840291, 1));
  EXPECT_TRUE(contains(told(cloud), "no grid") || contains(told(cloud), "no grid of")) << told(cloud);
}

}  // namespace
}  // namespace effuse::importers
