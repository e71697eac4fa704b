#include <gtest/gtest.h>

#include <cctype>
#include <filesystem>
#include <fstream>

#include "tests/architecture/rules.h"

namespace effuse::architecture {
namespace {

namespace fs = std::filesystem;

const fs::path kRoot = EFFUSE_SOURCE_DIR;

std::string text_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

bool is_text(const fs::path& file) {
  static const std::set<std::string> kinds{".h", ".cpp", ".cmake", ".in", ".txt", ".sh", ".md", ".json", ".toml", ".supp", ".mjs", ".js", ".py", ".html"};
  return kinds.contains(file.extension().string());
}

/// The repository's text files by path from its root; what builds and runs leave behind is not among them.
const std::map<std::string, std::string>& tree() {
  static const std::map<std::string, std::string> files = [] {
    std::map<std::string, std::string> found;
    for (auto it = fs::recursive_directory_iterator(kRoot); it != fs::recursive_directory_iterator(); ++it) {
      const std::string path = it->path().lexically_relative(kRoot).generic_string();
      if (it->is_directory() && (path == ".git" || path == "build" || path == "out" || path == ".cache" || ends_with(path, "node_modules")))
        it.disable_recursion_pending();
      else if (it->is_regular_file() && (is_text(it->path()) || path == ".ci/run"))
        found[path] = text_of(it->path());
    }
    return found;
  }();
  return files;
}

bool is_code(const std::string& path) { return ends_with(path, ".h") || ends_with(path, ".cpp"); }

std::string lines(const Faults& faults) {
  std::string all;
  for (const std::string& fault : faults) all += fault + "\n";
  return all;
}

// ---- The repository as it is ----

TEST(Tree, HasFilesInEveryRoom) {
  for (const std::string room : {"geometry/base", "geometry", "flow", "skin", "importers", "samples", "tests"})
    EXPECT_TRUE(std::any_of(tree().begin(), tree().end(), [&](const auto& f) { return is_code(f.first) && inside(f.first, room); })) << room;
}

TEST(Tree, NoIncludeClimbsAndEveryPackageStaysAtHome) {
  Faults faults;
  std::size_t includes = 0;
  for (const auto& [path, text] : tree()) {
    if (!is_code(path)) continue;
    includes += includes_of(text).size();
    const Faults here = include_faults(path, text, [](const std::string& name) { return fs::is_regular_file(kRoot / name); });
    faults.insert(faults.end(), here.begin(), here.end());
  }
  EXPECT_TRUE(faults.empty()) << lines(faults);
  EXPECT_GT(includes, 100u) << "the reader of includes has gone blind";
}

TEST(Tree, NoIncludesGoInACircle) { EXPECT_TRUE(circles(tree()).empty()) << lines(circles(tree())); }

TEST(Tree, NoTypeIsDefinedTwice) {
  std::map<std::string, std::string> code;
  std::size_t types = 0;
  for (const auto& [path, text] : tree())
    if (is_code(path)) {
      code[path] = text;
      types += types_of(text).size();
    }
  EXPECT_TRUE(types_defined_twice(code).empty()) << lines(types_defined_twice(code));
  EXPECT_GT(types, 400u) << "the reader of types has gone blind";
}

TEST(Tree, CodeHasTheTwoEndingsTheRulesRead) {
  for (const auto& entry : fs::recursive_directory_iterator(kRoot / "tests")) EXPECT_NE(entry.path().extension(), ".cc") << entry.path();
  for (const std::string room : {"geometry", "flow", "skin", "importers", "samples"})
    for (const auto& entry : fs::recursive_directory_iterator(kRoot / room)) {
      static const std::set<std::string> unread{".hpp", ".hh", ".hxx", ".cc", ".cxx", ".inl", ".ipp", ".tpp", ".c"};
      EXPECT_FALSE(unread.contains(entry.path().extension().string())) << entry.path() << ": .h and .cpp are what the rules read";
    }
}

TEST(Tree, TopLevelIsTheDesigns) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(kRoot)) names.push_back(entry.path().filename().string());
  EXPECT_TRUE(top_level_faults(names).empty()) << lines(top_level_faults(names));
}

TEST(Tree, FilesAreShortAndSayNothingOfTheMachineTheyWereWrittenOn) {
  Faults faults;
  for (const auto& [path, text] : tree()) {
    const Faults here = text_faults(path, text);
    faults.insert(faults.end(), here.begin(), here.end());
  }
  EXPECT_TRUE(faults.empty()) << lines(faults);
}

