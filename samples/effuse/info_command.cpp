#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "geometry/base/files.h"
#include "importers/info.h"
#include "samples/effuse/commands.h"
#include "samples/effuse/load_scene.h"
#include "skin/surface/level_set.h"

namespace effuse {

namespace fs = std::filesystem;

namespace {

using nlohmann::json;

/// The folder of the run that a path belongs to: the run's own, one of the folders in it, or a report it left; nothing for others.
std::optional<fs::path> run_of(const fs::path& path) {
  std::error_code ignored;
  const auto is_run = [&](const fs::path& folder) { return fs::exists(folder / "manifest.json", ignored) || (fs::exists(folder / "scene.toml", ignored) && fs::exists(folder / "checkpoints", ignored)); };
  const bool folder = fs::is_directory(path, ignored);
  if (folder && is_run(path)) return path;
  const fs::path above = fs::absolute(path, ignored).lexically_normal();
  const fs::path parent = above.has_filename() ? above.parent_path() : above.parent_path().parent_path();
  const std::string name = (above.has_filename() ? above : above.parent_path()).filename().string();
  const bool part = folder ? name == "frames" || name == "preview" || name == "maps" || name == "checkpoints" : name == "run.json" || name == "manifest.json";
  if (part && is_run(parent)) return parent;
  return std::nullopt;
}

/// What its manifest says: the frames and where they are.
void describe_manifest(const json& m, std::vector<std::string>& lines) {
  const int frames = m.at("frames").get<int>();
  const double fps = m.at("fps").get<double>();
  const json& times = m.at("frame_times");
  lines.push_back(fmt::format("run of '{}': {} frames at {} a second, {:.2f} s of film{}", m.at("name").get<std::string>(), frames, fps, frames / fps,
                              times.empty() ? "" : fmt::format(", {:.6g} s of lava", times.back().get<double>())));
  for (const auto& [format, pattern] : m.at("files").items()) lines.push_back(fmt::format("{}: {}", format, pattern.get<std::string>()));
  if (m.contains("flow")) {
    std::string paths;
    for (const auto& [name, path] : m.at("flow").items()) paths += (paths.empty() ? "" : ", ") + path.get<std::string>();
    lines.push_back("flow: " + paths);
  }
  const json& origin = m.at("origin");
  lines.push_back(fmt::format("origin on the map: {:.10g} {:.10g} {:.10g}", origin.at(0).get<double>(), origin.at(1).get<double>(), origin.at(2).get<double>()));
}

/// What its report says: how it ended, what it made and what it cost.
void describe_report(const json& r, std::vector<std::string>& lines) {
  const double seconds = r.at("seconds").get<double>();
  const std::string processor = r.contains("processor_seconds") ? fmt::format(" ({:.0f} s of processor time)", r.at("processor_seconds").get<double>()) : "";
  lines.push_back(fmt::format("{}, {:.0f} s on {} threads{}, {:.0f} MB of memory, made by effuse {}", r.at("outcome").get<std::string>(), seconds, r.at("threads").get<int>(), processor,
                              r.at("peak_memory_bytes").get<double>() / 1e6, r.at("effuse").get<std::string>()));
  for (const auto& [effect, figures] : r.at("effects").items()) {
    std::string line;
    for (const auto& [key, what] : {std::pair{"particles", "particles"}, {"volume_m3", "m3"}, {"steps", "steps"}})
      if (figures.contains(key)) line += fmt::format("{}{:.6g} {}", line.empty() ? "" : ", ", figures.at(key).get<double>(), what);
    if (figures.contains("min_temperature_K") && figures.contains("max_temperature_K"))
      line += fmt::format("{}{:.0f} to {:.0f} K", line.empty() ? "" : ", ", figures.at("min_temperature_K").get<double>(), figures.at("max_temperature_K").get<double>());
    lines.push_back(fmt::format("{}: {}", effect, line));
  }
  if (r.contains("skin"))
    lines.push_back(fmt::format("skin of frame {}: {} triangles, {} regions", r.at("skin").at("frame").get<int>(), r.at("skin").at("triangles").get<std::size_t>(), r.at("skin").at("regions").get<std::size_t>()));
  // Zones are of the last call, seconds of all: shares of what the zones sum up to.
  std::vector<std::pair<double, std::string>> zones;
  double all = 0;
  const json timed = r.value("zones", json::object());  // held: items() only refers
  for (const auto& [name, zone] : timed.items()) {
    zones.emplace_back(zone.at("self_s").get<double>(), name);
    all += zones.back().first;
  }
  std::stable_sort(zones.begin(), zones.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  std::string dearest;
  for (std::size_t k = 0; k < std::min<std::size_t>(zones.size(), 3); ++k) dearest += fmt::format("{}{} {:.0f} %", k == 0 ? "" : ", ", zones[k].second, 100 * zones[k].first / all);
  if (!dearest.empty()) lines.push_back("time went to " + dearest);
}

/// A run's folder: what its manifest and report say, of one that has them.
std::vector<std::string> describe_run(const fs::path& folder) {
  const fs::path manifest = folder / "manifest.json", report = folder / "run.json";
  std::vector<std::string> lines;
  const auto read = [&](const fs::path& file, void (*describe)(const json&, std::vector<std::string>&)) {
    try {
      describe(json::parse(read_file(file)), lines);
    } catch (const json::exception& error) {
      throw InputError(Place{file.string()}, fmt::format("is damaged: {}", error.what()));
    }
  };
  std::error_code ignored;
  if (fs::exists(manifest, ignored)) read(manifest, describe_manifest);
  else lines.push_back("run that has no manifest.json yet: it is in its first frames, or was ended there");
  if (fs::exists(report, ignored)) read(report, describe_report);
  lines.push_back(fmt::format("scene with every default: {}", (folder / "scene.toml").string()));
  return lines;
}

importers::FileFacts describe(const fs::path& file, const importers::ReadLimits& limits, const std::optional<Vec2>& at) {
  std::error_code ignored;  // a link to itself, a name too long: the reader says so
  if (at) return importers::file_facts(file, limits, at);
  if (const std::optional<fs::path> run = run_of(file)) return {describe_run(*run), ""};
  if (fs::is_directory(file, ignored)) throw InputError(Place{file.string()}, "is a folder that holds no run (no manifest.json), wanted a file or the folder of a run");
  if (file.extension() == ".vdb") return {skin::describe_vdb(file), ""};
  return importers::file_facts(file, limits);
}
}  // namespace

ExitCode info(const InfoCommand& command, const CommonOptions& common) {
  nlohmann::ordered_json j = nlohmann::ordered_json::array();
  std::vector<Fault> faults;
  const importers::ReadLimits limits = read_limits(common);
  std::optional<Vec2> at;
  if (!command.at.empty()) at = Vec2(command.at[0], command.at[1]);
  for (const fs::path& file : command.files) {
    try {
      const importers::FileFacts facts = describe(file, limits, at);
      const std::vector<std::string>& lines = facts.lines;
      j.push_back({{"file", file.string()}, {"facts", lines}});
      if (!facts.values.empty()) j.back()["values"] = nlohmann::ordered_json::parse(facts.values);
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
