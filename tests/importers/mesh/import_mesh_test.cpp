#include "importers/mesh/import_mesh.h"

#include <dlfcn.h>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <numeric>

#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "importers/mesh/ply_reader.h"
#include "tests/importers/test_files.h"

namespace effuse::importers {
namespace {

using geometry::MeshReport;
using geometry::validate;

std::string notes_of(const MeshImport& import) { return fmt::format("{}", fmt::join(import.notes, "\n")); }

/// The bytes of value, least significant first or last.
template <class T>
std::string raw(T value, bool little = true) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  if (little != (std::endian::native == std::endian::little)) std::reverse(bytes.begin(), bytes.end());
  return bytes;
}

/// A box from 0 to (1, 2, 3) in quads, counter-clockwise from outside.
const std::string kBoxObj =
    "v 0 0 0\nv 1 0 0\nv 1 2 0\nv 0 2 0\nv 0 0 3\nv 1 0 3\nv 1 2 3\nv 0 2 3\n"
    "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

MeshImport import_text(const std::string& name, const std::string& bytes) {
  const TestFolder folder;
  return import_mesh(folder.write(name, bytes));
}

std::string refused(const std::string& name, const std::string& bytes) {
  return refusal([&] { import_text(name, bytes); });
}

TEST(ImportMesh, ABoxIsTheSameSolidFromEveryFormat) {
  std::string off = "OFF\n8 6 0\n", ply =
                                        "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
                                        "element face 6\nproperty list uchar int vertex_indices\nend_header\n";
  const std::string corners = "0 0 0\n1 0 0\n1 2 0\n0 2 0\n0 0 3\n1 0 3\n1 2 3\n0 2 3\n";
  const std::string faces = "4 3 2 1 0\n4 4 5 6 7\n4 0 1 5 4\n4 1 2 6 5\n4 2 3 7 6\n4 3 0 4 7\n";
  const MeshImport box = import_text("box.obj", kBoxObj);
  std::string stl = "solid box\n", binary(80, 's');
  binary += raw(static_cast<std::uint32_t>(box.mesh.triangles.size()));
  for (const auto& t : box.mesh.triangles) {
    stl += "facet normal 0 0 0\nouter loop\n";
    binary += std::string(12, '\0');
    for (Index i : t) {
      const Vec3& x = box.mesh.positions[i];
      stl += fmt::format("vertex {} {} {}\n", x.x(), x.y(), x.z());
      for (int c = 0; c < 3; ++c) binary += raw(static_cast<float>(x[c]));
    }
    stl += "endloop\nendfacet\n";
    binary += std::string(2, '\0');
  }
  stl += "endsolid box\n";
  for (const auto& [name, bytes] : std::vector<std::pair<std::string, std::string>>{{"box.obj", kBoxObj},
                                                                                    {"box.off", off + corners + faces},
                                                                                    {"box.ply", ply + corners + faces},
                                                                                    {"box.stl", stl},
                                                                                    {"bin.stl", binary},
                                                                                    {"BOX.STL", stl}}) {
    const MeshImport import = import_text(name, bytes);
    const MeshReport report = validate(import.mesh);
    EXPECT_EQ(report.vertices, 8u) << name;
    EXPECT_EQ(report.triangles, 12u) << name;
    EXPECT_TRUE(report.solid()) << name << ": " << to_string(report);
    EXPECT_NEAR(geometry::signed_volume(import.mesh), 6, 1e-12) << name;
    EXPECT_EQ(geometry::bounds(import.mesh).max(), Vec3(1, 2, 3)) << name;
  }
}

TEST(ImportMesh, MapCoordinatesKeepTheirMillimetres) {
  std::string moved_obj, moved_off = "OFF\n4 1 0\n", moved_stl = "solid s\nfacet normal 0 0 1\nouter loop\n";
  const Vec3 origin(501234, 4181234, 1500);
  const std::vector<Vec3> corners = {origin + Vec3(0.001, 0.002, 0.003), origin + Vec3(10.001, 0.002, 0.003),
                                     origin + Vec3(10.001, 10.002, 0.004)};
  for (const Vec3& x : corners) {
    moved_obj += fmt::format("v {:.3f} {:.3f} {:.3f}\n", x.x(), x.y(), x.z());
    moved_stl += fmt::format("vertex {:.3f} {:.3f} {:.3f}\n", x.x(), x.y(), x.z());
  }
  moved_off = "OFF\n3 1 0\n" + moved_obj;
  std::erase(moved_off, 'v');
  for (const auto& [name, bytes] :
       std::vector<std::pair<std::string, std::string>>{{"a.obj", moved_obj + "f 1 2 3\n"},
                                                        {"a.off", moved_off + "3 0 1 2\n"},
                                                        {"a.stl", moved_stl + "endloop\nendfacet\nendsolid\n"}}) {
    const MeshImport import = import_text(name, bytes);
    ASSERT_EQ(import.mesh.positions.size(), 3u) << name;
    // A float would round to 0.25 m there; 1e-6 is a float's step at ten metres.
    for (std::size_t v = 0; v < 3; ++v) EXPECT_LT((import.mesh.positions[v] - corners[v]).norm(), 2e-6) << name;
    EXPECT_TRUE(contains(notes_of(import), "keep their digits")) << notes_of(import);
  }
}

TEST(ImportMesh, ObjNormalsAndColoursSurviveTheWeldWhereTheyAreSmooth) {
  const std::string smooth =
      "v 0 0 0 1 0.5 0\nv 1 0 0 1 0.5 0\nv 1 1 0 1 0.5 0\nv 0 1 0 1 0.5 0\nvn 0 0 1\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1\n";
  const MeshImport import = import_text("smooth.obj", smooth);
  ASSERT_EQ(import.mesh.positions.size(), 4u);
  ASSERT_EQ(import.mesh.normals.size(), 4u);
  EXPECT_EQ(import.mesh.normals[2], Vec3(0, 0, 1));
  const auto& color = import.mesh.attributes.at("color");
  EXPECT_NEAR(color.values[1], 0.21404114f, 1e-6) << "sRGB 0.5 in linear light";
  std::string creased = smooth;
  creased.replace(creased.rfind("1//1 3//1 4//1"), 14, "1//2 3//2 4//2");
  creased.insert(creased.find("f 1"), "vn 0 1 0\n");
  EXPECT_TRUE(import_text("creased.obj", creased).mesh.normals.empty()) << "two normals at one vertex are none";
}

TEST(ImportMesh, BrokenObjNamesTheLine) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n", ":2"},
      {"v 0 0 0\nv 1 0 1e999\nv 0 1 0\nf 1 2 3\n", ":2"},
      {"v 0 0 0\nv 1 0,5 0\nv 0 1 0\nf 1 2 3\n", "comma"},
      {"v 0 0 0\nv 1 0\nv 0 1 0\nf 1 2 3\n", ":2"},
      {"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", ":4"},
      {"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n", ":4"},
      {"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n", ":4"},
      {"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", ":4"},
      {"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 x\n", "'x'"},
      {"v 0 0 0\nv 1 0 0\nv 0 1 0\nf\n", ":4"},
      {"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999\n", ":4"},
      {"v 0 0 0\n", "no triangles"},
      {"v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n", "no triangles"},
  };
  for (const auto& [text, part] : cases) {
    const std::string message = refused("x.obj", text);
    EXPECT_TRUE(contains(message, part)) << message << " for\n" << text;
  }
  std::string giant = kBoxObj + "f";
  for (int i = 0; i < 20000; ++i) giant += " 1";
  EXPECT_TRUE(contains(refused("giant.obj", giant), "20000 corners"));
}

