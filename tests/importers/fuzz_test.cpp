// Importers meet broken files: small changes to good ones, the same on every run. Whatever comes, it is read or
// refused with an InputError; a crash or a hang fails the whole program.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstring>

#include "geometry/mesh/validate.h"
#include "importers/mesh/import_mesh.h"
#include "importers/scene/scene_file.h"
#include "importers/terrain/import_terrain.h"
#include "tests/importers/mutate.h"
#include "tests/importers/test_files.h"

#ifdef __SANITIZE_ADDRESS__
// libassimp's STL reader forgets the mesh and node in hand when it throws: not ours to free.
extern "C" const char* __lsan_default_suppressions();
extern "C" const char* __lsan_default_suppressions() { return "leak:libassimp\n"; }
#endif

namespace effuse::importers {
namespace {

struct Good {
  std::string name, bytes;
};

std::string little(float value) {
  std::string bytes(4, '\0');
  std::memcpy(bytes.data(), &value, 4);
  return bytes;
}

std::string good_tiff() {
  struct Entry {
    int tag, type, count;
    std::uint32_t value;
  };
  const std::size_t directory_end = 8 + 2 + 12 * 11 + 4;
  std::string scale, tie, heights;
  const auto f64 = [](std::string& to, double v) {
    char bytes[8];
    std::memcpy(bytes, &v, 8);
    to.append(bytes, 8);
  };
  for (const double v : {10.0, 10.0, 0.0}) f64(scale, v);
  for (const double v : {0.0, 0.0, 0.0, 2667400.0, 6478750.0, 0.0}) f64(tie, v);
  for (int n = 0; n < 30; ++n) heights += little(static_cast<float>(100 + (n * 7) % 13));
  const auto at = static_cast<std::uint32_t>(directory_end);
  const std::vector<Entry> entries = {{256, 3, 1, 6}, {257, 3, 1, 5}, {258, 3, 1, 32}, {259, 3, 1, 1}, {262, 3, 1, 1}, {273, 4, 1, at + 72}, {278, 3, 1, 5}, {279, 4, 1, 120}, {339, 3, 1, 3}, {33550, 12, 3, at}, {33922, 12, 6, at + 24}};
  std::string bytes = "II*";
  const auto number = [&](std::uint32_t v, int count) {
    for (int k = 0; k < count; ++k) bytes += static_cast<char>(v >> (8 * k) & 0xff);
  };
  number(0, 1), number(8, 4), number(static_cast<std::uint32_t>(entries.size()), 2);
  for (const Entry& e : entries) number(static_cast<std::uint32_t>(e.tag), 2), number(static_cast<std::uint32_t>(e.type), 2), number(static_cast<std::uint32_t>(e.count), 4), number(e.value, 4);
  number(0, 4);
  return bytes + scale + tie + heights;
}

std::vector<Good> good_files() {
  std::string asc = "ncols 6\nnrows 5\nxllcorner 2667400\nyllcorner 6478700\ncellsize 10\nNODATA_value -9999\n";
  for (int n = 0; n < 30; ++n) asc += fmt::format("{}{}", 100 + (n * 7) % 13, n % 6 == 5 ? "\n" : " ");
  const std::string corners = "0 0 0\n1 0 0\n1 2 0\n0 2 0\n0 0 3\n1 0 3\n1 2 3\n0 2 3\n";
  const std::string faces = "4 3 2 1 0\n4 4 5 6 7\n4 0 1 5 4\n4 1 2 6 5\n4 2 3 7 6\n4 3 0 4 7\n";
  const std::string obj =
      "# box\no box\nv 0 0 0\nv 1 0 0\nv 1 2 0\nv 0 2 0\nv 0 0 3\nv 1 0 3\nv 1 2 3\nv 0 2 3\nvn 0 0 1\nvt 0 0\n"
      "usemtl m\ns off\nf 4/1/1 3/1/1 2/1/1 1/1/1\nf 5 6 7 8\nf 1//1 2//1 6//1 5//1\nf -7 -6 -2 -3\nf 3 4 8 7\nf 4 1 5 8\n";
  std::string stl = "solid box\n", binary_stl(80, ' ');
  binary_stl += std::string("\x02\0\0\0", 4);
  for (int t = 0; t < 2; ++t) {
    stl += "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0.5\nendloop\nendfacet\n";
    for (int n = 0; n < 12; ++n) binary_stl += little(static_cast<float>((n * 5 + t) % 7));
    binary_stl += std::string(2, '\0');
  }
  stl += "endsolid box\n";
  const std::string ply_head =
      " 1.0\ncomment c\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 6\nproperty list uchar int vertex_indices\nend_header\n";
  std::string binary_ply = "ply\nformat binary_little_endian" + ply_head;
  for (int v = 0; v < 8; ++v)
    binary_ply += little(static_cast<float>(v & 1)) + little(static_cast<float>((v >> 1) & 1)) + little(static_cast<float>(v >> 2));
  for (int f = 0; f < 6; ++f) {
    binary_ply += '\x04';
    for (int c = 0; c < 4; ++c) binary_ply += std::string{static_cast<char>((f + c) % 8), 0, 0, 0};
  }
  const std::string toml =
      "name = \"x\"\nseed = 7\n[lava]\nrate = \"30 m3/s\"\nhot = 1.5e3\npath = [[1, 2], [3.5, 4]]\non = true\n"
      "[[lava.vents]]\nat = { x = 1, y = 2 }\n[skin.\"odd key\"]\ntext = '''\nmany\nlines'''\n";
  // A GeoTIFF of 6 x 5 floats in one strip, written by hand: directory at byte 8, heights at its end.
  std::string xyz = "x;y;z\n";
  for (int n = 0; n < 30; ++n) xyz += fmt::format("{};{};{}.5\n", 10 * (n % 6), 10 * (n / 6), 100 + (n * 7) % 13);
  return {{"a.tif", good_tiff()},
          {"a.xyz", xyz},
          {"a.toml", toml},
          {"a.asc", asc},
          {"a.obj", obj},
          {"a.off", "OFF\n# c\n8 6 0\n" + corners + faces},
          {"a.stl", stl},
          {"b.stl", binary_stl},
          {"a.ply", "ply\nformat ascii" + ply_head + corners + faces},
          {"b.ply", binary_ply}};
}

void feed(const std::filesystem::path& file) {
  const std::string extension = file.extension().string();
  if (extension == ".toml") {
    flow::Node scene = read_scene_file(file);
    // What was read can be written and read again.
    read_scene_text(to_toml(scene), "again");
  } else if (extension == ".asc" || extension == ".tif" || extension == ".xyz") {
    import_terrain(file);
  } else {
    geometry::validate(import_mesh(file).mesh);
  }
}

void fuzz(std::uint64_t seed, int times) {
  const TestFolder folder;
  for (const Good& good : good_files()) {
    EXPECT_NO_THROW(feed(folder.write(good.name, good.bytes))) << good.name << " unharmed";
    int refused = 0;
    for (int n = 0; n < times; ++n) {
      const std::string bytes = mutated(good.bytes, Dice(seed, static_cast<std::uint64_t>(n)));
      const std::filesystem::path file = folder.write(good.name, bytes);
      try {
        feed(file);
      } catch (const InputError& error) {
        ++refused;
        EXPECT_LT(std::string(error.what()).size(), 2000u) << good.name << " seed " << seed << " case " << n;
      } catch (const std::exception& error) {
        ADD_FAILURE() << good.name << " seed " << seed << " case " << n << " throws something else: " << error.what();
      }
    }
    EXPECT_GT(refused, times / 20) << good.name << ": the changes are too tame";
  }
}

TEST(FuzzSlow, HundredsOfSmallChangesAreReadOrRefused) { fuzz(1, 100); }

TEST(FuzzSlow, ThousandsOfSmallChangesAreReadOrRefused) {
  for (std::uint64_t seed = 2; seed < 6; ++seed) fuzz(seed, 1000);
}

}  // namespace
}  // namespace effuse::importers
