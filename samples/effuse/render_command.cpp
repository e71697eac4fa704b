#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>

#include "flow/effects/registry.h"
#include "flow/scene/scene.h"
#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/log.h"
#include "importers/scene/scene_file.h"
#include "samples/effuse/commands.h"
#include "samples/effuse/progress.h"
#include "samples/effuse/run_folder.h"
#include "samples/effuse/solid_things.h"
#include "skin/scene/skin_settings.h"
#include "skin/write/exr.h"

namespace effuse {

namespace fs = std::filesystem;

namespace {

struct Range {
  int first = 1, last = 0;
};

/// "12", "10-40", "10-", "-40" of 1..count.
Range frames_wanted(const std::string& text, int count) {
  const auto wrong = [&](const std::string& why) { return InputError(Place{"--frames"}, fmt::format("found '{:.40}': {}", text, why)); };
  Range range{1, count};
  if (text.empty()) return range;
  if (text.find_first_not_of("0123456789-") != std::string::npos || text.size() > 12) throw wrong("wanted a frame's number, or two with a minus between");
  const std::size_t minus = text.find('-');
  if (minus == std::string::npos) {
    range.first = range.last = std::atoi(text.c_str());
  } else {
    if (minus > 0) range.first = std::atoi(text.substr(0, minus).c_str());
    if (minus + 1 < text.size()) range.last = std::atoi(text.substr(minus + 1).c_str());
  }
  if (range.first < 1 || range.last > count || range.first > range.last) throw wrong(fmt::format("the run has frames 1 to {}", count));
  return range;
}

/// Takes the ways to place a camera that the changes replace out of [preview]: keys, round the terrain or a circle of it, round a target.
void drop_replaced_camera(flow::Node& scene, const std::vector<std::string>& set) {
  const auto sets = [&](const std::string& key) {
    return std::any_of(set.begin(), set.end(), [&](const std::string& assignment) {
      const std::string name = "preview." + key;
      return assignment.starts_with(name) && assignment.size() > name.size() && (assignment[name.size()] == '=' || assignment[name.size()] == '[');
    });
  };
  std::vector<std::string> replaced;
  if (sets("key")) replaced = {"azimuth", "elevation", "turn", "motion", "view", "target", "distance"};
  else if (sets("azimuth") || sets("elevation") || sets("turn") || sets("view") || sets("target") || sets("distance")) replaced = {"key"};
  if (sets("view")) replaced.insert(replaced.end(), {"target", "distance"});
  else if (sets("target") || sets("distance")) replaced.emplace_back("view");
  for (auto& [name, preview] : scene.entries) {
    if (name != "preview") continue;
    for (std::size_t k = preview.entries.size(); k-- > 0;) {
      const std::string& key = preview.entries[k].first;
      if (sets(key) || std::find(replaced.begin(), replaced.end(), key) == replaced.end()) continue;
      preview.entries.erase(preview.entries.begin() + static_cast<std::ptrdiff_t>(k));
      preview.key_places.erase(preview.key_places.begin() + static_cast<std::ptrdiff_t>(k));
    }
  }
}

/// [preview] of the run's scene with the changes; the rest of the scene is read, so that a misspelt key is told, and not used.
skin::SkinSettings settings_of(const fs::path& scene, const std::vector<std::string>& set) {
  for (const std::string& assignment : set)
    if (!assignment.starts_with("preview.")) throw InputError(Place{"--set"}, fmt::format("'{}': only [preview] can change in pictures of what has been simulated (preview.azimuth=2)", assignment));
  flow::Node node = importers::read_scene_file(scene);
  drop_replaced_camera(node, set);
  for (const std::string& assignment : set) importers::apply_override(node, assignment);
  flow::Parameters root(node);
  static_cast<void>(flow::read_scene(root, flow::effect_kinds()));
  skin::SkinSettings settings = skin::read_skin_settings(root);
  root.finish();
  settings.preview = true;
  return settings;
}

/// Runs ffmpeg on the numbered pictures; false where there is none. Throws std::runtime_error with its exit status.
bool make_film(const fs::path& pictures, int first, double fps, const fs::path& film) {
  const std::string rate = fmt::format("{:g}", fps), pattern = (pictures / "render.%04d.png").string(), start = std::to_string(first);
  const fs::path part = film.parent_path() / ("part." + film.filename().string());
  std::vector<std::string> words = {"ffmpeg", "-v", "error", "-nostdin", "-y", "-framerate", rate, "-start_number", start, "-i", pattern};
  if (film.extension() == ".gif") words.insert(words.end(), {"-vf", "split[a][b];[a]palettegen[p];[b][p]paletteuse"});
  else words.insert(words.end(), {"-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-c:v", "libx264", "-crf", "18", "-pix_fmt", "yuv420p", "-movflags", "+faststart"});
  words.push_back(part.string());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  pid_t pid = 0;
  const int error = ::posix_spawnp(&pid, "ffmpeg", nullptr, nullptr, argv.data(), environ);
  if (error == ENOENT) return false;
  if (error != 0) throw std::runtime_error(std::string("cannot start ffmpeg: ") + std::strerror(error));
  int status = 0;
  while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {}
  std::error_code ignored;
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    fs::remove(part, ignored);
    throw std::runtime_error(fmt::format("ffmpeg could not make {} (its words stand above)", film.string()));
  }
  fs::rename(part, film);
  return true;
}

}  // namespace

