#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <new>
#include <nlohmann/json.hpp>
#include <map>
#include <optional>

#include "geometry/base/files.h"
#include "geometry/base/log.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "importers/scene/scene_file.h"
#include "samples/effuse/accuracy_report.h"
#include "samples/effuse/body_writer.h"
#include "samples/effuse/branch.h"
#include "samples/effuse/commands.h"
#include "samples/effuse/cost.h"
#include "samples/effuse/flow_writer.h"
#include "samples/effuse/frame_writer.h"
#include "samples/effuse/handoff.h"
#include "samples/effuse/load_scene.h"
#include "samples/effuse/output_folder.h"
#include "samples/effuse/progress.h"
#include "samples/effuse/remove_run.h"
#include "samples/effuse/stop_signals.h"
#include "samples/effuse/trouble.h"

namespace effuse {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

constexpr double kUnsolvedShare = 0.05;  // of the steps: more are worth a word

/// Processor time of all threads since the process began [s], user and system.
double processor_seconds() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

/// What run.json says: figures of the frames made, by this call and the ones it resumed.
class RunRecord {
 public:
  /// The call's processor time counts from processor_start on [s], a value of processor_seconds().
  RunRecord(const LoadedScene& loaded, fs::path folder, double processor_start) : loaded_(loaded), folder_(std::move(folder)), processor_start_(processor_start) {
    if (!loaded.forecast) return;
    const budget::Machine machine = budget::known_machine(machine_);
    cost_ = cost_of(loaded, machine);
  }

  /// Keeps the hashes of frames 1..last of an earlier run.json, when it is of the same scene: by its scene_key, this one's or that given.
  void read(int last, const std::string& scene_key = {}) {
    try {
      const ordered_json old = ordered_json::parse(read_file(folder_ / "run.json"));
      if (old.at("scene_key") != (scene_key.empty() ? loaded_.key : scene_key)) throw std::runtime_error("of another scene");
      for (const ordered_json& frame : old.at("frames"))
        if (frame.at("frame").get<int>() <= last) frames_.push_back(frame);
      earlier_s_ = old.at("seconds").get<double>();
      earlier_cpu_s_ = old.value("processor_seconds", 0.0);
      if (old.contains("accuracy")) {
        const ordered_json& came = old.at("accuracy").at("came_to");
        earlier_steps_s_ = came.at("seconds").get<double>();
        earlier_processor_s_ = came.at("processor_seconds").get<double>();
      }
      if (old.contains("skin") && old.at("skin").at("frame").get<int>() <= last) skin_ = old.at("skin");
      if (old.contains("branches"))
        for (const ordered_json& each : old.at("branches"))
          if (each.at("from_frame").get<int>() <= last + 1) branches_.push_back(each);
    } catch (const std::exception&) {
      frames_ = ordered_json::array();
      log_warning(fmt::format("{} is missing, damaged or of another scene: the hashes of the frames up to {} are not in the new one", (folder_ / "run.json").string(), last));
    }
  }

  void add_frame(const flow::Simulation& simulation, const FrameWriter::Result& result) {
    frames_.push_back({{"frame", simulation.frame()},
                       {"time_s", simulation.time()},
                       {"state", simulation.state_hash()},
                       {"triangles", result.triangles},
                       {"skin_volume_m3", result.volume},
                       {"particle_volume_m3", result.particle_volume}});
    if (result.triangles == 0) return;
    skin_ = {{"frame", simulation.frame()},
             {"triangles", result.triangles},
             {"regions", result.regions},
             {"thin_triangles_share", result.shapes.thin},
             {"least_angle_deg", result.shapes.least_angle},
             {"folded_triangles", result.shapes.folded},
             {"held_back_vertices", result.held_back}};
  }

  /// The frames from this one on are of another scene than those before, which is kept under that name.
  void add_branch(int from_frame, const std::vector<std::string>& changes, const std::string& scene_before) {
    branches_.push_back({{"from_frame", from_frame}, {"changes", changes}, {"scene_before", scene_before}});
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
    j["processor_seconds"] = earlier_cpu_s_ + processor_seconds() - processor_start_;
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
    if (loaded_.forecast) {
      j["accuracy"] = ordered_json::parse(accuracy_json(*loaded_.forecast, cost_, machine_));
      j["accuracy"]["came_to"] = ordered_json::parse(came_to_json(outcome_of(profile)));
    }
    if (!skin_.empty()) j["skin"] = skin_;
    if (!branches_.empty()) j["branches"] = branches_;
    j["frames"] = frames_;
    return j;
  }

