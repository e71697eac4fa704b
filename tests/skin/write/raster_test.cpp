#include "skin/write/raster.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <bit>
#include <cmath>
#include <csignal>
#include <cstring>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/random.h"
#include "importers/terrain/esri_ascii.h"
#include "importers/terrain/import_terrain.h"

namespace effuse::skin {
namespace {

namespace fs = std::filesystem;

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
const std::string kMountEden = EFFUSE_SOURCE_DIR "/samples/scenes/maunga-whau.prj";

/// A TIFF as its specification has it, read without a word from the writer: either byte order, strips, tags of any
/// place in the file. Throws std::runtime_error on what a baseline reader would not read.
struct Tiff {
  struct Tag {
    std::uint16_t type;
    std::uint32_t count;
    std::string data;
  };
  std::map<int, Tag> tags;
  std::vector<int> order;  ///< of the tags in the directory
  std::string bytes;
  bool little = true;

  explicit Tiff(std::string all) : bytes(std::move(all)) {
    if (bytes.size() < 8) throw std::runtime_error("no header");
    little = bytes[0] == 'I';
    if (bytes.substr(0, 2) != (little ? "II" : "MM") || number(2, 2) != 42) throw std::runtime_error("not a TIFF");
    const std::uint64_t directory = number(4, 4), n = number(directory, 2);
    if (directory % 2 != 0) throw std::runtime_error("the directory is on an odd byte");
    static const std::map<int, std::uint64_t> sizes = {{1, 1}, {2, 1}, {3, 2}, {4, 4}, {5, 8}, {12, 8}};
    for (std::uint64_t k = 0; k < n; ++k) {
      const std::uint64_t at = directory + 2 + 12 * k;
      const int tag = static_cast<int>(number(at, 2));
      Tag t{static_cast<std::uint16_t>(number(at + 2, 2)), static_cast<std::uint32_t>(number(at + 4, 4)), ""};
      const std::uint64_t size = sizes.at(t.type) * t.count, value = size > 4 ? number(at + 8, 4) : at + 8;
      if (value % 2 != 0 || value + size > bytes.size()) throw std::runtime_error("a value lies outside the file or on an odd byte");
      t.data = bytes.substr(value, size);
      tags[tag] = t;
      order.push_back(tag);
    }
    if (number(directory + 2 + 12 * n, 4) != 0) throw std::runtime_error("a second image");
  }