ExitCode render_run(const RenderCommand& command, const CommonOptions& common) {
  const auto wants = [&](const char* kind) { return std::find(command.to.begin(), command.to.end(), kind) != command.to.end(); };
  const bool films = wants("mp4") || wants("gif");
  if (films && command.every != 1) throw InputError(Place{"--every"}, "films need every frame: without --every, or with fewer --frames");
  const RunFolder run(command.run);
  const skin::SkinSettings settings = settings_of(command.run / "scene.toml", command.set);
  const Range range = frames_wanted(command.frames, run.frames());
  const geometry::Terrain terrain = run.ground();
  skin::check_camera(settings, terrain, range.last, run.fps());

  const fs::path folder = command.folder.empty() ? command.run / "render" : command.folder;
  std::error_code error;
  std::vector<fs::path> old;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error))
    if (at->path().filename().string().starts_with("render.")) old.push_back(at->path());
  if (!old.empty() && !command.force) throw InputError(Place{folder.string()}, "holds pictures already: --force replaces them, -o names another folder");
  fs::create_directories(folder, error);
  if (error == std::errc::no_space_on_device) throw ResourceError(fmt::format("{}: cannot make the folder: {}", folder.string(), error.message()));
  if (error) throw InputError(Place{folder.string()}, "cannot make this folder: " + error.message());
  for (const fs::path& file : old) fs::remove(file);

  const skin::Preview preview(terrain.mesh());
  const bool pngs = wants("png") || films;
  int made = 0;
  Progress progress(range.first - 1, range.last, common.quiet);
  for (int frame = range.first; frame <= range.last; frame += command.every, ++made) {
    RunFolder::Shown shown = run.shown(frame);
    const skin::Image image = preview.render(in_one_picture(std::move(shown.lava), shown.others), skin::picture_at(settings, terrain, frame / run.fps()), shown.air);
    if (pngs) skin::write_png(folder / fmt::format("render.{:04}.png", frame), image);
    if (wants("exr")) skin::write_exr(folder / fmt::format("render.{:04}.exr", frame), image);
    progress.frame_done(frame, fmt::format("{} x {}", image.width, image.height));
  }
  progress.end();
  std::string names;
  for (const std::string& name : run.left_out()) names += (names.empty() ? "" : ", ") + name;
  if (!names.empty()) log_warning(fmt::format("not drawn: {}, whose files do not say how they look; the run's own pictures have them", names));

  nlohmann::ordered_json done = {{"ok", true}, {"folder", folder.string()}, {"pictures", made}};
  for (const char* kind : {"mp4", "gif"}) {
    if (!wants(kind)) continue;
    const fs::path film = folder / (std::string("render.") + kind);
    const bool there = make_film(folder, range.first, run.fps(), film);
    if (there) done["films"].push_back(film.string());
    else log_warning(fmt::format("ffmpeg is not installed, so {} was not made; the pictures are there: ffmpeg -framerate {:g} -start_number {} -i '{}/render.%04d.png' -pix_fmt yuv420p '{}'", film.string(), run.fps(), range.first, folder.string(), film.string()));
    if (!there) done["ok"] = false;
  }
  log_info(fmt::format("{} pictures in {}", made, folder.string()));
  if (common.json) print_document(done.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  return done["ok"].get<bool>() ? ExitCode::kDone : ExitCode::kFailed;
}

}  // namespace effuse
