#include "skin/write/write_volume.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <limits>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "skin/surface/level_set.h"

namespace effuse::skin {
namespace {

namespace fs = std::filesystem;

geometry::GridVolume volume() {
  geometry::GridVolume v;
  v.name = "smoke";
  v.n = {4, 5, 6};
  v.cell = 0.5;
  v.corner = Vec3(10, 20, 30);
  v.density.assign(120, 0);
  v.density[v.index(1, 2, 3)] = 2;
  v.density[v.index(3, 4, 5)] = 1;
  v.temperature.assign(120, 300);
  v.velocity.assign(360, 1);
  return v;
}

class VolumeFile : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path folder_ = fs::temp_directory_path() / ("effuse_volume_" + std::to_string(::getpid()));
};

TEST_F(VolumeFile, HoldsItsGridsWhereTheyAreAndOnlyWhatIsThere) {
  const fs::path file = folder_ / "smoke.vdb";
  write_volume_vdb(file, volume(), {{"crs", "EPSG:1"}});
  const std::vector<std::string> lines = describe_vdb(file);
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_TRUE(lines[0].starts_with("density: ")) << lines[0];
  EXPECT_NE(lines[0].find("2 active voxels"), std::string::npos) << lines[0];
  // Middles of cells (1, 2, 3) and (3, 4, 5).
  EXPECT_NE(lines[0].find("bounds (10.75, 21.25, 31.75) to (11.75, 22.25, 32.75)"), std::string::npos) << lines[0];
  EXPECT_TRUE(lines[1].starts_with("temperature: ")) << lines[1];
  EXPECT_TRUE(lines[2].starts_with("velocity: ")) << lines[2];
}

TEST_F(VolumeFile, TheSameVolumeIsTheSameBytesAndNoVolumeAFileToo) {
  write_volume_vdb(folder_ / "a.vdb", volume());
  write_volume_vdb(folder_ / "b.vdb", volume());
  EXPECT_EQ(read_file(folder_ / "a.vdb"), read_file(folder_ / "b.vdb"));
  write_volume_vdb(folder_ / "c.vdb", geometry::GridVolume());
  EXPECT_EQ(describe_vdb(folder_ / "c.vdb").size(), 1u);
}

TEST_F(VolumeFile, WhatIsNoNumberIsRefusedAndNothingIsLeft) {
  geometry::GridVolume v = volume();
  v.density[7] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(write_volume_vdb(folder_ / "bad.vdb", v), InputError);
  EXPECT_TRUE(fs::is_empty(folder_));
}

}  // namespace
}  // namespace effuse::skin
