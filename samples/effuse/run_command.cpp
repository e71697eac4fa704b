#include <fmt/format.h>
#include <sys/resource.h>

#include <csignal>
#include <cstring>
#include <nlohmann/json.hpp>

#include "geometry/base/files.h"
#include "geometry/base/log.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "samples/effuse/commands.h"
#include "samples/effuse/frame_writer.h"
#include "samples/effuse/load_scene.h"
#include "samples/effuse/progress.h"

namespace effuse {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

volatile std::sig_atomic_t g_interrupted = 0;  // a signal handler may touch nothing else

/// First Ctrl-C: finish the step, checkpoint, say how to go on. Second: the default, at once.
void on_interrupt(int signal) {
  g_interrupted = 1;
  std::signal(signal, SIG_DFL);
}

/// What run.json says: figures of the frames made, by this call and the ones it resumed.
class RunRecord {
 public:
  RunRecord(const LoadedScene& loaded, fs::path folder) : loaded_(loaded), folder_(std::move(folder)) {}

  /// Keeps the hashes of frames 1..last of an earlier run.json, when it is of the same scene.
  void read(int last) {
    try {
      const ordered_json old = ordered_json::parse(read_file(folder_ / "run.json"));
      if (old.at("scene_key") != loaded_.key) return;
      for (const ordered_json& frame : old.at("frames"))
        if (frame.at("frame").get<int>() <= last) frames_.push_back(frame);
      earlier_s_ = old.at("seconds").get<double>();
    } catch (const std::exception&) {
      log_warning(fmt::format("{} is missing or damaged: the hashes of the frames up to {} are not in the new one", (folder_ / "run.json").string(), last));
    }
  }

  void add_frame(const flow::Simulation& simulation, const FrameWriter::Result& result) {
    frames_.push_back({{"frame", simulation.frame()},
                       {"time_s", simulation.time()},
                       {"state", simulation.state_hash()},
                       {"triangles", result.triangles},
                       {"skin_volume_m3", result.volume},
                       {"particle_volume_m3", result.particle_volume}});
  }

  ordered_json document(const flow::Simulation& simulation, const Profile& profile, const std::string& outcome) const {
    ordered_json j;
    j["effuse"] = EFFUSE_VERSION;
    j["outcome"] = outcome;
    j["scene"] = loaded_.scene.name;
    j["scene_key"] = loaded_.key;
    j["seed"] = loaded_.scene.seed;
    j["threads"] = thread_count();
    j["seconds"] = earlier_s_ + profile.elapsed_s();
    rusage usage{};
    ::getrusage(RUSAGE_SELF, &usage);
    j["peak_memory_bytes"] = static_cast<std::int64_t>(usage.ru_maxrss) * 1024;
    j["terrain"] = loaded_.notes;
    for (const auto& effect : simulation.effects()) {
      ordered_json figures;
      for (const auto& [name, value] : effect->figures()) figures[name] = value;
      figures["memory_bytes"] = effect->memory();
      j["effects"][std::string(effect->name())] = figures;
    }
    for (const ZoneRow& row : profile.zones()) j["zones"][row.name] = {{"self_s", row.self_s}, {"total_s", row.total_s}, {"calls", row.calls}};
    for (const CounterRow& row : profile.counters()) j["counters"][row.name] = row.value;
    j["frames"] = frames_;
    return j;
  }

  void write(const ordered_json& document) const { write_file(folder_ / "run.json", document.dump(1) + "\n"); }

 private:
  const LoadedScene& loaded_;
  fs::path folder_;
  ordered_json frames_ = ordered_json::array();
  double earlier_s_ = 0;
};

/// A name for the output folder when none is given: out/ and the scene's.
fs::path default_folder(const fs::path& scene) { return fs::path("out") / scene.stem(); }

void go_on_from(const fs::path& checkpoint, LoadedScene& loaded) {
  loaded.simulation->restore(read_file(checkpoint), loaded.key, checkpoint.string());
}

}  // namespace