TEST(ImportMesh, BrokenStlAndOffSayWhatIsWrong) {
  EXPECT_TRUE(contains(refused("x.stl", "solid a\nendsolid a\n"), "without facets"));
  EXPECT_TRUE(contains(refused("x.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"), "truncated"));
  EXPECT_TRUE(
      contains(refused("x.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\nendfacet\n"), "2 vertices"));
  EXPECT_TRUE(contains(refused("x.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 nan\n"), ":4"));
  EXPECT_TRUE(contains(refused("x.stl", std::string(80, 'x') + raw(std::uint32_t{1000000}) + std::string(100, '\0')), "room for 2"));
  EXPECT_TRUE(contains(refused("x.stl", "short"), "not an STL file"));
  EXPECT_TRUE(contains(refused("x.off", "OFF\n99999999999 1 0\n0 0 0\n"), ":2"));
  EXPECT_TRUE(contains(refused("x.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n"), "vertex 2 of 3"));
  EXPECT_TRUE(contains(refused("x.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"), ":6"));
  EXPECT_TRUE(contains(refused("x.off", "FFO\n"), ":1"));
}

TEST(ImportMesh, OffWithCommentsAndBlankLinesKeepsEveryFace) {
  const MeshImport import = import_text("x.off",
                                        "# made by hand\nOFF # here\n\n# counts\n4 4 0\n\n# corners\n0 0 0\n1 0 0\n\n0 1 0\n0 0 1\n# "
                                        "faces\n\n3 0 2 1\n# one\n3 0 1 3\n3 1 2 3 0.5 0.5 0.5\n\n3 0 3 2\n# end\n");
  EXPECT_EQ(import.mesh.triangles.size(), 4u);
  EXPECT_TRUE(validate(import.mesh).solid());
}

