#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "geometry/base/files.h"
#include "samples/effuse/run_folder.h"
#include "tests/samples/made_run.h"

/// `effuse view` at its doors: what it takes, what it refuses, what it leaves behind. What the page does is in view_page_test.cpp.
namespace effuse {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing_runs::MadeRun;
using testing_runs::write_run;

class ViewCommandTest : public testing::Test {
 protected:
  ViewCommandTest() {
    const testing::TestInfo* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::temp_directory_path() / fmt::format("effuse.{}.{}.{}", info->test_suite_name(), info->name(), ::getpid());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~ViewCommandTest() override { fs::remove_all(folder_); }

  struct Outcome {
    int code = -1;
    std::string out, err;
  };

  Outcome view(const std::vector<std::string>& arguments, rlim_t largest_file = RLIM_INFINITY) {
    std::vector<std::string> words = {EFFUSE_PROGRAM, "view"};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    const pid_t pid = ::fork();
    if (pid == 0) {
      if (::chdir(folder_.c_str()) != 0 || !::freopen("stdout.txt", "w", stdout) || !::freopen("stderr.txt", "w", stderr)) ::_exit(99);
      if (largest_file != RLIM_INFINITY) {
        const rlimit limit{largest_file, largest_file};
        ::setrlimit(RLIMIT_FSIZE, &limit);
      }
      ::execv(argv[0], argv.data());
      ::_exit(98);
    }
    int status = 0;
    ::waitpid(pid, &status, 0);
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status), read_file(folder_ / "stdout.txt"), read_file(folder_ / "stderr.txt")};
  }

  /// The JSON in the element of that id.
  static json element(const std::string& html, const std::string& id) {
    const std::size_t begin = html.find('>', html.find("id=\"" + id + "\"")) + 1;
    return json::parse(html.substr(begin, html.find("</script>", begin) - begin));
  }