  std::uint64_t number(std::uint64_t at, int size) const { return number(bytes, at, size); }
  std::uint64_t number(const std::string& from, std::uint64_t at, int size) const {
    std::uint64_t v = 0;
    for (int k = 0; k < size; ++k) v |= static_cast<std::uint64_t>(static_cast<unsigned char>(from.at(at + static_cast<std::uint64_t>(little ? k : size - 1 - k)))) << (8 * k);
    return v;
  }
  std::vector<double> numbers(int tag) const {
    const Tag& t = tags.at(tag);
    std::vector<double> v;
    for (std::uint64_t k = 0; k < t.count; ++k) {
      if (t.type == 3) v.push_back(static_cast<double>(number(t.data, 2 * k, 2)));
      else if (t.type == 4) v.push_back(static_cast<double>(number(t.data, 4 * k, 4)));
      else if (t.type == 12) v.push_back(std::bit_cast<double>(number(t.data, 8 * k, 8)));
      else throw std::runtime_error("not numbers");
    }
    return v;
  }
  int one(int tag) const { return static_cast<int>(numbers(tag).at(0)); }
  std::string text(int tag) const {
    const Tag& t = tags.at(tag);
    if (t.type != 2 || t.data.empty() || t.data.back() != '\0') throw std::runtime_error("not a text");
    return t.data.substr(0, t.data.size() - 1);
  }
  /// Floats, north row first.
  std::vector<float> image() const {
    if (one(258) != 32 || one(259) != 1 || one(277) != 1 || one(339) != 3) throw std::runtime_error("not one band of floats");
    const auto nx = static_cast<std::uint64_t>(one(256)), ny = static_cast<std::uint64_t>(one(257)), rows = static_cast<std::uint64_t>(one(278));
    const std::vector<double> offsets = numbers(273), counts = numbers(279);
    if (offsets.size() != (ny + rows - 1) / rows || counts.size() != offsets.size()) throw std::runtime_error("wrong number of strips");
    std::vector<float> values;
    for (std::size_t s = 0; s < offsets.size(); ++s) {
      const std::uint64_t here = std::min(rows, ny - s * rows) * nx * 4;
      if (counts[s] != static_cast<double>(here)) throw std::runtime_error("a strip of the wrong length");
      for (std::uint64_t k = 0; k < here; k += 4) values.push_back(std::bit_cast<float>(static_cast<std::uint32_t>(number(static_cast<std::uint64_t>(offsets[s]) + k, 4))));
    }
    return values;
  }
  /// Of GeoTIFF's keys: numbers as text, texts without their end.
  std::map<int, std::string> geo_keys() const {
    const std::vector<double> d = numbers(34735);
    if (d.at(0) != 1 || d.at(1) != 1 || d.size() != 4 + 4 * static_cast<std::size_t>(d.at(3))) throw std::runtime_error("no key directory");
    std::map<int, std::string> keys;
    int last = 0;
    for (std::size_t k = 4; k < d.size(); k += 4) {
      if (d[k] <= last) throw std::runtime_error("keys out of order");
      last = static_cast<int>(d[k]);
      if (d[k + 1] == 0) keys[last] = fmt::format("{}", d[k + 3]);
      else keys[last] = text(34737).substr(static_cast<std::size_t>(d[k + 3]), static_cast<std::size_t>(d[k + 2]) - 1);
    }
    return keys;
  }
};

/// Values of every size, holes among them; seed printed by who uses it.
Raster sample(int nx, int ny, std::uint64_t seed) {
  Raster r;
  r.corner = Vec2(2667400, 6478700.5);
  r.cell = Vec2(10, 10);
  r.nx = nx;
  r.ny = ny;
  r.unit = "m";
  r.description = "Thickness <of> lava & ash";
  for (int k = 0; k < nx * ny; ++k) {
    const Real u = random_uniform(seed, 0, static_cast<std::uint64_t>(k)), v = random_uniform(seed, 1, static_cast<std::uint64_t>(k));
    r.values.push_back(u < 0.2 ? kNone : static_cast<float>(std::pow(10, 8 * v - 4)));
  }
  return r;
}

class RasterFiles : public testing::Test {
 protected:
  RasterFiles() {
    std::string name = (fs::temp_directory_path() / "effuse_raster_XXXXXX").string();
    if (!::mkdtemp(name.data())) throw std::runtime_error("no temporary folder");
    folder_ = name;
  }
  ~RasterFiles() override { fs::remove_all(folder_); }
  std::size_t files() const { return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator())); }
  fs::path folder_;
};

std::string run_and_read(const std::string& command) {
  std::string text;
  FILE* pipe = ::popen(command.c_str(), "r");
  if (!pipe) return text;
  char buffer[4096];
  while (std::fgets(buffer, sizeof buffer, pipe)) text += buffer;
  return ::pclose(pipe) == 0 ? text : "failed: " + text;
}

TEST(GeoTiff, HoldsEveryValueNorthRowFirstAtItsPlace) {
  // One row, one column, one strip and several, a last strip that is shorter.
  for (const auto& [nx, ny] : {std::pair{1, 1}, {1, 7}, {9, 1}, {61, 87}, {700, 130}, {20000, 3}}) {
    Raster r = sample(nx, ny, 5);
    r.crs = "EPSG:27200";
    const Tiff tiff(encode_geotiff(r));
    EXPECT_TRUE(std::is_sorted(tiff.order.begin(), tiff.order.end())) << "a directory is sorted by tag";
    ASSERT_EQ(tiff.one(256), nx);
    ASSERT_EQ(tiff.one(257), ny);
    const std::vector<float> image = tiff.image();
    ASSERT_EQ(image.size(), r.values.size());
    for (int j = 0; j < ny; ++j)
      for (int i = 0; i < nx; ++i) {
        const float wanted = r.values[static_cast<std::size_t>(j * nx + i)], found = image[static_cast<std::size_t>((ny - 1 - j) * nx + i)];
        ASSERT_EQ(found, std::isnan(wanted) ? -9999.f : wanted) << i << " " << j;
      }
    EXPECT_EQ(tiff.numbers(33550), (std::vector<double>{10, 10, 0}));
    EXPECT_EQ(tiff.numbers(33922), (std::vector<double>{0, 0, 0, 2667400, 6478700.5 + 10 * ny, 0})) << "the north-west corner";
    EXPECT_EQ(tiff.text(42113), "-9999");
    EXPECT_EQ(tiff.text(270), r.description);
    EXPECT_NE(tiff.text(42112).find("Thickness &amp;lt;of&amp;gt; lava &amp;amp; ash"), std::string::npos);
    EXPECT_EQ(tiff.geo_keys().at(1025), "1") << "a value is of the whole cell";
  }
}

