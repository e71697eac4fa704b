#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "geometry/base/files.h"

/// What a run leaves for people who study flows.
namespace effuse {
namespace {

namespace fs = std::filesystem;

const fs::path kScenes = fs::path(EFFUSE_SOURCE_DIR) / "samples" / "scenes";

/// flow.csv by column; an empty field is NaN.
struct Series {
  std::map<std::string, std::vector<double>> column;
  std::size_t rows = 0;
  explicit Series(const fs::path& file) {
    std::istringstream in(read_file(file));
    std::string line, word;
    std::vector<std::string> names;
    std::getline(in, line);
    for (std::istringstream head(line); std::getline(head, word, ',');) names.push_back(word);
    for (; std::getline(in, line); ++rows) {
      line += ',';  // so that an empty last field is one
      std::istringstream fields(line);
      std::size_t k = 0;
      for (; std::getline(fields, word, ','); ++k) column[names.at(k)].push_back(word.empty() ? std::nan("") : std::stod(word));
      EXPECT_EQ(k, names.size()) << line;
    }
  }
  const std::vector<double>& operator[](const std::string& name) const { return column.at(name); }
};

class FlowOutput : public testing::Test {
 protected:
  FlowOutput() {
    const testing::TestInfo* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::temp_directory_path() / fmt::format("effuse.{}.{}.{}", info->test_suite_name(), info->name(), ::getpid());
    fs::remove_all(folder_);
  }
  ~FlowOutput() override { fs::remove_all(folder_); }

