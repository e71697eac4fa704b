#include <fmt/format.h>
#include <link.h>
#include <sys/resource.h>
#include <time.h>

#include <cstdio>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "flow/effects/registry.h"
#include "geometry/base/hash.h"
#include "geometry/base/log.h"
#include "geometry/base/parallel.h"
#include "samples/effuse/load_scene.h"
#include "tests/samples/counted_run/allocations.h"

/// counted_run SCENE FRAMES [KEY=VALUE]...: builds the effects of a scene and steps them, on one thread, as flow::Simulation does, and
/// says as JSON what each took of the heap, and what the whole took of heap, memory and time. Linked twice: with all effects there are,
/// and with lava alone.
namespace {

using effuse::counted::Account;
using effuse::counted::Heap;

nlohmann::ordered_json told(const Heap& heap) { return {{"calls", heap.calls}, {"bytes", heap.bytes}, {"held", heap.held}, {"largest", heap.largest}}; }

double cpu_s() {
  timespec t{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// Bytes of the program's own variables: its segments that can be written.
std::int64_t variables() {
  std::int64_t bytes = 0;
  ::dl_iterate_phdr(
      [](dl_phdr_info* program, std::size_t, void* to) {
        for (int k = 0; k < program->dlpi_phnum; ++k)
          if (const auto& segment = program->dlpi_phdr[k]; segment.p_type == PT_LOAD && (segment.p_flags & PF_W)) *static_cast<std::int64_t*>(to) += static_cast<std::int64_t>(segment.p_memsz);
        return 1;  // the program is the first; the libraries are the same ones
      },
      &bytes);
  return bytes;
}

int run(int argc, char** argv) {
  using namespace effuse;
  if (argc < 3) throw InputError(Place{}, "wanted: counted_run SCENE FRAMES [KEY=VALUE]...");
  set_log_level(LogLevel::kWarnings);
  const ThreadLimit one(1);
  const Heap at_start = counted::heap();
  const auto loaded = load_scene(argv[1], {argv + 3, argv + argc}, std::stoi(argv[2]));
  loaded->simulation.reset();

  const flow::World world{&*loaded->terrain,          loaded->scene.seed,           &loaded->solids.obstacles, &loaded->solids.bodies, &loaded->solids.joints,
                          loaded->scene.body_settings, [&](const flow::PlannedForm& form) { return load_form(form, {std::filesystem::path(argv[1]).parent_path(), {false, 0, 0}}, loaded->notes); }};
  const Heap loaded_heap = counted::heap();
  const double loaded_s = cpu_s();
  std::vector<std::unique_ptr<flow::Effect>> effects;
  effects.reserve(loaded->scene.effects.size());
  for (const flow::EffectPlan& plan : loaded->scene.effects) {
    const Account account(plan.name);
    effects.push_back(plan.build(world));
  }
  for (const auto& effect : effects) {
    std::vector<flow::Effect*> others;
    others.reserve(effects.size());
    for (const auto& other : effects)
      if (other != effect) others.push_back(other.get());
    const Account account{std::string(effect->name())};
    effect->meet(others);
  }
  for (int frame = 1; frame <= loaded->scene.frames; ++frame)
    for (const auto& effect : effects) {
      const Account account{std::string(effect->name())};
      while (effect->time() < loaded->scene.frame_time(frame)) effect->step(loaded->scene.frame_time(frame));
    }
  const double end_s = cpu_s();
  const Heap end = counted::heap();

  nlohmann::ordered_json j;
  j["kinds"] = nlohmann::ordered_json::array();
  for (const flow::EffectKind& kind : flow::effect_kinds()) j["kinds"].push_back(kind.name);
  StateHash hash;
  const auto accounts = counted::heap_by_label();
  Heap named;
  for (const auto& effect : effects) {
    const std::string name(effect->name());
    effect->add_to(hash);
    j["effects"][name] = told(accounts.at(name));
    j["effects"][name]["says"] = effect->memory();
    named.calls += accounts.at(name).calls;
  }
  j["calls_of_no_effect"] = end.calls - loaded_heap.calls - named.calls;
  j["state"] = hash.hex();
  j["before_main"] = told(at_start);
  j["whole"] = told(end);
  j["variables"] = variables();
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  j["peak_rss"] = static_cast<std::int64_t>(usage.ru_maxrss) * 1024;
  // At the end, when lava is most: without the pages of the program's file and its libraries', which the system shares and drops. Counted
  // page by page: what /proc/self/status says is off by up to some hundred pages on a machine with many cores.
  std::ifstream pages("/proc/self/smaps_rollup");
  for (std::string line; std::getline(pages, line);)
    if (line.starts_with("Anonymous:")) j["anonymous"] = std::stoll(line.substr(10)) * 1024;
  j["load_cpu_s"] = loaded_s;
  j["effects_cpu_s"] = end_s - loaded_s;
  fmt::print("{}\n", j.dump(1));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return 2;
  }
}
