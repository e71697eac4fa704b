#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "geometry/base/files.h"
#include "importers/info.h"
#include "samples/effuse/commands.h"
#include "skin/surface/level_set.h"

namespace effuse {

namespace fs = std::filesystem;

namespace {
/// A run's folder: what its manifest and report say.
std::vector<std::string> describe_run(const fs::path& folder) {
  const fs::path manifest = folder / "manifest.json", report = folder / "run.json";
  if (!fs::exists(manifest)) throw InputError(Place{folder.string()}, "is a folder without manifest.json, wanted a file or the folder of a run");
  std::vector<std::string> lines;
  try {
    const auto m = nlohmann::json::parse(read_file(manifest));
    lines.push_back(fmt::format("run of '{}': {} frames at {} a second", m.at("name").get<std::string>(), m.at("frames").get<int>(), m.at("fps").get<double>()));
    for (const auto& [format, pattern] : m.at("files").items()) lines.push_back(fmt::format("{}: {}", format, pattern.get<std::string>()));
    const auto r = nlohmann::json::parse(read_file(report));
    lines.push_back(fmt::format("{}, {:.0f} s on {} threads, made by effuse {}", r.at("outcome").get<std::string>(), r.at("seconds").get<double>(), r.at("threads").get<int>(),
                                r.at("effuse").get<std::string>()));
  } catch (const nlohmann::json::exception& error) {
    throw InputError(Place{folder.string()}, fmt::format("manifest.json or run.json is damaged: {}", error.what()));
  }
  return lines;
}

std::vector<std::string> describe(const fs::path& file) {
  std::error_code ignored;  // a link to itself, a name too long: the reader says so
  if (fs::is_directory(file, ignored)) return describe_run(file);
  if (file.extension() == ".vdb") return skin::describe_vdb(file);
  return importers::describe_file(file);
}
}  // namespace

ExitCode info(const std::vector<fs::path>& files, const CommonOptions& common) {
  nlohmann::ordered_json j = nlohmann::ordered_json::array();
  std::vector<Fault> faults;
  for (const fs::path& file : files) {
    try {
      const std::vector<std::string> lines = describe(file);
      j.push_back({{"file", file.string()}, {"facts", lines}});
      if (common.json) continue;
      fmt::print("{}\n", file.string());
      for (const std::string& line : lines) fmt::print("  {}\n", line);
    } catch (const InputError& error) {
      faults.insert(faults.end(), error.faults().begin(), error.faults().end());
    }
  }
  if (!faults.empty()) throw InputError(faults);
  if (common.json) print_document(j.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  return ExitCode::kDone;
}

}  // namespace effuse
