#include "samples/study/run_study.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <regex>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/log.h"

namespace effuse::study {
namespace {

namespace fs = std::filesystem;
using Names = std::vector<std::string>;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// Made-up cases: one that passes, one that misses two bars, one that throws, one that is slow.
class RunStudy : public testing::Test {
 protected:
  RunStudy() {
    set_log_level(LogLevel::kQuiet);
    folder_ = fs::temp_directory_path() / fmt::format("effuse.study.{}.{}", testing::UnitTest::GetInstance()->current_test_info()->name(), ::getpid());
    fs::remove_all(folder_);
    cases_.push_back({"good", "A <good> case", "Nobody 2001, \"On nothing\"", true, [this] {
                        ran_.push_back("good");
                        CaseResult result;
                        result.measures.push_back({"front at 550 s", "m", 15.0, 15.17, 0.0112, 0.03, ""});
                        result.plots.push_back(plot("good_front"));
                        result.note = "dx 10 cm, 6,600 particles";
                        return result;
                      }});
    cases_.push_back({"bad", "A bad case", "Nobody 2002", true, [this] {
                        ran_.push_back("bad");
                        CaseResult result;
                        result.measures.push_back({"speed", "m/s", 1.5, 1.0, 0.5, 0.25, ""});
                        result.measures.push_back({"drift", "m", kNan, 0.0, kNan, 0.1, "dx"});
                        result.plots.push_back(plot("bad_speed"));
                        result.plots[0].curves[0].y[1] = kNan;
                        return result;
                      }});
    cases_.push_back({"broken", "A broken case", "Nobody 2003", true, [this]() -> CaseResult {
                        ran_.push_back("broken");
                        throw std::runtime_error("the vent is <dry>");
                      }});
    cases_.push_back({"slow", "A slow case", "Nobody 2004", false, [this] {
                        ran_.push_back("slow");
                        CaseResult result;
                        result.measures.push_back({"energy", "J", 1.0, 1.0, 0.0, 0.01, ""});
                        result.plots.push_back(plot("slow_energy"));
                        return result;
                      }});
  }
  ~RunStudy() override {
    fs::remove_all(folder_);
    set_log_level(LogLevel::kInfo);
  }

  static Plot plot(const std::string& file) {
    Plot p{file, "Plot of " + file, "time [s]", "front [m]", false, false, {}};
    p.curves.push_back({"measured", {0, 1, 2}, {0.1, 1.0 / 3, 1.9}, true, false});
    p.curves.push_back({"exact", {0, 2}, {0, 2}, false, true});
    return p;
  }

  StudyReport run(const Names& only = {}, bool full = false, bool resume = false, const std::string& version = "1.2.3") {
    ran_.clear();
    StudyOptions options;
    options.version = version;
    options.folder = folder_;
    options.only = only;
    options.full = full;
    options.resume = resume;
    options.picture_scale = 0.25;  // painting takes most of the time
    return run_study(cases_, options, [this](std::size_t k, std::size_t n, const Case& which, const Outcome* outcome) {
      if (outcome) said_.push_back(fmt::format("{}/{} {} {}", k, n, which.name, outcome->failure.empty() ? "ran" : "failed"));
    });
  }

  std::string read(const std::string& name) const { return read_file(folder_ / name); }

  fs::path folder_;
  std::vector<Case> cases_;
  Names ran_, said_;
};

TEST_F(RunStudy, RunsTheQuickCasesAndGoesOnAfterOneThatThrows) {
  const StudyReport report = run();
  EXPECT_EQ(ran_, (Names{"good", "bad", "broken"}));
  EXPECT_EQ(said_, (Names{"1/3 good ran", "2/3 bad ran", "3/3 broken failed"}));
  ASSERT_EQ(report.outcomes.size(), 3u);
  EXPECT_EQ(report.outcomes[2].failure, "the vent is <dry>");
  EXPECT_EQ(report.not_run, Names{"slow"});
  const Tally t = tally(report.outcomes);
  EXPECT_EQ(t.figures, 3u);
  EXPECT_EQ(t.missed, 2u) << "not a number is missed";
  EXPECT_EQ(t.failed, 1u);
  EXPECT_EQ(summary(report.outcomes).rfind("1 of 3 figures hold, 2 missed, 1 of 3 cases failed, ", 0), 0u) << summary(report.outcomes);
}

TEST_F(RunStudy, RunsAllOrTheNamedOnesWhenAsked) {
  EXPECT_EQ(run({}, true).outcomes.size(), 4u);
  EXPECT_EQ(ran_, (Names{"good", "bad", "broken", "slow"}));
  EXPECT_EQ(run({"slow", "good", "slow"}).outcomes.size(), 2u);
  EXPECT_EQ(ran_, (Names{"good", "slow"}));
}

TEST_F(RunStudy, RefusesANameNobodyHasBeforeItWrites) {
  try {
    run({"goood", "bad"});
    FAIL() << "took it";
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "no case 'goood'; did you mean 'good'?");
  }
  try {
    run({"something else"});
    FAIL() << "took it";
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "no case 'something else'; there are good, bad, broken, slow");
  }
  EXPECT_FALSE(fs::exists(folder_));
  EXPECT_TRUE(ran_.empty());
}