  /// What this run, and those it went on from, have taken so far: without the rehearsals.
  CameTo outcome_of(const Profile& profile) const {
    CameTo c = came_to(loaded_, folder_);
    rusage usage{};
    ::getrusage(RUSAGE_SELF, &usage);
    c.seconds = earlier_steps_s_ + profile.elapsed_s() - loaded_.rehearsal_seconds;
    c.processor_seconds = earlier_processor_s_ + processor_seconds() - loaded_.rehearsal_processor_seconds;
    c.memory = 1024.0 * static_cast<double>(usage.ru_maxrss);
    return c;
  }
  const Cost& cost() const { return cost_; }

  void write(const ordered_json& document) const { write_file(folder_ / "run.json", document.dump(1, ' ', false, ordered_json::error_handler_t::replace) + "\n"); }

 private:
  const LoadedScene& loaded_;
  fs::path folder_;
  double processor_start_;
  ordered_json frames_ = ordered_json::array();
  ordered_json branches_ = ordered_json::array();
  ordered_json skin_;  // of the last frame with one
  double earlier_s_ = 0, earlier_cpu_s_ = 0, earlier_steps_s_ = 0, earlier_processor_s_ = 0;  // the last two without rehearsals
  Cost cost_;            // predicted, where the scene says how right it is to be
  std::string machine_;  // where the figures for it come from
};

/// A name for the output folder when none is given: out/ and the scene's.
fs::path default_folder(const fs::path& scene) { return fs::path("out") / scene.stem(); }

/// A word as a shell reads it back.
std::string quoted(const std::string& word) {
  if (!word.empty() && word.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=./,:@%") == std::string::npos) return word;
  std::string out = "'";
  for (const char c : word) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

/// The command that goes on with this run.
std::string resume_line(const RunCommand& command, const std::string& program, const fs::path& folder) {
  std::string line = fmt::format("{} run {} -o {}", quoted(program), quoted(command.scene.string()), quoted(folder.string()));
  if (command.frames > 0) line += fmt::format(" --frames {}", command.frames);
  for (const std::string& assignment : command.set) line += " --set " + quoted(assignment);
  return line + " --resume";
}

/// "4.2 s", "4 min 4 s"
std::string duration(double s) { return s < 120 ? fmt::format("{:.1f} s", s) : fmt::format("{:.0f} min {:.0f} s", std::floor(s / 60), std::floor(s - 60 * std::floor(s / 60))); }

/// "4 min 4 s, 7 min 3 s of processor time: sph.forces 61 %, preview.rays 12 %, skin.mesh 8 %"
std::string summary(const Profile& profile, double processor_s) {
  const double all = profile.elapsed_s();
  std::string text = fmt::format("{}, {} of processor time", duration(all), duration(processor_s));
  const std::vector<ZoneRow> zones = profile.zones();
  for (std::size_t k = 0; k < std::min<std::size_t>(zones.size(), 3); ++k) text += fmt::format("{} {} {:.0f} %", k == 0 ? ":" : ",", zones[k].name, 100 * zones[k].self_s / all);
  return text;
}

/// Restores the newest checkpoint that is whole, and what the maps had gathered by then; false when there is none at all.
bool go_on(const fs::path& folder, LoadedScene& loaded, FlowWriter& flow_writer, BodyWriter& body_writer) {
  const std::vector<fs::path> checkpoints = flow::checkpoints(folder);
  bool whole = false;
  for (const fs::path& checkpoint : checkpoints) {
    const std::string bytes = read_file(checkpoint);
    if (!flow::undamaged(bytes)) {
      log_warning(fmt::format("{} is damaged or of another version, going back to the one before", checkpoint.string()));
      continue;
    }
    loaded.simulation->restore(bytes, loaded.key, checkpoint.string());
    if (!body_writer.restore()) throw InputError(Place{(folder / "bodies.csv").string()}, "is missing, damaged or shorter than the checkpoint, and the run goes on from it; --force starts anew");
    if (flow_writer.restore()) return true;
    whole = true;
    log_warning(fmt::format("{} has no sound record of the maps and flow.csv beside it, going back to the one before", checkpoint.string()));
  }
  if (whole)
    throw InputError(Place{(folder / "checkpoints").string()},
                     "no checkpoint has a record of the maps and flow.csv beside it (flow.*.state): --set output.maps=false --set output.series=false goes on without them, --force starts anew");
  if (!checkpoints.empty()) throw InputError(Place{(folder / "checkpoints").string()}, "every checkpoint is damaged or of another version; --force starts anew");
  return false;
}

/// The state after that frame of the folder's run, to go on from with the scene as it is now; the scene before is kept beside the new one.
void branch(const fs::path& folder, int last, LoadedScene& loaded, FlowWriter& flow_writer, BodyWriter& body_writer, RunRecord& record) {
  const std::vector<std::string> changes = changes_between(importers::read_scene_file(folder / "scene.toml"), importers::read_scene_text(loaded.resolved, "the scene"));
  const fs::path checkpoint = checkpoint_after(folder, last);
  const std::string key = loaded.simulation->branch(read_file(checkpoint), checkpoint.string());
  if (!body_writer.restore()) throw InputError(Place{(folder / "bodies.csv").string()}, "is missing, damaged or shorter than the checkpoint; --force starts anew");
  if (!flow_writer.restore(key))
    throw InputError(Place{checkpoint.string()}, "has no sound record of the maps and flow.csv beside it (flow.*.state): --set output.maps=false --set output.series=false goes on without them");
  const std::string before = fmt::format("scene.until-{:04}.toml", last);
  record.read(last, key);
  record.add_branch(last + 1, changes, before);
  write_file(folder / before, read_file(folder / "scene.toml"));
  for (const std::string& change : changes) log_info("from frame " + std::to_string(last + 1) + " on " + change);
  if (changes.empty()) log_warning("the scene is the one that the frames before were made with: the frames will be the same");
}

}  // namespace

ExitCode run(const RunCommand& command, const CommonOptions& common) {
  Profile profile;
  const double processor_start = processor_seconds();
  const ProfileScope scope(profile);
  const std::unique_ptr<LoadedScene> loaded = load_scene(command.scene, command.set, command.frames, read_limits(common));
  const flow::Scene& scene = loaded->scene;
  flow::Simulation& simulation = *loaded->simulation;
  for (const std::string& note : loaded->notes) log_info("terrain: " + note);
  if (loaded->forecast)
    for (const auto& [name, text] : told(*loaded->forecast)) log_info(name + ": " + text);
  double particles = 0;
  for (const flow::EffectPlan& plan : scene.effects) particles += plan.estimate.particles;
  const bool lava = std::any_of(simulation.effects().begin(), simulation.effects().end(), [](const auto& effect) { return effect->spacing() > 0; });
  if (lava && particles < 1) log_warning("not one particle will come out within the film: look at rate, start and spacing");

  const fs::path folder = command.folder.empty() ? default_folder(command.scene) : command.folder;
  std::error_code no_folder;
  const bool was_there = fs::exists(folder / "scene.toml", no_folder);
  if (was_there && !command.resume && !command.force && command.from_frame == 0)
    throw InputError(Place{folder.string()}, "holds a run already: --resume goes on with it, --from-frame goes on differently, --force starts anew, -o names another folder");
  if ((command.resume || command.from_frame > 0) && !was_there)
    throw InputError(Place{folder.string()}, fmt::format("{}, so there is nothing to go on with: without --resume a run starts{}", fs::exists(folder, no_folder) ? "holds no run" : "does not exist",
                                                         command.folder.empty() ? "; -o names the folder when it is another" : ""));

  FlowWriter flow_writer(*loaded, folder);
  BodyWriter body_writer(*loaded, folder);
  const OutputFolder held(folder);
  RunRecord record(*loaded, folder, processor_start);
  if (command.resume) {
    if (go_on(folder, *loaded, flow_writer, body_writer)) {
      record.read(simulation.frame());
      log_info(fmt::format("going on after frame {}", simulation.frame()));
    } else {
      log_info("no checkpoint yet: starting from the first frame");
    }
  } else if (command.from_frame > 0) {
    if (scene.frames < command.from_frame) throw InputError(Place{"--from-frame"}, fmt::format("is {}, the film has {} frames", command.from_frame, scene.frames));
    branch(folder, command.from_frame - 1, *loaded, flow_writer, body_writer, record);
  } else if (was_there) {
    remove_run(folder);
  }

  FrameWriter writer(scene, loaded->skin, *loaded->terrain, loaded->solids, folder);
  writer.write_terrain();
  // From the start, so that a run that is cut off can be opened.
  write_handoff_scripts(folder);
  if (std::error_code ignored; !fs::exists(folder / "manifest.json", ignored)) writer.write_manifest(simulation.frame(), {});

  std::optional<StopSignals> signals(std::in_place);
  Progress progress(simulation.frame(), scene.frames, common.quiet);
  const auto status = [&] {
    std::string text;
    double now = simulation.time();
    for (const auto& effect : simulation.effects()) {
      text += (text.empty() ? "" : "; ") + effect->status();
      now = std::max(now, effect->time());
    }
    return fmt::format("{:.4g} s, {}", now, text);
  };

  const auto written = [&] {
    std::vector<std::pair<std::string, std::string>> files = flow_writer.files();
    for (auto& file : body_writer.files()) files.push_back(std::move(file));
    return files;
  };

  // The records of maps and bodies before the checkpoint they belong to.
  const auto save_state = [&] {
    body_writer.write_series();
    flow_writer.save_record();
    flow::write_checkpoint(folder, simulation, loaded->key, static_cast<std::size_t>(loaded->skin.keep_checkpoints));
    flow_writer.remove_old_records();
  };

  if (command.from_frame > 0) {
    // From here to the checkpoint saved below a crash leaves the run before, shorter.
    remove_frames_from(folder, command.from_frame);
    record.write(record.document(simulation, profile, "running"));
    save_state();
    writer.write_manifest(simulation.frame(), written());
  }
  write_file(folder / "scene.toml", loaded->resolved);

  std::string outcome = "done";
  ExitCode code = ExitCode::kDone;
  try {
    while (simulation.frame() < scene.frames) {
      const bool whole = simulation.advance([&] {
        progress.tick(status());
        return !StopSignals::asked();
      });
      if (!whole) {
        outcome = "interrupted";
        code = ExitCode::kInterrupted;
        break;
      }
      const FrameWriter::Result result = writer.write_frame(simulation);
      record.add_frame(simulation, result);
      flow_writer.add_frame();
      body_writer.add_frame();
      progress.frame_done(simulation.frame(), fmt::format("{}, {} triangles", status(), result.triangles));
      if (simulation.frame() % loaded->skin.checkpoint_every == 0 || simulation.frame() == scene.frames) {
        // The record first: killed in between, it holds more frames than the checkpoint, never fewer.
        record.write(record.document(simulation, profile, "running"));
        save_state();
        flow_writer.write_series();
        writer.write_collections(simulation.frame());
        writer.write_manifest(simulation.frame(), written());
      }
    }
    if (code == ExitCode::kInterrupted) {
      record.write(record.document(simulation, profile, outcome));
      save_state();
    }
    if (code == ExitCode::kDone) writer.write_contact_sheet(scene.frames);
  } catch (const UnstableError& error) {
    progress.end();
    log_warning(error.what());
    outcome = std::string("unstable: ") + error.what();
    code = ExitCode::kUnstable;
    record.write(record.document(simulation, profile, outcome));
    save_state();  // as before the step that failed
    for (const std::string& line : write_trouble(folder, command.scene, *loaded, error)) log_warning(line);
  } catch (const std::exception& error) {
    const bool full = dynamic_cast<const ResourceError*>(&error) || dynamic_cast<const std::bad_alloc*>(&error);
    progress.end();
    if (full) log_warning("out of room; with more, this goes on: " + resume_line(command, common.program, folder));
    throw;
  }
  progress.end();

  flow_writer.write_series();
  flow_writer.write_maps();
  body_writer.write_series();
  body_writer.write_animation();
  writer.write_manifest(simulation.frame(), written());
  const ordered_json document = record.document(simulation, profile, outcome);
  record.write(document);
  if (!common.quiet && !common.json) {
    const std::string text = command.stats ? "\n" + profile.table() + "\n" : fmt::format("took {} (--stats lists all)\n", summary(profile, processor_seconds() - processor_start));
    std::fwrite(text.data(), 1, text.size(), stderr);
  }
  if (loaded->forecast && code == ExitCode::kDone) log_info(beside(*loaded->forecast, record.cost(), record.outcome_of(profile)));

  for (const auto& effect : simulation.effects()) {
    std::map<std::string, double> figures;
    for (const auto& [name, value] : effect->figures()) figures[name] = value;
    if (const double unsolved = figures["unsolved_steps"], steps = figures["steps"]; unsolved > kUnsolvedShare * steps)
      log_warning(fmt::format("{}: in {:.0f} of {:.0f} steps a solve did not reach its tolerance (run.json: largest_divergence_error, "
                              "largest_viscosity_residual); a shorter max_step or more max_iterations would help",
                              effect->name(), unsolved, steps));
    if (figures["crushed"] > 0 || figures["stopped"] > 0)
      log_warning(fmt::format("{}: among obstacles {:.0f} times a particle found no room and {:.0f} times too many surfaces in one step (flow.csv: crushed, stopped): some may be on the wrong side of the last that came",
                              effect->name(), figures["crushed"], figures["stopped"]));
  }
  if (code == ExitCode::kInterrupted) log_warning("interrupted; this goes on: " + resume_line(command, common.program, folder));
  if (code == ExitCode::kUnstable) {
    log_warning(fmt::format("stopped in frame {}; the last good state is {}", simulation.frame() + 1, flow::checkpoints(folder).front().string()));
  }
  if (code == ExitCode::kDone)
    log_info(fmt::format("{} frames in {}; to see them: {} view {}, or blender --python {}", simulation.frame(), (folder / "frames").string(), quoted(common.program), quoted(folder.string()), quoted((folder / "open_in_blender.py").string())));
  signals.reset();  // a reader of the document that went away ends this as it does any tool
  if (common.json) print_document(document.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  return code;
}

}  // namespace effuse
