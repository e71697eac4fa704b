#include <fmt/format.h>
#include <gtest/gtest.h>
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <fstream>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "skin/surface/level_set.h"
#include "tests/skin/surface/shapes.h"

namespace effuse::skin {
namespace {

namespace fs = std::filesystem;
using testing_shapes::Cloud;
using testing_shapes::cube;
using testing_shapes::fill;

class Vdb : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() /
              fmt::format("effuse_vdb_test_{}_{}", ::getpid(), testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path folder_;

  static LevelSet ball() {
    const Cloud cloud = fill(cube(4), 1, [](const Vec3& p) { return p.norm() < 3.8; });
    LevelSetOptions options;
    options.spacing = 1;
    return build_level_set(cloud.points(), cloud.volume(), nullptr, options);
  }
};

bool starts_with(const std::vector<std::string>& lines, const std::string& start) {
  for (const std::string& line : lines)
    if (line.rfind(start, 0) == 0) return true;
  return false;
}

TEST_F(Vdb, HoldsTheFourGridsWithTheirClasses) {
  const fs::path file = folder_ / "ball.0001.vdb";
  write_vdb(file, ball(), {{"crs", "EPSG:27200"}, {"origin", "1 2 3"}});
  const std::vector<std::string> lines = describe_vdb(file);
  ASSERT_EQ(lines.size(), 4u);
  EXPECT_TRUE(starts_with(lines, "surface: Level Set, float, voxel 0.5 m, "));
  EXPECT_TRUE(starts_with(lines, "density: Fog Volume, float, voxel 0.5 m, "));
  EXPECT_TRUE(starts_with(lines, "temperature: Fog Volume, float, voxel 0.5 m, "));
  EXPECT_TRUE(starts_with(lines, "velocity: "));
  // Nothing else is left in the folder.
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
}

TEST_F(Vdb, ValuesReadBackAreDistancesTemperaturesAndVelocities) {
  // A ball of radius 8 (16 voxels), far enough from the origin that single precision would show.
  const Vec3 centre(400000, 5900000, 300);
  const Cloud ball_at_home = fill(
      cube(9), 1, [](const Vec3& p) { return p.norm() < 7.6; }, 0.05);
  Cloud cloud;
  for (const Vec3& p : ball_at_home.x) {
    cloud.add(p + centre, 1);
    cloud.temperature.back() = 1200 + 10 * p.x();
    cloud.velocity.back() = Vec3(1, p.y(), -2);
  }
  LevelSetOptions options;
  options.spacing = 1;
  const fs::path file = folder_ / "ball.vdb";
  write_vdb(file, build_level_set(cloud.points(), 4.0 / 3 * kPi * 512, nullptr, options), {{"crs", "EPSG:27200"}});

  openvdb::initialize();
  openvdb::io::File in(file.string());
  in.open(false);
  EXPECT_EQ(in.getMetadata()->metaValue<std::string>("crs"), "EPSG:27200");
  const auto scalar = [&](const char* name) { return openvdb::gridPtrCast<openvdb::FloatGrid>(in.readGrid(name)); };
  const auto surface = scalar("surface"), density = scalar("density"), temperature = scalar("temperature");
  const auto velocity = openvdb::gridPtrCast<openvdb::Vec3SGrid>(in.readGrid("velocity"));
  const auto local = [&](const openvdb::Coord& c) {
    const openvdb::Vec3d w = surface->indexToWorld(c);
    return Vec3(w.x() - centre.x(), w.y() - centre.y(), w.z() - centre.z());
  };

  EXPECT_EQ(surface->background(), 1.5f);
  double worst = 0, squares = 0, n = 0;
  for (auto v = surface->cbeginValueOn(); v; ++v, ++n) {
    ASSERT_TRUE(v.isVoxelValue());
    const double error = *v - (local(v.getCoord()).norm() - 8);
    worst = std::max(worst, std::abs(error));
    squares += error * error;
  }
  EXPECT_GT(n, 4 * kPi * 32 * 32 * 0.6);  // six voxels deep, radius 16: 19000
  EXPECT_LT(worst, 0.6);                  // half a spacing: the particles' lattice is that rough
  EXPECT_LT(std::sqrt(squares / n), 0.2);
  // Deep inside and far outside: no voxel, the right sign.
  const openvdb::Coord middle = surface->transform().worldToIndexCellCentered(openvdb::Vec3d(centre.x(), centre.y(), centre.z()));
  EXPECT_EQ(surface->tree().getValue(middle), -1.5f);
  EXPECT_FALSE(surface->tree().isValueOn(middle));
  EXPECT_EQ(surface->tree().getValue(middle.offsetBy(200)), 1.5f);

  EXPECT_EQ(density->tree().getValue(middle), 1);
  double volume = 0;
  for (auto v = density->cbeginValueOn(); v; ++v) volume += static_cast<double>(*v) * static_cast<double>(v.getVoxelCount()) / 8;
  EXPECT_NEAR(volume / (4.0 / 3 * kPi * 512), 1, 0.02);

  // Linear fields come back as they were, up to half floats and, at the rim, the averages' shift inwards.
  for (auto v = temperature->cbeginValueOn(); v; ++v) {
    const Vec3 p = local(v.getCoord());
    const double shift = p.norm() < 5.5 ? 0.1 : 2.0;
    ASSERT_NEAR(*v, 1200 + 10 * p.x(), 10 * shift + 1) << p.transpose();
    ASSERT_NEAR(velocity->tree().getValue(v.getCoord()).y(), p.y(), shift + 0.01);
    ASSERT_NEAR(velocity->tree().getValue(v.getCoord()).z(), -2, 1e-3);
  }
}

TEST_F(Vdb, OfAnEmptyLevelSetIsValid) {
  const fs::path file = folder_ / "empty.vdb";
  write_vdb(file, LevelSet{}, {});
  const std::vector<std::string> lines = describe_vdb(file);
  EXPECT_EQ(lines.size(), 4u);
  EXPECT_TRUE(starts_with(lines, "surface: Level Set, float, voxel 1 m, 0 active voxels"));
}

TEST_F(Vdb, IsReadByOpenVdbsOwnPrinter) {
  if (std::system("command -v vdb_print > /dev/null 2>&1") != 0) GTEST_SKIP() << "vdb_print (package libopenvdb-tools) is not installed";
  const fs::path file = folder_ / "ball.vdb";
  write_vdb(file, ball(), {{"crs", "EPSG:27200"}});
  // It exits 0 on errors: its words count.
  std::FILE* pipe = ::popen(fmt::format("vdb_print -m '{}' 2>&1", file.string()).c_str(), "r");
  ASSERT_NE(pipe, nullptr);
  std::string words;
  std::array<char, 4096> buffer;
  while (const std::size_t got = std::fread(buffer.data(), 1, buffer.size(), pipe)) words.append(buffer.data(), got);
  ::pclose(pipe);
  for (const char* wanted : {"surface", "density", "temperature", "velocity", "level set", "fog volume", "EPSG:27200"})
    EXPECT_NE(words.find(wanted), std::string::npos) << wanted << " is not in:\n" << words;
}

TEST_F(Vdb, WhenTheDiskIsFullThereIsAnErrorAndNoFile) {
  const fs::path file = folder_ / "full.vdb";
  const LevelSet surface = ball();
  // A limit on the size of files stands in for the end of the disk; the signal it comes with must not end the test.
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  for (const rlim_t limit : {rlim_t{0}, rlim_t{1000}, rlim_t{20000}}) {
    rlimit small = before;
    small.rlim_cur = limit;
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
    EXPECT_THROW(write_vdb(file, surface, {}), ResourceError) << limit;
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
    EXPECT_TRUE(fs::is_empty(folder_)) << limit;
  }
  std::signal(SIGXFSZ, handler);
  write_vdb(file, surface, {});
  EXPECT_GT(fs::file_size(file), 20000u) << "the limits above would not have been met";
}

TEST_F(Vdb, BrokenFilesAreErrorsOfOneShortSentence) {
  const fs::path file = folder_ / "ball.vdb", broken = folder_ / "broken.vdb";
  write_vdb(file, ball(), {});
  const std::string bytes = read_file(file);
  // Cut anywhere: never read as whole.
  for (std::size_t k = 0; k < 60; ++k) {
    const std::size_t size = k < 20 ? k : bytes.size() * k / 60;
    std::ofstream(broken, std::ios::binary) << bytes.substr(0, size);
    try {
      describe_vdb(broken);
      ADD_FAILURE() << "read " << size << " of " << bytes.size() << " bytes as if whole";
    } catch (const InputError& e) {
      EXPECT_LT(std::string(e.what()).size(), 500u);
      EXPECT_NE(std::string(e.what()).find("broken.vdb"), std::string::npos);
    }
  }
  EXPECT_THROW(describe_vdb(folder_ / "absent.vdb"), InputError);
  EXPECT_THROW(describe_vdb(folder_), InputError);
  std::ofstream(broken, std::ios::binary) << "ply\nformat ascii 1.0\n";
  EXPECT_THROW(describe_vdb(broken), InputError);
}

}  // namespace
}  // namespace effuse::skin
