#include "importers/terrain/import_terrain.h"

#include <assimp/scene.h>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <assimp/Importer.hpp>
#include <cmath>

#include "importers/terrain/dem_importer.h"
#include "importers/terrain/esri_ascii.h"
#include "tests/importers/test_files.h"

namespace effuse::importers {
namespace {

/// North row first, as files have it: heights tell row and column apart.
const std::string kSmall = "ncols 3\nnrows 2\nxllcorner 100\nyllcorner 200\ncellsize 10\nNODATA_value -9999\n1 2 3\n4 5 6\n";

std::string told(const std::string& text) {
  return refusal([&] { parse_esri_ascii(text, "test.asc"); });
}

std::string header(const std::string& rest = "") { return "ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n" + rest; }

std::string notes_of(const std::vector<std::string>& notes) { return fmt::format("{}", fmt::join(notes, "\n")); }

TEST(EsriAscii, NorthRowIsFirstInTheFileAndLastInTheGrid) {
  const DemGrid grid = parse_esri_ascii(kSmall, "test.asc");
  EXPECT_EQ(grid.nx, 3);
  EXPECT_EQ(grid.ny, 2);
  EXPECT_EQ(grid.z, (std::vector<Real>{4, 5, 6, 1, 2, 3}));
}

TEST(EsriAscii, PostsStandOnTheCentresOfCellsWhicheverWayTheHeaderSaysIt) {
  EXPECT_EQ(parse_esri_ascii(kSmall, "t").corner, Vec2(105, 205));
  EXPECT_EQ(parse_esri_ascii("ncols 3\nnrows 2\nxllcenter 105\nyllcenter 205\ncellsize 10\n1 2 3 4 5 6", "t").corner, Vec2(105, 205));
  const DemGrid oblong = parse_esri_ascii("NCOLS 3\nNROWS 2\nXLLCORNER 100\nYLLCENTER 205\nDX 10\nDY 20\n1 2 3 4 5 6", "t");
  EXPECT_EQ(oblong.corner, Vec2(105, 205));
  EXPECT_EQ(oblong.spacing, Vec2(10, 20));
}

TEST(EsriAscii, ItsDialectsAllGiveTheSameGrid) {
  const DemGrid plain = parse_esri_ascii(kSmall, "t");
  std::string windows, old_mac;
  for (char c : kSmall) {
    windows += c == '\n' ? std::string("\r\n") : std::string(1, c);
    old_mac += c == '\n' ? '\r' : c;
  }
  for (const std::string& dialect :
       {windows, old_mac, "\xEF\xBB\xBF" + kSmall, "\n \t" + kSmall + "\n\n",
        std::string("cellsize 1e1\nNODATA -9999\nyllcorner +200.0\nxllcorner 100.000\nnrows 2.0\nncols 3\n 1\n2 3 4.0\n5\t+6e0"),
        std::string("NCOLS\t3\nNROWS 2\nXLLCORNER 100 YLLCORNER 200 CELLSIZE 10\n1 2 3\n4 5 6\n")}) {
    const DemGrid grid = parse_esri_ascii(dialect, "t");
    EXPECT_EQ(grid.z, plain.z) << dialect;
    EXPECT_EQ(grid.corner, plain.corner) << dialect;
    EXPECT_EQ(grid.spacing, plain.spacing) << dialect;
  }
}

TEST(EsriAscii, NodataAndNanAreHolesAndCounted) {
  const DemGrid grid = parse_esri_ascii("ncols 3\nnrows 3\ncellsize 1\nnodata_value -1\n-1 -1.0 nan\n4 5 6\n7 8 9", "t");
  EXPECT_EQ(grid.nodata, 3u);
  for (int i : {6, 7, 8}) EXPECT_TRUE(std::isnan(grid.z[static_cast<std::size_t>(i)]));
  EXPECT_TRUE(contains(notes_of(grid.notes), "3 of 9 posts")) << notes_of(grid.notes);
}

TEST(EsriAscii, MissingDataThatTheHeaderDoesNotDeclareIsAHoleWithANote) {
  const std::string rest = "ncols 3\nnrows 3\nxllcorner 0\nyllcorner 0\ncellsize 1\n";
  for (const char* mark : {"-9999", "-32768", "-3.4028234663852886e+38", "1e31"}) {
    const DemGrid grid = parse_esri_ascii(rest + mark + " 2 3\n4 5 6\n7 8 9", "t");
    EXPECT_EQ(grid.nodata, 1u) << mark;
    EXPECT_TRUE(contains(notes_of(grid.notes), "though the header does not say so")) << mark;
  }
}

TEST(EsriAscii, DecimalCommasAreReadWithANoteUnlessThereArePointsToo) {
  const DemGrid grid = parse_esri_ascii("ncols 2\nnrows 2\nxllcorner 0,5\nyllcorner 0\ncellsize 10,0\n1,25 2\n3 -4,5e1\n", "t");
  EXPECT_EQ(grid.z, (std::vector<Real>{3, -45, 1.25, 2}));
  EXPECT_EQ(grid.corner, Vec2(5.5, 5));
  EXPECT_TRUE(contains(notes_of(grid.notes), "decimal commas"));
}

TEST(EsriAscii, ANodataValueMayStandAtTheEnd) {
  const DemGrid grid = parse_esri_ascii("ncols 3\nnrows 2\ncellsize 1\n0 2 3\n4 5 6\nNODATA_value 0\n", "t");
  EXPECT_EQ(grid.nodata, 1u);
  EXPECT_TRUE(std::isnan(grid.z[3]));
  EXPECT_TRUE(contains(notes_of(grid.notes), "at the end"));
}

TEST(EsriAscii, EachFaultNamesItsLineAndWhatWasFound) {
  const std::vector<std::pair<std::string, std::vector<std::string>>> cases = {
      {header("1 2 3\n4 0,5,5 6"), {"test.asc:7:3", "'0,5,5'", "comma"}},
      {header("1.5 2 3\n4 0,5 6"), {"test.asc:7:3", "'0,5'", "thousands"}},
      {header("1 2 3\n4 x5 6"), {"test.asc:7:3", "'x5'"}},
      {header("1 2 3\n4 5.5.5 6"), {"test.asc:7:3", "'5.5.5'"}},
      {header("1 2 3\n4 inf 6"), {"test.asc:7:3", "'inf'"}},
      {header("1 2 3\n4 1e999 6"), {"test.asc:7:3"}},
      {header("1 2 3\n4 1e6 6"), {"test.asc:7:3", "1e6", "NODATA_value"}},
      {header("1 2 3\n4 5"), {"5 of 6 heights"}},
      {header("1 2 3\n4 5 6\n\n7\n"), {"test.asc:9:1", "one too many", "'7'"}},
      {header(""), {"6 heights are missing"}},
      {"ncols 3\nnrows 2\n1 2 3 4 5 6", {"lacks cellsize"}},
      {"1 2 3\n4 5 6", {"lacks ncols, nrows, cellsize"}},
      {"ncols 3\nnrows 2\nxllcorner 0\ncellsize 1\n1 2 3 4 5 6", {"lacks yllcorner"}},
      {"ncols 3\nnrows 2\ncellsize 1,500.5\n1 2 3 4 5 6", {"test.asc:3:10", "comma"}},
      {"ncols 3\nnrows 2\ncellsice 1\n1 2 3 4 5 6", {"test.asc:3:1", "did you mean 'cellsize'?"}},
      {"ncols 3\nncols 3\nnrows 2\ncellsize 1\n1 2 3 4 5 6", {"test.asc:2:1", "twice"}},
      {"ncols 3\nnrows 2\ncellsize 0\n1 2 3 4 5 6", {"test.asc:3:10", "above 0"}},
      {"ncols 3\nnrows 2\ncellsize nan\n1 2 3 4 5 6", {"test.asc:3:10"}},
      {"ncols 3\nnrows -2\ncellsize 1\n1 2 3 4 5 6", {"test.asc:2:7", "-2"}},
      {"ncols 2.5\nnrows 2\ncellsize 1\n1 2 3 4 5 6", {"test.asc:1:7", "2.5"}},
      {"ncols\nnrows 2\ncellsize 1\n1 2 3 4 5 6", {"test.asc:2:1", "'nrows'"}},
      {"ncols 3\nnrows 2\ncellsize 1e-300\nxllcorner 1e300\nyllcorner 0\n1 2 3 4 5 6", {"told apart"}},
      {"ncols 3\nnrows 2\nxllcorner 0\nxllcenter 0\nyllcorner 0\ncellsize 1\n1 2 3 4 5 6", {"both xllcorner and xllcenter"}},
      {"ncols 1\nnrows 1\nxllcorner 0\nyllcorner 0\ncellsize 1\n5", {"1 x 1", "at least 2 x 2"}},
      {header("nan nan nan nan nan nan"), {"no heights"}},
      {header("1 nan 3\nnan 5 6"), {"no cell has four heights"}},
      {"<html>404</html>", {"test.asc:1:1", "not an ESRI ASCII grid"}},
      {"  \n\n ", {"nothing but blanks"}},
  };
  for (const auto& [text, parts] : cases) {
    const std::string message = told(text);
    EXPECT_FALSE(message.empty()) << "taken: " << text;
    for (const std::string& part : parts) EXPECT_TRUE(contains(message, part)) << message << "\n  lacks: " << part << "\n  for: " << text;
  }
}

TEST(EsriAscii, AHeaderThatPromisesTheEarthDoesNotGetTheMemory) {
  const std::string message = told("ncols 2000000000\nnrows 2000000000\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2 3\n");
  EXPECT_TRUE(contains(message, "4000000000000000000")) << message;
}

TEST(ImportTerrain, MaungaWhauStandsWhereItsSourceSays) {
  const TerrainImport import = import_terrain(EFFUSE_SOURCE_DIR "/samples/scenes/maunga-whau.asc");
  const geometry::Terrain& terrain = import.terrain;
  ASSERT_TRUE(terrain.is_height_field());
  EXPECT_EQ(terrain.georeference().origin, Vec3(2667405, 6478705, 0));
  EXPECT_TRUE(contains(terrain.georeference().crs, "New_Zealand_Map_Grid"));
  EXPECT_TRUE(contains(notes_of(import.notes), "EPSG:27200")) << notes_of(import.notes);
  const geometry::HeightField& field = *terrain.height_field();
  EXPECT_EQ(field.corner(), Vec2(0, 0));
  EXPECT_EQ(field.nx(), 61);
  EXPECT_EQ(field.ny(), 87);
  EXPECT_EQ(field.bounds().min().z(), 94);
  EXPECT_EQ(field.bounds().max().z(), 195);
  // The crater's floor at 2667675 E 6478993 N (mean of its lowest posts): north is north, east is east.
  EXPECT_NEAR(field.height(2667675 - 2667405, 6478993 - 6478705), 148, 2);
  EXPECT_EQ(field.post(0, 86), 94) << "the first height of the file is the north-west corner";
}

TEST(ImportTerrain, TheGridGoesThroughAssimpAsSceneMeshAndDoubleOrigin) {
  const TestFolder folder;
  const std::filesystem::path file = folder.write("utm.txt",
                                                  "ncols 3\nnrows 3\nxllcorner 501234.25\nyllcorner 4181234.125\ncellsize 2.5\n"
                                                  "7 8 9\n4 5 nan\n1 2 3\n");
  const auto result = std::make_shared<DemResult>();
  Assimp::Importer importer;
  importer.RegisterLoader(make_dem_importer(result));
  const aiScene* scene = importer.ReadFile(file.string(), 0);
  ASSERT_NE(scene, nullptr) << importer.GetErrorString();
  ASSERT_EQ(scene->mNumMeshes, 1u);
  EXPECT_EQ(scene->mMeshes[0]->mNumFaces, 4u) << "two of the four cells touch the hole";
  EXPECT_EQ(scene->mMeshes[0]->mNumVertices, 6u);
  double x = 0, y = 0;
  ASSERT_TRUE(scene->mMetaData->Get("origin_x", x));
  ASSERT_TRUE(scene->mMetaData->Get("origin_y", y));
  EXPECT_EQ(x, 501235.5);
  EXPECT_EQ(y, 4181235.375);
  EXPECT_EQ(result->grid.corner, Vec2(x, y));
}

TEST(ImportTerrain, AFileThatCannotBeTerrainGivesOneClearSentence) {
  const TestFolder folder;
  const auto sentence = [&](const std::string& name, const std::string& text) {
    const std::filesystem::path file = text == "absent" ? folder.path() / name : folder.write(name, text);
    const std::string message = refusal([&] { import_terrain(file); });
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    EXPECT_TRUE(contains(message, name)) << message;
    return message;
  };
  EXPECT_TRUE(contains(sentence("missing.asc", "absent"), "no such file"));
  EXPECT_TRUE(contains(sentence("empty.asc", ""), "empty"));
  EXPECT_TRUE(contains(sentence("cut.asc", kSmall.substr(0, kSmall.size() - 4)), "4 of 6 heights"));
  EXPECT_TRUE(contains(sentence("nan.asc", header("nan nan nan nan nan nan")), "no heights"));
  EXPECT_TRUE(contains(sentence("one.asc", "ncols 1\nnrows 1\nxllcorner 0\nyllcorner 0\ncellsize 1\n5\n"), "at least 2 x 2"));
  EXPECT_TRUE(contains(sentence("picture.tif", "II*"), "raster"));
  EXPECT_TRUE(contains(sentence("what.xyzzy", "abc"), "no reader"));
  EXPECT_TRUE(contains(sentence("none.obj", "v 0 0 0\n"), "no triangles"));
  EXPECT_TRUE(contains(refusal([&] { import_terrain(folder.path()); }), "folder"));
}

TEST(ImportTerrain, AGridUnderAnotherNameIsKnownByItsHeader) {
  const TestFolder folder;
  EXPECT_EQ(import_terrain(folder.write("grid.txt", kSmall)).terrain.height_field()->nx(), 3);
  EXPECT_EQ(import_terrain(folder.write("grid", kSmall)).terrain.height_field()->nx(), 3);
  EXPECT_EQ(import_terrain(folder.write("grid.grd", kSmall)).terrain.height_field()->nx(), 3);
}

TEST(ImportTerrain, TheOriginIsWholeMetresAndNothingIsLostFarFromZero) {
  const TestFolder folder;
  const TerrainImport import = import_terrain(
      folder.write("far.asc", "ncols 2\nnrows 2\nxllcenter 501234.375\nyllcenter 4181234.8125\ncellsize 0.25\n1 2\n3 4.125\n"));
  EXPECT_EQ(import.terrain.georeference().origin, Vec3(501234, 4181234, 0));
  EXPECT_EQ(import.terrain.height_field()->corner(), Vec2(0.375, 0.8125)) << "exact: these are binary fractions";
  EXPECT_EQ(import.terrain.height_field()->post(1, 0), 4.125);
}

TEST(ImportTerrain, OptionsOverrideTheCoordinateSystem) {
  const TestFolder folder;
  folder.write("a.prj", "GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\",SPHEROID[\"WGS 84\",6378137,298.257223563]],PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433]]");
  const std::filesystem::path file = folder.write("a.asc", kSmall);
  EXPECT_TRUE(contains(refusal([&] { import_terrain(file); }), "no place")) << "there is no latitude of 205 degrees";
  TerrainImportOptions options;
  options.dem.file_crs = "EPSG:31287";
  EXPECT_TRUE(contains(import_terrain(file, options).terrain.georeference().crs, "Austria Lambert"));
}

TEST(ImportTerrain, AMeshBecomesGroundInItsOwnLocalFrame) {
  const TestFolder folder;
  const std::filesystem::path file = folder.write(
      "slope.obj",
      "v 500000.5 4000000.25 100\nv 500010.5 4000000.25 100\nv 500010.5 4000010.25 110\nv 500000.5 4000010.25 110\nf 1 2 3 4\n");
  const TerrainImport import = import_terrain(file);
  EXPECT_FALSE(import.terrain.is_height_field());
  EXPECT_EQ(import.terrain.georeference().origin, Vec3(500000, 4000000, 0));
  const auto height = import.terrain.height(5.5, 5.25);
  ASSERT_TRUE(height.has_value());
  EXPECT_NEAR(*height, 105, 1e-6);
}

TEST(ImportTerrain, AnOpenMeshThatFacesDownIsTurnedOverWithANote) {
  const TestFolder folder;
  const std::string square = "v 0 0 1\nv 10 0 1\nv 10 10 1\nv 0 10 1\n";
  const TerrainImport up = import_terrain(folder.write("up.obj", square + "f 1 2 3 4\n"));
  const TerrainImport down = import_terrain(folder.write("down.obj", square + "f 4 3 2 1\n"));
  EXPECT_FALSE(contains(notes_of(up.notes), "turned over"));
  EXPECT_TRUE(contains(notes_of(down.notes), "turned over"));
  EXPECT_NEAR(down.terrain.signed_distance(Vec3(5, 5, 3)), 2, 1e-9);
}

TEST(ImportTerrain, AMeshWithYUpIsToldAndCanBeTurned) {
  const TestFolder folder;
  const std::filesystem::path file = folder.write("yup.obj", "v 0 3 0\nv 10 3 0\nv 10 3 10\nv 0 3 10\nf 4 3 2 1\n");
  EXPECT_TRUE(contains(notes_of(import_terrain(file).notes), "y may be up"));
  TerrainImportOptions options;
  options.mesh.up = UpAxis::kY;
  const TerrainImport turned = import_terrain(file, options);
  EXPECT_EQ(turned.terrain.bounds().min().z(), 3);
  EXPECT_FALSE(contains(notes_of(turned.notes), "turned over")) << notes_of(turned.notes);
}

TEST(ImportTerrainSharedData, RealGridsHaveTheFactsOfTheirSources) {
  const std::filesystem::path data = shared_data();
  if (data.empty()) GTEST_SKIP() << "no shared data on this machine (EFFUSE_SHARED_DATA)";
  const TerrainImport hit = import_terrain(data / "terrain/avaHit.asc");
  const geometry::HeightField& field = *hit.terrain.height_field();
  EXPECT_EQ(field.nx(), 526);
  EXPECT_EQ(field.ny(), 446);
  EXPECT_NEAR(field.bounds().min().z(), 1455.17, 0.005);
  EXPECT_NEAR(field.bounds().max().z(), 2604.46, 0.005);
  // xllcenter: no half cell shift. Whole metres away from 272771.421744369.
  EXPECT_EQ(hit.terrain.georeference().origin, Vec3(272771, 357502, 0));
  EXPECT_NEAR(field.corner().x(), 0.421744369, 1e-9);
  const TerrainImport kot = import_terrain(data / "terrain/avaKot.asc");
  EXPECT_NEAR(kot.terrain.height_field()->corner().x() + kot.terrain.georeference().origin.x(), 176973.437998359208 + 4.997688906601 / 2,
              1e-9);
  EXPECT_NEAR(kot.terrain.height_field()->bounds().max().z(), 2206.97, 0.005);
}

TEST(ImportTerrainSharedData, RealGroundMeshesLoad) {
  const std::filesystem::path data = shared_data();
  if (data.empty()) GTEST_SKIP() << "no shared data on this machine (EFFUSE_SHARED_DATA)";
  const TerrainImport hill = import_terrain(data / "meshes/terrain-meshes/openfoam-turbine-siting-terrain.stl");
  EXPECT_EQ(hill.terrain.mesh().positions.size(), 10800u);
  EXPECT_NEAR(hill.terrain.bounds().min().z(), 937.3, 0.01);
  EXPECT_NEAR(hill.terrain.bounds().max().z(), 1044.6, 0.05);
  TerrainImportOptions options;
  options.mesh.up = UpAxis::kY;
  const TerrainImport peaks = import_terrain(data / "meshes/terrain-meshes/three_peaks.off", options);
  EXPECT_EQ(peaks.terrain.mesh().triangles.size(), 3671u);
  EXPECT_TRUE(contains(notes_of(peaks.notes), "turned over")) << "its normals point to -y";
}

}  // namespace
}  // namespace effuse::importers
