#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <sstream>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/mesh/measure.h"
#include "geometry/procedural/primitives.h"
#include "importers/mesh/import_mesh.h"
#include "skin/write/write_mesh.h"

namespace effuse::skin {
namespace {

namespace fs = std::filesystem;
using geometry::TriMesh;

/// The region of each vertex and face as a reader of the format's text finds it: header by lines, numbers at their offsets.
struct Found {
  std::string header;
  std::vector<std::uint64_t> vertex, face;
};

Found read_regions(const fs::path& file) {
  const std::string bytes = read_file(file);
  Found found;
  const std::size_t end = bytes.find("end_header\n") + 11;
  found.header = bytes.substr(0, end);
  std::istringstream lines(found.header);
  struct Element {
    std::size_t count = 0, size = 0, region = 0, high = 0;  // offsets; 0: none (none comes first)
  };
  Element elements[2];
  int at = -1;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string first, second, third;
    words >> first >> second >> third;
    if (first == "element") elements[++at].count = std::stoul(third);
    if (first != "property") continue;
    Element& e = elements[at];
    if (second == "list") {
      e.size += 1 + 3 * 4;
      continue;
    }
    if (third == "region" || third == "region_high") {
      EXPECT_EQ(second, "uint");
      (third == "region" ? e.region : e.high) = e.size;
    }
    e.size += second == "uchar" ? 1 : 4;
  }
  std::size_t offset = end;
  for (int k = 0; k < 2; ++k) {
    const Element& e = elements[k];
    for (std::size_t i = 0; i < e.count; ++i, offset += e.size) {
      if (e.region == 0) continue;
      std::uint32_t low = 0, high = 0;
      std::memcpy(&low, bytes.data() + offset + e.region, 4);
      if (e.high > 0) std::memcpy(&high, bytes.data() + offset + e.high, 4);
      (k == 0 ? found.vertex : found.face).push_back(low | std::uint64_t{high} << 32);
    }
  }
  EXPECT_EQ(offset, bytes.size());
  return found;
}

class WriteSkinPly : public testing::Test {
 protected:
  WriteSkinPly() {
    folder_ = fs::temp_directory_path() / ("effuse.skin_ply." + std::to_string(::getpid()));
    fs::create_directories(folder_);
    mesh_ = geometry::make_sphere(Vec3::Zero(), 1, 1);
    mesh_.attributes["temperature"].values.assign(mesh_.positions.size(), 1300.0f);
    mesh_.attributes["color"] = {3, std::vector<float>(3 * mesh_.positions.size(), 0.5f)};
  }
  ~WriteSkinPly() override { fs::remove_all(folder_); }

  /// Three regions of those ids, going round.
  RegionLabels labels(std::vector<std::uint64_t> id, bool faces) const {
    RegionLabels labels;
    labels.id = std::move(id);
    labels.particle = {4, 7, 9};
    for (std::size_t v = 0; v < mesh_.positions.size(); ++v) labels.of_vertex.push_back(static_cast<Index>(v % 3));
    for (std::size_t t = 0; faces && t < mesh_.triangles.size(); ++t) labels.of_triangle.push_back(static_cast<Index>((t + 1) % 3));
    return labels;
  }
  void expect_read_back(const RegionLabels& labels, const Found& found) const {
    ASSERT_EQ(found.vertex.size(), labels.of_vertex.size());
    ASSERT_EQ(found.face.size(), labels.of_triangle.size());
    for (std::size_t v = 0; v < found.vertex.size(); ++v) EXPECT_EQ(found.vertex[v], labels.id[labels.of_vertex[v]]);
    for (std::size_t t = 0; t < found.face.size(); ++t) EXPECT_EQ(found.face[t], labels.id[labels.of_triangle[t]]);
  }
  static bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

  fs::path folder_;
  TriMesh mesh_;
};

TEST_F(WriteSkinPly, IdsComeBackToTheLastBitWhateverTheirSize) {
  const std::vector<std::uint64_t> small = {0, 5, 1u << 24}, middle = {1, (1u << 24) + 1, 0xffffffffu},
                                   large = {2, 0x100000000ull, 0xfedcba9876543211ull};
  for (const auto& id : {small, middle, large})
    for (const bool faces : {false, true}) {
      const RegionLabels regions = labels(id, faces);
      write_skin_ply(folder_ / "a.ply", mesh_, regions);
      const Found found = read_regions(folder_ / "a.ply");
      expect_read_back(regions, found);
      EXPECT_EQ(contains(found.header, "region_high"), id == large);
      // Who keeps them as float is warned.
      EXPECT_EQ(contains(found.header, "comment region: "), id != small);
    }
}

TEST_F(WriteSkinPly, TheRestIsAsWritePlyWritesIt) {
  write_ply(folder_ / "without.ply", mesh_);
  write_skin_ply(folder_ / "with.ply", mesh_, labels({1, 2, 3}, true));
  const TriMesh without = importers::import_mesh(folder_ / "without.ply").mesh, with = importers::import_mesh(folder_ / "with.ply").mesh;
  EXPECT_EQ(with.positions, without.positions);
  EXPECT_EQ(with.normals, without.normals);
  EXPECT_EQ(with.triangles, without.triangles);
  EXPECT_EQ(with.attributes.size(), without.attributes.size() + 1);
  for (const auto& [name, attribute] : without.attributes) EXPECT_EQ(with.attributes.at(name).values, attribute.values) << name;
  const std::vector<float>& region = with.attributes.at("region").values;
  for (std::size_t v = 0; v < region.size(); ++v) EXPECT_EQ(region[v], static_cast<float>(1 + v % 3));
}

TEST_F(WriteSkinPly, AnEmptySkinHasThePropertyTooSoThatASequenceIsOfOneKind) {
  write_skin_ply(folder_ / "empty.ply", TriMesh{}, RegionLabels{});
  const Found found = read_regions(folder_ / "empty.ply");
  EXPECT_TRUE(contains(found.header, "property uint region\n"));
  EXPECT_TRUE(found.vertex.empty() && found.face.empty());
}

TEST_F(WriteSkinPly, AnAttributeOfTheSameNameIsRefused) {
  mesh_.attributes["region"].values.assign(mesh_.positions.size(), 1.0f);
  EXPECT_THROW(write_skin_ply(folder_ / "a.ply", mesh_, labels({1, 2, 3}, false)), InputError);
  EXPECT_FALSE(fs::exists(folder_ / "a.ply"));
}

}  // namespace
}  // namespace effuse::skin