/// A GLB file of one JSON text and one chunk of data.
std::string glb(const nlohmann::json& json, std::string data, std::size_t unaligned = 0) {
  std::string text = json.dump();
  while (text.size() % 4 != unaligned) text += ' ';
  while (data.size() % 4 != 0) data += '\0';
  const auto u32 = [](std::size_t value) { return raw(static_cast<std::uint32_t>(value)); };
  return "glTF" + u32(2) + u32(28 + text.size() + data.size()) + u32(text.size()) + "JSON" + text + u32(data.size()) +
         std::string("BIN\0", 4) + data;
}

/// One triangle in y up coordinates with a temperature at each corner.
nlohmann::json triangle_json() {
  return nlohmann::json::parse(R"({
    "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "name": "n"}],
    "meshes": [{"name": "skin", "primitives": [{"attributes": {"POSITION": 0, "_TEMPERATURE": 1, "COLOR_0": 2, "_VELOCITY": 0, "_BROKEN": 9}, "indices": 3}]}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, -1], "max": [1, 2, 0]},
                  {"bufferView": 1, "componentType": 5126, "count": 3, "type": "SCALAR"},
                  {"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC3"},
                  {"bufferView": 3, "componentType": 5123, "count": 3, "type": "SCALAR"}],
    "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 12},
                    {"buffer": 0, "byteOffset": 48, "byteLength": 36}, {"buffer": 0, "byteOffset": 84, "byteLength": 6}],
    "buffers": [{"byteLength": 90}]})");
}

std::string triangle_data() {
  std::string data;
  for (float x : {0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 2.f, -1.f}) data += raw(x);
  for (float t : {300.f, 1400.f, 1423.15f}) data += raw(t);
  for (float c : {0.25f, 0.5f, 1.f, 0.25f, 0.5f, 1.f, 0.25f, 0.5f, 1.f}) data += raw(c);
  for (int i : {0, 1, 2}) data += raw(static_cast<std::uint16_t>(i));
  return data;
}

TEST(ImportMesh, GlbIsTurnedToZUpAndKeepsItsOwnAttributes) {
  for (std::size_t unaligned : {0u, 1u, 2u, 3u}) {
    const MeshImport import = import_text("t.glb", glb(triangle_json(), triangle_data(), unaligned));
    ASSERT_EQ(import.mesh.positions.size(), 3u);
    EXPECT_EQ(import.mesh.positions[2], Vec3(0, 1, 2)) << "(x, y, z) of glTF is (x, -z, y) here";
    EXPECT_EQ(import.mesh.attributes.at("temperature").values, (std::vector<float>{300, 1400, 1423.15f}));
    EXPECT_EQ(import.mesh.attributes.at("velocity").width, 3);
    EXPECT_EQ(import.mesh.attributes.at("color").values[0], 0.25f) << "glTF's colours are linear already";
    EXPECT_TRUE(contains(notes_of(import), "_BROKEN")) << notes_of(import);
  }
}

