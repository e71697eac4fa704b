#include "importers/terrain/mosaic.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "importers/terrain/import_dem.h"
#include "tests/importers/terrain/made_rasters.h"
#include "tests/importers/test_files.h"

namespace effuse::importers {
namespace {

namespace fs = std::filesystem;

std::string notes_of(const DemGrid& grid) { return fmt::format("{}", fmt::join(grid.notes, "\n")); }

/// A tile of the sample's endless ground, from that column and row on.
fs::path tile(const TestFolder& folder, const std::string& name, int column, int row, int columns, int rows, double lift = 0) {
  MadeRaster made = sample_raster(columns, rows);
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) made.values[static_cast<std::size_t>(columns * r + c)] = sample_height(column + c, row + r) + lift;
  made.transform[0] += 10 * column;
  made.transform[3] -= 10 * row;
  return make_raster(folder.path() / name, "GTiff", made);
}

TEST(Mosaic, TilesSideBySideOrWithASharedEdgeMakeTheWhole) {
  const TestFolder folder;
  const DemGrid whole = import_dem({tile(folder, "whole.tif", 0, 0, 40, 30)});
  const DemGrid beside = import_dem({tile(folder, "d.tif", 20, 15, 20, 15), tile(folder, "a.tif", 0, 0, 20, 15), tile(folder, "b.tif", 20, 0, 20, 15), tile(folder, "c.tif", 0, 15, 20, 15)});
  EXPECT_EQ(beside.z, whole.z);
  EXPECT_EQ(beside.corner, whole.corner);
  EXPECT_FALSE(contains(notes_of(beside), "missing")) << notes_of(beside);
  const DemGrid shared = import_dem({tile(folder, "e.tif", 0, 0, 21, 30), tile(folder, "f.tif", 20, 0, 20, 30)});
  EXPECT_EQ(shared.z, whole.z);
  EXPECT_TRUE(contains(notes_of(shared), "30 cells lie in several files")) << notes_of(shared);
}

TEST(Mosaic, WhereTilesDisagreeTheFirstCountsAndTheStepIsTold) {
  const TestFolder folder;
  const DemGrid grid = import_dem({tile(folder, "a.tif", 0, 0, 21, 15), tile(folder, "b.tif", 18, 0, 20, 15, 0.5)});
  EXPECT_TRUE(contains(notes_of(grid), "45 cells lie in several files: the first one's heights count, others differ by up to 0.5 m")) << notes_of(grid);
  EXPECT_EQ(grid.z[20], static_cast<float>(sample_height(20, 14)));
  EXPECT_EQ(grid.z[21], static_cast<float>(sample_height(21, 14) + 0.5));
}

TEST(Mosaic, AMissingTileIsNamedAndIsAHole) {
  const TestFolder folder;
  const DemGrid grid = import_dem({tile(folder, "a.tif", 0, 0, 20, 15), tile(folder, "b.tif", 20, 0, 20, 15), tile(folder, "c.tif", 0, 15, 20, 15)});
  EXPECT_EQ(grid.nodata, 300u);
  EXPECT_TRUE(contains(notes_of(grid), "a tile is missing: no file covers x 500205 to 500395, y 3999705 to 3999845")) << notes_of(grid);
  DemOptions strict;
  strict.holes = HolePolicy::kError;
  EXPECT_FALSE(refusal([&] { import_dem({folder.path() / "a.tif", folder.path() / "b.tif", folder.path() / "c.tif"}, strict); }).empty());
}

TEST(Mosaic, TilesInDegreesAreJoinedBeforeTheyAreResampled) {
  const TestFolder folder;
  const auto degrees = [&](const std::string& name, int column, int columns) {
    MadeRaster made = sample_raster(columns, 50);
    for (int r = 0; r < 50; ++r)
      for (int c = 0; c < columns; ++c) made.values[static_cast<std::size_t>(columns * r + c)] = sample_height(column + c, r);
    made.crs = "EPSG:4326";
    made.transform = {-84.7 + column / 3600.0, 1 / 3600.0, 0, 10.5, 0, -1 / 3600.0};
    return make_raster(folder.path() / name, "GTiff", made);
  };
  const DemGrid whole = import_dem({degrees("whole.tif", 0, 60)}), tiles = import_dem({degrees("a.tif", 0, 25), degrees("b.tif", 25, 35)});
  ASSERT_EQ(tiles.z.size(), whole.z.size());
  for (std::size_t k = 0; k < whole.z.size(); ++k) {
    ASSERT_EQ(std::isnan(tiles.z[k]), std::isnan(whole.z[k])) << k;
    if (std::isnan(whole.z[k])) continue;
    ASSERT_NEAR(tiles.z[k], whole.z[k], 1e-6) << "no seam";
  }
}

TEST(Mosaic, FilesOfDifferentSpacingAndSystemLieOverOneAnother) {
  const TestFolder folder;
  MadeRaster coarse = sample_raster(40, 40);
  coarse.transform = {499800, 25, 0, 4000200, 0, -25};
  for (double& z : coarse.values) z = 7;
  const DemGrid grid = import_dem({tile(folder, "fine.tif", 0, 0, 20, 15), make_raster(folder.path() / "coarse.tif", "GTiff", coarse)});
  EXPECT_EQ(grid.spacing.x(), 10);
  EXPECT_TRUE(contains(notes_of(grid), "posts lie in several files")) << notes_of(grid);
  const auto at = [&](double x, double y) { return grid.z[static_cast<std::size_t>(std::lround((y - grid.corner.y()) / 10) * grid.nx + std::lround((x - grid.corner.x()) / 10))]; };
  EXPECT_NEAR(at(500055, 3999945), sample_height(5, 5), 1e-4) << "the first file's";
  EXPECT_EQ(at(499905, 3999905), 7);
}

}  // namespace
}  // namespace effuse::importers
