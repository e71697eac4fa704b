#include "samples/effuse/remove_run.h"

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <regex>
#include <string>
#include <vector>

#include "geometry/base/files.h"

namespace effuse {

namespace fs = std::filesystem;

namespace {

/// skin|lava|obstacles, and what effects wrote by names of their own: of patterns "frames/NAME.####.ply" in the manifest.
std::string stems(const fs::path& folder) {
  std::string all = "skin|lava|obstacles";
  try {
    static const std::regex pattern(R"(frames/([A-Za-z0-9_-]+)\.####\..*)");
    const nlohmann::json manifest = nlohmann::json::parse(read_file(folder / "manifest.json"));  // held: items() only refers
    for (const auto& [name, value] : manifest.at("files").items()) {
      std::smatch match;
      const std::string path = value.is_string() ? value.get<std::string>() : "";
      if (std::regex_match(path, match, pattern)) all += "|" + match[1].str();
    }
  } catch (const std::exception&) {  // none, or damaged
  }
  return all;
}

/// Files with a number, from that frame on; whole: those without one, too.
void remove(const fs::path& folder, int from, bool whole) {
  struct Ours {
    const char* folder;
    std::regex name;
  };
  const std::vector<Ours> ours = {
      {"frames", std::regex("(?:" + stems(folder) + R"()\.(\d+)(?:\.(?:[0-9a-f]+\.)?part)?\.\w+(?:\.\w+)?)")},
      {"frames", std::regex("(?:" + stems(folder) + R"()\.(?:vtp\.series|clips\.usda))")},
      {"preview", std::regex(R"((?:preview\.(\d+)|contact_sheet)(?:\.(?:[0-9a-f]+\.)?part)?\.png)")},
      {"maps", std::regex(R"((?:max_thickness|max_temperature|arrival_time|deposit|thickness)(?:\.(\d+))?(?:\.(?:[0-9a-f]+\.)?part)?\.(?:tif|asc|prj))")},
      {"trouble", std::regex(R"(particles\.ply|picture\.png)")},
      {"checkpoints", std::regex(R"((?:checkpoint|flow)\.(\d+)(?:\.(?:[0-9a-f]+\.)?part)?\.state)")}};
  for (const Ours& kind : ours) {
    std::error_code error;
    std::vector<fs::path> found;
    for (fs::directory_iterator at(folder / kind.folder, error), end; !error && at != end; at.increment(error)) {
      std::smatch match;
      const std::string name = at->path().filename().string();
      if (std::regex_match(name, match, kind.name) && (match.size() > 1 && match[1].matched ? std::atoi(match[1].str().c_str()) >= from : whole)) found.push_back(at->path());
    }
    for (const fs::path& file : found) fs::remove(file);
    fs::remove(folder / kind.folder, error);  // if nothing is left in it
  }
}

}  // namespace

void remove_run(const fs::path& folder) {
  const std::regex named(R"(scene\.until-\d+\.toml|(?:)" + stems(folder) + R"()\.pvd)");
  remove(folder, 0, true);
  std::error_code error;
  std::vector<fs::path> found;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error))
    if (std::regex_match(at->path().filename().string(), named)) found.push_back(at->path());
  for (const fs::path& file : found) fs::remove(file);
  for (const char* file : {"flow.csv", "bodies.csv", "bodies.glb", "run.json", "manifest.json", "terrain.vtp", "terrain.usda", "obstacles.ply", "obstacles.glb", "obstacles.vtp", "obstacles.usda", "film.usda", "film.glb", "open_in_blender.py",
                           "open_in_houdini.py", "open_in_paraview.py"})
    fs::remove(folder / file);
}

void remove_frames_from(const fs::path& folder, int frame) { remove(folder, frame, false); }

}  // namespace effuse