  using Words = std::vector<std::string>;
  /// The exit code of the program on the gully scene, coarse, without skin and pictures; what it says goes nowhere.
  static int effuse(const std::string& verb, const Words& words) {
    std::string line = fmt::format("'{}' {} '{}' --set 'lava.spacing=1.2 m' --set film.time_scale=4 --set preview.pictures=false --set 'output.formats=[]' --set output.checkpoint_every=3", EFFUSE_PROGRAM, verb,
                                   (kScenes / "lava.toml").string());
    for (const std::string& word : words) line += " '" + word + "'";
    const int status = std::system((line + " >/dev/null 2>&1").c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  /// settings: key=value each.
  static int gully(const fs::path& out, int frames, const Words& settings = {}, bool resume = false) {
    Words words = {"-o", out.string(), "--frames", std::to_string(frames)};
    for (const std::string& setting : settings) words.insert(words.end(), {"--set", setting});
    if (resume) words.push_back("--resume");
    return effuse("run", words);
  }
  static int go_on(const fs::path& out, int frames, const Words& settings = {}) { return gully(out, frames, settings, true); }
  /// An ESRI ASCII grid, taken as it stands: header, then values from the north row on; NaN for nodata.
  struct Map {
    std::map<std::string, double> header;
    std::vector<double> values;
  };
  static Map read_map(const fs::path& file) {
    Map map;
    std::istringstream in(read_file(file));
    std::string key;
    for (int k = 0; k < 6; ++k) {
      in >> key;
      in >> map.header[key];
    }
    for (double v; in >> v;) map.values.push_back(v == -9999 ? std::nan("") : v);
    EXPECT_EQ(static_cast<double>(map.values.size()), map.header["ncols"] * map.header["nrows"]);
    return map;
  }
  /// Every file of maps/ and flow.csv.
  static std::map<std::string, std::string> outputs(const fs::path& out) {
    std::map<std::string, std::string> files = {{"flow.csv", read_file(out / "flow.csv")}};
    for (const fs::directory_entry& entry : fs::directory_iterator(out / "maps")) files[entry.path().filename().string()] = read_file(entry.path());
    return files;
  }
  static void expect_same_outputs(const fs::path& a, const fs::path& b) {
    const auto x = outputs(a), y = outputs(b);
    ASSERT_EQ(x.size(), y.size());
    for (const auto& [name, bytes] : x) EXPECT_TRUE(y.contains(name) && bytes == y.at(name)) << name;
  }
  fs::path folder_;
};

/// One run, for the tests that only look at what it left.
class FlowOutputOfARun : public FlowOutput {
 protected:
  static constexpr int kFrames = 30;
  static void SetUpTestSuite() {
    out_ = fs::temp_directory_path() / fmt::format("effuse.flow_output_of_a_run.{}", ::getpid());
    fs::remove_all(out_);
    exit_code_ = gully(out_, kFrames);
  }
  static void TearDownTestSuite() { fs::remove_all(out_); }
  void SetUp() override { ASSERT_EQ(exit_code_, 0); }
  static inline fs::path out_;
  static inline int exit_code_ = -1;
};

TEST_F(FlowOutputOfARun, HasALineAFrameThatAgreesWithItsReport) {
  const Series s(out_ / "flow.csv");
  ASSERT_EQ(s.rows, static_cast<std::size_t>(kFrames));
  const auto figures = nlohmann::json::parse(read_file(out_ / "run.json")).at("effects").at("lava");
  EXPECT_NEAR(s["volume_m3"].back() / figures.at("volume_m3").get<double>(), 1, 1e-9) << "ten digits";
  EXPECT_NEAR(s["max_temperature_K"].back(), figures.at("max_temperature_K").get<double>(), 1e-6);
  EXPECT_NEAR(s["min_temperature_K"].back(), figures.at("min_temperature_K").get<double>(), 1e-6);
  double let_out = 0;
  for (std::size_t k = 0; k < s.rows; ++k) {
    EXPECT_EQ(s["frame"][k], static_cast<double>(k + 1));
    EXPECT_NEAR(s["time_s"][k], static_cast<double>(k + 1) * 4 / 24, 1e-9);
    let_out += s["discharge_m3_s"][k] * 4 / 24;
    if (s["volume_m3"][k] == 0) {
      EXPECT_TRUE(std::isnan(s["front_m"][k]) && std::isnan(s["max_speed_m_s"][k]) && std::isnan(s["mean_temperature_K"][k])) << "there is nothing to say it of";
      continue;
    }
    EXPECT_GE(s["max_temperature_K"][k], s["mean_temperature_K"][k]);
    EXPECT_GE(s["mean_temperature_K"][k], s["min_temperature_K"][k]);
    EXPECT_GE(s["inundated_m2"][k], k > 0 ? s["inundated_m2"][k - 1] : 0);
  }
  EXPECT_NEAR(let_out, figures.at("mass_emitted_kg").get<double>() / 2600, 1e-6 * let_out) << "discharge adds up to what came out";
  // The classic model keeps no heat budget.
  for (const char* term : {"radiated_J", "convected_J", "ground_J", "vent_J", "stored_J", "viscous_J", "left_J"}) EXPECT_FALSE(s.column.contains(term)) << "the classic lava has none, so there is no blank column";
}

TEST_F(FlowOutputOfARun, HasItsFrontInMapCoordinatesAsFarFromTheVentAsItSays) {
  const Series s(out_ / "flow.csv");
  double before = 0;
  for (std::size_t k = 0; k < s.rows; ++k) {
    if (s["volume_m3"][k] == 0) continue;
    const double x = s["front_x"][k], y = s["front_y"][k];
    EXPECT_NEAR(std::hypot(x - 18, y - 46), s["front_m"][k], 1e-6);
    EXPECT_GT(s["front_m"][k], before - 0.6) << "lava does not run back";
    before = s["front_m"][k];
  }
  EXPECT_GT(before, 2.5) << "out of the crater";
}

TEST_F(FlowOutputOfARun, HasADepositOfTheLavasVolumeOnTheTerrainsCells) {
  const Series s(out_ / "flow.csv");
  const Map terrain = read_map(kScenes / "gully.asc");
  const auto map = [&](const char* name) { return read_map(out_ / "maps" / fmt::format("{}.asc", name)); };
  const Map deposit = map("deposit"), most = map("max_thickness"), hottest = map("max_temperature"), arrival = map("arrival_time");
  for (const Map* m : {&deposit, &most, &hottest, &arrival}) EXPECT_EQ(m->header, terrain.header);
  const double cell = std::pow(terrain.header.at("cellsize"), 2);
  double volume = 0, reached = 0;
  for (std::size_t k = 0; k < deposit.values.size(); ++k) {
    const bool came = !std::isnan(most.values[k]);
    ASSERT_EQ(came, !std::isnan(deposit.values[k])) << "the same cells have data";
    ASSERT_EQ(came, !std::isnan(hottest.values[k]));
    if (came) {
      volume += deposit.values[k] * cell;
      EXPECT_GE(most.values[k], deposit.values[k]);
      EXPECT_GT(hottest.values[k], 900);
      EXPECT_LE(hottest.values[k], 1473.15 + 1e-3);
    }
    ASSERT_EQ(!std::isnan(arrival.values[k]), came && most.values[k] > 0.6) << "half a spacing thick";
    if (std::isnan(arrival.values[k])) continue;
    reached += cell;
    EXPECT_GE(arrival.values[k], 4. / 24 - 1e-6);
    EXPECT_LE(arrival.values[k], kFrames * 4. / 24 + 1e-6);
  }
  EXPECT_NEAR(volume, s["volume_m3"].back(), 1e-6 * volume);
  EXPECT_EQ(reached, s["inundated_m2"].back());
}

class FlowOutputSlow : public FlowOutput {};

TEST_F(FlowOutputSlow, KilledAfterACheckpointItGoesOnToTheSameBytes) {
  const std::vector<std::string> every = {"output.thickness_every=2", "output.keep_checkpoints=2"};
  const fs::path whole = folder_ / "whole", broken = folder_ / "broken";
  ASSERT_EQ(gully(whole, 11, every), 0);
  EXPECT_TRUE(fs::exists(whole / "maps" / "thickness.0010.tif"));
  EXPECT_FALSE(fs::exists(whole / "maps" / "thickness.0011.tif"));
  ASSERT_EQ(gully(broken, 7, every), 0);
  // As if killed between frames 6 and 7: what was to come is not there, or is there in another state.
  fs::remove(broken / "checkpoints" / "checkpoint.0007.state");
  write_file(broken / "maps" / "deposit.asc", "torn");
  EXPECT_TRUE(fs::exists(broken / "checkpoints" / "flow.0006.state"));
  ASSERT_EQ(go_on(broken, 11, every), 0);
  expect_same_outputs(whole, broken);
  // As many records stay as checkpoints.
  std::size_t records = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(broken / "checkpoints")) records += entry.path().filename().string().starts_with("flow.");
  EXPECT_EQ(records, 2u);
  // Done already: the same once more, from the record alone.
  fs::remove_all(broken / "maps" / "deposit.tif");
  fs::remove(broken / "flow.csv");
  ASSERT_EQ(go_on(broken, 11, every), 0);
  expect_same_outputs(whole, broken);
}

TEST_F(FlowOutputSlow, ADamagedRecordSendsItBackToTheCheckpointBefore) {
  const fs::path whole = folder_ / "whole", broken = folder_ / "broken";
  ASSERT_EQ(gully(whole, 9), 0);
  ASSERT_EQ(gully(broken, 7), 0);
  const fs::path record = broken / "checkpoints" / "flow.0007.state";
  std::string bytes = read_file(record);
  bytes[bytes.size() / 2] ^= 1;
  write_file(record, bytes);
  ASSERT_EQ(go_on(broken, 9), 0);
  expect_same_outputs(whole, broken);
}

TEST_F(FlowOutput, RefusesToGoOnWithMapsThatLackTheBeginning) {
  const std::vector<std::string> off = {"output.maps=false", "output.series=false"};
  ASSERT_EQ(gully(folder_, 4, off), 0);
  for (const char* name : {"maps", "flow.csv"}) EXPECT_FALSE(fs::exists(folder_ / name)) << "nobody asked for them";
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_ / "checkpoints")) EXPECT_FALSE(entry.path().filename().string().starts_with("flow."));
  EXPECT_EQ(go_on(folder_, 6), 2);
  EXPECT_EQ(go_on(folder_, 6, off), 0);
}

TEST_F(FlowOutput, RefusesToGoOnWithCellsOfAnotherSize) {
  ASSERT_EQ(gully(folder_, 4), 0);
  const auto before = outputs(folder_);
  EXPECT_EQ(go_on(folder_, 6, {"output.map_cell=1 m"}), 2);
  EXPECT_EQ(go_on(folder_, 6, {"output.arrival_thickness=1 m"}), 2);
  EXPECT_EQ(outputs(folder_), before);
}

TEST_F(FlowOutput, WritesWhatIsAskedForAndNothingElse) {
  ASSERT_EQ(gully(folder_, 3, {"output.map_formats=[\"tif\"]", "output.series=false", "output.map_cell=\"1 m\"", "output.arrival_thickness=\"5 cm\""}), 0);
  EXPECT_FALSE(fs::exists(folder_ / "flow.csv"));
  std::size_t n = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_ / "maps")) {
    EXPECT_EQ(entry.path().extension(), ".tif");
    ++n;
  }
  EXPECT_EQ(n, 4u);
  EXPECT_EQ(nlohmann::json::parse(read_file(folder_ / "manifest.json")).at("flow"),
            (nlohmann::json{{"max_thickness_tif", "maps/max_thickness.tif"},
                            {"max_temperature_tif", "maps/max_temperature.tif"},
                            {"arrival_time_tif", "maps/arrival_time.tif"},
                            {"deposit_tif", "maps/deposit.tif"}}));
  EXPECT_NE(read_file(folder_ / "maps" / "arrival_time.tif").find("thicker than 0.05 m"), std::string::npos);
}

TEST_F(FlowOutput, RefusesAMapTooLargeAtTheScenesLineBeforeItWritesAnything) {
  for (const char* cell : {"output.map_cell=\"0.1 mm\"", "output.map_cell=1e-300"}) {
    EXPECT_EQ(gully(folder_, 3, {cell}), 2) << cell;
    EXPECT_EQ(effuse("check", {"--set", cell}), 2) << cell;
    EXPECT_FALSE(fs::exists(folder_));
  }
}

TEST_F(FlowOutputSlow, AnOutputPlaceInTheWayIsBadInputAndTheRunCanGoOn) {
  ASSERT_EQ(gully(folder_ / "whole", 5), 0);
  const fs::path out = folder_ / "out";
  write_file(out / "maps", "a file of that name");
  EXPECT_EQ(gully(out, 5), 2);
  fs::remove(out / "maps");
  EXPECT_EQ(go_on(out, 5), 0);
  expect_same_outputs(folder_ / "whole", out);
}

}  // namespace
}  // namespace effuse
