// Rasters that are cut short, lie, or are none: one sentence each, in seconds, without the memory they ask for.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "geometry/base/random.h"
#include "importers/terrain/import_dem.h"
#include "importers/terrain/import_terrain.h"
#include "tests/importers/cost_of.h"
#include "tests/importers/terrain/made_rasters.h"
#include "tests/importers/test_files.h"

namespace effuse::importers {
namespace {

namespace fs = std::filesystem;

/// Reads the file as ground in a child of its own; exit 0: refused with an InputError of one line.
Cost cost_of_refusing(const fs::path& file) {
  return cost_of([&] {
    try {
      import_terrain(file);
      return 1;
    } catch (const InputError& error) {
      const std::string what = error.what();
      return what.find('\n') == std::string::npos && what.size() < 600 && what.find(file.filename().string()) != std::string::npos ? 0 : 2;
    } catch (...) {
      return 3;
    }
  });
}

void expect_refused(const fs::path& file) {
  const Cost cost = cost_of_refusing(file);
  EXPECT_EQ(cost.exit, 0) << file << " (1: taken, 2: no single sentence, 3: another exception, 100 and more: a signal): " << refusal([&] { import_terrain(file); });
  EXPECT_LT(cost.seconds, 10) << file;
  if (kMemoryIsCounted) {
    EXPECT_LT(cost.peak, 1.0 * (1 << 30)) << file;
  }
}

std::string bytes_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(in), {});
}

TEST(BrokenRasters, CutShortAnywhereTheyAreRefused) {
  const TestFolder folder;
  MadeRaster made = sample_raster(200, 150);
  for (const auto& [name, options] : {std::pair<const char*, std::vector<std::string>>{"strips.tif", {}}, {"tiles.tif", {"TILED=YES", "COMPRESS=DEFLATE"}}, {"lzw.tif", {"COMPRESS=LZW"}}}) {
    made.options = options;
    const std::string whole = bytes_of(make_raster(folder.path() / name, "GTiff", made));
    for (const double share : {0.0005, 0.01, 0.3, 0.7, 0.99}) expect_refused(folder.write("cut.tif", whole.substr(0, static_cast<std::size_t>(share * static_cast<double>(whole.size())) + 1)));
  }
}

TEST(BrokenRasters, PromisesTakeNoMemory) {
  const TestFolder folder;
  // 200,000 x 200,000 heights in a file of some kilobytes.
  GDALAllRegister();
  char** options = nullptr;
  for (const char* option : {"SPARSE_OK=TRUE", "TILED=YES", "BIGTIFF=YES", "BLOCKXSIZE=2048", "BLOCKYSIZE=2048"}) options = CSLAddString(options, option);
  const fs::path vast = folder.path() / "vast.tif";
  GDALDatasetH dataset = GDALCreate(GDALGetDriverByName("GTiff"), vast.string().c_str(), 200000, 200000, 1, GDT_Float64, options);
  CSLDestroy(options);
  std::array<double, 6> transform = {0, 1, 0, 0, 0, -1};
  GDALSetGeoTransform(dataset, transform.data());
  GDALClose(dataset);
  expect_refused(vast);
  // Raw grids whose header says more than the file holds.
  folder.write("raw.hdr", "nrows 100000\nncols 100000\nxllcorner 0\nyllcorner 0\ncellsize 1\nbyteorder LSBFIRST\n");
  expect_refused(folder.write("raw.flt", "abc"));
  folder.write("short.hdr", "nrows 1000\nncols 1000\nxllcorner 0\nyllcorner 0\ncellsize 1\nbyteorder LSBFIRST\n");
  expect_refused(folder.write("short.flt", std::string(4000, '\0')));
  expect_refused(folder.write("alone.flt", std::string(4000, '\0')));
}

TEST(BrokenRastersSlow, NoiseAndTextUnderEveryEndingAreRefused) {
  const TestFolder folder;
  std::string noise;
  for (std::uint64_t k = 0; k < 4000; ++k) noise += static_cast<char>(random_bits(5, 0, k));
  for (const char* ending : {"tif", "hgt", "dem", "flt", "bil", "img", "nc", "png", "grd", "bt", "ter", "ddf", "dt0", "asc", "xyz"})
    for (const std::string& content : {noise, std::string("<!DOCTYPE html><html>404</html>\n"), std::string(2000, '\0'), std::string("CDF\x01"), std::string("\x89PNG\r\n\x1a\n"), std::string("II*\0\x08\0\0\0\xff\xff", 10)})
      expect_refused(folder.write(std::string("a.") + ending, content));
}

}  // namespace
}  // namespace effuse::importers
