#include "importers/points/import_points.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <functional>

#include "geometry/base/random.h"
#include "importers/points/spacing.h"
#include "tests/importers/points/hand_written.h"
#include "tests/importers/test_files.h"

namespace effuse::importers {
namespace {

std::string gzipped(std::string_view bytes, int window = 15 + 16) {
  z_stream z{};
  EXPECT_EQ(deflateInit2(&z, 6, Z_DEFLATED, window, 8, Z_DEFAULT_STRATEGY), Z_OK);
  std::string out(deflateBound(&z, bytes.size()) + 64, '\0');
  z.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  z.avail_in = static_cast<uInt>(bytes.size());
  z.next_out = reinterpret_cast<Bytef*>(out.data());
  z.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(deflate(&z, Z_FINISH), Z_STREAM_END);
  out.resize(z.total_out);
  deflateEnd(&z);
  return out;
}

std::string refused(const std::string& bytes, const std::string& name) {
  return refusal([&] { parse_points(bytes, name); });
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

class HandWritten : public testing::TestWithParam<hand_written::File> {};

TEST_P(HandWritten, FilesHoldTheFiveParticles) {
  const std::vector<hand_written::Particle> expected = hand_written::particles();
  for (const bool zipped : {false, true}) {
    const PointCloud cloud = parse_points(zipped ? gzipped(GetParam().bytes) : GetParam().bytes, GetParam().name + (zipped ? ".gz" : ""));
    ASSERT_EQ(cloud.size(), expected.size());
    ASSERT_EQ(cloud.radius.size(), expected.size());
    ASSERT_EQ(cloud.velocity.size(), expected.size());
    ASSERT_EQ(cloud.temperature.size(), expected.size());
    ASSERT_EQ(cloud.id.size(), expected.size());
    EXPECT_TRUE(cloud.crust.empty() && cloud.age.empty() && cloud.rest.empty() && cloud.rest2.empty());
    for (std::size_t i = 0; i < expected.size(); ++i) {
      EXPECT_EQ(cloud.position[i], expected[i].position) << i;
      EXPECT_EQ(cloud.velocity[i], expected[i].velocity) << i;
      EXPECT_EQ(cloud.radius[i], expected[i].radius) << i;
      EXPECT_EQ(cloud.temperature[i], expected[i].temperature) << i;
      EXPECT_EQ(cloud.id[i], expected[i].id) << i;
    }
    const geometry::Points points = cloud.points();
    EXPECT_EQ(points.size(), expected.size());
    EXPECT_EQ(points.id.size(), expected.size());
  }
}

TEST_P(HandWritten, FilesCutAnywhereAreReadOrRefusedWithTheirName) {
  const hand_written::File& file = GetParam();
  std::size_t refusals = 0;
  for (std::size_t length = 0; length < file.bytes.size(); ++length) {
    try {
      // Text cut within its last number is text still.
      EXPECT_LE(parse_points(file.bytes.substr(0, length), file.name).size(), 5u);
    } catch (const InputError& error) {
      ++refusals;
      EXPECT_TRUE(contains(error.what(), file.name)) << error.what();
      EXPECT_LT(std::string(error.what()).size(), 400u) << error.what();
    }
  }
  if (!file.name.ends_with(".xyz") && !file.name.ends_with(".csv")) {
    EXPECT_GT(refusals, file.bytes.size() * 9 / 10);
  }
}

/// Whatever bytes change, the file is read or refused.
void flip_bytes(const hand_written::File& file, std::uint64_t seed, std::uint64_t times) {
  std::size_t refusals = 0;
  for (std::uint64_t n = 0; n < times; ++n) {
    std::string bytes = file.bytes;
    for (std::uint64_t k = 0; k < 1 + n % 3; ++k) {
      const std::size_t at = random_bits(seed, 3 * n + k, 0) % bytes.size();
      const std::uint64_t change = random_bits(seed, 3 * n + k, 1);
      bytes[at] = static_cast<char>(n % 2 ? change : static_cast<unsigned char>(bytes[at]) ^ (1u << change % 8));
    }
    try {
      EXPECT_LE(parse_points(bytes, file.name).size(), bytes.size());
    } catch (const InputError& error) {
      ++refusals;
      EXPECT_TRUE(contains(error.what(), file.name)) << error.what();
    } catch (const std::exception& error) {
      ADD_FAILURE() << file.name << " seed " << seed << " case " << n << " throws something else: " << error.what();
    }
  }
  EXPECT_GT(refusals, times / 50) << "the changes are too tame";
}

TEST_P(HandWritten, FilesWithFlippedBytesAreReadOrRefused) { flip_bytes(GetParam(), 5, 1500); }

TEST(HandWrittenSlow, FilesWithFlippedBytesAreReadOrRefused) {
  for (std::uint64_t seed = 6; seed < 16; ++seed)
    for (const hand_written::File& file : hand_written::files()) flip_bytes(file, seed, 5000);
}

INSTANTIATE_TEST_SUITE_P(Formats, HandWritten, testing::ValuesIn(hand_written::files()), [](const auto& param) {
  std::string name = param.param.name;
  std::replace_if(name.begin(), name.end(), [](char c) { return c == '.' || c == '_'; }, 'X');
  return name;
});

TEST(ImportPoints, ReadsVtkXmlZippedInBlocksBothWaysOfCoding) {
  // Two blocks of 32 bytes and one of 28 hold the 60 bytes of 15 floats... as VTK lays them out: count, size, size of the
  // last, zipped sizes, zipped blocks.
  const auto word = [](std::uint32_t v) { return std::string{static_cast<char>(v), static_cast<char>(v >> 8), static_cast<char>(v >> 16), static_cast<char>(v >> 24)}; };
  std::string plain;
  for (const auto& p : hand_written::particles())
    for (const Real x : p.position) {
      const float value = static_cast<float>(x);
      plain.append(reinterpret_cast<const char*>(&value), 4);
    }
  const std::string a = gzipped(plain.substr(0, 32), 15), b = gzipped(plain.substr(32), 15);
  const std::string header = word(2) + word(32) + word(28) + word(static_cast<std::uint32_t>(a.size())) + word(static_cast<std::uint32_t>(b.size()));
  const auto base64 = [](const std::string& bytes) {
    static const std::string kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
      std::uint32_t bits = 0;
      for (std::size_t k = 0; k < 3; ++k) bits = bits << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0);
      for (std::size_t k = 0; k < 4; ++k) out += i + k > bytes.size() ? '=' : kDigits[bits >> (18 - 6 * k) & 63];
    }
    return out;
  };
  const std::string coded = base64(header) + base64(a + b);
  const std::string head = "<VTKFile type=\"PolyData\" byte_order=\"LittleEndian\" compressor=\"vtkZLibDataCompressor\"><PolyData><Piece NumberOfPoints=\"5\"><Points>\n";
  const std::string array = "<DataArray type=\"Float32\" NumberOfComponents=\"3\" ";
  const std::string tail = "</Points></Piece></PolyData>\n";
  const std::string inlined = head + array + "format=\"binary\">\n" + coded + "\n</DataArray>" + tail + "</VTKFile>";
  const std::string appended = head + array + "format=\"appended\" offset=\"0\"/>" + tail + "<AppendedData encoding=\"base64\">\n_" + coded + "\n</AppendedData></VTKFile>";
  const std::string raw = head + array + "format=\"appended\" offset=\"0\"/>" + tail + "<AppendedData encoding=\"raw\">_" + header + a + b + "</AppendedData></VTKFile>";
  for (const std::string& file : {inlined, appended, raw}) {
    const PointCloud cloud = parse_points(file, "a.vtp");
    ASSERT_EQ(cloud.size(), 5u);
    for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(cloud.position[i], hand_written::particles()[i].position);
    // Every byte of the zipped data counts.
    for (std::size_t at = file.size() - 60; at < file.size() - 30; ++at) {
      std::string broken = file;
      broken[at] = static_cast<char>(broken[at] ^ 1);
      try {
        parse_points(broken, "a.vtp");
      } catch (const InputError&) {
      }
    }
  }
  EXPECT_TRUE(contains(refused(replaced(inlined, "ZLib", "LZ4"), "a.vtp"), "'vtkLZ4DataCompressor', which is not read"));
}

TEST(ImportPoints, WhatIsNotUsedIsNamed) {
  const PointCloud cloud = parse_points("x y z density pressure\n0 0 0 1000 5\n1 0 0 1000 6\n", "a.xyz");
  ASSERT_EQ(cloud.notes.size(), 1u);
  EXPECT_EQ(cloud.notes[0], "not used: density, pressure");
  EXPECT_TRUE(cloud.radius.empty());
}

TEST(ImportPoints, ColumnsWithoutNamesAreXyzAndRawFloatsAreToo) {
  const PointCloud text = parse_points("1 2 3 4\n5 6 7 8\n", "a.txt");
  ASSERT_EQ(text.size(), 2u);
  EXPECT_EQ(text.position[1], Vec3(5, 6, 7));
  EXPECT_EQ(text.notes.at(0), "not used: column 4");
  const PointCloud raw = parse_points(hand_written::hex("0000003f 0000803f 000000c0 | 00000000 0000003f 0000803f"), "a.xyz");
  ASSERT_EQ(raw.size(), 2u);
  EXPECT_EQ(raw.position[0], Vec3(0.5, 1, -2));
  EXPECT_EQ(raw.notes.at(0), "read as x y z in little-endian float32");
}

TEST(ImportPoints, AFileWithoutParticlesIsOne) {
  EXPECT_EQ(parse_points("x,y,z,temperature\n", "a.csv").size(), 0u);
  EXPECT_EQ(parse_points("ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n", "a.ply").size(), 0u);
  EXPECT_EQ(parse_points("# vtk DataFile Version 3.0\n\nASCII\nDATASET POLYDATA\nPOINTS 0 float\n", "a.vtk").size(), 0u);
  EXPECT_EQ(parse_points("<VTKFile type=\"PolyData\"><PolyData><Piece NumberOfPoints=\"0\"></Piece></PolyData></VTKFile>", "a.vtp").size(), 0u);
  EXPECT_EQ(parse_points("Bgeo" + hand_written::hex("56 00000005") + std::string(32, '\0'), "a.bgeo").size(), 0u);
}

TEST(ImportPoints, IdsThatCannotBeToldApartAreLeftOutAndSaid) {
  const std::string head = "x y z id\n0 0 0 ";
  EXPECT_EQ(parse_points(head + "9007199254740992\n", "a.xyz").id.at(0), 9007199254740992u);
  for (const char* id : {"1.5", "-1", "1e17"}) {
    const PointCloud cloud = parse_points(head + id + "\n", "a.xyz");
    EXPECT_TRUE(cloud.id.empty()) << id;
    EXPECT_TRUE(contains(cloud.notes.at(0), "ids are left out")) << id;
  }
  // A float has 24 bits.
  const std::string vtk = "# vtk DataFile Version 3.0\n\nASCII\nDATASET POLYDATA\nPOINTS 1 float\n0 0 0\nPOINT_DATA 1\nSCALARS id float\nLOOKUP_TABLE default\n16777217\n";
  EXPECT_TRUE(parse_points(vtk, "a.vtk").id.empty());
  EXPECT_EQ(parse_points(replaced(vtk, "id float", "id int"), "a.vtk").id.at(0), 16777217u);
}

TEST(ImportPoints, WhoHasARadiusNeedNotMindTheFiles) {
  const std::string file = "x y z radius\n0 0 0 1\n1 0 0 0\n";
  EXPECT_TRUE(contains(refused(file, "a.xyz"), "a.xyz: the radius of particle 1 (from 0) is 0, wanted > 0"));
  const PointCloud cloud = parse_points(file, "a.xyz", {.radius = false});
  EXPECT_EQ(cloud.size(), 2u);
  EXPECT_TRUE(cloud.radius.empty());
}

TEST(ImportPoints, BrokenFilesAreRefusedWithPlaceFindingAndWish) {
  using hand_written::hex;
  struct Case {
    std::string bytes, name, says;
  };
  const std::string vtk = hand_written::vtk_ascii(), bgeo = hand_written::bgeo(), vtp = hand_written::vtp_inline();
  const std::vector<Case> cases = {
      {"1 2 3\n4 x 6\n", "a.xyz", "a.xyz:2: found 'x', wanted a number"},
      {"1 2 3\n4 5\n", "a.xyz", "a.xyz:2: found 2 numbers, on the lines before 3"},
      {"8\n", "a.xyz", "a.xyz:1: found '8' on this line, wanted x y z at least"},
      {"x y\n", "a.csv", "a.csv:1: found 'x y', wanted numbers, or the columns' names with x, y and z among them"},
      {"x,y,z\n1,2,3,4\n", "a.csv", "a.csv:2: found 4 numbers, the columns' names are 3"},
      {"1 2 nan\n", "a.xyz", "particle 0 (from 0) is at 1 2 nan, wanted finite numbers"},
      {"x y z v_x v_y v_z\n1 2 3 4 inf 6\n", "a.xyz", "the velocity of particle 0 (from 0) is inf, wanted a finite number"},
      {std::string("\0\1\2", 3), "a.xyz", "neither text nor x y z as float32: its 3 bytes are no multiple of 12"},
      {"1 2 3\n", "a.abc", "not from '.abc'"},
      {"1 2 3\n", "a", "not from one without an ending"},
      {replaced(vtk, "# vtk", "# vkt"), "a.vtk", "a.vtk:1: found '# vkt DataFile Version 5.1', wanted '# vtk DataFile Version ...'"},
      {replaced(vtk, "POLYDATA", "STRUCTURED_POINTS"), "a.vtk", "found a DATASET 'STRUCTURED_POINTS', particles are read from POLYDATA and UNSTRUCTURED_GRID"},
      {replaced(vtk, "POINTS 5 double", "POINTS 5 dobule"), "a.vtk", "a.vtk:8: found 'dobule', wanted a type"},
      {replaced(vtk, "POINTS 5", "POINTS 5000000000"), "a.vtk", "5000000000 particles are too many"},
      {replaced(vtk, "POINTS 5", "POINTS 500000000"), "a.vtk", "500000000 x 3 numbers are promised, the rest of the file has room for"},
      {replaced(vtk, "POINT_DATA 5", "POINT_DATA 6"), "a.vtk", "found data of 6 points, there are 5"},
      {replaced(vtk, "1000 1100", "1000 l100"), "a.vtk", "found 'l100', wanted a number"},
      {replaced(vtk, "1300 1400", "1300"), "a.vtk", "the file ends in the middle of its data: truncated"},
      {replaced(hand_written::vtk_binary(), "CELLS 5 10", "CELLS 5 1000"), "a.vtk", "a.vtk: at byte 152: 1000 x 1 numbers are promised"},
      {"\x7fNSJb", "a.bgeo", "is a .bgeo of Houdini 12 or later (JSON), which is not read; write it as .bhclassic, .ply or .vtk"},
      {replaced(bgeo, hex("56 00000005"), hex("56 00000004")), "a.bgeo", "at byte 5: found version 4, wanted 5"},
      {replaced(bgeo, hex("00000005 00000000"), hex("7f000005 00000000")), "a.bgeo", "are promised"},
      {replaced(bgeo, hex("56 00000005 00000005"), hex("56 00000005 80000005")), "a.bgeo", "found -2147483643 as the number of points"},
      {replaced(bgeo, hex("0003 00000005"), hex("0003 00000002")), "a.bgeo", "at byte 41: point attribute 'v' is of type 2, wanted 0 (float)"},
      {replaced(vtp, "type=\"PolyData\"", "type=\"ImageData\""), "a.vtp", "a.vtp:3: is a VTK file of type 'ImageData', particles are read from PolyData and UnstructuredGrid"},
      {replaced(vtp, "DAAAAAAAAD8", "EAAAAAAAAD8"), "a.vtp", "a.vtp:10: array 'radius' has 16 bytes of data, wanted 12"},
      {replaced(vtp, "DAAAAAAAAD8", "DAAAA.AAAD8"), "a.vtp", "found '.' in the data of array 'radius', wanted base64"},
      {replaced(vtp, "7 8\n 9", "7 8"), "a.vtp", "a.vtp:7: found 2 numbers, wanted 3 x 1"},
      {replaced(vtp, "NumberOfPoints=\"3\"", "NumberOfPoints=\"300000000000\""), "a.vtp", "are promised, there is room for"},
      {gzipped(bgeo).substr(0, 60), "a.bgeo.gz", "the zipped data end too early, after 60 bytes: truncated"},
      {"\x1f\x8bnonsense, this", "a.bgeo", "the zipped data are damaged"},
  };
  for (const Case& c : cases) {
    const std::string says = refused(c.bytes, c.name);
    EXPECT_TRUE(contains(says, c.says)) << "'" << says << "' instead of '" << c.says << "'";
    EXPECT_TRUE(says.starts_with(c.name)) << says;
  }
}

TEST(ImportPoints, ACountIsNotBelievedBeforeTheFileHasRoomForIt) {
  // Two thousand million points in a file of a few hundred bytes: refused, not allocated (the tests run in less memory).
  const std::string big = "2000000000";
  EXPECT_NE(refused("ply\nformat binary_little_endian 1.0\nelement vertex " + big + "\nproperty float x\nproperty float y\nproperty float z\nend_header\n" + std::string(120, '\0'), "a.ply"), "");
  EXPECT_NE(refused("# vtk DataFile Version 3.0\n\nBINARY\nDATASET POLYDATA\nPOINTS " + big + " float\n" + std::string(120, '\0'), "a.vtk"), "");
  EXPECT_NE(refused("Bgeo" + hand_written::hex("56 00000005 7fffffff") + std::string(200, '\0'), "a.bgeo"), "");
  EXPECT_NE(refused("Bgeo" + hand_written::hex("56 00000005 00000000 00000000 00000000 00000000 7fffffff") + std::string(200, '\0'), "a.bgeo"), "");
  EXPECT_NE(refused(replaced(hand_written::vtu_appended(), "NumberOfPoints=\"5\"", "NumberOfPoints=\"" + big + "\""), "a.vtu"), "");
  // Pieces that all point at the same appended data.
  std::string pieces;
  for (int n = 0; n < 1000; ++n)
    pieces += "<Piece NumberOfPoints=\"5\"><Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"appended\" offset=\"0\"/></Points></Piece>\n";
  const std::string shared = "<VTKFile type=\"PolyData\" byte_order=\"BigEndian\"><PolyData>" + pieces + "</PolyData><AppendedData encoding=\"raw\">_" + hand_written::hex("0000003c") +
                             hand_written::positions_big() + "</AppendedData></VTKFile>";
  EXPECT_EQ(parse_points(shared, "a.vtp").size(), 5000u) << "as long as the file is longer than what it promises";
}

TEST(ImportPoints, ReadsFromDiskAndKnowsItsEndings) {
  const TestFolder folder;
  EXPECT_EQ(import_points(folder.write("a.BGEO", hand_written::bgeo())).size(), 5u);
  EXPECT_TRUE(contains(refusal([&] { import_points(folder.path() / "none.vtk"); }), "no such file"));
  EXPECT_TRUE(contains(refusal([&] { import_points(folder.write("empty.vtk", "")); }), "the file is empty"));
  for (const char* name : {"a.vtk", "A.VTP", "a.bgeo.gz", "x.xyz"}) EXPECT_TRUE(has_point_ending(name)) << name;
  for (const char* name : {"a.ply", "a.csv", "a.gz", "vtk"}) EXPECT_FALSE(has_point_ending(name)) << name;
}

TEST(Spacing, OfLatticesAndSheetsIsExactAndOfRandomPlacesAFifthLow) {
  std::vector<Vec3> lattice, sheet, jittered, random;
  for (std::uint64_t n = 0; n < 8000; ++n) {
    const Vec3 at(static_cast<Real>(n % 20), static_cast<Real>(n / 20 % 20), static_cast<Real>(n / 400));
    const auto uniform = [&](std::uint64_t axis) { return random_uniform(1, axis, n); };
    const Vec3 off(uniform(0), uniform(1), uniform(2));
    lattice.push_back(0.25 * at);
    jittered.push_back(0.25 * (at + 0.2 * (2 * off - Vec3::Ones())));
    random.push_back(5 * off);
    if (n < 400) sheet.push_back(0.25 * at);
  }
  EXPECT_NEAR(estimate_spacing(lattice), 0.25, 1e-12);
  EXPECT_NEAR(estimate_spacing(sheet), 0.25, 1e-12);
  EXPECT_NEAR(estimate_spacing(jittered), 0.25, 0.06 * 0.25);
  // Mean distance of the four nearest of random places: 0.778 n^(-1/3), and a little more at the box's faces.
  EXPECT_NEAR(estimate_spacing(random), 0.778 * 0.25, 0.05 * 0.25);
  // Doubles count once, and order does not matter.
  std::vector<Vec3> twice = lattice;
  twice.insert(twice.end(), lattice.rbegin(), lattice.rend());
  EXPECT_NEAR(estimate_spacing(twice), 0.25, 0.01);
  EXPECT_EQ(estimate_spacing(std::vector<Vec3>{}), 0);
  EXPECT_EQ(estimate_spacing(std::vector<Vec3>(5, Vec3(1, 2, 3))), 0);
  EXPECT_EQ(estimate_spacing(std::vector<Vec3>{Vec3(0, 0, 0), Vec3(3, 0, 0)}), 3);
}

}  // namespace
}  // namespace effuse::importers
