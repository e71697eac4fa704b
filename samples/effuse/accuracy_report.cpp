#include "samples/effuse/accuracy_report.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace effuse {

std::string accuracy_json(const budget::Forecast& f, const Cost& cost, const std::string& why) {
  nlohmann::ordered_json j;
  j["wanted"] = f.wanted;
  for (const budget::Setting& s : f.settings) j[s.of_the_scene ? "kept" : "chosen"][s.key] = s.value;
  j["rehearsed_m"] = f.rehearsed;
  j["front_error_by"] = f.told_by == budget::ErrorBy::kRehearsals ? "rehearsals" : "depth";
  j["predicted"] = {{"front_error", f.error},
                    {"front_m", f.front},
                    {"particles", f.particles},
                    {"steps", f.counts.steps},
                    {"seconds", cost.seconds},
                    {"processor_seconds", cost.processor_seconds},
                    {"memory_bytes", cost.memory},
                    {"disk_bytes", cost.disk}};
  j["machine"] = why;
  return j.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

CameTo came_to(const LoadedScene& loaded, const std::filesystem::path& folder) {
  CameTo c;
  for (const auto& effect : loaded.simulation->effects()) {
    if (effect->name() != "lava") continue;
    std::vector<flow::sph::PlanLine> vents;
    for (const flow::Opening& opening : effect->openings()) vents.push_back({opening.from.head<2>(), opening.to.head<2>()});
    const geometry::Points points = effect->points();
    if (const auto front = flow::sph::find_front(points, vents)) c.front = front->distance;
    c.particles = static_cast<double>(points.size());
    for (const auto& [name, value] : effect->figures())
      if (name == "steps") c.steps = value;
  }
  for (const char* part : {"frames", "preview"}) {
    std::error_code error;
    for (const auto& file : std::filesystem::directory_iterator(folder / part, error))
      if (file.is_regular_file(error)) c.disk += static_cast<double>(file.file_size(error));
  }
  return c;
}

std::string came_to_json(const CameTo& c) {
  const nlohmann::ordered_json j = {{"front_m", c.front},   {"particles", c.particles},  {"steps", c.steps},    {"seconds", c.seconds}, {"processor_seconds", c.processor_seconds},
                                    {"memory_bytes", c.memory}, {"disk_bytes", c.disk}};
  return j.dump();
}

std::string beside(const budget::Forecast& f, const Cost& cost, const CameTo& c) {
  return fmt::format("predicted, and come to: {} and {}, {} and {} of memory, {} and {} of disk, front at {:.0f} and {:.0f} m, off by about {:.2g} %", time_text(cost.seconds), time_text(c.seconds), bytes_text(cost.memory),
                     bytes_text(c.memory), bytes_text(cost.disk), bytes_text(c.disk), f.front, c.front, 100 * f.error);
}

}  // namespace effuse
