// Grids whose numbers are numbers and yet no ground: places off every planet, bytes in the wrong order, names that lie.

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "importers/mesh/import_mesh.h"
#include "importers/terrain/import_dem.h"
#include "importers/terrain/import_terrain.h"
#include "importers/terrain/spatial_reference.h"
#include "tests/importers/terrain/made_rasters.h"
#include "tests/importers/test_files.h"

namespace effuse::importers {
namespace {

namespace fs = std::filesystem;

std::string grid_text(const std::string& corner, const std::string& cell) {
  return fmt::format("ncols 3\nnrows 3\nxllcorner {0}\nyllcorner {0}\ncellsize {1}\n1 2 3\n2 3 4\n3 4 6\n", corner, cell);
}

DemGrid grid_of(const fs::path& file, const DemOptions& options = {}) { return import_dem({file}, options); }
std::string refused(const fs::path& file, const DemOptions& options = {}) {
  return refusal([&] { import_dem({file}, options); });
}
std::string notes_of(const DemGrid& grid) { return fmt::format("{}", fmt::join(grid.notes, "\n")); }

TEST(HostileGrids, NoPlaceOnAPlanetIsRefused) {
  const TestFolder folder;
  for (const auto& [corner, cell] : {std::pair{"0", "1e300"}, {"0", "1e12"}, {"1e15", "10"}, {"-1e17", "10"}, {"1e300", "1e290"}}) {
    const std::string why = refused(folder.write("a.asc", grid_text(corner, cell)));
    EXPECT_TRUE(contains(why, "a.asc") && contains(why, "no place on a planet")) << corner << " " << cell << ": " << why;
  }
  for (const auto& [corner, cell] : {std::pair{"5000", "1e-300"}, {"1e6", "1e-9"}, {"100000000", "1e-5"}}) {
    const std::string why = refused(folder.write("a.asc", grid_text(corner, cell)));
    EXPECT_TRUE(contains(why, "a.asc") && contains(why, "told apart")) << corner << " " << cell << ": " << why;
  }
  MadeRaster made = sample_raster();
  made.transform = {1e300, 1, 0, 0, 0, -1};
  EXPECT_TRUE(contains(refused(make_raster(folder.path() / "far.tif", "GTiff", made)), "no place on a planet"));
  // The largest and the smallest there are: other planets' maps, a model on a table at map coordinates.
  EXPECT_EQ(grid_of(folder.write("a.asc", grid_text("-300000000", "100000"))).spacing.x(), 1e5);
  EXPECT_EQ(grid_of(folder.write("a.asc", grid_text("6479491.22", "0.001"))).spacing.x(), 1e-3);
}

TEST(HostileGrids, ATinyGridAtTheOriginIsNotTakenForDegreesWhereItWouldBeAWallThere) {
  const TestFolder folder;
  // 5 m on 0.3 m would be in degrees what 5 m on 3 um is in metres: neither is likelier, and metres are the standard.
  const DemGrid tiny = grid_of(folder.write("a.asc", grid_text("0", "1e-6")));
  EXPECT_EQ(tiny.spacing.x(), 1e-6);
  EXPECT_FALSE(contains(notes_of(tiny), "degrees"));
  // 5 m on 300 m are a slope, on 3 mm a wall.
  EXPECT_TRUE(contains(notes_of(grid_of(folder.write("a.asc", grid_text("0", "0.001")))), "look like degrees"));
}

TEST(HostileGrids, BytesInTheOtherOrderAreRefused) {
  const TestFolder folder;
  std::string bytes;
  for (int k = 0; k < 16; ++k) {
    const float z = static_cast<float>(k);  // whole numbers have zeros at their end: next to nothing the other way round
    const char* from = reinterpret_cast<const char*>(&z);
    bytes.append(from, 4);
  }
  const fs::path flt = folder.write("a.flt", bytes);
  const auto header = [&](const char* order) { folder.write("a.hdr", fmt::format("ncols 4\nnrows 4\nxllcorner 0\nyllcorner 0\ncellsize 10\nbyteorder {}\n", order)); };
  header("LSBFIRST");
  EXPECT_EQ(grid_of(flt).z.back(), 3);
  header("MSBFIRST");
  EXPECT_TRUE(contains(refused(flt), "byteorder")) << refused(flt);
  // Flat ground at height zero is ground.
  folder.write("zero.hdr", "ncols 4\nnrows 4\nxllcorner 0\nyllcorner 0\ncellsize 10\nbyteorder MSBFIRST\n");
  EXPECT_EQ(grid_of(folder.write("zero.flt", std::string(64, '\0'))).z.front(), 0);
}

TEST(HostileGrids, ATiffIsReadUnderAnyName) {
  const TestFolder folder;
  const fs::path tif = make_raster(folder.path() / "a.tif", "GTiff", sample_raster());
  for (const char* name : {"b.dat", "b.xyz", "b.obj", "b", "b.txt", "b.TIFF", "b.bin"}) {
    fs::copy_file(tif, folder.path() / name);
    const TerrainImport import = import_terrain(folder.path() / name);
    ASSERT_TRUE(import.terrain.height_field()) << name;
    EXPECT_EQ(import.terrain.height_field()->nx(), 23) << name;
  }
}

TEST(HostileGrids, AMaskBesideAFileIsNotOpenedWhenItNamesOtherFiles) {
  const TestFolder folder;
  const fs::path tif = make_raster(folder.path() / "a.tif", "GTiff", sample_raster());
  const fs::path other = make_raster(folder.path() / "other.tif", "GTiff", sample_raster());
  const std::string band = "<VRTRasterBand dataType=\"Byte\" band=\"1\"><SimpleSource><SourceFilename relativeToVRT=\"1\">none.tif</SourceFilename><SourceBand>1</SourceBand></SimpleSource></VRTRasterBand>";
  folder.write("a.tif.msk", "<VRTDataset rasterXSize=\"23\" rasterYSize=\"17\"><Metadata><MDI key=\"INTERNAL_MASK_FLAGS_1\">2</MDI></Metadata>" + band + "</VRTDataset>");
  const DemGrid masked = grid_of(tif), plain = grid_of(other);
  EXPECT_EQ(masked.nodata, 0u) << "the mask says that there is nothing";
  EXPECT_EQ(masked.z, plain.z);
}

TEST(HostileGrids, AVastFileOfNothingIsRefusedByItsBeginning) {
  const TestFolder folder;
  const fs::path vast = folder.write("a.asc", "no grid at all\n");
  fs::resize_file(vast, std::uintmax_t{3} << 30);  // takes no room on the disk
  const auto start = std::chrono::steady_clock::now();
  DemOptions options;
  options.limits.apart = true;
  options.limits.bytes = 500'000'000;
  EXPECT_TRUE(contains(refused(vast, options), "begins with")) << refused(vast, options);
  EXPECT_LT(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(), 5);
}

TEST(HostileGrids, AFileThatMayNotBeReadIsNotCalledNoRaster) {
  const TestFolder folder;
  const fs::path tif = make_raster(folder.path() / "a.tif", "GTiff", sample_raster());
  fs::permissions(tif, fs::perms::none);
  fs::permissions(folder.path(), fs::perms::all);
  // In a child that is nobody, since root may read everything.
  const pid_t pid = ::fork();
  if (pid == 0) {
    if (::geteuid() == 0 && ::setresuid(65534, 65534, 65534) != 0) ::_exit(2);
    ::_exit(contains(refused(tif), "Permission denied") ? 0 : 1);
  }
  int status = -1;
  ::waitpid(pid, &status, 0);
  EXPECT_EQ(status, 0);
}

TEST(HostileGrids, TheHeaderOfARawGridStandsForIt) {
  const TestFolder folder;
  folder.write("a.hdr", "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 10\nbyteorder LSBFIRST\n");
  folder.write("a.flt", std::string(16, '\0'));
  EXPECT_EQ(grid_of(folder.path() / "a.hdr").nx, 2);
}

TEST(HostileGrids, WhatIsNoGridIsToldWhatItIs) {
  const TestFolder folder;
  const auto why = [&](const std::string& name, const std::string& text) { return refusal([&] { import_terrain(folder.write(name, text)); }); };
  EXPECT_TRUE(contains(why("a.xyz", "hello\n"), "places, x y z")) << why("a.xyz", "hello\n");
  EXPECT_TRUE(contains(why("a.prj", "PROJCS[\"NZGD49\",GEOGCS[\"x\"]]"), "coordinate system")) << why("a.prj", "PROJCS[\"NZGD49\",GEOGCS[\"x\"]]");
  const std::string tile = refusal([&] { import_terrain(folder.write("N99W085.hgt", std::string(1201 * 1201 * 2, '\1'))); });
  EXPECT_TRUE(contains(tile, "N99W085.hgt") && contains(tile, "degrees")) << tile;
}

TEST(HostileGrids, ABlankCoordinateSystemIsNone) {
  const TestFolder folder;
  const fs::path tif = make_raster(folder.path() / "a.tif", "GTiff", sample_raster());
  for (const char* blank : {" ", "   ", "\t\n"}) {
    DemOptions options;
    options.crs = blank;
    EXPECT_TRUE(contains(refused(tif, options), "crs")) << refused(tif, options);
    options = {};
    options.file_crs = blank;
    EXPECT_TRUE(contains(refused(tif, options), "file_crs")) << refused(tif, options);
  }
}

TEST(Stretch, OfWebMercatorIsOneOverTheCosineAndOfUtmItsScale) {
  const Crs mercator = read_crs("EPSG:3857", ""), utm = read_crs("EPSG:32632", ""), degrees = read_crs("EPSG:4326", "");
  for (const double latitude : {0.0, 30.0, 48.0, -60.0}) {
    const Vec2 stretch = stretch_at(mercator, CrsTransform(degrees, mercator)(Vec2(9, latitude)));
    // A sphere's mercator of an ellipsoid's latitudes: sec(latitude) east times a / N, and times a / M north.
    const double s = std::sin(latitude * kPi / 180), w = 1 - 0.00669437999014 * s * s;
    EXPECT_NEAR(stretch.x(), std::sqrt(w) / std::cos(latitude * kPi / 180), 1e-6) << latitude;
    EXPECT_NEAR(stretch.y(), w * std::sqrt(w) / (1 - 0.00669437999014) / std::cos(latitude * kPi / 180), 1e-6) << latitude;
  }
  for (const double north : {100e3, 5000e3}) {
    const Vec2 middle = stretch_at(utm, Vec2(500e3, north));
    EXPECT_NEAR(middle.x(), 0.9996, 1e-6);
    EXPECT_NEAR(middle.y(), 0.9996, 1e-6);
  }
}

TEST(Stretch, IsToldWhereAMapsMetresAreNone) {
  const TestFolder folder;
  MadeRaster made = sample_raster();
  made.crs = "EPSG:3857";
  made.transform = {1001875, 10, 0, 6106855, 0, -10};  // 9 E, 48 N
  const std::string stretched = notes_of(grid_of(make_raster(folder.path() / "web.tif", "GTiff", made)));
  EXPECT_TRUE(contains(stretched, "1.49 times") && contains(stretched, "EPSG:32632")) << stretched;
  made.crs = "EPSG:32633";
  made.transform = {500000, 10, 0, 4000000, 0, -10};
  EXPECT_FALSE(contains(notes_of(grid_of(make_raster(folder.path() / "utm.tif", "GTiff", made))), "lengths"));
}

TEST(HostileMeshes, NothingOnAPlanetIsRefused) {
  const TestFolder folder;
  for (const char* size : {"1e37", "1e18", "1e10", "1e-30", "1e-7"}) {
    const std::string why = refusal([&] { import_mesh(folder.write("a.obj", fmt::format("v 0 0 0\nv {0} 0 0\nv 0 {0} 0\nf 1 2 3\n", size))); });
    EXPECT_TRUE(contains(why, "a.obj") && contains(why, "planet")) << size << ": " << why;
  }
  // In millimetres a map's northings are large.
  MeshOptions millimetres;
  millimetres.metres_per_unit = 1e-3;
  const fs::path map = folder.write("mm.obj", "v 2667400000 6479491220 0\nv 2667401000 6479491220 0\nv 2667400000 6479492220 0\nf 1 2 3\n");
  EXPECT_NEAR(import_mesh(map, millimetres).mesh.positions.front().y(), 6479491.220, 1e-6);
  EXPECT_NE(refusal([&] { import_mesh(map); }), "");
  EXPECT_NE(refusal([&] { import_mesh(folder.write("own.obj", "# effuse, metres, z up\n# origin: 1e300 0 0\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")); }), "");
}

}  // namespace
}  // namespace effuse::importers
