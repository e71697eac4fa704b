#include "skin/write/write_points.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "importers/points/import_points.h"
#include "tests/importers/points/hand_written.h"
#include "tests/importers/test_files.h"

namespace effuse::skin {
namespace {

namespace fs = std::filesystem;
using geometry::Points;
using importers::contains;
using importers::PointCloud;
using importers::refusal;
using importers::TestFolder;
using importers::hand_written::hex;

/// What every field of Points may hold, for n particles; floats, so that files give it back to the bit.
PointCloud cloud_of(std::size_t n, std::uint64_t first_id = 0) {
  PointCloud cloud;
  for (std::size_t i = 0; i < n; ++i) {
    const auto number = [&](std::uint64_t axis) { return static_cast<Real>(static_cast<float>(100 * random_uniform(1, axis, i))); };
    const auto vector = [&](std::uint64_t axis) { return Vec3(number(axis), -number(axis + 1), number(axis + 2)); };
    cloud.position.push_back(vector(0));
    cloud.radius.push_back(static_cast<Real>(static_cast<float>(number(3) + 1)));
    cloud.velocity.push_back(vector(4));
    cloud.temperature.push_back(number(7));
    cloud.crust.push_back(number(8));
    cloud.age.push_back(number(9));
    cloud.opacity.push_back(number(16));
    cloud.rest.push_back(vector(10));
    cloud.rest2.push_back(vector(13));
    cloud.id.push_back(first_id + 3 * i);
  }
  return cloud;
}

void expect_same(const PointCloud& a, const PointCloud& b, const std::string& what) {
  EXPECT_EQ(a.position, b.position) << what;
  EXPECT_EQ(a.radius, b.radius) << what;
  EXPECT_EQ(a.velocity, b.velocity) << what;
  EXPECT_EQ(a.temperature, b.temperature) << what;
  EXPECT_EQ(a.crust, b.crust) << what;
  EXPECT_EQ(a.age, b.age) << what;
  EXPECT_EQ(a.opacity, b.opacity) << what;
  EXPECT_EQ(a.id, b.id) << what;
  EXPECT_EQ(a.rest, b.rest) << what;
  EXPECT_EQ(a.rest2, b.rest2) << what;
}

void write(const fs::path& file, const Points& points) {
  const std::string ending = file.extension().string();
  if (ending == ".ply") write_points_ply(file, points, {{"scene", "two\nlines"}});
  else if (ending == ".vtk") write_points_vtk(file, points, {{"scene", "two\nlines"}});
  else write_points_bgeo(file, points);
}

TEST(WritePoints, ComeBackToTheBitFromEveryFormatWhateverTheyHold) {
  const TestFolder folder;
  for (const char* name : {"a.ply", "a.vtk", "a.bgeo"}) {
    const fs::path file = folder.path() / name;
    for (const std::size_t n : {0, 1, 1000}) {
      const PointCloud all = cloud_of(n);
      write(file, all.points());
      expect_same(importers::import_points(file), all, name);
      PointCloud bare;
      bare.position = all.position;
      write(file, bare.points());
      expect_same(importers::import_points(file), bare, name);
    }
  }
}

TEST(WritePoints, BytesAreThoseOfTheSpecifications) {
  const TestFolder folder;
  Points p;
  const std::vector<Vec3> x = {{1, 0, 0.5}};
  const std::vector<Real> radius = {0.5}, temperature = {1000};
  const std::vector<Vec3> v = {{1, 0, -2}};
  const std::vector<std::uint64_t> id = {300};
  p.position = x;
  p.radius = radius;
  p.velocity = v;
  p.temperature = temperature;
  p.id = id;

  write(folder.path() / "a.bgeo", p);
  EXPECT_EQ(read_file(folder.path() / "a.bgeo"),
            "Bgeo" + hex("56 00000005 00000001 00000000 00000000 00000000 00000004 00000000 00000000 00000000") + hex("0006") + "pscale" + hex("0001 00000000 00000000") +
                hex("0001") + "v" + hex("0003 00000005 00000000 00000000 00000000") + hex("000b") + "temperature" + hex("0001 00000000 00000000") + hex("0002") + "id" +
                hex("0001 00000001 00000000") + hex("3f800000 00000000 3f000000 3f800000 | 3f000000 | 3f800000 00000000 c0000000 | 447a0000 | 0000012c") + hex("00 ff"));

  write(folder.path() / "a.vtk", p);
  EXPECT_EQ(read_file(folder.path() / "a.vtk"),
            "# vtk DataFile Version 3.0\neffuse particles, metres, seconds, kelvin; scene: two lines\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 1 float\n" +
                hex("3f800000 00000000 3f000000") + "\nCELLS 1 2\n" + hex("00000001 00000000") + "\nCELL_TYPES 1\n" + hex("00000001") +
                "\nPOINT_DATA 1\nFIELD FieldData 4\nradius 1 1 float\n" + hex("3f000000") + "\nvelocity 3 1 float\n" + hex("3f800000 00000000 c0000000") +
                "\ntemperature 1 1 float\n" + hex("447a0000") + "\nid 1 1 unsigned_int\n" + hex("0000012c") + "\n");

  write(folder.path() / "a.ply", p);
  EXPECT_EQ(read_file(folder.path() / "a.ply"),
            "ply\nformat binary_little_endian 1.0\ncomment effuse particles, metres, seconds, kelvin\ncomment scene: two lines\nelement vertex 1\n"
            "property float x\nproperty float y\nproperty float z\nproperty float radius\nproperty float velocity_x\nproperty float velocity_y\nproperty float velocity_z\n"
            "property float temperature\nproperty uint id\nend_header\n" +
                hex("0000803f 00000000 0000003f | 0000003f | 0000803f 00000000 000000c0 | 00007a44 | 2c010000"));
}

TEST(WritePoints, LargeIdsAreKeptOrRefusedNeverWrong) {
  const TestFolder folder;
  const PointCloud large = cloud_of(4, std::uint64_t{1} << 40), huge = cloud_of(4, std::uint64_t{1} << 60);
  write(folder.path() / "a.vtk", large.points());
  EXPECT_EQ(importers::import_points(folder.path() / "a.vtk").id, large.id);
  // PLY's attributes are read in single precision: too coarse for these, which is said.
  write(folder.path() / "a.ply", large.points());
  const PointCloud back = importers::import_points(folder.path() / "a.ply");
  EXPECT_TRUE(back.id.empty());
  EXPECT_TRUE(contains(back.notes.at(0), "ids are left out"));
  EXPECT_TRUE(contains(refusal([&] { write(folder.path() / "a.bgeo", large.points()); }), "id 1099511627785 does not fit: the integers of a BGEO file end at 2147483647"));
  EXPECT_FALSE(fs::exists(folder.path() / "a.bgeo"));
  for (const char* name : {"b.ply", "b.vtk"}) EXPECT_TRUE(contains(refusal([&] { write(folder.path() / name, huge.points()); }), "does not fit")) << name;
}

TEST(WritePoints, WhatCannotBeWrittenIsRefusedAndNoFileLeft) {
  const TestFolder folder;
  for (const char* name : {"a.ply", "a.vtk", "a.bgeo"}) {
    const fs::path file = folder.path() / name;
    PointCloud cloud = cloud_of(3);
    cloud.temperature[2] = std::numeric_limits<Real>::quiet_NaN();
    EXPECT_TRUE(contains(refusal([&] { write(file, cloud.points()); }), "\"temperature\" of particle 2 is not finite")) << name;
    cloud = cloud_of(3);
    cloud.position[0].y() = 1e39;  // finite, no float
    EXPECT_TRUE(contains(refusal([&] { write(file, cloud.points()); }), "\"position\" of particle 0 is not finite in single precision")) << name;
    cloud = cloud_of(3);
    cloud.velocity.pop_back();
    EXPECT_TRUE(contains(refusal([&] { write(file, cloud.points()); }), "\"velocity\" has 2 values for 3 particles")) << name;
    EXPECT_FALSE(fs::exists(file)) << name;
  }
}

TEST(WritePoints, GiveTheSameBytesOnOneAndTwoThreads) {
  const TestFolder folder;
  const PointCloud cloud = cloud_of(5000);
  for (const char* name : {"a.ply", "a.vtk", "a.bgeo"}) {
    write(folder.path() / name, cloud.points());
    const std::string many = read_file(folder.path() / name);
    const ThreadLimit one(1);
    write(folder.path() / name, cloud.points());
    EXPECT_TRUE(read_file(folder.path() / name) == many) << name;
  }
}

}  // namespace
}  // namespace effuse::skin
