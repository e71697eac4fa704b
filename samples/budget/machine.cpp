#include "samples/budget/machine.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <utility>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/parallel.h"

namespace effuse::budget {

namespace fs = std::filesystem;

namespace {

constexpr int kVersion = 1;

/// The numbers, by the names they have in the file.
constexpr std::array<std::pair<const char*, Real Machine::*>, 12> kFigures = {{{"speedup", &Machine::speedup},
                                                                               {"step", &Machine::step},
                                                                               {"particle_step", &Machine::particle_step},
                                                                               {"pair_step", &Machine::pair_step},
                                                                               {"pressure_particle", &Machine::pressure_particle},
                                                                               {"pressure_pair", &Machine::pressure_pair},
                                                                               {"viscosity_particle", &Machine::viscosity_particle},
                                                                               {"viscosity_pair", &Machine::viscosity_pair},
                                                                               {"classic_pair", &Machine::classic_pair},
                                                                               {"skin_particle", &Machine::skin_particle},
                                                                               {"write_byte", &Machine::write_byte},
                                                                               {"picture_pixel", &Machine::picture_pixel}}};

std::string processor() {
  std::ifstream in("/proc/cpuinfo");
  for (std::string line; std::getline(in, line);)
    if (line.starts_with("model name")) {
      const std::size_t colon = line.find(": ");
      if (colon != std::string::npos) return line.substr(colon + 2);
    }
  return "unknown processor";
}

}  // namespace

Real Machine::seconds(const Counts& c, bool classic) const {
  if (classic) return step * c.steps + classic_pair * c.pair_steps;
  return step * c.steps + particle_step * c.particle_steps + pair_step * c.pair_steps + pressure_particle * c.pressure_particles + pressure_pair * c.pressure_pairs +
         viscosity_particle * c.viscosity_particles + viscosity_pair * c.viscosity_pairs;
}

Real Machine::on_threads(Real processor_seconds, int wanted) const {
  if (wanted <= 1) return processor_seconds;
  // Amdahl's law through the measured point: speedup = 1 / (1 - s + s / n).
  const Real measured_with = std::max(2, threads);
  const Real shared = std::clamp((1 - 1 / speedup) / (1 - 1 / measured_with), 0.0, 1.0);
  return processor_seconds * (1 - shared + shared / wanted);
}

Machine usual_machine() { return {}; }

std::string name_of_this_machine() {
  std::array<char, 256> host{};
  if (::gethostname(host.data(), host.size() - 1) != 0) host[0] = 0;
  return fmt::format("{}, {}, {} threads", host[0] ? host.data() : "unknown host", processor(), thread_count());
}

fs::path machine_file() {
  // An empty or relative XDG_CACHE_HOME counts as none (XDG Base Directory Specification 0.8).
  if (const char* cache = std::getenv("XDG_CACHE_HOME"); cache && *cache == '/') return fs::path(cache) / "effuse" / "machine.json";
  if (const char* home = std::getenv("HOME"); home && *home) return fs::path(home) / ".cache" / "effuse" / "machine.json";
  return {};
}

Machine known_machine(std::string& why) {
  const fs::path file = machine_file();
  std::error_code error;
  if (file.empty() || !fs::exists(file, error)) {
    why = "built-in figures; `effuse study --calibrate` measures this machine's";
    return usual_machine();
  }
  try {
    Machine machine = read_machine(read_file(file), file.string());
    // Fewer threads by --threads are another question: on_threads answers it.
    const std::string mine = name_of_this_machine();
    if (machine.name.substr(0, machine.name.rfind(',')) != mine.substr(0, mine.rfind(','))) {
      why = fmt::format("built-in figures: {} is of another machine, {}; `effuse study --calibrate` measures this one", file.string(), machine.name);
      return usual_machine();
    }
    why = fmt::format("figures of this machine, {}", machine.when);
    return machine;
  } catch (const InputError& bad) {
    why = fmt::format("built-in figures: {}; `effuse study --calibrate` writes it anew", bad.what());
    return usual_machine();
  }
}

std::string machine_json(const Machine& machine) {
  nlohmann::ordered_json j;
  j["effuse_machine"] = kVersion;
  j["name"] = machine.name;
  j["when"] = machine.when;
  j["threads"] = machine.threads;
  for (const auto& [name, figure] : kFigures) j[name] = machine.*figure;
  return j.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

Machine read_machine(const std::string& json, const std::string& file) {
  Machine machine;
  try {
    const auto j = nlohmann::json::parse(json);
    if (j.at("effuse_machine").get<int>() != kVersion) throw InputError(Place{file}, fmt::format("version {}, wanted {}", j.at("effuse_machine").get<int>(), kVersion));
    machine.name = j.at("name").get<std::string>();
    machine.when = j.at("when").get<std::string>();
    machine.threads = j.at("threads").get<int>();
    for (const auto& [name, figure] : kFigures) {
      machine.*figure = j.at(name).get<Real>();
      if (!(machine.*figure > 0) || !std::isfinite(machine.*figure)) throw InputError(Place{file}, fmt::format("{} is {}, wanted a number above 0", name, machine.*figure));
    }
    if (machine.threads < 1) throw InputError(Place{file}, fmt::format("threads is {}, wanted at least 1", machine.threads));
  } catch (const nlohmann::json::exception& bad) {
    throw InputError(Place{file}, fmt::format("is not what `effuse study --calibrate` writes: {}", bad.what()));
  }
  return machine;
}

void keep(const Machine& machine) {
  const fs::path file = machine_file();
  if (file.empty()) throw InputError(Place{}, "nowhere to keep the machine's figures: the environment has neither XDG_CACHE_HOME nor HOME");
  try {
    write_file(file, machine_json(machine));
  } catch (const ResourceError&) {
    throw;
  } catch (const std::exception& error) {
    throw InputError(Place{file.string()}, fmt::format("cannot be written: {}; XDG_CACHE_HOME names another folder", error.what()));
  }
}

}  // namespace effuse::budget