TEST(ImportMesh, NodesPlaceTheirMeshesAndMirrorsDoNotTurnThemInsideOut) {
  nlohmann::json json = triangle_json();
  json["nodes"] = nlohmann::json::parse(
      R"([{"children": [1, 2], "translation": [10, 0, 0]}, {"mesh": 0}, {"mesh": 0, "scale": [-1, 1, 1], "translation": [0, 5, 0]}])");
  const MeshImport import = import_text("t.glb", glb(json, triangle_data()));
  ASSERT_EQ(import.mesh.triangles.size(), 2u);
  EXPECT_EQ(geometry::bounds(import.mesh).min(), Vec3(9, 0, 0));
  EXPECT_EQ(geometry::bounds(import.mesh).max(), Vec3(11, 1, 7));
  for (const auto& [a, b, c] : import.mesh.triangles) {
    const auto& x = import.mesh.positions;
    EXPECT_GT((x[b] - x[a]).cross(x[c] - x[a]).z(), 0) << "both face up";
  }
  EXPECT_EQ(import.mesh.attributes.at("temperature").values.size(), 6u);
}

TEST(ImportMesh, HostileGlbIsRefused) {
  const std::string good = glb(triangle_json(), triangle_data());
  for (std::size_t cut : {3u, 15u, 19u, 30u, 500u}) EXPECT_NE(refused("x.glb", good.substr(0, cut)), "") << cut;
  std::string deep = "{\"asset\":" + std::string(100000, '[');
  const auto u32 = [](std::size_t value) { return raw(static_cast<std::uint32_t>(value)); };
  EXPECT_TRUE(contains(refused("x.glb", "glTF" + u32(2) + u32(20 + deep.size()) + u32(deep.size()) + "JSON" + deep), "nested too deeply"));
  EXPECT_TRUE(contains(refused("x.gltf", deep), "nested too deeply"));
  nlohmann::json ring = triangle_json();
  ring["nodes"] = nlohmann::json::parse(R"([{"children": [1]}, {"children": [0], "mesh": 0}])");
  EXPECT_TRUE(contains(refused("x.glb", glb(ring, triangle_data())), "ring"));
  nlohmann::json chain = triangle_json();
  for (int n = 0; n < 100000; ++n) chain["nodes"][static_cast<std::size_t>(n)] = {{"children", {n + 1}}};
  chain["nodes"].push_back({{"mesh", 0}});
  EXPECT_TRUE(contains(refused("x.glb", glb(chain, triangle_data())), "nested deeper"));
}

TEST(ImportMesh, AFileThatIsNoMeshIsRefusedByName) {
  const TestFolder folder;
  EXPECT_TRUE(contains(refusal([&] { import_mesh(folder.path() / "no.obj"); }), "no such file"));
  EXPECT_TRUE(contains(refusal([&] { import_mesh(folder.path()); }), "folder"));
  EXPECT_TRUE(contains(refused("a.obj", ""), "empty"));
  EXPECT_TRUE(contains(refused("a", "v 0 0 0"), "no reader"));
  EXPECT_TRUE(contains(refused("a.docx", "v 0 0 0"), "no reader"));
}

TEST(ImportMesh, AssertionsOfAssimpAreExceptions) {
  // Debian's libassimp calls this function by its name in the program, which has to be ours: its own aborts.
  using Violation = void (*)(const char*, const char*, int);
  const auto violation = reinterpret_cast<Violation>(dlsym(RTLD_DEFAULT, "_ZN6Assimp17aiAssertViolationEPKcS1_i"));
  ASSERT_NE(violation, nullptr);
  EXPECT_THROW(violation("x > 0", "file.cpp", 1), std::runtime_error);
}

// --- PLY

