#include "skin/write/write_mesh.h"

#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <assimp/Importer.hpp>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/parallel.h"
#include "skin/color/lava_color.h"
#include "skin/color/srgb.h"
#include "skin/write/emission_ramp.h"
#include "skin/write/png.h"
#include "tests/skin/sample_lava.h"

namespace effuse::skin {
namespace {

namespace fs = std::filesystem;
using geometry::TriMesh;
using testing_meshes::tube;

/// An own empty folder per test, gone afterwards.
class WriteMesh : public testing::Test {
 protected:
  void SetUp() override {
    const testing::TestInfo* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::temp_directory_path() / ("effuse_" + std::to_string(::getpid()) + "_" + info->test_suite_name() + "_" + info->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path folder_;
};

TriMesh lava(int along = 40, int around = 12) {
  TriMesh mesh = tube(60, 3, along, around);
  color_lava(mesh);
  return mesh;
}

/// PLY as the format says it, read by nobody's library: properties in order, then rows.
struct Ply {
  std::vector<std::string> lines;                               // of the header
  std::vector<std::pair<std::string, std::string>> properties;  // type, name
  std::size_t vertices = 0, faces = 0;
  std::vector<std::map<std::string, double>> rows;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

Ply parse_ply(const std::string& bytes) {
  Ply ply;
  const std::size_t end = bytes.find("end_header\n");
  EXPECT_NE(end, std::string::npos);
  std::istringstream header(bytes.substr(0, end));
  for (std::string line; std::getline(header, line);) {
    ply.lines.push_back(line);
    std::istringstream words(line);
    std::string a, b, c;
    words >> a >> b >> c;
    if (a == "element" && b == "vertex") ply.vertices = std::stoul(c);
    if (a == "element" && b == "face") ply.faces = std::stoul(c);
    if (a == "property" && b != "list") ply.properties.emplace_back(b, c);
  }
  const char* at = bytes.data() + end + std::strlen("end_header\n");
  const char* stop = bytes.data() + bytes.size();
  for (std::size_t i = 0; i < ply.vertices; ++i) {
    auto& row = ply.rows.emplace_back();
    for (const auto& [type, name] : ply.properties) {
      if (type == "uchar") {
        row[name] = static_cast<unsigned char>(*at++);
      } else {
        float x;
        std::memcpy(&x, at, 4);
        row[name] = x;
        at += 4;
      }
    }
  }
  for (std::size_t i = 0; i < ply.faces; ++i) {
    EXPECT_EQ(*at++, 3);
    auto& t = ply.triangles.emplace_back();
    std::memcpy(t.data(), at, 12);
    at += 12;
  }
  EXPECT_EQ(at, stop) << "nothing missing, nothing left over";
  return ply;
}

TEST_F(WriteMesh, PlyHoldsEveryVertexAttributeAndTriangleUnderItsName) {
  const TriMesh mesh = lava();
  write_ply(folder_ / "skin.0001.ply", mesh, {{"crs", "EPSG:27200"}, {"note", "two\nlines"}});
  const Ply ply = parse_ply(read_file(folder_ / "skin.0001.ply"));

  std::vector<std::string> names;
  for (const auto& [type, name] : ply.properties) names.push_back(name);
  EXPECT_EQ(names, (std::vector<std::string>{"x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", "crust", "detail", "glow_x", "glow_y",
                                             "glow_z", "temperature", "velocity_x", "velocity_y", "velocity_z"}));
  EXPECT_NE(std::find(ply.lines.begin(), ply.lines.end(), "comment crs: EPSG:27200"), ply.lines.end());
  EXPECT_NE(std::find(ply.lines.begin(), ply.lines.end(), "comment note: two lines"), ply.lines.end());
  EXPECT_NE(std::find(ply.lines.begin(), ply.lines.end(), "property list uchar uint vertex_indices"), ply.lines.end());

  ASSERT_EQ(ply.vertices, mesh.positions.size());
  ASSERT_EQ(ply.faces, mesh.triangles.size());
  for (std::size_t i = 0; i < ply.vertices; ++i) {
    const auto& row = ply.rows[i];
    EXPECT_EQ(row.at("x"), static_cast<float>(mesh.positions[i].x()));
    EXPECT_EQ(row.at("z"), static_cast<float>(mesh.positions[i].z()));
    EXPECT_NEAR(row.at("nz"), mesh.normals[i].z(), 1e-7);
    EXPECT_EQ(row.at("temperature"), mesh.attributes.at("temperature").values[i]);
    EXPECT_EQ(row.at("velocity_y"), mesh.attributes.at("velocity").values[3 * i + 1]);
    EXPECT_NEAR(row.at("green"), 255 * srgb_from_linear(mesh.attributes.at("color").values[3 * i + 1]), 0.501) << "sRGB, not linear";
  }
  for (std::size_t i = 0; i < ply.faces; ++i) EXPECT_EQ(ply.triangles[i], mesh.triangles[i]);
}

/// What assimp reads, one mesh, corners shared or not.
const aiMesh* load(Assimp::Importer& importer, const fs::path& file) {
  const aiScene* scene = importer.ReadFile(file.string(), aiProcess_ValidateDataStructure);
  EXPECT_NE(scene, nullptr) << importer.GetErrorString();
  if (!scene) return nullptr;
  EXPECT_EQ(scene->mNumMeshes, 1u);
  return scene->mMeshes[0];
}

/// Corner by corner, so that it does not matter whether the reader shares vertices.
void expect_same(const aiMesh* read, const TriMesh& mesh, bool y_up, bool srgb, double position_tolerance) {
  ASSERT_NE(read, nullptr);
  ASSERT_EQ(read->mNumFaces, mesh.triangles.size());
  ASSERT_TRUE(read->HasNormals());
  ASSERT_TRUE(read->HasVertexColors(0));
  const auto vector = [&](const aiVector3D& v) { return y_up ? Vec3(v.x, -v.z, v.y) : Vec3(v.x, v.y, v.z); };
  const auto& color = mesh.attributes.at("color").values;
  double worst_position = 0, worst_normal = 0, worst_color = 0;
  for (unsigned f = 0; f < read->mNumFaces; ++f) {
    ASSERT_EQ(read->mFaces[f].mNumIndices, 3u);
    for (unsigned c = 0; c < 3; ++c) {
      const unsigned i = read->mFaces[f].mIndices[c];
      const Index j = mesh.triangles[f][c];
      worst_position = std::max(worst_position, (vector(read->mVertices[i]) - mesh.positions[j]).cwiseAbs().maxCoeff());
      worst_normal = std::max(worst_normal, (vector(read->mNormals[i]) - mesh.normals[j]).cwiseAbs().maxCoeff());
      const aiColor4D& rgba = read->mColors[0][i];
      for (unsigned k = 0; k < 3; ++k) {
        const double linear = color[3 * j + k];
        worst_color = std::max(worst_color, std::abs(rgba[k] - (srgb ? srgb_from_linear(linear) : linear)));
      }
      EXPECT_EQ(rgba.a, 1.0f);
    }
  }
  EXPECT_LT(worst_position, position_tolerance);
  EXPECT_LT(worst_normal, 1e-5);
  EXPECT_LT(worst_color, srgb ? 0.5 / 255 + 1e-4 : 1e-5);
}

TEST_F(WriteMesh, AssimpReadsTheSamePlyBack) {
  const TriMesh mesh = lava();
  write_ply(folder_ / "a.ply", mesh);
  Assimp::Importer importer;
  expect_same(load(importer, folder_ / "a.ply"), mesh, false, true, 1e-5);
}

TEST_F(WriteMesh, AssimpReadsTheSameObjBack) {
  const TriMesh mesh = lava();
  write_obj(folder_ / "a.obj", mesh, {{"crs", "EPSG:27200"}});
  Assimp::Importer importer;
  expect_same(load(importer, folder_ / "a.obj"), mesh, false, true, 1e-5);
}

TEST_F(WriteMesh, AssimpReadsTheSameGlbBackTurnedYUp) {
  const TriMesh mesh = lava();
  write_glb(folder_ / "a.glb", mesh, {{"crs", "EPSG:27200"}});
  Assimp::Importer importer;
  expect_same(load(importer, folder_ / "a.glb"), mesh, true, false, 1e-5);
}

TEST_F(WriteMesh, ObjKeepsNineDigitsOfTheLargestCoordinate) {
  TriMesh mesh = lava(4, 5);
  for (Vec3& p : mesh.positions) p += Vec3(123456.123456789, -0.000000123, 7);
  write_obj(folder_ / "a.obj", mesh);
  std::istringstream text(read_file(folder_ / "a.obj"));
  std::size_t i = 0;
  for (std::string line; std::getline(text, line);) {
    if (line.rfind("v ", 0) != 0) continue;
    std::istringstream words(line.substr(2));
    Vec3 p;
    words >> p.x() >> p.y() >> p.z();
    EXPECT_LE((p - mesh.positions[i]).cwiseAbs().maxCoeff(), 0.5e-3 + 1e-9) << line;  // 123456.123: three decimals
    ++i;
  }
  EXPECT_EQ(i, mesh.positions.size());
}

TEST_F(WriteMesh, ObjTakesTimeInProportionToItsVertices) {
  const auto seconds = [&](const TriMesh& mesh) {
    double best = 1e9;
    for (int k = 0; k < 3; ++k) {
      const auto start = std::chrono::steady_clock::now();
      write_obj(folder_ / "a.obj", mesh);
      best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
    }
    return best;
  };
  const double few = seconds(lava(100, 100)), many = seconds(lava(1000, 100));
  std::cout << "100 k vertices, 200 k triangles, " << fs::file_size(folder_ / "a.obj") / 1000000 << " MB: " << many << " s\n";
  EXPECT_LT(many, 40 * few) << "ten times as many vertices: a quadratic writer would take a hundred times as long";
}

/// The two chunks of a GLB.
struct Glb {
  nlohmann::json json;
  std::string bin;
};
Glb parse_glb(const std::string& bytes) {
  const auto u32 = [&](std::size_t at) {
    std::uint32_t x;
    std::memcpy(&x, bytes.data() + at, 4);
    return x;
  };
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(u32(4), 2u);
  EXPECT_EQ(u32(8), bytes.size());
  EXPECT_EQ(bytes.size() % 4, 0u);
  const std::size_t text = u32(12);
  EXPECT_EQ(text % 4, 0u);
  Glb glb{nlohmann::json::parse(bytes.substr(20, text)), {}};
  if (bytes.size() > 20 + text) glb.bin = bytes.substr(20 + text + 8);
  return glb;
}

TEST_F(WriteMesh, GlbCarriesTemperatureVelocityAndExtrasAndAGlowThatTheRampGivesBack) {
  const TriMesh mesh = lava();
  write_glb(folder_ / "a.glb", mesh, {{"crs", "EPSG:27200"}, {"origin", "2667400 6478700 0"}});
  const Glb glb = parse_glb(read_file(folder_ / "a.glb"));
  const auto& json = glb.json;
  EXPECT_EQ(json["asset"]["extras"]["crs"], "EPSG:27200");
  const auto& attributes = json["meshes"][0]["primitives"][0]["attributes"];
  for (const char* name : {"POSITION", "NORMAL", "COLOR_0", "TEXCOORD_0", "_TEMPERATURE", "_VELOCITY", "_CRUST"})
    EXPECT_TRUE(attributes.contains(name)) << name;
  EXPECT_EQ(json["extensionsUsed"], nlohmann::json::array({"KHR_materials_emissive_strength"}));

  const auto floats = [&](const char* name, std::size_t width) {
    const auto& accessor = json["accessors"][attributes[name].get<std::size_t>()];
    const auto& view = json["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    EXPECT_EQ(view["byteOffset"].get<std::size_t>() % 4, 0u);
    std::vector<float> values(width * accessor["count"].get<std::size_t>());
    std::memcpy(values.data(), glb.bin.data() + view["byteOffset"].get<std::size_t>(), values.size() * sizeof(float));
    return values;
  };
  EXPECT_EQ(floats("_TEMPERATURE", 1), mesh.attributes.at("temperature").values);
  const auto velocity = floats("_VELOCITY", 3);
  EXPECT_EQ(velocity[1], mesh.attributes.at("velocity").values[2]) << "up is y";
  EXPECT_EQ(velocity[2], -mesh.attributes.at("velocity").values[1]);

  // Emission as a viewer computes it: filtered texel, sRGB decoded, times the strength.
  const auto& material = json["materials"][0];
  const double strength = material["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"];
  const auto& picture = json["bufferViews"][json["images"][0]["bufferView"].get<std::size_t>()];
  const Rgb8Image ramp = decode_png(
      std::string_view(glb.bin).substr(picture["byteOffset"].get<std::size_t>(), picture["byteLength"].get<std::size_t>()), "ramp");
  ASSERT_EQ(ramp.width, 256);
  const auto uv = floats("TEXCOORD_0", 2);
  const auto& glow = mesh.attributes.at("glow").values;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const double at = uv[2 * i] * 256 - 0.5;
    const std::size_t k = std::min<std::size_t>(static_cast<std::size_t>(std::max(at, 0.0)), 254);
    for (std::size_t c = 0; c < 3; ++c) {
      const double low = linear_from_srgb(ramp.rgb[3 * k + c] / 255.0), high = linear_from_srgb(ramp.rgb[3 * k + 3 + c] / 255.0);
      // Eight bits: half a step is 0.5 % of full; between texels the square adds (1/255)^2.
      EXPECT_NEAR(strength * (low + (at - static_cast<double>(k)) * (high - low)), glow[3 * i + c], 0.006 * strength) << i << " " << c;
    }
  }
}

TEST_F(WriteMesh, GlbOfColdTerrainHasNoEmission) {
  TriMesh mesh = tube(10, 1, 4, 6);
  mesh.attributes.clear();
  write_glb(folder_ / "terrain.glb", mesh);
  const Glb glb = parse_glb(read_file(folder_ / "terrain.glb"));
  EXPECT_FALSE(glb.json.contains("textures"));
  EXPECT_FALSE(glb.json.contains("extensionsUsed"));
}

TEST_F(WriteMesh, AMeshWithoutTrianglesIsAValidFileInEveryFormat) {
  TriMesh empty;
  color_lava(empty);
  write_ply(folder_ / "e.ply", empty);
  write_obj(folder_ / "e.obj", empty, {{"note", "nothing yet"}});
  write_glb(folder_ / "e.glb", empty, {{"note", "nothing yet"}});
  const Ply ply = parse_ply(read_file(folder_ / "e.ply"));
  EXPECT_EQ(ply.vertices, 0u);
  EXPECT_EQ(ply.faces, 0u);
  EXPECT_EQ(ply.properties.size(), 6u + 3u + 3u);
  const Glb glb = parse_glb(read_file(folder_ / "e.glb"));
  EXPECT_TRUE(glb.bin.empty());
  for (const char* name : {"meshes", "buffers", "accessors", "nodes"}) EXPECT_FALSE(glb.json.contains(name)) << name;
  EXPECT_NE(read_file(folder_ / "e.obj").find("# note: nothing yet"), std::string::npos);
}

TEST_F(WriteMesh, WithoutNormalsTheyAreComputed) {
  TriMesh mesh = lava();
  const std::vector<Vec3> normals = mesh.normals;
  mesh.normals.clear();
  write_ply(folder_ / "a.ply", mesh);
  const Ply ply = parse_ply(read_file(folder_ / "a.ply"));
  for (std::size_t i = 0; i < normals.size(); ++i) EXPECT_NEAR(ply.rows[i].at("nx"), normals[i].x(), 1e-6);
}

TEST_F(WriteMesh, AMeshThatCannotBeWrittenSaysWhyAndLeavesNothing) {
  const auto refused = [&](const TriMesh& mesh, const std::string& part) {
    for (auto* write : {&write_ply, &write_obj, &write_glb}) {
      try {
        write(folder_ / "bad.out", mesh, {});
        ADD_FAILURE() << "written: " << part;
      } catch (const InputError& error) {
        EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
        EXPECT_NE(std::string(error.what()).find("bad.out"), std::string::npos) << error.what();
      }
      EXPECT_TRUE(fs::is_empty(folder_));
    }
  };
  TriMesh mesh = lava(3, 4);
  mesh.triangles[5][1] = 1000;
  refused(mesh, "triangle 5 names vertices");
  mesh = lava(3, 4);
  mesh.positions[7].y() = std::numeric_limits<double>::quiet_NaN();
  refused(mesh, "vertex 7 lies at");
  mesh = lava(3, 4);
  mesh.positions[2].x() = 1e300;
  refused(mesh, "vertex 2 lies at");
  mesh = lava(3, 4);
  mesh.attributes["velocity"].values.pop_back();
  refused(mesh, "attribute \"velocity\" has");
  mesh = lava(3, 4);
  mesh.attributes["temperature"].values[3] = std::numeric_limits<float>::infinity();
  refused(mesh, "attribute \"temperature\" of vertex 3 is inf");
  mesh = lava(3, 4);
  mesh.normals.pop_back();
  refused(mesh, "normals for");
}

TEST_F(WriteMesh, SameBytesOnAnyNumberOfThreads) {
  const TriMesh mesh = lava(300, 30);
  const auto bytes = [&](int threads) {
    const ThreadLimit limit(threads);
    write_ply(folder_ / "a.ply", mesh);
    write_obj(folder_ / "a.obj", mesh);
    write_glb(folder_ / "a.glb", mesh);
    return read_file(folder_ / "a.ply") + read_file(folder_ / "a.obj") + read_file(folder_ / "a.glb");
  };
  const std::string one = bytes(1);
  EXPECT_TRUE(one == bytes(2));
  EXPECT_TRUE(one == bytes(4));
}

/// Runs body in a child that may write files of at most 4 kB, as on a disk that fills; its exit code.
template <class Body>
int with_full_disk(Body&& body) {
  const pid_t child = ::fork();
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);  // write() then fails with EFBIG
    const rlimit limit{4096, 4096};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    int code = 1;
    try {
      const ThreadLimit one(1);  // threads do not survive a fork
      body();
    } catch (const ResourceError&) {
      code = 5;
    } catch (...) {
      code = 2;
    }
    ::_exit(code);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST_F(WriteMesh, AFullDiskIsAResourceErrorAndLeavesNoPartOfAFile) {
  const TriMesh mesh = lava();
  EXPECT_EQ(with_full_disk([&] { write_ply(folder_ / "a.ply", mesh); }), 5);
  EXPECT_EQ(with_full_disk([&] { write_obj(folder_ / "a.obj", mesh); }), 5);
  EXPECT_EQ(with_full_disk([&] { write_glb(folder_ / "a.glb", mesh); }), 5);
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST(EmissionRamp, AGlowOfOneVertexAndOneOfNoneAreRampsToo) {
  const EmissionRamp one = make_emission_ramp({3, {2.0f, 0.5f, 0.0f}});
  EXPECT_EQ(one.strength, 2.0f);
  EXPECT_FLOAT_EQ(one.coordinate[0], 255.5f / 256);
  EXPECT_EQ(one.image.rgb[3 * 255], 255);
  EXPECT_EQ(one.image.rgb[3 * 255 + 1], SrgbEncoder()(0.25f));
  EXPECT_EQ(make_emission_ramp({3, {0, 0, 0}}).strength, 0.0f);
  EXPECT_EQ(make_emission_ramp({3, {}}).coordinate.size(), 0u);
}

TEST(Png, WhatIsEncodedIsDecoded) {
  Rgb8Image image{7, 3, {}};
  for (int i = 0; i < 63; ++i) image.rgb.push_back(static_cast<std::uint8_t>(i * 4));
  const Rgb8Image back = decode_png(encode_png(image), "here");
  EXPECT_EQ(back.width, 7);
  EXPECT_EQ(back.height, 3);
  EXPECT_EQ(back.rgb, image.rgb);
}

TEST(Png, BrokenFilesAreInputErrorsAtEveryLength) {
  const std::string whole = encode_png({7, 3, std::vector<std::uint8_t>(63, 9)});
  for (std::size_t length = 0; length + 13 < whole.size(); ++length)  // libpng does not ask for the 12 bytes of the end mark
    EXPECT_THROW(decode_png(whole.substr(0, length), "short.png"), InputError) << length;
  EXPECT_THROW(decode_png("not a picture at all", "text.png"), InputError);
  EXPECT_THROW(read_png("/nonexistent/picture.png"), InputError);
}

}  // namespace
}  // namespace effuse::skin
