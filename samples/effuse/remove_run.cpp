#include "samples/effuse/remove_run.h"

#include <regex>
#include <vector>

namespace effuse {

namespace fs = std::filesystem;

void remove_run(const fs::path& folder) {
  struct Ours {
    const char* folder;
    std::regex name;
  };
  const std::vector<Ours> ours = {
      {"frames", std::regex(R"((skin|lava|obstacles)\.\d+(\.part)?\.(ply|obj|glb|vdb))")},
      {"preview", std::regex(R"((preview\.\d+|contact_sheet)(\.part)?\.png)")},
      {"maps", std::regex(R"((max_thickness|max_temperature|arrival_time|deposit|thickness)(\.\d+)?(\.part)?\.(tif|asc|prj))")},
      {"checkpoints", std::regex(R"((checkpoint|flow)\.\d+(\.part)?\.state)")}};
  for (const Ours& kind : ours) {
    std::error_code error;
    std::vector<fs::path> found;
    for (fs::directory_iterator at(folder / kind.folder, error), end; !error && at != end; at.increment(error))
      if (std::regex_match(at->path().filename().string(), kind.name)) found.push_back(at->path());
    for (const fs::path& file : found) fs::remove(file);
    fs::remove(folder / kind.folder, error);  // if nothing is left in it
  }
  for (const char* file : {"flow.csv", "bodies.csv", "bodies.glb", "run.json", "manifest.json"}) fs::remove(folder / file);
}

}  // namespace effuse