// ---- The rules on made-up lines: each can fail ----

struct Line {
  std::string path, line;
  std::string fault;  ///< a part of the sentence; "": none
};

/// For the test's name.
void PrintTo(const Line& given, std::ostream* out) {
  for (const char c : given.path + " " + given.line) *out << (std::isalnum(static_cast<unsigned char>(c)) || c == '.' || c == '/' ? c : '_');
}

class IncludeRule : public testing::TestWithParam<Line> {};

TEST_P(IncludeRule, FindsTheFaultAndNoOther) {
  const Line& given = GetParam();
  const Faults faults = include_faults(given.path, given.line, [](const std::string& name) { return !starts_with(name, "gone") && name.find('/') != std::string::npos; });
  if (given.fault.empty()) {
    EXPECT_TRUE(faults.empty()) << lines(faults);
  } else {
    ASSERT_EQ(faults.size(), 1u) << lines(faults);
    EXPECT_NE(faults[0].find(given.fault), std::string::npos) << faults[0];
    EXPECT_TRUE(starts_with(faults[0], given.path + ":1: ")) << faults[0];
  }
}

INSTANTIATE_TEST_SUITE_P(Arrows, IncludeRule, testing::Values(
    Line{"geometry/base/a.h", "#include \"geometry/base/types.h\"", ""},
    Line{"geometry/base/a.h", "#include \"geometry/mesh/tri_mesh.h\"", "climbs"},
    Line{"geometry/mesh/a.cpp", "#include \"geometry/terrain/terrain.h\"", ""},
    Line{"geometry/mesh/a.cpp", "#include \"flow/sph/kernel.h\"", "climbs"},
    Line{"geometry/mesh/a.cpp", "#include \"skin/write/write_mesh.h\"", "climbs"},
    Line{"flow/sph/a.cpp", "#include \"geometry/collide/contact.h\"", ""},
    Line{"flow/sph/a.cpp", "#include \"flow/sph/kernel.h\"", ""},
    Line{"flow/sph/a.cpp", "#include \"flow/integrate/scheme.h\"", ""},
    Line{"flow/sph/a.cpp", "#include \"flow/springs/net.h\"", "climbs"},
    Line{"flow/springs/a.cpp", "#include \"flow/sph/kernel.h\"", "climbs"},
    Line{"flow/sph/a.cpp", "#include \"flow/scene/parameters.h\"", "climbs"},
    Line{"flow/sph/a.cpp", "#include \"flow/effects/lava.h\"", "climbs"},
    Line{"flow/spherical/a.cpp", "#include \"flow/sph/kernel.h\"", "climbs"},
    Line{"flow/integrate/a.h", "#include \"flow/sph/kernel.h\"", "climbs"},
    Line{"flow/scene/a.cpp", "#include \"flow/sph/kernel.h\"", "climbs"},
    Line{"flow/scene/a.cpp", "#include \"flow/effects/lava.h\"", "climbs"},
    Line{"flow/effects/a.cpp", "#include \"flow/sph/kernel.h\"", ""},
    Line{"flow/effects/a.cpp", "#include \"flow/scene/parameters.h\"", ""},
    Line{"flow/effects/a.cpp", "#include \"skin/surface/level_set.h\"", "climbs"}));