TEST_F(RunStudy, RefusesAFolderThatIsAFile) {
  write_file(folder_, "in the way");
  EXPECT_THROW(run(), InputError);
  EXPECT_TRUE(ran_.empty());
}

TEST_F(RunStudy, WritesCurvesPicturesAndTablesAndNothingHalf) {
  run({}, true);
  Names found;
  for (const auto& entry : fs::recursive_directory_iterator(folder_))
    if (entry.is_regular_file()) found.push_back(entry.path().lexically_relative(folder_).generic_string());
  std::sort(found.begin(), found.end());
  Names wanted = {"validation.csv", "validation.html", "validation.json"};
  for (const char* name : {"good", "bad", "broken", "slow"}) wanted.push_back(fmt::format("cases/{}.json", name));
  for (const char* name : {"good_front", "bad_speed", "slow_energy"})
    for (const char* kind : {"csv", "svg", "png"}) wanted.push_back(fmt::format("plots/{}.{}", name, kind));
  std::sort(wanted.begin(), wanted.end());
  EXPECT_EQ(found, wanted);
  EXPECT_EQ(read("plots/good_front.csv"), "measured: time [s],measured: front [m],exact: time [s],exact: front [m]\n0,0.1,0,0\n1,0.3333333333333333,2,2\n2,1.9,,\n");
  EXPECT_NE(read("plots/bad_speed.csv").find("\n1,nan,2,2\n"), std::string::npos);
}

TEST_F(RunStudy, TableSaysByHowMuchAFigureFallsShort) {
  run();
  const std::string csv = read("validation.csv");
  EXPECT_EQ(csv.substr(0, csv.find('\n')), "case,title,figure,unit,measured,reference,error,hold,error_unit,result,short_by,seconds,version,note,source");
  EXPECT_NE(csv.find("\ngood,A <good> case,front at 550 s,m,15,15.17,0.0112,0.03,,passed,,"), std::string::npos) << csv;
  EXPECT_NE(csv.find(",1.2.3,\"dx 10 cm, 6,600 particles\",\"Nobody 2001, \"\"On nothing\"\"\"\n"), std::string::npos) << csv;
  EXPECT_NE(csv.find("\nbad,A bad case,speed,m/s,1.5,1,0.5,0.25,,missed,0.25,"), std::string::npos) << csv;
  EXPECT_NE(csv.find("\nbad,A bad case,drift,m,nan,0,nan,0.1,dx,missed,nan,"), std::string::npos) << csv;
  EXPECT_NE(csv.find("\nbroken,A broken case,,,,,,,,failed,,"), std::string::npos) << csv;

  const auto j = nlohmann::json::parse(read("validation.json"));
  EXPECT_FALSE(j.at("ok").get<bool>());
  EXPECT_EQ(j.at("missed"), 2);
  EXPECT_EQ(j.at("failed"), 1);
  EXPECT_EQ(j.at("not_run"), nlohmann::json::array({"slow"}));
  EXPECT_EQ(j.at("cases").at(0).at("measures").at(0).at("passed"), true);
  EXPECT_EQ(j.at("cases").at(1).at("measures").at(1).at("error"), "nan");
  EXPECT_EQ(j.at("cases").at(2).at("failure"), "the vent is <dry>");
}

TEST_F(RunStudy, PageStandsAloneAndShowsEveryFigureAndPlot) {
  run();
  const std::string page = read("validation.html");
  EXPECT_FALSE(std::regex_search(page, std::regex("https?:|//[a-z]|<script|<link|<img|@import|src\\s*=|url\\((?!#)", std::regex::icase)));
  EXPECT_FALSE(std::regex_search(page, std::regex("href=\"(?!#)")));
  for (const char* said : {"A &lt;good&gt; case", "front at 550 s", "15.17 m", "1.12 %", "✓ passed", "✗ missed by 25 % (2 times the bar)", "✗ missed: not a number", "✗ failed: the vent is &lt;dry&gt;",
                           "1.2.3", "6,600 particles", "Not run here: slow", "prefers-color-scheme:dark", "Plot of good_front", "Plot of bad_speed", "On nothing"})
    EXPECT_NE(page.find(said), std::string::npos) << said;
  // Every tag that is opened is closed.
  for (const char* tag : {"table", "tr", "td", "th", "svg", "section", "figure", "div", "p", "text", "title"}) {
    const auto opened = [&](const std::string& pattern) {
      const std::regex r(pattern);
      return std::distance(std::sregex_iterator(page.begin(), page.end(), r), std::sregex_iterator());
    };
    EXPECT_EQ(opened(fmt::format("<{}[ >]", tag)), opened(fmt::format("</{}>", tag))) << tag;
  }
}

