// The parsers of our own, fed with changed files from memory: thousands a second. libFuzzer does the same with more wit
// (tests/fuzz.sh), where clang is.

#include "tests/importers/fuzz_parsers.h"

#include <gtest/gtest.h>

#include <chrono>

#include "geometry/base/files.h"
#include "importers/input_file.h"
#include "tests/importers/mutate.h"
#include "tests/importers/test_files.h"

namespace effuse::importers {
namespace {

struct Seed {
  std::string name, extension, bytes;
};

/// Small files of each kind, and all real ones of up to 64 kB that this machine has, the invalid ones among them.
std::vector<Seed> seeds() {
  std::vector<Seed> all = {
      {"ply", ".ply",
       "ply\nformat ascii 1.0\ncomment effuse, metres, z up\ncomment origin: 2667405 6478705 0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\nproperty uchar red\nproperty uchar green\nproperty uchar "
       "blue\nproperty float velocity_x\nproperty float velocity_y\nproperty float velocity_z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0 1 2 3 0 0 1\n1 0 0 4 5 6 0 0 1\n1 1 0 7 8 9 0 0 1\n0 1 0 1 1 1 0 0 1\n3 0 1 2\n3 0 2 3\n"},
      {"obj", ".obj", "# c\nv 2667400.1 6478700 1\nv 2667401 6478700 1\nv 2667401 6478701 1\nvt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 3//1\nf -3 -2 \\\n-1\n"},
      {"stl", ".stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n"},
      {"off", ".off", "OFF\n# c\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n\n0 1 0\n3 0 1 2\n3 0 2 3\n"},
      {"asc", ".asc", "ncols 3\nnrows 2\nxllcenter 0,5\nyllcorner 2\ndx 10\ndy 20\nNODATA_value -9999\n1 2 3\n4 -9999 6\n"},
      {"xyz", ".xyz", "x;y;z\n0;0;1\n10;0;2\n0;10;3\n10;10;4\n20;0;5\n20;10;6\n"},
  };
  const std::filesystem::path data = shared_data();
  if (data.empty()) return all;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(data)) {
    const std::string extension = lower_extension(entry.path());
    if (!entry.is_regular_file() || entry.file_size() > 65536 || std::find(kParsers.begin(), kParsers.end(), extension) == kParsers.end()) continue;
    all.push_back({entry.path().filename().string(), extension, read_file(entry.path())});
  }
  std::sort(all.begin() + 6, all.end(), [](const Seed& a, const Seed& b) { return a.name < b.name; });
  return all;
}

void feed(std::uint64_t seed, std::uint64_t rounds, double seconds) {
  const auto start = std::chrono::steady_clock::now();
  const std::vector<Seed> all = seeds();
  std::size_t fed = 0, taken = 0;
  for (std::uint64_t n = 0; n < rounds && std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() < seconds; ++n)
    for (std::size_t k = 0; k < all.size(); ++k) {
      const std::string bytes = n == 0 ? all[k].bytes : mutated(all[k].bytes, Dice(seed, n * all.size() + k));
      const auto before = std::chrono::steady_clock::now();
      try {
        ++fed;
        taken += parse_with(all[k].extension, bytes);
      } catch (const std::exception& error) {
        ADD_FAILURE() << all[k].name << " seed " << seed << " round " << n << ": " << error.what();
      }
      EXPECT_LT(std::chrono::duration<double>(std::chrono::steady_clock::now() - before).count(), 10) << all[k].name << " seed " << seed << " round " << n;
    }
  EXPECT_GT(taken, fed / 20) << "the changes are too wild";
  EXPECT_LT(taken, fed) << "the changes are too tame";
}

TEST(FuzzParsers, AThousandChangesAreReadOrRefused) { feed(1, 60, 3); }
TEST(FuzzParsersSlow, AMinuteOfChangesIsReadOrRefused) { feed(2, 1'000'000'000, 60); }

}  // namespace
}  // namespace effuse::importers