  /// Refused with this exit code and sentence, and no page or part of one is left.
  void expect_refused(const std::vector<std::string>& arguments, int code, const std::string& sentence) {
    const Outcome outcome = view(arguments);
    EXPECT_EQ(outcome.code, code) << outcome.err;
    EXPECT_NE(outcome.err.find(sentence), std::string::npos) << outcome.err;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder_)) EXPECT_NE(entry.path().extension(), ".html") << entry.path();
  }

  fs::path folder_;
};

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST_F(ViewCommandTest, MakesAPageOfARun) {
  write_run(folder_ / "run", {});
  const Outcome outcome = view({"run", "-o", "page.html"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(contains(outcome.out, "page.html: 4 frames, 992 triangles a frame")) << outcome.out;
  const std::string html = read_file(folder_ / "page.html");
  const json about = element(html, "about"), meshes = element(html, "meshes");
  EXPECT_EQ(about.at("title"), "A made flow");
  EXPECT_EQ(about.at("crs"), "EPSG:27200");
  ASSERT_EQ(about.at("frames").size(), 4u);
  EXPECT_NEAR(about.at("frames").at(2).at("time").get<double>(), 30 / 24.0, 1e-6);
  EXPECT_EQ(meshes.at(about.at("frames").at(0).at("lava").get<std::size_t>()).at("planes").back(), "thickness");
  // The tube's top is 2.4 m over its axis and up to 0.4 m of ripple over the ground's cells; a few centimetres of those.
  EXPECT_NEAR(about.at("ranges").at("thickness").at(1).get<double>(), 2.7, 0.25);
  std::vector<std::string> charts;
  for (const json& series : about.at("series")) charts.push_back(series.at("chart").get<std::string>() + " " + series.at("name").get<std::string>());
  EXPECT_EQ(charts, (std::vector<std::string>{"Front ", "Temperature hottest", "Temperature mean", "Heat radiated", "Volume "}));
  EXPECT_TRUE(about.at("series").at(2).at("values").at(0).is_null());  // an empty field
  EXPECT_NEAR(about.at("series").at(1).at("values").at(0).get<double>(), 1469 - 273.15, 1e-3);
}

TEST_F(ViewCommandTest, TakesSomeOfTheFramesAndFewerTriangles) {
  write_run(folder_ / "run", {.frames = 9});
  const Outcome outcome = view({"run", "--frames", "3-8", "--every", "2", "--triangles", "400", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const json report = json::parse(outcome.out);
  EXPECT_EQ(report.at("frames"), 3);
  EXPECT_EQ(report.at("frames_cut_down"), 3);
  EXPECT_EQ(report.at("bytes").get<std::size_t>(), fs::file_size(folder_ / "run" / "view.html"));
  const std::string html = read_file(folder_ / "run" / "view.html");
  const json about = element(html, "about"), meshes = element(html, "meshes");
  std::vector<int> numbers;
  for (const json& frame : about.at("frames")) {
    numbers.push_back(frame.at("number"));
    EXPECT_LE(meshes.at(frame.at("lava").get<std::size_t>()).at("triangles").get<int>(), 400);
  }
  EXPECT_EQ(numbers, (std::vector<int>{3, 5, 7}));
}

TEST_F(ViewCommandTest, SaysWhichFramesAreMissingAndGoesOn) {
  write_run(folder_ / "run", {.frames = 6});
  fs::remove(folder_ / "run" / "frames" / "skin.0002.ply");
  fs::remove(folder_ / "run" / "frames" / "skin.0003.ply");
  fs::remove(folder_ / "run" / "frames" / "skin.0005.ply");
  const Outcome outcome = view({"run", "-o", "page.html"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(contains(outcome.err, "the skins of frames 2-3, 5 are missing")) << outcome.err;
  EXPECT_EQ(element(read_file(folder_ / "page.html"), "about").at("frames").size(), 3u);
}

TEST_F(ViewCommandTest, RefusesWhatIsNoRun) {
  expect_refused({"nowhere"}, 2, "nowhere: no such folder");
  fs::create_directories(folder_ / "empty");
  expect_refused({"empty"}, 2, "no manifest.json");
  write_file(folder_ / "notes.txt", "x");
  expect_refused({"notes.txt"}, 2, "is a file, wanted the folder of a run");
  write_file(folder_ / "empty" / "manifest.json", "{\"name\": 3");
  expect_refused({"empty"}, 2, "manifest.json: is damaged");
}

TEST_F(ViewCommandTest, RefusesARunWithoutWhatItShows) {
  write_run(folder_ / "run", {.lava = false});
  expect_refused({"run"}, 2, "a run that wrote no meshes");
  write_run(folder_ / "gone", {});
  fs::remove_all(folder_ / "gone" / "frames");
  expect_refused({"gone"}, 2, "the files are gone");
}

TEST_F(ViewCommandTest, RefusesRangesOutsideTheRun) {
  write_run(folder_ / "run", {});
  expect_refused({"run", "--frames", "9-12"}, 2, "the run has frames 1 to 4");
  expect_refused({"run", "--frames", "3-2"}, 2, "--frames 3-2");
  expect_refused({"run", "--frames", "two"}, 2, "is no range of frames");
  expect_refused({"run", "--every", "0"}, 2, "--every");
}

TEST_F(ViewCommandTest, RefusesADamagedFrameAndNamesIt) {
  write_run(folder_ / "run", {});
  const fs::path file = folder_ / "run" / "frames" / "skin.0003.ply";
  const std::string whole = read_file(file);
  write_file(file, whole.substr(0, whole.size() / 2));
  expect_refused({"run"}, 2, "skin.0003.ply");
  write_file(file, whole);
  write_file(folder_ / "run" / "flow.csv", "frame,time_s,front_m\n1,0.1,far\n");
  expect_refused({"run"}, 2, "flow.csv:2: found 'far' in column front_m, wanted a number");
}

TEST_F(ViewCommandTest, LeavesNothingHalfWrittenOnAFullDisk) {
  write_run(folder_ / "run", {});
  const Outcome outcome = view({"run", "-o", "page.html"}, 20000);
  EXPECT_EQ(outcome.code, 5) << outcome.err;
  EXPECT_FALSE(fs::exists(folder_ / "page.html"));
  EXPECT_FALSE(fs::exists(folder_ / "page.part.html"));
}

TEST_F(ViewCommandTest, KeepsTheOldPageWhenTheNewOneFails) {
  write_run(folder_ / "run", {});
  ASSERT_EQ(view({"run", "-o", "page.html"}).code, 0);
  const std::string before = read_file(folder_ / "page.html");
  EXPECT_EQ(view({"run", "-o", "page.html", "--title", "Another"}, 20000).code, 5);
  EXPECT_EQ(read_file(folder_ / "page.html"), before);
}

}  // namespace
}  // namespace effuse