TEST_F(RunStudy, ResumeKeepsWhatIsThereAndRunsTheRest) {
  run({}, true);
  const std::string html = read("validation.html"), curves = read("plots/bad_speed.svg");
  const StudyReport again = run({}, true, true);
  EXPECT_EQ(ran_, Names{"broken"}) << "what failed runs again";
  EXPECT_EQ(again.outcomes.size(), 4u);
  EXPECT_TRUE(again.outcomes[0].kept);
  const auto table = [](const std::string& page) { return std::regex_replace(page, std::regex("[0-9.]+ m?s\\b|min"), ""); };
  EXPECT_EQ(table(read("validation.html")), table(html)) << "the page from files is the page from memory";
  EXPECT_EQ(read("plots/bad_speed.svg"), curves);

  // Cases not asked for stay on the page, unless they failed.
  EXPECT_EQ(run({"bad"}, false, true).outcomes.size(), 3u);
  EXPECT_TRUE(ran_.empty());
  // Without it they do not.
  EXPECT_EQ(run({"bad"}).outcomes.size(), 1u);
  EXPECT_EQ(ran_, Names{"bad"});
}

TEST_F(RunStudy, ResumeKeepsNothingOfAnotherVersionOrDamaged) {
  run({"good", "bad", "slow"});
  run({"good", "bad"}, false, true, "1.2.4");
  EXPECT_EQ(ran_, (Names{"good", "bad"}));
  write_file(folder_ / "cases" / "good.json", read("cases/good.json").substr(0, 100));
  write_file(folder_ / "cases" / "bad.json", "{\"format\": 1, \"case\": 7}");
  EXPECT_EQ(run({"good", "bad"}, false, true, "1.2.4").outcomes.size(), 2u) << "the slow one is of 1.2.3";
  EXPECT_EQ(ran_, (Names{"good", "bad"}));
}

TEST_F(RunStudy, ACaseThatCannotBeShownIsAFailure) {
  const auto add = [&](const std::string& name, const Plot& p) {
    cases_.push_back({name, name, "", true, [p] {
                        CaseResult result;
                        result.plots.push_back(p);
                        return result;
                      }});
  };
  Plot uneven = plot("uneven");
  uneven.curves[0].x.pop_back();
  add("escape", plot("../escape"));
  add("nameless", plot(""));
  add("thief", plot("good_front"));
  add("uneven", uneven);
  const StudyReport report = run();
  ASSERT_EQ(report.outcomes.size(), 7u);
  EXPECT_TRUE(report.outcomes[0].failure.empty());
  for (std::size_t k = 3; k < 7; ++k) EXPECT_NE(report.outcomes[k].failure.find("plot '"), std::string::npos) << report.outcomes[k].name;
  EXPECT_FALSE(fs::exists(folder_ / "escape.csv"));
}

TEST_F(RunStudy, OutcomesReadBackBitForBit) {
  const StudyReport report = run();
  for (const Outcome& outcome : report.outcomes) EXPECT_EQ(outcome_json(read_outcome(outcome_json(outcome), "x")), outcome_json(outcome));
  EXPECT_THROW(read_outcome("", "x"), InputError);
  EXPECT_THROW(read_outcome("[]", "x"), InputError);
  std::string uneven = outcome_json(report.outcomes[0]);
  uneven.replace(uneven.find("\"x\": ["), 6, "\"x\": [1, ");
  EXPECT_THROW(read_outcome(uneven, "x"), InputError);
}

TEST(StudyWords, SayTimesAsPeopleDo) {
  EXPECT_EQ(duration_text(0.04), "40 ms");
  EXPECT_EQ(duration_text(0.0996), "0.1 s");
  EXPECT_EQ(duration_text(9.94), "9.9 s");
  EXPECT_EQ(duration_text(75.4), "75 s");
  EXPECT_EQ(duration_text(250.2), "4 min 10 s");
}

TEST(StudyWords, WriteNumbersWithTheDigitsThatMatter) {
  EXPECT_EQ(figure_text(18662.4, "Pa"), "18662 Pa");
  EXPECT_EQ(figure_text(1.23456789, ""), "1.235");
  EXPECT_EQ(figure_text(1.5e9, "Pa s"), "1.5e+09 Pa s");
  EXPECT_EQ(figure_text(kNan, "m"), "nan m");
}

TEST(StudyWords, AFigurePassesAtItsBarAndNotAbove) {
  EXPECT_EQ(verdict({"a", "m", 1, 1, 0.03, 0.03, ""}), "passed");
  EXPECT_EQ(verdict({"a", "m", 1, 1, 0.031, 0.03, ""}), "missed by 0.1 % (1.03 times the bar)");
  EXPECT_EQ(verdict({"a", "m", 1, 1, 0.3, 0.1, "dx"}), "missed by 0.2 dx (3 times the bar)");
  EXPECT_EQ(verdict({"a", "m", 1, 1, 0.3, 0, ""}), "missed by 30 %");
}

}  // namespace
}  // namespace effuse::study