INSTANTIATE_TEST_SUITE_P(AboveFlow, IncludeRule, testing::Values(
    Line{"skin/surface/a.cpp", "#include \"geometry/mesh/points.h\"", ""},
    Line{"skin/surface/a.cpp", "#include \"flow/sph/state.h\"", "climbs"},
    Line{"skin/surface/a.cpp", "#include \"flow/scene/node.h\"", "climbs"},
    Line{"skin/surface/a.cpp", "#include \"skin/scene/skin_settings.h\"", "speaks to scenes"},
    Line{"skin/scene/a.cpp", "#include \"flow/scene/parameters.h\"", ""},
    Line{"skin/scene/a.cpp", "#include \"skin/surface/level_set.h\"", ""},
    Line{"skin/scene/a.cpp", "#include \"flow/sph/state.h\"", "climbs"},
    Line{"skin/write/a.cpp", "#include \"importers/mesh/import_mesh.h\"", "climbs"},
    Line{"importers/scene/a.cpp", "#include \"flow/scene/node.h\"", ""},
    Line{"importers/info.cpp", "#include \"flow/scene/node.h\"", ""},
    Line{"importers/info.cpp", "#include \"importers/scene/scene_file.h\"", ""},
    Line{"importers/mesh/a.cpp", "#include \"importers/scene/scene_file.h\"", "speaks to scenes"},
    Line{"importers/mesh/a.cpp", "#include \"flow/scene/node.h\"", "climbs"},
    Line{"importers/mesh/a.cpp", "#include \"skin/write/write_mesh.h\"", "climbs"},
    Line{"samples/effuse/run.cpp", "#include \"skin/scene/skin_settings.h\"", ""},
    Line{"samples/effuse/run.cpp", "#include \"flow/effects/lava.h\"", ""},
    Line{"samples/effuse/run.cpp", "#include \"tests/helpers.h\"", "climbs"},
    Line{"tests/skin/a_test.cpp", "#include \"importers/mesh/import_mesh.h\"", ""}));

INSTANTIATE_TEST_SUITE_P(Packages, IncludeRule, testing::Values(
    Line{"geometry/terrain/a.cpp", "#include <CGAL/AABB_tree.h>", ""},
    Line{"geometry/terrain/a.h", "#include <CGAL/AABB_tree.h>", "belongs into the .cpp"},
    Line{"geometry/terrain/tree_internal.h", "#include <CGAL/AABB_tree.h>", ""},
    Line{"flow/sph/a.cpp", "#include <CGAL/AABB_tree.h>", "lives in geometry"},
    Line{"flow/sph/a.cpp", "#  include <fcl/fcl.h>", "lives in geometry"},
    Line{"flow/sph/a.cpp", "#include <tbb/parallel_for.h>", "lives in geometry/base"},
    Line{"geometry/base/parallel.cpp", "#include <tbb/parallel_for.h>", ""},
    Line{"skin/surface/a.cpp", "#include <openvdb/openvdb.h>", ""},
    Line{"geometry/query/a.cpp", "#include <openvdb/openvdb.h>", ""},
    Line{"geometry/mesh/a.cpp", "#include <openvdb/openvdb.h>", "lives in skin"},
    Line{"skin/preview/a.cpp", "#include <embree3/rtcore.h>", ""},
    Line{"samples/effuse/a.cpp", "#include <openvdb/openvdb.h>", "lives in skin"},
    Line{"importers/mesh/a.cpp", "#include <assimp/Importer.hpp>", ""},
    Line{"skin/write/a.cpp", "#include <assimp/Exporter.hpp>", "lives in importers"},
    Line{"importers/scene/a.h", "#include <toml++/toml.h>", "belongs into the .cpp"},
    Line{"importers/terrain/a.cpp", "#include <gdal_priv.h>", ""},
    Line{"flow/sph/a.h", "#include <fmt/format.h>", "belongs into the .cpp"},
    Line{"flow/sph/a.h", "#include <Eigen/Dense>", ""},
    Line{"flow/sph/a.h", "#include <vector>", ""},
    Line{"flow/sph/a.h", "#include <unistd.h>", "system header"},
    Line{"flow/sph/a.cpp", "#include <unistd.h>", ""},
    Line{"flow/sph/a.cpp", "#include <spdlog/spdlog.h>", "without a home"},
    Line{"tests/skin/a_test.cpp", "#include <assimp/Importer.hpp>", ""}));

INSTANTIATE_TEST_SUITE_P(Writing, IncludeRule, testing::Values(
    Line{"flow/sph/a.cpp", "#include \"kernel.h\"", "from the repository's root"},
    Line{"flow/sph/a.cpp", "#include \"../sph/kernel.h\"", "climbs"},
    Line{"tests/skin/a_test.cpp", "#include \"gone/a.h\"", "no such file"},
    Line{"flow/sph/a.cpp", "#include \"flow/sph/kernel.cpp\"", "only headers"},
    Line{"flow/sph/a.cpp", "#include FLOW_HEADER", "macro"},
    Line{"flow/sph/a.cpp", "#include \"flow/sph/grid_internal.h\"", ""},
    Line{"flow/sph/a.h", "#include \"flow/sph/grid_internal.h\"", "public header"},
    Line{"flow/sph/a.cpp", "#include \"geometry/terrain/tree_internal.h\"", "internal to geometry"},
    Line{"flow/sph/a.cpp", "  // #include \"skin/surface/level_set.h\"", ""},
    Line{"flow/sph/a.cpp", "const char* line = \"#include <CGAL/Kernel.h>\";", ""}));