TEST(GeoTiff, NamesTheCoordinateSystemByCodeWhereThereIsOne) {
  Raster r = sample(3, 2, 1);
  for (const char* crs : {"EPSG:27200", "epsg:27200", R"wkt(PROJCS["a [b] (c)",GEOGCS["d",AUTHORITY["EPSG","4272"]],UNIT["metre",1],AUTHORITY["EPSG","27200"]])wkt",
                          "PROJCRS[\"a\",\n  BASEGEOGCRS[\"d\",ID[\"EPSG\",4272]],\n  ID[\"EPSG\",27200]]"}) {
    r.crs = crs;
    const auto keys = Tiff(encode_geotiff(r)).geo_keys();
    EXPECT_EQ(keys.at(1024), "1") << crs;
    EXPECT_EQ(keys.at(3072), "27200") << crs;
    EXPECT_FALSE(keys.contains(3073)) << crs;
  }
}

TEST(GeoTiff, TakesNoCodeThatIsNotTheProjectedSystemsOwn) {
  for (const char* crs : {"", "EPSG:", "EPSG:x", "EPSG:-3", "EPSG:27200x", "ESRI:54009", "27200", R"wkt(PROJCS["a",GEOGCS["d",AUTHORITY["EPSG","4272"]],UNIT["metre",1]])wkt",
                          R"wkt(COMPD_CS["a",PROJCS["b",AUTHORITY["EPSG","27200"]],AUTHORITY["EPSG","9999"]])wkt", R"wkt(PROJCS["a",AUTHORITY["ESRI","102100"]])wkt", R"wkt(PROJCS["a,AUTHORITY["EPSG","1"])wkt",
                          R"wkt(PROJCS["AUTHORITY[""EPSG"",""1""]",UNIT["metre",1]])wkt", "PROJCS[", "PROJCS[\"a\",AUTHORITY["})
    EXPECT_EQ(epsg_code(crs), std::nullopt) << crs;
}

TEST(GeoTiff, CarriesAWktWithoutCodeInItsCitation) {
  Raster r = sample(3, 2, 1);
  r.crs = read_file(kMountEden);
  const auto keys = Tiff(encode_geotiff(r)).geo_keys();
  EXPECT_EQ(keys.at(1024), "32767");
  EXPECT_EQ(keys.at(3072), "32767");
  EXPECT_EQ(keys.at(3073).substr(0, 17), "ESRI PE String = ");
  std::string wkt = r.crs;
  while (wkt.back() == '\n') wkt.pop_back();
  EXPECT_EQ(keys.at(3073).substr(17), wkt);
  r.crs = "the quarry's own | grid";
  const auto named = Tiff(encode_geotiff(r)).geo_keys();
  EXPECT_EQ(named.at(1026), "the quarry's own / grid");
  EXPECT_FALSE(named.contains(3072));
  r.crs = "";
  EXPECT_FALSE(Tiff(encode_geotiff(r)).tags.contains(34735));
}

TEST_F(RasterFiles, EsriAsciiReadsBackToTheSameFloatsInTheSamePlace) {
  Raster r = sample(61, 87, 7);
  for (const Vec2& cell : {Vec2(10, 10), Vec2(2.7, 2.7), Vec2(10, 25)}) {
    r.cell = cell;
    const importers::DemGrid grid = importers::parse_esri_ascii(encode_esri_ascii(r), "raster.asc");
    ASSERT_EQ(grid.nx, 61);
    ASSERT_EQ(grid.ny, 87);
    EXPECT_EQ(grid.spacing, cell);
    EXPECT_EQ(grid.corner, r.corner + cell / 2);
    for (std::size_t k = 0; k < r.values.size(); ++k) {
      ASSERT_EQ(std::isnan(grid.z[k]), std::isnan(r.values[k])) << k;
      if (std::isnan(r.values[k])) continue;
      ASSERT_EQ(static_cast<float>(grid.z[k]), r.values[k]) << k;
    }
  }
}