/// A tetrahedron in the format asked for, with a vertex's and a face's other properties and an unknown element.
std::string tetrahedron(const std::string& format, const std::string& line_end = "\n") {
  std::string text =
      "ply\nformat " + format +
      " 1.0\ncomment between\nelement vertex 4\ncomment after an element\nproperty double x\nproperty double y\nproperty double z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float velocity_z\nproperty float velocity_x\n"
      "property float velocity_y\nproperty float temperature\nproperty list uchar short extra\n"
      "element odd 2\nproperty int a\nproperty list ushort float b\n"
      "element face 4\nproperty uchar flag\nproperty list uchar uint vertex_index\nobj_info whatever\nend_header\n";
  std::string head;
  for (char c : text) head += c == '\n' ? line_end : std::string(1, c);
  const bool ascii = format == "ascii", little = format != "binary_big_endian";
  std::string body;
  const auto put = [&](auto value) { body += ascii ? fmt::format("{} ", value) : raw(value, little); };
  const double far = 4181234.001;  // more digits than a float has
  const std::vector<Vec3> corners = {{far, 0, 0}, {far + 1, 0, 0}, {far, 1, 0}, {far, 0, 1}};
  for (std::size_t v = 0; v < 4; ++v) {
    for (int c = 0; c < 3; ++c) put(corners[v][c]);
    for (std::uint8_t c : {std::uint8_t{255}, std::uint8_t{188}, std::uint8_t{0}}) put(c);
    put(3.f);
    put(1.f);
    put(2.f);
    put(1000.f + static_cast<float>(v));
    put(static_cast<std::uint8_t>(v));
    for (std::size_t i = 0; i < v; ++i) put(static_cast<std::int16_t>(-5));
    if (ascii) body += line_end;
  }
  for (int n = 0; n < 2; ++n) {
    put(std::int32_t{-7});
    put(std::uint16_t{1});
    put(0.5f);
    if (ascii) body += line_end;
  }
  for (const auto& face : std::vector<std::vector<std::uint32_t>>{{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}}) {
    put(std::uint8_t{1});
    put(std::uint8_t{3});
    for (std::uint32_t i : face) put(i);
    if (ascii) body += line_end;
  }
  return head + body;
}

TEST(Ply, AllFormatsAndLineEndsGiveTheSameMeshInDouble) {
  for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    for (const char* line_end : {"\n", "\r\n", "\r"}) {
      const MeshImport import = import_text("t.ply", tetrahedron(format, line_end));
      const MeshReport report = validate(import.mesh);
      EXPECT_TRUE(report.solid() && report.vertices == 4) << format << to_string(report);
      EXPECT_EQ(import.mesh.positions[1].x(), 4181235.001) << format << ": double stays double";
      EXPECT_EQ(import.mesh.attributes.at("velocity").values[2], 3.f) << "whatever order its components stand in";
      EXPECT_EQ(import.mesh.attributes.at("velocity").values[0], 1.f);
      EXPECT_EQ(import.mesh.attributes.at("temperature").values[3], 1003.f);
      EXPECT_NEAR(import.mesh.attributes.at("color").values[1], 0.5029f, 1e-4) << "sRGB 188";
      EXPECT_TRUE(contains(notes_of(import), "2 of 'odd' were skipped")) << notes_of(import);
    }
  }
}

TEST(Ply, BinaryDataThatBeginLikeALineEndAreData) {
  std::string text =
      "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty uchar kind\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  for (float x : {0.f, 1.f, 2.f}) text += '\n' + raw(x) + raw(x * x) + raw(0.f);
  text += '\x03' + raw(0) + raw(1) + raw(2);
  const MeshImport import = import_text("t.ply", text);
  EXPECT_EQ(import.mesh.positions[2], Vec3(2, 4, 0));
  EXPECT_EQ(import.mesh.attributes.at("kind").values[0], 10.f);
}

