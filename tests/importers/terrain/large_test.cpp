// A raster far larger than what is asked of it.

#include <gtest/gtest.h>

#include <cmath>

#include "importers/terrain/import_dem.h"
#include "tests/importers/cost_of.h"
#include "tests/importers/terrain/made_rasters.h"
#include "tests/importers/test_files.h"

namespace effuse::importers {
namespace {

namespace fs = std::filesystem;

constexpr int kSide = 20000, kPart = 2000;

/// 20,000 x 20,000 floats, 1.6 GB, of which only one tile's worth of blocks is on the disk.
fs::path sparse_raster(const fs::path& folder) {
  GDALAllRegister();
  char** options = nullptr;
  for (const char* option : {"SPARSE_OK=TRUE", "TILED=YES", "BIGTIFF=YES"}) options = CSLAddString(options, option);
  const fs::path file = folder / "sparse.tif";
  GDALDatasetH dataset = GDALCreate(GDALGetDriverByName("GTiff"), file.string().c_str(), kSide, kSide, 1, GDT_Float32, options);
  CSLDestroy(options);
  std::array<double, 6> transform = {300000, 2, 0, 5000000, 0, -2};
  GDALSetGeoTransform(dataset, transform.data());
  GDALSetProjection(dataset, wkt_of("EPSG:32633").c_str());
  std::vector<float> row(kPart);
  for (int r = 0; r < kPart; ++r) {
    for (int c = 0; c < kPart; ++c) row[static_cast<std::size_t>(c)] = static_cast<float>(100 + c % 100 + r % 50);
    EXPECT_EQ(GDALRasterIO(GDALGetRasterBand(dataset, 1), GF_Write, 9000, 9000 + r, kPart, 1, row.data(), kPart, 1, GDT_Float32, 0, 0), CE_None);
  }
  GDALClose(dataset);
  return file;
}

/// Memory of a child that does the work [bytes].
template <class Work>
double memory_of(const Work& work) {
  const Cost cost = cost_of([&] { return work() ? 0 : 1; });
  EXPECT_EQ(cost.exit, 0);
  return cost.grown;
}

TEST(LargeRasterSlow, ACropTakesMemoryForTheCropOnly) {
  if (!kMemoryIsCounted) GTEST_SKIP() << "a sanitizer's shadow is several times what it watches";
  const TestFolder folder;
  const fs::path file = sparse_raster(folder.path());
  EXPECT_LT(fs::file_size(file), 40e6);
  // Kept posts, and posts of another system.
  DemOptions same;
  same.crop = {318001, 4978001, 321999, 4981999};
  const double kept = memory_of([&] {
    const DemGrid grid = import_dem({file}, same);
    return grid.nx == kPart && grid.ny == kPart && grid.z[0] == 100 + 0 + 1999 % 50;
  });
  DemOptions moved = same;
  moved.spacing = 3;
  const double resampled = memory_of([&] { return import_dem({file}, moved).nx == 1333; });
  // The heights of the crop, 32 MB; assimp's overview and GDAL's cache of 64 MB beside them.
  EXPECT_LT(kept, 150e6);
  EXPECT_LT(resampled, 200e6);
  RecordProperty("kept_MB", static_cast<int>(kept / 1e6));
  RecordProperty("resampled_MB", static_cast<int>(resampled / 1e6));
  std::printf("cropped 2,000 x 2,000 of 20,000 x 20,000: %.0f MB kept, %.0f MB resampled\n", kept / 1e6, resampled / 1e6);
}

TEST(LargeRasterSlow, TheWholeOfItIsRefusedBeforeMemoryIsTaken) {
  const TestFolder folder;
  const fs::path file = sparse_raster(folder.path());
  const std::string message = refusal([&] { import_dem({file}); });
  EXPECT_TRUE(contains(message, "400000000 posts")) << message;
  EXPECT_TRUE(contains(message, "crop")) << message;
}

}  // namespace
}  // namespace effuse::importers