TEST(IncludeReader, CountsLinesAndSeesConditionalOnes) {
  const auto found = includes_of("#pragma once\n\n#if 0\n  #include <CGAL/Kernel.h>  // why\n#endif\n#include\t\"a/b.h\"\r\n");
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].line, 4);
  EXPECT_EQ(found[0].name, "CGAL/Kernel.h");
  EXPECT_FALSE(found[0].quoted);
  EXPECT_EQ(found[1].line, 6);
  EXPECT_EQ(found[1].name, "a/b.h");
  EXPECT_TRUE(found[1].quoted);
}

TEST(CircleRule, FindsACircleOfThreeAndLeavesADiamondAlone) {
  EXPECT_TRUE(circles({{"a.h", "#include \"b.h\"\n#include \"c.h\""}, {"b.h", "#include \"d.h\""}, {"c.h", "#include \"d.h\""}, {"d.h", ""}}).empty());
  const Faults found = circles({{"a.h", "#include \"b.h\""}, {"b.h", "#include \"c.h\""}, {"c.h", "#include \"a.h\""}});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0], "a.h -> b.h -> c.h -> a.h");
}

TEST(TypeRule, FindsTheSameNameInOneNamespaceOnly) {
  const std::string front = "namespace effuse::skin {\n";
  const std::string back = "}  // namespace effuse::skin\n";
  const std::string map = front + "struct Raster {\n};\n" + back;
  const std::string field = front + "struct Other;\nclass Raster final : public Base {\n  struct Part {\n" + back;
  EXPECT_EQ(types_defined_twice({{"skin/a.h", map}, {"skin/b.h", field}}),
            (Faults{"skin/b.h:3: effuse::skin::Raster is defined in skin/a.h:2 as well"}));
  EXPECT_EQ(types_defined_twice({{"skin/a.h", front + "template <class T> struct Raster {\n"}, {"skin/b.h", front + "enum class Raster : int {\n"}}).size(), 1u);
  const std::string hidden = front + "namespace {\nstruct Raster {\n}  // namespace\n" + back;
  const std::string elsewhere = "namespace effuse::flow {\nstruct Raster {\n}  // namespace effuse::flow\n";
  EXPECT_TRUE(types_defined_twice({{"skin/a.h", map}, {"skin/b.cpp", hidden}, {"flow/c.h", elsewhere}, {"skin/d.h", front + "struct Raster;\n" + back}}).empty());
  EXPECT_EQ(types_of(hidden + field).size(), 1u) << "a namespace that ended is left";
}

TEST(TopLevelRule, FindsWhatIsMissingAndWhatIsTooMuch) {
  std::vector<std::string> names{"CMakeLists.txt", "CMakePresets.json", "LICENSE", "README.md", "geometry", "flow", "skin", "importers", "tests", "samples", ".git", "build"};
  EXPECT_TRUE(top_level_faults(names).empty()) << lines(top_level_faults(names));
  names.push_back("docs");
  EXPECT_EQ(top_level_faults(names).size(), 1u);
  names.front() = "Makefile";
  EXPECT_EQ(top_level_faults(names).size(), 3u);
}

TEST(TextRule, FindsOwnPathsNotesAndLengthAndNothingElse) {
  const auto count = [](const std::string& text) { return text_faults("flow/a.cpp", text).size(); };
  EXPECT_EQ(count(std::string("open(\"/ho") + "me/ann/x.asc\");"), 1u);
  EXPECT_EQ(count(std::string("cd /wo") + "rk/main"), 1u);
  EXPECT_EQ(count(std::string("/ro") + "ot/data"), 1u);
  EXPECT_EQ(count(std::string("// TO") + "DO later"), 1u);
  EXPECT_EQ(count("path = dir / \"home/frames\";  // see flow/home/x.h, /usr/lib, http://example.org/home/x"), 0u);
  EXPECT_EQ(count(std::string(kMostLines - 1, '\n')), 0u);
  EXPECT_EQ(count(std::string(kMostLines, '\n')), 1u);
  EXPECT_EQ(text_faults("flow/a.h", "int x;").size(), 1u);
}

}  // namespace
}  // namespace effuse::architecture
