#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "geometry/base/files.h"
#include "geometry/base/log.h"
#include "samples/budget/machine.h"
#include "samples/effuse/calibrate.h"
#include "samples/effuse/commands.h"
#include "samples/study/cost/cheapest_table.h"
#include "samples/study/page.h"
#include "samples/study/run_study.h"
#include "samples/study/study.h"

namespace effuse {

namespace {

struct Study {
  std::string name, what;
  std::vector<study::Case> (*cases)();
};

std::vector<Study> studies() {
  return {{"validation", "the modern lava beside exact solutions, benchmarks and experiments", &study::validation_cases},
          {"skin", "the skin of solids filled with particles beside the solids, its relief and colour; --full makes a sheet of close-ups", &study::skin_cases},
          {"integrators", "what a scheme and its step cost for the error they make, and where they blow up", &study::integrator_cases},
          {"lava", "what the lava's spacing, support, step, tolerances and stiffness cost for the error they make", &study::lava_cases},
          {"heat", "what the crust's cells cost, and what they buy", &study::heat_cases},
          {"terrain", "what triangles of the ground cost, and where the lava goes on fewer", &study::terrain_cases},
          {"solvers", "waves, rigid bodies, elastic solids: what grid, step and elements cost", &study::solver_cases}};
}

/// A log that nobody reads any more must not end a study.
void say(const std::string& line) {
  std::fwrite(line.data(), 1, line.size(), stderr);
  std::fflush(stderr);
}

void print_list(const std::vector<Study>& chosen, const CommonOptions& common) {
  nlohmann::ordered_json j = nlohmann::ordered_json::array();
  for (const Study& one : chosen) {
    nlohmann::ordered_json cases = nlohmann::ordered_json::array();
    if (!common.json) fmt::print("{}: {}\n", one.name, one.what);
    for (const study::Case& c : one.cases()) {
      if (!common.json) fmt::print("  {:<24} {:<6} {}\n", c.name, c.quick ? "quick" : "slow", c.title);
      cases.push_back({{"case", c.name}, {"title", c.title}, {"quick", c.quick}, {"source", c.source}});
    }
    j.push_back({{"study", one.name}, {"what", one.what}, {"cases", cases}});
  }
  if (common.json) print_document(j.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
}

ExitCode measure_machine(const StudyCommand& command, const CommonOptions& common) {
  if (!command.names.empty() || !command.cases.empty()) throw InputError(Place{}, "--calibrate measures the machine and runs no study: leave the names out");
  if (budget::machine_file().empty()) throw InputError(Place{}, "nowhere to keep the machine's figures: the environment has neither XDG_CACHE_HOME nor HOME");
  const budget::Machine machine = calibrate([&](const std::string& what) {
    if (!common.quiet) say(fmt::format("measuring {}\n", what));
  });
  budget::keep(machine);
  if (common.json) {
    print_document(budget::machine_json(machine));
    return ExitCode::kDone;
  }
  fmt::print("{}\n", machine.name);
  fmt::print("  a particle and step     {:.2f} us, and {:.1f} ns a neighbour\n", 1e6 * machine.particle_step, 1e9 * machine.pair_step);
  fmt::print("  an iteration            {:.1f} ns of a particle and {:.2f} ns a neighbour for pressure, {:.1f} and {:.2f} for viscosity\n", 1e9 * machine.pressure_particle, 1e9 * machine.pressure_pair, 1e9 * machine.viscosity_particle, 1e9 * machine.viscosity_pair);
  fmt::print("  classic                 {:.1f} ns a neighbour and step\n", 1e9 * machine.classic_pair);
  fmt::print("  threads                 {} step {:.2f} times as fast as one\n", machine.threads, machine.speedup);
  fmt::print("  skin                    {:.0f} us a particle and frame\n", 1e6 * machine.skin_particle);
  fmt::print("  files                   {:.0f} MB/s\n", 1e-6 / machine.write_byte);
  fmt::print("  pictures                {:.2f} us a pixel\n", 1e6 * machine.picture_pixel);
  log_info(fmt::format("kept in {}", budget::machine_file().string()));
  return ExitCode::kDone;
}

/// Of all studies asked for that the folder holds.
ExitCode print_cheapest(const StudyCommand& command) {
  const std::filesystem::path folder = command.folder.empty() ? std::filesystem::path("out") / "study" : command.folder;
  std::vector<study::CaseCosts> cases;
  for (const Study& one : studies()) {
    if (!command.names.empty() && std::find(command.names.begin(), command.names.end(), one.name) == command.names.end()) continue;
    const std::filesystem::path file = folder / (one.name + "-costs.csv");
    std::error_code error;
    if (!std::filesystem::exists(file, error)) continue;
    for (study::CaseCosts& costs : study::read_costs(read_file(file), file.string())) cases.push_back(std::move(costs));
  }
  if (cases.empty()) throw InputError(Place{folder.string()}, "holds no costs of a study: `effuse study integrators lava -o " + folder.string() + "` writes them");
  if (!command.cases.empty()) std::erase_if(cases, [&](const study::CaseCosts& c) { return std::find(command.cases.begin(), command.cases.end(), c.name) == command.cases.end(); });
  constexpr double kErrors[] = {0.1, 0.03, 0.01, 0.003};
  fmt::print("{}", study::cheapest_table(cases, kErrors));
  return ExitCode::kDone;
}

}  // namespace

ExitCode run_studies(const StudyCommand& command, const CommonOptions& common) {
  if (command.calibrate) return measure_machine(command, common);
  std::vector<std::string> names, case_names;
  for (const Study& one : studies()) names.push_back(one.name);
  study::require_known("study", command.names, names);
  if (command.cheapest) return print_cheapest(command);
  std::vector<Study> chosen = studies();
  if (!command.names.empty()) std::erase_if(chosen, [&](const Study& one) { return std::find(command.names.begin(), command.names.end(), one.name) == command.names.end(); });
  if (command.list) {
    print_list(chosen, common);
    return ExitCode::kDone;
  }
  // A case may belong to any of the studies asked for; a wrong name is told before the first of them runs.
  std::vector<std::vector<study::Case>> cases;
  for (const Study& one : chosen) {
    cases.push_back(one.cases());
    for (const study::Case& c : cases.back()) case_names.push_back(c.name);
  }
  study::require_known("case", command.cases, case_names);

  ExitCode code = ExitCode::kDone;
  nlohmann::ordered_json documents = nlohmann::ordered_json::array();
  std::vector<study::Chapter> chapters;
  for (std::size_t s = 0; s < chosen.size(); ++s) {
    study::StudyOptions options;
    options.name = chosen[s].name;
    options.what = chosen[s].what;
    options.version = EFFUSE_VERSION;
    options.folder = command.folder.empty() ? std::filesystem::path("out") / "study" : command.folder;
    options.full = command.full;
    options.resume = command.resume;
    for (const study::Case& c : cases[s])
      if (std::find(command.cases.begin(), command.cases.end(), c.name) != command.cases.end()) options.only.push_back(c.name);
    if (options.only.empty() && !command.cases.empty()) continue;  // its cases were not asked for

    const study::StudyReport report = study::run_study(cases[s], options, [&](std::size_t k, std::size_t n, const study::Case& which, const study::Outcome* outcome) {
      if (common.quiet) return;
      const std::string head = fmt::format("[{:>{}}/{}] {}: ", k, std::to_string(n).size(), n, which.name);
      if (!outcome) say(head + which.title + "\n");
      else if (!outcome->failure.empty()) say(fmt::format("{}failed after {}: {}\n", head, study::duration_text(outcome->seconds), outcome->failure));
      else say(fmt::format("{}{} of {} figures hold, {}\n", head, outcome->result.measures.size() - study::tally({*outcome}).missed, outcome->result.measures.size(), study::duration_text(outcome->seconds)));
    });

    chapters.push_back({options.name, options.what, report.outcomes, report.not_run});
    // All of them on one page, from the second on; as it grows.
    if (chapters.size() > 1) write_file(options.folder / "study.html", study::page_of("accuracy and what it costs", EFFUSE_VERSION, chapters));

    const study::Tally t = study::tally(report.outcomes);
    if (t.failed > 0 || (command.strict && t.missed > 0)) code = ExitCode::kFailed;
    if (common.json) {
      nlohmann::ordered_json document = nlohmann::ordered_json::parse(study::table_json(options.name, options.version, report.outcomes, report.not_run));
      document["folder"] = options.folder.string();
      documents.push_back(std::move(document));
    } else {
      fmt::print("{}", study::table_text(report.outcomes));
    }
    log_info(fmt::format("{}: {}; {}", options.name, study::summary(report.outcomes), (options.folder / (options.name + ".html")).string()));
  }
  // One study, one object: what scripts expect today; several come as a list.
  if (common.json) print_document((documents.size() == 1 ? documents[0] : documents).dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  return code;
}

}  // namespace effuse