TEST_F(RasterFiles, EsriAsciiKeepsItsCoordinateSystemBesideItAndNoOldOne) {
  Raster r = sample(5, 4, 3);
  std::fill(r.values.begin(), r.values.end(), 2.5f);
  const fs::path asc = folder_ / "deposit.asc";
  r.crs = read_file(kMountEden);
  write_esri_ascii(asc, r);
  EXPECT_EQ(files(), 2u);
  const geometry::Terrain terrain = importers::import_terrain(asc).terrain;
  EXPECT_NE(terrain.georeference().crs.find("New_Zealand_Map_Grid"), std::string::npos);
  EXPECT_NEAR(terrain.height(20, 20).value(), 2.5, 1e-12);
  for (const char* unspelled : {"EPSG:2193", ""}) {
    r.crs = "EPSG:32740";
    write_esri_ascii(asc, r);
    EXPECT_NE(read_file(folder_ / "deposit.prj").find("WGS_1984_UTM_Zone_40S"), std::string::npos);
    EXPECT_NE(importers::import_terrain(asc).terrain.georeference().crs.find("UTM zone 40S"), std::string::npos);
    r.crs = unspelled;
    write_esri_ascii(asc, r);
    EXPECT_EQ(files(), 1u) << unspelled;
  }
}

TEST_F(RasterFiles, BadPlacesAreRefusedByNameAndLeaveNothing) {
  const Raster r = sample(5, 4, 3);
  write_file(folder_ / "file", "x");
  fs::create_directories(folder_ / "folder.tif");
  fs::create_directories(folder_ / "folder.asc");
  const std::size_t before = files();
  for (const fs::path& bad : {folder_ / "file" / "a.tif", folder_ / "folder.tif", fs::path("/proc/effuse/a.tif"), folder_ / (std::string(300, 'a') + ".tif")}) {
    for (const bool tif : {true, false}) {
      fs::path place = bad;
      if (!tif) place.replace_extension(".asc");
      try {
        tif ? write_geotiff(place, r) : write_esri_ascii(place, r);
        ADD_FAILURE() << place << " was written";
      } catch (const InputError& error) {
        EXPECT_EQ(error.faults().at(0).place.file, place.string());
      }
    }
  }
  EXPECT_EQ(files(), before);
  EXPECT_TRUE(fs::is_empty(folder_ / "folder.tif"));
}

TEST_F(RasterFiles, AFullDiskIsAResourceErrorAndLeavesTheOldMapWhole) {
  const fs::path tif = folder_ / "a.tif";
  write_geotiff(tif, sample(5, 4, 3));
  const std::string old = read_file(tif);
  // In a child: the limit cannot be raised again.
  const pid_t pid = ::fork();
  if (pid == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{10'000, 10'000};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    int code = 1;
    try {
      write_geotiff(tif, sample(100, 100, 3));
    } catch (const ResourceError&) {
      code = 0;
    } catch (...) {
    }
    ::_exit(code);
  }
  int status = -1;
  ::waitpid(pid, &status, 0);
  EXPECT_EQ(status, 0);
  EXPECT_EQ(read_file(tif), old);
  EXPECT_EQ(files(), 1u);
}

