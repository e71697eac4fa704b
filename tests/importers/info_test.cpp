#include "importers/info.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "importers/terrain/depressions.h"
#include "tests/importers/test_files.h"

namespace effuse::importers {
namespace {

std::string all(const std::filesystem::path& file) {
  std::string text;
  for (const std::string& line : describe_file(file)) text += line + "\n";
  return text;
}

TEST(DescribeFile, AVolcanoIsAGridWithOneDeepCrater) {
  const std::string text = all(EFFUSE_SOURCE_DIR "/samples/scenes/maunga-whau.asc");
  EXPECT_TRUE(contains(text, "61 x 87 posts, 10 x 10 m apart: 600 x 860 m")) << text;
  EXPECT_TRUE(contains(text, "format: ESRI ASCII")) << text;
  EXPECT_TRUE(contains(text, "heights: 94 to 195 m")) << text;
  EXPECT_TRUE(contains(text, "holes: none")) << text;
  EXPECT_TRUE(contains(text, "New Zealand Map Grid (EPSG:27200)")) << text;
  EXPECT_TRUE(contains(text, "local origin: 2667405, 6478705, 0")) << text;
  EXPECT_TRUE(contains(text, "highest at x ")) << text;
  EXPECT_TRUE(contains(text, "20 m deep, floor 148 m, spills at 168 m, lowest at x 2667")) << text;
}

TEST(DescribeFile, AGridTellsTheSameToPrograms) {
  const std::string values = file_facts(EFFUSE_SOURCE_DIR "/samples/scenes/maunga-whau.asc").values;
  for (const char* part : {"\"posts\":[61,87]", "\"spacing_m\":[10.0,10.0]", "\"heights_m\":[94.0,195.0]", "\"hole_share\":0.0", "\"epsg\":27200", "\"west\":2667405.0", "\"depth_m\":20.0", "ESRI ASCII grid"})
    EXPECT_TRUE(contains(values, part)) << part << " in " << values;
}

TEST(DescribeFile, AGridTellsOfAPlaceWhatASceneWantsAndOthersRefuse) {
  const FileFacts facts = file_facts(EFFUSE_SOURCE_DIR "/samples/scenes/maunga-whau.asc", {}, Vec2(2667617, 6479412));
  std::string text;
  for (const std::string& line : facts.lines) text += line + "\n";
  EXPECT_TRUE(contains(text, "at x 2667617, y 6479412 (174.76")) << text;
  EXPECT_TRUE(contains(facts.values, "\"downhill_deg\"")) << facts.values;
  EXPECT_THROW(file_facts(EFFUSE_SOURCE_DIR "/samples/scenes/house.obj", {}, Vec2(1, 2)), InputError);
}

TEST(DescribeFile, AMeshTellsVolumeOnlyWhenItEnclosesOne) {
  const TestFolder folder;
  const std::string corners = "v 0 0 0\nv 2 0 0\nv 0 3 0\nv 0 0 4\n";
  const std::string closed = all(folder.write("closed.obj", corners + "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"));
  EXPECT_TRUE(contains(closed, "closed")) << closed;
  EXPECT_TRUE(contains(closed, "volume 4 m3")) << closed;
  EXPECT_TRUE(contains(closed, "size: 2 x 3 x 4 m")) << closed;
  const std::string open = all(folder.write("open.obj", corners + "f 1 3 2\nf 1 2 4\nf 2 3 4\n"));
  EXPECT_FALSE(contains(open, "volume")) << open;
}

TEST(DescribeFile, AMeshTellsItsStateItsFaultsAndItsFrame) {
  const TestFolder folder;
  // Two squares across one another, one of them with a triangle turned. They meet in a line that lies in one of its triangles, from
  // where it touches the other: three pairs.
  const std::string crossed = "v 0 0 0\nv 4 0 0\nv 4 0 -4\nv 0 0 -4\nv 1 -1 -1\nv 3 -1 -1\nv 3 1 -1\nv 1 1 -1\nf 1 2 3\nf 1 4 3\nf 5 6 7 8\n";
  const std::filesystem::path file = folder.write("crossed.obj", crossed);
  const std::string text = all(file), values = file_facts(file).values;
  for (const char* part : {"format: obj", "self-intersections: 3 pairs", "not oriented at 1 edge", "2 components", "up axis: the file does not say", "unit: the file does not say; metres are assumed"}) EXPECT_TRUE(contains(text, part)) << part << " in " << text;
  for (const char* part : {"\"kind\":\"mesh\"", "\"closed\":false", "\"oriented\":false", "\"misoriented_edges\":1", "\"self_intersections\":3", "\"degenerate_triangles\":0", "\"metres_per_unit\":null", "\"volume_m3\":null"})
    EXPECT_TRUE(contains(values, part)) << part << " in " << values;
  const std::string own = all(folder.write("own.obj", "# effuse, metres, z up\n# origin: 2667400 6478700 0\n# crs: EPSG:27200\n" + crossed));
  for (const char* part : {"up axis: z, by its comments", "unit: 1 m, by its comments", "origin on the map: 2667400, 6478700, 0"}) EXPECT_TRUE(contains(own, part)) << part << " in " << own;
}

TEST(DescribeFile, TrianglesWithoutNumberInOnePlaceTakeNoTime) {
  const TestFolder folder;
  std::string heap = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  for (int k = 0; k < 20000; ++k) heap += "f 1 2 3\n";
  const std::filesystem::path file = folder.write("heap.obj", heap);
  EXPECT_TRUE(contains(all(file), fmt::format("self-intersections: {} or more pairs", kMostCrossings)));
  EXPECT_TRUE(contains(file_facts(file).values, "\"self_intersections_or_more\":true"));
}

TEST(DescribeFile, ASceneTellsItsNameEffectsAndTables) {
  const TestFolder folder;
  const std::string text = all(folder.write("x.toml", "name = \"flank\"\neffects = [\"lava\", \"skin\"]\n[lava]\n[[vents]]\nr = 1\n"));
  EXPECT_TRUE(contains(text, "scene: flank")) << text;
  EXPECT_TRUE(contains(text, "effects: lava, skin")) << text;
  EXPECT_TRUE(contains(text, "tables: lava, vents")) << text;
}

TEST(DescribeFile, AFileNobodyReadsNamesWhatIsRead) {
  const TestFolder folder;
  const std::string told = refusal([&] { describe_file(folder.write("notes.xyzzy", "hello")); });
  EXPECT_TRUE(contains(told, ".xyzzy")) << told;
  EXPECT_TRUE(contains(told, ".obj")) << told;
  EXPECT_TRUE(contains(told, ".asc")) << told;
  EXPECT_TRUE(contains(refusal([&] { describe_file(folder.path() / "none.toml"); }), "no such file"));
}

TEST(ClosedDepressions, ABowlInAPlainSpillsAtItsLowestRim) {
  // A plain at 10 m with a rim at 12 m that has a notch at 11 m around a floor at 5 m.
  const int n = 9;
  std::vector<Real> z(n * n, 10);
  for (int j = 2; j <= 6; ++j)
    for (int i = 2; i <= 6; ++i) z[static_cast<std::size_t>(j * n + i)] = (i == 2 || i == 6 || j == 2 || j == 6) ? 12 : 7;
  z[4 * n + 4] = 5;
  z[4 * n + 6] = 11;
  const std::vector<Depression> found = closed_depressions(geometry::HeightField(Vec2(100, 200), Vec2(2, 3), n, n, z));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].floor, 5);
  EXPECT_EQ(found[0].spill, 11);
  EXPECT_EQ(found[0].posts, 9u);
  EXPECT_DOUBLE_EQ(found[0].volume, (8 * 4 + 6) * 2 * 3.0);
  EXPECT_EQ(found[0].lowest, Vec2(100 + 4 * 2, 200 + 4 * 3));
}

TEST(ClosedDepressions, WaterLeavesThroughAHoleInTheData) {
  const int n = 7;
  std::vector<Real> z(n * n, 10);
  z[3 * n + 3] = 4;
  EXPECT_EQ(closed_depressions(geometry::HeightField(Vec2(0, 0), Vec2(1, 1), n, n, z)).size(), 1u);
  z[3 * n + 4] = std::nan("");
  EXPECT_TRUE(closed_depressions(geometry::HeightField(Vec2(0, 0), Vec2(1, 1), n, n, z)).empty());
}

}  // namespace
}  // namespace effuse::importers