TEST(Ply, EveryScalarTypeIsReadByBothItsNames) {
  for (const auto& [first, second, value] :
       std::vector<std::tuple<std::string, std::string, std::string>>{{"char", "int8", raw(std::int8_t{-3})},
                                                                      {"uchar", "uint8", raw(std::uint8_t{200})},
                                                                      {"short", "int16", raw(std::int16_t{-300})},
                                                                      {"ushort", "uint16", raw(std::uint16_t{60000})},
                                                                      {"int", "int32", raw(std::int32_t{-70000})},
                                                                      {"uint", "uint32", raw(std::uint32_t{3000000000u})},
                                                                      {"float", "float32", raw(-2.5f)},
                                                                      {"double", "float64", raw(-2.5)}}) {
    const float expected = first == "char"     ? -3.f
                           : first == "uchar"  ? 200.f
                           : first == "short"  ? -300.f
                           : first == "ushort" ? 60000.f
                           : first == "int"    ? -70000.f
                           : first == "uint"   ? 3e9f
                                               : -2.5f;
    for (const std::string& type : {first, second}) {
      std::string text = "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty " + type +
                         " value\nproperty float x\nproperty float y\nproperty float z\nend_header\n" + value + std::string(12, '\0');
      EXPECT_EQ(parse_ply(text, "t.ply").attributes.at("value").values.at(0), expected) << type;
    }
  }
}

TEST(Ply, EveryFaultIsRefused) {
  const auto head = [](const std::string& rest) { return "ply\nformat ascii 1.0\n" + rest; };
  const std::string vertex3 = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
  const std::string face1 = "element face 1\nproperty list uchar int vertex_indices\n";
  const std::string corners = "0 0 0\n1 0 0\n0 1 0\n";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"plx\n", "not a PLY file"},
      {"ply\nformat ascii 1.0\nelement vertex 3\n", "no 'end_header'"},
      {"ply\nelement vertex 1\nend_header\n", "no 'format'"},
      {"ply\nformat morse 1.0\nend_header\n", ":2"},
      {head("element vertex\nend_header\n"), ":3"},
      {head("element vertex -3\nend_header\n"), "'-3'"},
      {head("element vertex 99999999999999999999999\nend_header\n"), ":3"},
      {head("property float x\nend_header\n"), "before the first element"},
      {head("element vertex 1\nproperty quad x\nend_header\n"), "'quad'"},
      {head("element vertex 1\nproperty float x\nproperty float x\nend_header\n"), "twice"},
      {head("element vertex 1\nproperty float x\nproperty float y\nend_header\n0 0\n"), "no x, y and z"},
      {head("nonsense\nend_header\n"), "'nonsense'"},
      {head("element vertex 1000000000000\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n"), "too many"},
      {head("element vertex 1000000000\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n"), "room for"},
      {head(vertex3 + face1 + "end_header\n" + corners + "3 0 1\n"), "truncated"},
      {head(vertex3 + face1 + "end_header\n" + corners + "3 0 1 3\n"), "names vertex 3"},
      {head(vertex3 + face1 + "end_header\n" + corners + "3 0 1 -1\n"), "names vertex -1"},
      {head(vertex3 + face1 + "end_header\n" + corners + "3 0 1 1.5\n"), "names vertex 1.5"},
      {head(vertex3 + face1 + "end_header\n" + corners + "-3 0 1 2\n"), "a list of -3"},
      {head(vertex3 + face1 + "end_header\n" + corners + "200000000 0 1 2\n"), "cannot stand"},
      {head(vertex3 + face1 + "end_header\n0 0 0\n1 0 nan\n0 1 0\n3 0 1 2\n"), ":11"},
      {head(vertex3 + face1 + "end_header\n0 0 0\n1 0 x\n0 1 0\n3 0 1 2\n"), ":11"},
      {head(vertex3 + "element face 1\nproperty uchar n\nend_header\n" + corners + "3\n"), "no list 'vertex_indices'"},
      {head(vertex3 + "end_header\n" + corners), "no triangles"},
      {head("element face 1\nproperty list uchar int vertex_indices\nend_header\n3 0 1 2\n"), "names vertex 0"},
  };
  for (const auto& [text, part] : cases) {
    const std::string message = refused("t.ply", text);
    EXPECT_TRUE(contains(message, part)) << message << " for\n" << text;
  }
  const std::string binary = tetrahedron("binary_little_endian");
  for (std::size_t cut = 1; cut < binary.size(); cut += 7) EXPECT_NE(refused("t.ply", binary.substr(0, cut)), "") << cut;
}

}  // namespace
}  // namespace effuse::importers