ExitCode run(const RunCommand& command, const CommonOptions& common) {
  Profile profile;
  const ProfileScope scope(profile);
  const std::unique_ptr<LoadedScene> loaded = load_scene(command.scene, command.set, command.frames);
  const flow::Scene& scene = loaded->scene;
  flow::Simulation& simulation = *loaded->simulation;
  for (const std::string& note : loaded->notes) log_info("terrain: " + note);

  const fs::path folder = command.folder.empty() ? default_folder(command.scene) : command.folder;
  const std::string resume_line = fmt::format("effuse run {} -o {} --resume", command.scene.string(), folder.string());
  const bool was_there = fs::exists(folder / "scene.toml");
  if (was_there && !command.resume && !command.force)
    throw InputError(Place{folder.string()}, "holds a run already: --resume goes on with it, --force starts anew, -o names another folder");

  RunRecord record(*loaded, folder);
  if (command.resume && was_there) {
    const fs::path checkpoint = flow::newest_checkpoint(folder);
    if (!checkpoint.empty()) {
      go_on_from(checkpoint, *loaded);
      record.read(simulation.frame());
      log_info(fmt::format("going on after frame {}", simulation.frame()));
    }
  } else if (was_there) {
    for (const char* old : {"frames", "preview", "checkpoints", "run.json", "manifest.json"}) fs::remove_all(folder / old);
  }

  FrameWriter writer(scene, loaded->skin, *loaded->terrain, folder);
  write_file(folder / "scene.toml", loaded->resolved);
  writer.write_terrain();

  g_interrupted = 0;
  const auto old_handler = std::signal(SIGINT, on_interrupt);
  const auto old_terminate = std::signal(SIGTERM, on_interrupt);
  Progress progress(simulation.frame(), scene.frames, common.quiet);
  const auto status = [&] {
    std::string text;
    for (const auto& effect : simulation.effects()) text += (text.empty() ? "" : "; ") + effect->status();
    return text;
  };

  std::string outcome = "done";
  ExitCode code = ExitCode::kDone;
  try {
    while (simulation.frame() < scene.frames) {
      const bool whole = simulation.advance([&] {
        progress.tick(status());
        return g_interrupted == 0;
      });
      if (!whole) {
        outcome = "interrupted";
        code = ExitCode::kInterrupted;
        break;
      }
      const FrameWriter::Result result = writer.write_frame(simulation);
      record.add_frame(simulation, result);
      progress.frame_done(simulation.frame(), fmt::format("{}, {} triangles", status(), result.triangles));
      if (simulation.frame() % loaded->skin.checkpoint_every == 0 || simulation.frame() == scene.frames) {
        flow::write_checkpoint(folder, simulation, loaded->key);
        record.write(record.document(simulation, profile, "running"));
        writer.write_manifest(simulation.frame());
      }
    }
    if (code == ExitCode::kInterrupted) flow::write_checkpoint(folder, simulation, loaded->key);
    if (code == ExitCode::kDone) writer.write_contact_sheet(scene.frames);
  } catch (const UnstableError& error) {
    progress.end();
    log_warning(error.what());
    outcome = std::string("unstable: ") + error.what();
    code = ExitCode::kUnstable;
  }
  progress.end();
  std::signal(SIGINT, old_handler);
  std::signal(SIGTERM, old_terminate);

  writer.write_manifest(simulation.frame());
  const ordered_json document = record.document(simulation, profile, outcome);
  record.write(document);
  if (common.json) fmt::print("{}\n", document.dump(1));
  if (!common.quiet && !common.json) fmt::print(stderr, "\n{}\n", profile.table());

  if (code == ExitCode::kInterrupted) log_warning("interrupted; this goes on: " + resume_line);
  if (code == ExitCode::kUnstable) {
    const fs::path checkpoint = flow::newest_checkpoint(folder);
    log_warning(fmt::format("stopped in frame {}; the last good state is {}", simulation.frame() + 1, checkpoint.empty() ? "the start" : checkpoint.string()));
  }
  if (code == ExitCode::kDone) log_info(fmt::format("{} frames in {}", simulation.frame(), (folder / "frames").string()));
  return code;
}

}  // namespace effuse