TEST_F(RasterFiles, HeightsAndTheirSystemAreWrittenBothOrNeither) {
  Raster large = sample(100, 100, 3);
  large.crs = "EPSG:32633";
  const auto full = [&](const fs::path& file, const Raster& raster, rlim_t bytes) {
    const pid_t pid = ::fork();
    if (pid == 0) {
      std::signal(SIGXFSZ, SIG_IGN);
      const rlimit limit{bytes, bytes};
      ::setrlimit(RLIMIT_FSIZE, &limit);
      int code = 1;
      try {
        write_esri_ascii(file, raster);
      } catch (const ResourceError&) {
        code = 0;
      } catch (...) {
      }
      ::_exit(code);
    }
    int status = -1;
    ::waitpid(pid, &status, 0);
    return status;
  };
  EXPECT_EQ(full(folder_ / "new.asc", large, 10'000), 0);
  EXPECT_EQ(files(), 0u);
  Raster tiny = sample(3, 2, 3);
  tiny.crs = read_file(kMountEden);
  ASSERT_LT(encode_esri_ascii(tiny).size(), 300u);
  ASSERT_GT(tiny.crs.size(), 400u);
  EXPECT_EQ(full(folder_ / "new.asc", tiny, 350), 0);
  EXPECT_EQ(files(), 0u) << "heights without the system they are in";
  Raster small = sample(5, 4, 3);
  small.crs = "EPSG:32750";
  write_esri_ascii(folder_ / "old.asc", small);
  const std::string heights = read_file(folder_ / "old.asc"), system = read_file(folder_ / "old.prj");
  EXPECT_EQ(full(folder_ / "old.asc", large, 10'000), 0);
  EXPECT_EQ(read_file(folder_ / "old.asc"), heights);
  EXPECT_EQ(read_file(folder_ / "old.prj"), system);
  EXPECT_EQ(files(), 2u);
}

/// The reader everybody uses, where it is installed.
TEST_F(RasterFiles, GdalReadsTheSamePlaceSystemAndValues) {
  if (std::system("gdalinfo --version >/dev/null 2>&1") != 0) GTEST_SKIP() << "gdalinfo is not on this machine";
  Raster r = sample(61, 87, 11);
  const std::string wkt = read_file(kMountEden);
  struct Case {
    std::string crs, tif, asc;  // what the systems read are called
  };
  for (const Case& c : {Case{"EPSG:27200", "27200", ""}, Case{wkt, "New Zealand Map Grid", "New Zealand Map Grid"}, Case{"EPSG:32705", "32705", "UTM zone 5S"},
                        Case{"EPSG:25833", "25833", "UTM zone 33N"}, Case{"", "", ""}}) {
    r.crs = c.crs;
    write_geotiff(folder_ / "r.tif", r);
    write_esri_ascii(folder_ / "r.asc", r);
    for (const char* name : {"r.tif", "r.asc"}) {
      const std::string text = run_and_read(fmt::format("gdalinfo -json -stats '{}' 2>&1", (folder_ / name).string()));
      fs::remove(folder_ / (std::string(name) + ".aux.xml"));  // the statistics GDAL leaves behind
      ASSERT_EQ(text.find("failed"), std::string::npos) << text;
      ASSERT_EQ(text.find("Warning"), std::string::npos) << text;
      const auto j = nlohmann::json::parse(text);
      EXPECT_EQ(j.at("size"), (nlohmann::json{61, 87}));
      EXPECT_EQ(j.at("geoTransform"), (nlohmann::json{2667400.0, 10.0, 0.0, 6478700.5 + 870, 0.0, -10.0}));
      const auto& band = j.at("bands").at(0);
      EXPECT_EQ(band.at("type"), "Float32");
      EXPECT_EQ(band.at("noDataValue").get<double>(), -9999);
      double sum = 0, most = 0;
      std::size_t n = 0;
      for (const float v : r.values) {
        if (std::isnan(v)) continue;
        sum += v;
        most = std::max<double>(most, v);
        ++n;
      }
      EXPECT_NEAR(band.at("mean").get<double>(), sum / static_cast<double>(n), 1e-3 * sum / static_cast<double>(n)) << "gdalinfo prints three decimals";
      EXPECT_NEAR(band.at("maximum").get<double>(), most, 1e-3);
      const std::string wanted = name == std::string("r.tif") ? c.tif : c.asc;
      const std::string found = j.contains("coordinateSystem") ? j.at("coordinateSystem").at("wkt").get<std::string>() : "";
      EXPECT_EQ(found.empty(), wanted.empty()) << name << " " << c.crs << ": " << found;
      EXPECT_NE(found.find(wanted), std::string::npos) << name << " " << c.crs << ": " << found;
    }
  }
  const auto band = nlohmann::json::parse(run_and_read(fmt::format("gdalinfo -json '{}'", (folder_ / "r.tif").string()))).at("bands").at(0);
  EXPECT_EQ(band.at("unit"), "m");
  EXPECT_EQ(band.at("description"), r.description);
}

}  // namespace
}  // namespace effuse::skin
