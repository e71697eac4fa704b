#include "skin/write/write_vtp.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/parallel.h"
#include "importers/points/import_points.h"
#include "skin/color/lava_color.h"
#include "skin/color/srgb.h"
#include "tests/skin/sample_lava.h"

namespace effuse::skin {
namespace {

namespace fs = std::filesystem;
using geometry::TriMesh;

class WriteVtp : public testing::Test {
 protected:
  WriteVtp() { fs::create_directories(folder_); }
  ~WriteVtp() override { fs::remove_all(folder_); }
  fs::path folder_ = fs::temp_directory_path() / fmt::format("effuse_vtp_{}_{}", ::getpid(), testing::UnitTest::GetInstance()->current_test_info()->name());
};

TriMesh lava(int along = 40) {
  TriMesh mesh = testing_meshes::tube(60, 3, along, 12);
  color_lava(mesh);
  return mesh;
}

/// An uncompressed file's array of that name, found by what its tag says.
template <class T>
std::vector<T> array_of(const std::string& file, const std::string& name) {
  const std::size_t tag = file.find("Name=\"" + name + "\"");
  EXPECT_NE(tag, std::string::npos) << name;
  const std::size_t offset = std::stoul(file.substr(file.find("offset=\"", tag) + 8));
  const std::size_t at = file.find("<AppendedData encoding=\"raw\">") + std::strlen("<AppendedData encoding=\"raw\">\n_") + offset;
  std::uint64_t bytes = 0;
  std::memcpy(&bytes, file.data() + at, 8);
  EXPECT_LE(at + 8 + bytes, file.size());
  std::vector<T> values(bytes / sizeof(T));
  std::memcpy(values.data(), file.data() + at + 8, bytes);
  return values;
}

TEST_F(WriteVtp, HoldsPointsTrianglesNormalsAndEveryAttributeUnderItsName) {
  const TriMesh mesh = lava();
  write_vtp(folder_ / "a.vtp", mesh, 12.5, {{"crs", "a \"b\" <c>"}}, false);
  const std::string file = read_file(folder_ / "a.vtp");
  EXPECT_NE(file.find("NumberOfTuples=\"1\" format=\"ascii\">12.5</DataArray>"), std::string::npos);
  EXPECT_NE(file.find("97 32 34 98 34 32 60 99 62 0"), std::string::npos) << "a string is the codes of its letters";
  const auto points = array_of<float>(file, "Points"), normals = array_of<float>(file, "Normals"), velocity = array_of<float>(file, "velocity"), linear = array_of<float>(file, "color_linear");
  const auto corners = array_of<std::int32_t>(file, "connectivity"), ends = array_of<std::int32_t>(file, "offsets");
  const auto color = array_of<std::uint8_t>(file, "color");
  ASSERT_EQ(points.size(), 3 * mesh.positions.size());
  ASSERT_EQ(corners.size(), 3 * mesh.triangles.size());
  ASSERT_EQ(ends.size(), mesh.triangles.size());
  ASSERT_EQ(color.size(), points.size());
  EXPECT_EQ(array_of<float>(file, "temperature"), mesh.attributes.at("temperature").values);
  EXPECT_EQ(velocity, mesh.attributes.at("velocity").values);
  EXPECT_EQ(linear, mesh.attributes.at("color").values);
  for (std::size_t i = 0; i < points.size(); ++i) {
    ASSERT_EQ(points[i], static_cast<float>(mesh.positions[i / 3][static_cast<Eigen::Index>(i % 3)]));
    ASSERT_NEAR(normals[i], mesh.normals[i / 3][static_cast<Eigen::Index>(i % 3)], 1e-6);
    ASSERT_NEAR(color[i], 255 * srgb_from_linear(linear[i]), 0.501) << "sRGB";
  }
  for (std::size_t t = 0; t < ends.size(); ++t) {
    ASSERT_EQ(ends[t], static_cast<std::int32_t>(3 * t + 3));
    for (std::size_t k = 0; k < 3; ++k) ASSERT_EQ(corners[3 * t + k], static_cast<std::int32_t>(mesh.triangles[t][k]));
  }
}

TEST_F(WriteVtp, CompressedItHoldsTheSameInFewerBytes) {
  const TriMesh mesh = lava(4000);  // several blocks an array
  write_vtp(folder_ / "raw.vtp", mesh, 1, {}, false);
  write_vtp(folder_ / "zip.vtp", mesh, 1);
  EXPECT_LT(fs::file_size(folder_ / "zip.vtp"), 0.8 * static_cast<double>(fs::file_size(folder_ / "raw.vtp")));
  // Read by the importer of other programs' files, which inflates them by itself.
  const importers::PointCloud cloud = importers::import_points(folder_ / "zip.vtp", {false}), raw = importers::import_points(folder_ / "raw.vtp", {false});
  ASSERT_EQ(cloud.size(), mesh.positions.size());
  EXPECT_EQ(cloud.temperature, raw.temperature);
  EXPECT_EQ(cloud.velocity, raw.velocity);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    ASSERT_EQ(cloud.position[i], mesh.positions[i].cast<float>().cast<Real>());
    ASSERT_EQ(cloud.temperature[i], mesh.attributes.at("temperature").values[i]);
  }
}

TEST_F(WriteVtp, VerticesWithoutTrianglesAreParticlesWithACellEach) {
  TriMesh mesh;
  mesh.positions = {Vec3(1, 2, 3), Vec3(4, 5, 6)};
  mesh.attributes["radius"].values = {0.5f, 0.25f};
  write_vtp(folder_ / "p.vtp", mesh, 0, {}, false);
  const std::string file = read_file(folder_ / "p.vtp");
  EXPECT_NE(file.find("NumberOfPoints=\"2\" NumberOfVerts=\"2\""), std::string::npos);
  EXPECT_EQ(array_of<std::int32_t>(file, "connectivity"), (std::vector<std::int32_t>{0, 1}));
  EXPECT_EQ(file.find("Normals"), std::string::npos);
  EXPECT_EQ(importers::import_points(folder_ / "p.vtp").radius, (std::vector<Real>{0.5, 0.25}));
}

TEST_F(WriteVtp, AnEmptyMeshIsAFileAndABrokenOneNone) {
  write_vtp(folder_ / "empty.vtp", TriMesh{}, 0);
  EXPECT_NE(read_file(folder_ / "empty.vtp").find("NumberOfPoints=\"0\""), std::string::npos);
  EXPECT_EQ(importers::import_points(folder_ / "empty.vtp", {false}).size(), 0u);
  TriMesh broken = lava();
  broken.attributes["temperature"].values[7] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(write_vtp(folder_ / "broken.vtp", broken, 0), InputError);
  EXPECT_FALSE(fs::exists(folder_ / "broken.vtp"));
}

TEST_F(WriteVtp, TheSameBytesOnAnyNumberOfThreads) {
  const TriMesh mesh = lava(3000);
  write_vtp(folder_ / "many.vtp", mesh, 1);
  const ThreadLimit one(1);
  write_vtp(folder_ / "one.vtp", mesh, 1);
  EXPECT_TRUE(read_file(folder_ / "many.vtp") == read_file(folder_ / "one.vtp"));
}

TEST_F(WriteVtp, CollectionAndSeriesNameFilesAndTimes) {
  const std::vector<TimedFile> files = {{"a & b.0001.vtp", 0.125}, {"a & b.0002.vtp", 0.25}};
  write_pvd(folder_ / "f.pvd", files);
  write_series(folder_ / "f.vtp.series", files);
  EXPECT_NE(read_file(folder_ / "f.pvd").find("<DataSet timestep=\"0.25\" part=\"0\" file=\"a &amp; b.0002.vtp\"/>"), std::string::npos);
  const auto j = nlohmann::json::parse(read_file(folder_ / "f.vtp.series"));
  EXPECT_EQ(j.at("file-series-version"), "1.0");
  EXPECT_EQ(j.at("files").at(1).at("name"), "a & b.0002.vtp");
  EXPECT_EQ(j.at("files").at(1).at("time"), 0.25);
}

}  // namespace
}  // namespace effuse::skin
