// Every file of the shared terrain folder: what SOURCES.md says of it comes out, or the refusal; and what it costs.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "importers/terrain/import_dem.h"
#include "importers/terrain/import_terrain.h"
#include "importers/terrain/spatial_reference.h"
#include "tests/importers/cost_of.h"
#include "tests/importers/test_files.h"

namespace effuse::importers {
namespace {

struct Expected {
  const char* file;
  int nx, ny;           // 0: resampled, see spacing
  double spacing;       // [m]
  double low, high;     // [m]; of resampled ones those of the file, which lie outside
  double missing;       // share of the posts without height
  int epsg;             // 0: none
  double bytes;         // more it must not take [bytes]: measured and half as much again
  const char* refusal;  // or what it is refused with
};

class SharedTerrain : public testing::TestWithParam<Expected> {};

TEST_P(SharedTerrain, IsWhatItsSourceSays) {
  const std::filesystem::path data = shared_data();
  if (data.empty()) GTEST_SKIP() << "no shared data on this machine (EFFUSE_SHARED_DATA)";
  const Expected& expected = GetParam();
  const std::filesystem::path file = data / "terrain" / expected.file;
  ASSERT_TRUE(std::filesystem::exists(file)) << file;
  if (expected.refusal) {
    EXPECT_TRUE(contains(refusal([&] { import_terrain(file); }), expected.refusal)) << refusal([&] { import_terrain(file); });
  } else {
    const DemGrid grid = import_dem({file});
    const bool resampled = expected.nx == 0;
    if (!resampled) {
      EXPECT_EQ(grid.nx, expected.nx);
      EXPECT_EQ(grid.ny, expected.ny);
    }
    EXPECT_NEAR(grid.spacing.x(), expected.spacing, 1e-6 * expected.spacing + (resampled ? 0.01 * expected.spacing : 0));
    double low = INFINITY, high = -INFINITY;
    for (const double z : grid.z) low = std::fmin(low, z), high = std::fmax(high, z);
    if (resampled) {
      EXPECT_GE(low, expected.low);
      EXPECT_LE(high, expected.high);
      EXPECT_LT(low, expected.low + 10);
      EXPECT_GT(high, expected.high - 15);
    } else {
      EXPECT_NEAR(low, expected.low, 0.005);
      EXPECT_NEAR(high, expected.high, 0.005);
    }
    EXPECT_NEAR(static_cast<double>(grid.nodata) / static_cast<double>(grid.z.size()), expected.missing, 0.01);
    EXPECT_EQ(read_crs(grid.crs, "grid").epsg, expected.epsg);
  }
  // Time and memory of this file alone: read as ground, or refused, in a process of its own.
  const Cost cost = cost_of([&] { return refusal([&] { import_terrain(file); }).empty() ? 0 : 2; });
  EXPECT_EQ(cost.exit, expected.refusal ? 2 : 0);
  EXPECT_LT(cost.seconds, 10);
  if (kMemoryIsCounted) {
    EXPECT_LT(cost.grown, expected.bytes);
  }
  fmt::print("{}: {:.2f} s, {:.1f} MB\n", expected.file, cost.seconds, cost.grown / 1e6);
}

INSTANTIATE_TEST_SUITE_P(All, SharedTerrain,
                         testing::Values(Expected{"maunga-whau.asc", 61, 87, 10, 94, 195, 0, 27200, 25e6, nullptr}, Expected{"arenal.tif", 0, 0, 30.55, 357, 1647, 0, 32616, 25e6, nullptr},
                                         Expected{"avaAlr.tif", 417, 915, 5, 566.13, 2452.32, 0.31, 31287, 40e6, nullptr}, Expected{"avaHit.asc", 526, 446, 4.997678230579, 1455.17, 2604.46, 0.32, 0, 25e6, nullptr},
                                         Expected{"avaKot.asc", 439, 517, 4.997688906601, 1052.15, 2206.97, 0.40, 0, 25e6, nullptr}, Expected{"luxembourg-elev.tif", 0, 0, 745.66, 141, 547, 0.514, 32632, 25e6, nullptr},
                                         Expected{"volcano-vega-datasets.json", 0, 0, 0, 0, 0, 0, 0, 10e6, "no reader"}, Expected{"maunga-whau.prj", 0, 0, 0, 0, 0, 0, 0, 10e6, "maunga-whau.prj"}),
                         [](const auto& tested) {
                           std::string name = tested.param.file;
                           for (char& c : name)
                             if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
                           return name;
                         });

TEST(SharedTerrainTwin, ReadFromTheWestVegasVolcanoIsMaungaWhau) {
  // Its JSON has the western edge as row 0 and south first: the transpose of our grid.
  const std::filesystem::path data = shared_data();
  if (data.empty()) GTEST_SKIP() << "no shared data on this machine (EFFUSE_SHARED_DATA)";
  const DemGrid grid = import_dem({data / "terrain/maunga-whau.asc"});
  std::ifstream in(data / "terrain/volcano-vega-datasets.json");
  std::string text((std::istreambuf_iterator<char>(in)), {});
  std::size_t at = text.find("\"values\"");
  ASSERT_NE(at, std::string::npos);
  at = text.find('[', at);
  std::vector<double> values;
  while (at < text.size() && text[at] != ']') {
    ++at;
    values.push_back(std::strtod(text.c_str() + at, nullptr));
    at = text.find_first_of(",]", at);
  }
  ASSERT_EQ(values.size(), 87u * 61);
  int equal_west = 0, equal_east = 0;
  for (int j = 0; j < 87; ++j)
    for (int i = 0; i < 61; ++i) {
      const double z = grid.z[static_cast<std::size_t>(61 * j + i)];
      equal_west += z == values[static_cast<std::size_t>(87 * i + j)];
      equal_east += z == values[static_cast<std::size_t>(87 * (60 - i) + j)];
    }
  EXPECT_EQ(std::max(equal_west, equal_east), 87 * 61) << equal_west << " from the west, " << equal_east << " from the east";
}

}  // namespace
}  // namespace effuse::importers
