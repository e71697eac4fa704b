// What goes wrong with elevation models: each trap on a file made here, and beside it the real file that shows it.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "importers/terrain/import_dem.h"
#include "importers/terrain/import_terrain.h"
#include "importers/terrain/spatial_reference.h"
#include "tests/importers/terrain/made_rasters.h"
#include "tests/importers/test_files.h"

namespace effuse::importers {
namespace {

namespace fs = std::filesystem;

std::string notes_of(const DemGrid& grid) { return fmt::format("{}", fmt::join(grid.notes, "\n")); }
Real post(const DemGrid& grid, int i, int j) { return grid.z[static_cast<std::size_t>(j * grid.nx + i)]; }

TEST(Traps, HalfACell) {
  const TestFolder folder;
  const std::string rest = "ncols 3\nnrows 2\ncellsize 10\n1 2 3\n4 5 6\n";
  EXPECT_EQ(import_dem({folder.write("corner.asc", "xllcorner 100\nyllcorner 200\n" + rest)}).corner, Vec2(105, 205));
  EXPECT_EQ(import_dem({folder.write("center.asc", "xllcenter 100\nyllcenter 200\n" + rest)}).corner, Vec2(100, 200));
  // avaHit says xllcenter, avaKot xllcorner: import_terrain_test has both.
}

TEST(Traps, PixelIsPoint) {
  const TestFolder folder;
  // The same tie point and the same heights: as areas it is a corner of the first cell, as points its post.
  MadeRaster made = sample_raster();
  made.more = [](GDALDatasetH d) { GDALSetMetadataItem(d, "AREA_OR_POINT", "Point", nullptr); };
  const DemGrid point = import_dem({make_raster(folder.path() / "point.tif", "GTiff", made)});
  made.more = nullptr;
  const DemGrid area = import_dem({make_raster(folder.path() / "area.tif", "GTiff", made)});
  // GDAL writes each so that its own transform comes out the same; in the bytes the tie points differ by half a cell.
  EXPECT_EQ(point.corner, area.corner);
  // Bytes of the area file read as points: the type key alone is changed from 1 to 2.
  std::string bytes;
  {
    std::ifstream in(folder.path() / "area.tif", std::ios::binary);
    bytes.assign(std::istreambuf_iterator<char>(in), {});
  }
  const std::string area_key("\x01\x04\x00\x00\x01\x00\x01\x00", 8), point_key("\x01\x04\x00\x00\x01\x00\x02\x00", 8);
  const std::size_t at = bytes.find(area_key);
  ASSERT_NE(at, std::string::npos);
  bytes.replace(at, 8, point_key);
  const DemGrid turned = import_dem({folder.write("turned.tif", bytes)});
  EXPECT_NEAR(turned.corner.x(), area.corner.x() - 5, 1e-9) << "the tie point is now the first post, not its cell's corner";
  EXPECT_NEAR(turned.corner.y(), area.corner.y() + 5, 1e-9);
}

TEST(Traps, RowOrder) {
  const TestFolder folder;
  MadeRaster north = sample_raster(), south = north, west = north;
  // The same ground with its rows from the south, and with its columns from the east.
  south.transform = {500000, 10, 0, 4000000 - 170, 0, 10};
  west.transform = {500000 + 230, -10, 0, 4000000, 0, -10};
  for (int r = 0; r < 17; ++r)
    for (int c = 0; c < 23; ++c) {
      south.values[static_cast<std::size_t>(23 * r + c)] = sample_height(c, 16 - r);
      west.values[static_cast<std::size_t>(23 * r + c)] = sample_height(22 - c, r);
    }
  const DemGrid up = import_dem({make_raster(folder.path() / "north.tif", "GTiff", north)});
  const DemGrid down = import_dem({make_raster(folder.path() / "south.tif", "GTiff", south)});
  const DemGrid mirrored = import_dem({make_raster(folder.path() / "west.tif", "GTiff", west)});
  EXPECT_EQ(post(up, 0, 0), static_cast<float>(sample_height(0, 16))) << "south-west is the last row's first";
  EXPECT_EQ(down.z, up.z);
  EXPECT_EQ(down.corner, up.corner);
  EXPECT_EQ(mirrored.z, up.z);
  EXPECT_EQ(mirrored.corner, up.corner);
}

TEST(Traps, FeetAreNotMetres) {
  const TestFolder folder;
  // New York Long Island counts in US survey feet.
  MadeRaster made = sample_raster();
  made.crs = "EPSG:2263";
  made.transform = {980000, 30, 0, 200000, 0, -30};
  const DemGrid heights_unknown = import_dem({make_raster(folder.path() / "ny.tif", "GTiff", made)});
  const double foot = 1200.0 / 3937;
  EXPECT_NEAR(heights_unknown.spacing.x(), 30 * foot, 1e-9);
  EXPECT_NEAR(heights_unknown.corner.x(), (980000 + 15) * foot, 1e-6);
  EXPECT_EQ(post(heights_unknown, 0, 0), static_cast<float>(sample_height(0, 16)));
  EXPECT_TRUE(contains(notes_of(heights_unknown), "does not say the unit of its heights")) << notes_of(heights_unknown);
  // The place in metres is the same place: there and back through degrees.
  const Crs metres = read_crs(heights_unknown.crs, "test");
  EXPECT_EQ(metres.unit, 1);
  const Crs degrees = read_crs("EPSG:4326", "test");
  const Vec2 as_metres = CrsTransform(metres, degrees)(heights_unknown.corner), as_feet = CrsTransform(read_crs("EPSG:2263", "test"), degrees)(Vec2(980015, 200000 - 16.5 * 30));
  EXPECT_NEAR((as_metres - as_feet).norm(), 0, 1e-9);

  // Heights: by the band's unit, by the vertical datum, as asked.
  made.more = [](GDALDatasetH d) { GDALSetRasterUnitType(GDALGetRasterBand(d, 1), "US survey foot"); };
  EXPECT_NEAR(post(import_dem({make_raster(folder.path() / "unit.tif", "GTiff", made)}), 0, 0), sample_height(0, 16) * foot, 1e-5);
  made.more = nullptr;
  made.crs = "EPSG:2263+6360";
  EXPECT_NEAR(post(import_dem({make_raster(folder.path() / "compound.tif", "GTiff", made)}), 0, 0), sample_height(0, 16) * foot, 1e-5);
  DemOptions options;
  options.vertical_unit = "ft";
  EXPECT_NEAR(post(import_dem({folder.path() / "ny.tif"}, options), 0, 0), sample_height(0, 16) * 0.3048, 1e-5);
  options.vertical_unit = "furlong";
  EXPECT_TRUE(contains(refusal([&] { import_dem({folder.path() / "ny.tif"}, options); }), "us-ft"));
}

TEST(Traps, DegreesAreNotMetres) {
  const TestFolder folder;
  MadeRaster made = sample_raster(60, 60);
  made.transform = {-84.7, 1 / 3600.0, 0, 10.5, 0, -1 / 3600.0};
  for (const char* crs : {"EPSG:4326", ""}) {  // said, and guessed
    made.crs = crs;
    const DemGrid grid = import_dem({make_raster(folder.path() / "degrees.tif", "GTiff", made)});
    EXPECT_NEAR(grid.spacing.x(), 30.5, 0.3);
    EXPECT_TRUE(contains(notes_of(grid), "EPSG:32616")) << notes_of(grid);
    EXPECT_GT(grid.corner.x(), 100000);
  }
  // Other side of the equator, of a zone, of the world; the polar caps; Norway's wide zone.
  const Crs degrees = read_crs("EPSG:4326", "test");
  EXPECT_EQ(utm_of({174.76, -36.88}, degrees).epsg, 32760);
  EXPECT_EQ(utm_of({-180, 10}, degrees).epsg, 32601);
  EXPECT_EQ(utm_of({181, 10}, degrees).epsg, 32601);
  EXPECT_EQ(utm_of({5, 60}, degrees).epsg, 32632);
  EXPECT_EQ(utm_of({15, 78}, degrees).epsg, 32633);
  EXPECT_EQ(utm_of({0, 85}, degrees).epsg, 32661);
  EXPECT_EQ(utm_of({0, -85}, degrees).epsg, 32761);
  EXPECT_EQ(utm_of({12.1, 47}, read_crs("EPSG:4258", "test")).epsg, 25833);
  // A system in degrees is none to work in.
  DemOptions options;
  options.crs = "EPSG:4326";
  EXPECT_TRUE(contains(refusal([&] { import_dem({folder.path() / "degrees.tif"}, options); }), "degrees"));
}

TEST(Traps, NodataDeclaredOrNot) {
  const TestFolder folder;
  const auto with = [&](double mark, GDALDataType type, bool declared) {
    MadeRaster made = sample_raster();
    made.type = type;
    made.values[3] = made.values[40] = mark;
    if (declared) made.more = [mark](GDALDatasetH d) { GDALSetRasterNoDataValue(GDALGetRasterBand(d, 1), mark); };
    return import_dem({make_raster(folder.path() / "nodata.tif", "GTiff", made)});
  };
  for (const double mark : {-9999.0, -32768.0, 0.0, 12.5}) {
    const DemGrid grid = with(mark, mark == 12.5 ? GDT_Float32 : GDT_Int16, true);
    EXPECT_EQ(grid.nodata, 2u) << mark;
    EXPECT_TRUE(contains(notes_of(grid), "2 cells hold the nodata value")) << notes_of(grid);
  }
  EXPECT_EQ(with(-3.4028234663852886e38, GDT_Float32, true).nodata, 2u);
  for (const double mark : {-9999.0, -32768.0, -3.4028234663852886e38, std::nan("")}) {
    const DemGrid grid = with(mark, GDT_Float32, false);
    EXPECT_EQ(grid.nodata, 2u) << mark;
    EXPECT_TRUE(std::isnan(post(grid, 3, 16)));
    EXPECT_TRUE(contains(notes_of(grid), "not")) << notes_of(grid);
  }
  EXPECT_TRUE(contains(refusal([&] { with(123456, GDT_Float32, false); }), "column 4, row 1"));
}

TEST(Traps, NodataByItsPolicy) {
  const TestFolder folder;
  MadeRaster made = sample_raster();
  for (int r = 5; r < 9; ++r)
    for (int c = 8; c < 14; ++c) made.values[static_cast<std::size_t>(23 * r + c)] = -9999;
  const fs::path file = make_raster(folder.path() / "hole.tif", "GTiff", made);
  DemOptions options;
  EXPECT_EQ(import_dem({file}, options).nodata, 24u);
  options.holes = HolePolicy::kError;
  EXPECT_TRUE(contains(refusal([&] { import_dem({file}, options); }), "24 cells have no height"));
  options.holes = HolePolicy::kFill;
  const DemGrid filled = import_dem({file}, options);
  EXPECT_EQ(filled.nodata, 0u);
  EXPECT_TRUE(contains(notes_of(filled), "24 posts without a height")) << notes_of(filled);
  for (int r = 5; r < 9; ++r)
    for (int c = 8; c < 14; ++c) EXPECT_NEAR(post(filled, c, 16 - r), 100.5 + 3 * c - 2 * r, 1) << "the plane under the bumps of 1 m";
}

TEST(Traps, ARotatedGridIsResampledWhereItLies) {
  const TestFolder folder;
  // A plane is what bilinear sampling keeps exactly: heights are a function of the place.
  MadeRaster made = sample_raster(40, 30);
  const double a = 0.3, cell = 10;
  made.transform = {500000, cell * std::cos(a), cell * std::sin(a), 4000000, cell * std::sin(a), -cell * std::cos(a)};
  const auto height = [](double x, double y) { return 100 + 0.2 * (x - 500000) - 0.1 * (y - 4000000); };
  made.type = GDT_Float64;
  for (int r = 0; r < 30; ++r)
    for (int c = 0; c < 40; ++c) {
      const auto& t = made.transform;
      made.values[static_cast<std::size_t>(40 * r + c)] = height(t[0] + (c + 0.5) * t[1] + (r + 0.5) * t[2], t[3] + (c + 0.5) * t[4] + (r + 0.5) * t[5]);
    }
  const DemGrid grid = import_dem({make_raster(folder.path() / "rotated.tif", "GTiff", made)});
  EXPECT_TRUE(contains(notes_of(grid), "resampled")) << notes_of(grid);
  int heights = 0;
  for (int j = 0; j < grid.ny; ++j)
    for (int i = 0; i < grid.nx; ++i) {
      if (std::isnan(post(grid, i, j))) continue;
      ++heights;
      ASSERT_NEAR(post(grid, i, j), height(grid.corner.x() + i * grid.spacing.x(), grid.corner.y() + j * grid.spacing.y()), 1e-6);
    }
  EXPECT_NEAR(heights, 39 * 29, 80) << "as many posts as it had cells, less its rim";
}

TEST(Traps, AnOriginFarAwayIsSubtractedInDouble) {
  const TestFolder folder;
  MadeRaster made = sample_raster();
  made.crs = "EPSG:27200";
  made.transform = {2667400.125, 0.5, 0, 6479491.5, 0, -0.5};
  made.type = GDT_Float64;
  for (double& z : made.values) z += 0.001;
  const TerrainImport import = import_terrain(make_raster(folder.path() / "far.tif", "GTiff", made));
  const geometry::HeightField& field = *import.terrain.height_field();
  EXPECT_EQ(import.terrain.georeference().origin, Vec3(2667400, 6479483, 0));
  EXPECT_EQ(field.corner(), Vec2(0.375, 0.25)) << "exact: these are binary fractions";
  EXPECT_EQ(field.post(0, 0), sample_height(0, 16) + 0.001);
  EXPECT_TRUE(contains(import.terrain.georeference().crs, "27200"));
}

TEST(Crop, KeepsThePostsInsideAndNothingElse) {
  const TestFolder folder;
  const fs::path file = make_raster(folder.path() / "a.tif", "GTiff", sample_raster());
  const DemGrid all = import_dem({file});
  DemOptions options;
  options.crop = {500035, 3999885, 500095, 3999965};  // on posts: they belong to it
  const DemGrid part = import_dem({file}, options);
  EXPECT_EQ(part.nx, 7);
  EXPECT_EQ(part.ny, 9);
  EXPECT_EQ(part.corner, Vec2(500035, 3999885));
  for (int j = 0; j < part.ny; ++j)
    for (int i = 0; i < part.nx; ++i) EXPECT_EQ(post(part, i, j), post(all, i + 3, j + 5));
  options.crop = {0, 0, 10, 10};
  EXPECT_TRUE(contains(refusal([&] { import_dem({file}, options); }), "it covers x 500005 to 500225"));
  options.crop = {500036, 3999886, 500044, 3999999};
  EXPECT_TRUE(contains(refusal([&] { import_dem({file}, options); }), "fewer than 2 x 2"));
  options.crop = {5, 4, 3, 2};
  EXPECT_TRUE(contains(refusal([&] { import_dem({file}, options); }), "west < east"));
  options.crop = {400000, 3999885, 500095, 3999965};
  EXPECT_TRUE(contains(notes_of(import_dem({file}, options)), "reaches beyond"));
}

TEST(Resample, CoarserPostsAreMeansAndFinerOnesLieOnTheSurface) {
  const TestFolder folder;
  MadeRaster made = sample_raster(40, 40);
  for (int r = 0; r < 40; ++r)
    for (int c = 0; c < 40; ++c) made.values[static_cast<std::size_t>(40 * r + c)] = 100 + 3 * c - 2 * r + (c % 2 ? 1 : -1);
  const fs::path file = make_raster(folder.path() / "a.tif", "GTiff", made);
  DemOptions options;
  options.spacing = 40;
  const DemGrid coarse = import_dem({file}, options);
  EXPECT_NEAR(coarse.corner.x() - 500005, 40 * std::round((coarse.corner.x() - 500005) / 40), 1e-9) << "on every fourth post of the file";
  for (int j = 1; j + 1 < coarse.ny; ++j)
    for (int i = 1; i + 1 < coarse.nx; ++i) {
      const double c = (coarse.corner.x() + 40 * i - 500005) / 10, r = (3999995 - coarse.corner.y() - 40 * j) / 10;
      EXPECT_NEAR(post(coarse, i, j), 100 + 3 * c - 2 * r, 0.01) << "the comb of +-1 m is averaged out";
    }
  options.resampling = Resampling::kNearest;
  EXPECT_NEAR(std::abs(post(import_dem({file}, options), 3, 3) - post(coarse, 3, 3)), 1, 0.01) << "and here it is not";
  options.resampling = Resampling::kAuto;
  options.spacing = 5;
  const DemGrid fine = import_dem({file}, options);
  EXPECT_EQ(fine.nx, 79);
  EXPECT_NEAR(post(fine, 1, 0), (post(fine, 0, 0) + post(fine, 2, 0)) / 2, 1e-9);
  options.max_posts = 1000;
  EXPECT_TRUE(contains(refusal([&] { import_dem({file}, options); }), "max_posts"));
}

}  // namespace
}  // namespace effuse::importers
