#include "samples/study/run_study.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/log.h"
#include "samples/study/page.h"
#include "samples/study/plot.h"

namespace effuse::study {

namespace fs = std::filesystem;

namespace {

bool fits_a_file_name(const std::string& name) {
  return !name.empty() && name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-") == std::string::npos;
}

/// Of a picture: such a name, and an ending.
bool fits_a_picture(const std::string& file) {
  const std::size_t dot = file.find('.');
  return dot != std::string::npos && fits_a_file_name(file.substr(0, dot)) && fits_a_file_name(file.substr(dot + 1));
}

fs::path result_file(const fs::path& folder, const std::string& name) { return folder / "cases" / (name + ".json"); }

/// What cannot be drawn or filed is the case's failure. owner: the case that each plot's file belongs to.
void check_plots(const Outcome& outcome, const std::map<std::string, std::string>& owner) {
  std::set<std::string> own;
  for (const Plot& plot : outcome.result.plots) {
    if (!fits_a_file_name(plot.file)) throw std::runtime_error(fmt::format("plot '{}': a file's name is made of letters, digits, _ and -", plot.file));
    const auto other = owner.find(plot.file);
    if (!own.insert(plot.file).second || (other != owner.end() && other->second != outcome.name)) throw std::runtime_error(fmt::format("plot '{}': another plot has this name", plot.file));
    for (const Curve& curve : plot.curves)
      if (curve.x.size() != curve.y.size()) throw std::runtime_error(fmt::format("plot '{}', curve '{}': {} x and {} y", plot.file, curve.name, curve.x.size(), curve.y.size()));
  }
  for (const Picture& picture : outcome.result.pictures)
    if (!fits_a_picture(picture.file)) throw std::runtime_error(fmt::format("picture '{}': a file's name is made of letters, digits, _ and -, and an ending", picture.file));
}

/// The result of an earlier call, if the folder has one that may be kept.
std::optional<Outcome> earlier(const Case& c, const StudyOptions& options) {
  const fs::path file = result_file(options.folder, c.name);
  std::error_code error;
  if (!fs::exists(file, error)) return std::nullopt;
  try {
    Outcome outcome = read_outcome(read_file(file), file.string());
    if (outcome.name != c.name || outcome.version != options.version || !outcome.failure.empty()) return std::nullopt;
    outcome.title = c.title;
    outcome.source = c.source;
    return outcome;
  } catch (const InputError& bad) {
    log_warning(fmt::format("{}; the case runs again", bad.what()));
    return std::nullopt;
  }
}

Outcome run_case(const Case& c, const StudyOptions& options, const std::map<std::string, std::string>& owner) {
  Outcome outcome;
  outcome.name = c.name;
  outcome.title = c.title;
  outcome.source = c.source;
  outcome.version = options.version;
  const auto start = std::chrono::steady_clock::now();
  try {
    outcome.result = options.full && c.run_full ? c.run_full() : c.run();
    check_plots(outcome, owner);
  } catch (const std::exception& error) {
    outcome.failure = *error.what() ? error.what() : "an error without words";
    outcome.result = {};
  }
  outcome.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return outcome;
}

void write_pictures(const StudyOptions& options, const Outcome& outcome) {
  const fs::path folder = options.folder / "plots";
  for (const Plot& plot : outcome.result.plots) {
    const Drawing drawing = draw(plot);
    write_file(folder / (plot.file + ".csv"), csv_of(plot));
    write_file(folder / (plot.file + ".svg"), svg_file(drawing));
    write_file(folder / (plot.file + ".png"), png_file(drawing, options.picture_scale));
  }
  for (const Picture& picture : outcome.result.pictures) write_file(options.folder / "pictures" / picture.file, picture.bytes);
}

void write_tables(const StudyOptions& options, const StudyReport& report) {
  write_file(options.folder / (options.name + ".csv"), table_csv(report.outcomes));
  write_file(options.folder / (options.name + ".json"), table_json(options.name, options.version, report.outcomes, report.not_run) + "\n");
  if (const std::string costs = costs_csv(report.outcomes); !costs.empty()) write_file(options.folder / (options.name + "-costs.csv"), costs);
  write_file(options.folder / (options.name + ".html"), page_of(options.name, options.version, {{options.name, options.what, report.outcomes, report.not_run}}));
}

void make_folder(const fs::path& folder) {
  std::error_code error;
  if (fs::is_directory(folder, error)) return;
  if (fs::exists(fs::symlink_status(folder, error))) throw InputError(Place{folder.string()}, "is not a folder, wanted one to write the study to");
  fs::create_directories(folder, error);
  if (error == std::errc::no_space_on_device) throw ResourceError(fmt::format("{}: cannot make the folder: {}", folder.string(), error.message()));
  if (error) throw InputError(Place{folder.string()}, "cannot make this folder: " + error.message());
}

}  // namespace

void require_known(const std::string& what, const std::vector<std::string>& wanted, const std::vector<std::string>& known) {
  std::vector<Fault> faults;
  for (const std::string& name : wanted) {
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    const std::string nearest = nearest_name(name, known);
    std::string all;
    for (const std::string& one : known) all += (all.empty() ? "" : ", ") + one;
    faults.push_back({Place{}, fmt::format("no {} '{}'; {}", what, name, nearest.empty() ? "there are " + all : "did you mean '" + nearest + "'?")});
  }
  if (!faults.empty()) throw InputError(std::move(faults));
}

StudyReport run_study(const std::vector<Case>& cases, const StudyOptions& options, const StudyProgress& progress) {
  std::vector<std::string> names;
  for (const Case& c : cases) names.push_back(c.name);
  require_known("case", options.only, names);
  make_folder(options.folder);

  // What is there already, and what is to be run.
  std::vector<std::optional<Outcome>> outcomes(cases.size());
  std::vector<std::size_t> wanted;
  std::map<std::string, std::string> owner;
  for (std::size_t k = 0; k < cases.size(); ++k) {
    const Case& c = cases[k];
    if (options.resume) outcomes[k] = earlier(c, options);
    if (outcomes[k])
      for (const Plot& plot : outcomes[k]->result.plots) owner.emplace(plot.file, c.name);
    const bool chosen = options.only.empty() ? options.full || c.quick : std::find(options.only.begin(), options.only.end(), c.name) != options.only.end();
    if (chosen && !outcomes[k]) wanted.push_back(k);
  }
  const auto report = [&] {
    StudyReport all;
    for (std::size_t k = 0; k < cases.size(); ++k) {
      if (outcomes[k]) all.outcomes.push_back(*outcomes[k]);
      else all.not_run.push_back(cases[k].name);
    }
    return all;
  };

  for (std::size_t n = 0; n < wanted.size(); ++n) {
    const Case& c = cases[wanted[n]];
    progress(n + 1, wanted.size(), c, nullptr);
    Outcome outcome = run_case(c, options, owner);
    for (const Plot& plot : outcome.result.plots) owner.emplace(plot.file, c.name);
    write_pictures(options, outcome);
    write_file(result_file(options.folder, c.name), outcome_json(outcome));
    outcomes[wanted[n]] = std::move(outcome);
    write_tables(options, report());
    progress(n + 1, wanted.size(), c, &*outcomes[wanted[n]]);
  }
  const StudyReport all = report();
  write_tables(options, all);  // also when there was nothing to run
  return all;
}

}  // namespace effuse::study
