#include "samples/effuse/calibrate.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <filesystem>

#include "geometry/base/files.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "importers/scene/scene_file.h"
#include "samples/effuse/frame_writer.h"
#include "samples/effuse/load_scene.h"

namespace effuse {

namespace fs = std::filesystem;
using budget::Counts;
using budget::Machine;

namespace {

constexpr int kFrames = 12;

/// Lava from a round vent on an inclined plane, the number of frames as above.
std::string scene_text(double slope_deg, const std::string& lava, double seconds) {
  return fmt::format(
      "format = 1\n[film]\nframes = {}\nfps = 1\ntime_scale = {:g}\n[terrain.plane]\nsize = [\"120 m\", \"120 m\"]\nslope = \"{:g} deg\"\n[lava]\n{}\n"
      "[preview]\nwidth = 480\nheight = 270\nview = [0, 0, 30]\n",
      kFrames, seconds / kFrames, slope_deg, lava);
}

const char* const kThin = "preset = \"etna\"\nspacing = 0.8\n[[lava.vent]]\nat = [-30, 0]\nwidth = \"14 m\"\nrate = \"24 m3/s\"\n";
const char* const kThick = "preset = \"etna\"\nspacing = 0.5\n[[lava.vent]]\nat = [0, 0]\nwidth = \"6 m\"\nrate = \"12 m3/s\"\n";
const char* const kClassic = "model = \"classic\"\nspacing = 0.6\n[[lava.vent]]\nat = [0, 0]\nwidth = \"6 m\"\nrate = \"12 m3/s\"\n";

/// What ends with its folder.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (fs::temp_directory_path() / "effuse-calibrate-XXXXXX").string();
    if (!::mkdtemp(name.data())) throw std::runtime_error(fmt::format("cannot make a folder in {}", fs::temp_directory_path().string()));
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

/// Seconds of the lava's parts.
struct Parts {
  Counts counts;
  Real all = 0, pressure = 0, viscosity = 0;
};

Real zone(const Profile& profile, std::string_view head) {
  Real sum = 0;
  for (const ZoneRow& row : profile.zones())
    if (row.name.starts_with(head)) sum += row.self_s;
  return sum;
}

Parts parts_of(const std::string& text) {
  const flow::Node node = importers::read_scene_text(text, "calibration");
  const TemporaryFolder folder;
  write_file(folder.path() / "scene.toml", text);
  const std::unique_ptr<LoadedScene> loaded = load_scene(folder.path() / "scene.toml", {}, 0);
  Parts parts;
  Profile profile;
  {
    const ProfileScope scope(profile);
    const flow::World world{&*loaded->terrain, loaded->scene.seed};
    const budget::Rehearsal run = budget::rehearse(node, world, loaded->simulation->effects().front()->spacing(), 1e12);
    parts.counts = run.moments.back().counts;
    parts.all = run.moments.back().seconds;
  }
  // Zones are of the clock: of the processor's time, their share.
  const Real clock = zone(profile, "sph.");
  parts.pressure = parts.all * zone(profile, "sph.pressure") / clock;
  parts.viscosity = parts.all * zone(profile, "sph.viscosity") / clock;
  return parts;
}

/// Wall seconds of the heap's steps with these threads.
Real wall_of(int threads) {
  const ThreadLimit limit(threads);
  const TemporaryFolder folder;
  write_file(folder.path() / "scene.toml", scene_text(1, kThick, 20));
  const std::unique_ptr<LoadedScene> loaded = load_scene(folder.path() / "scene.toml", {}, 0);
  const auto start = std::chrono::steady_clock::now();
  while (loaded->simulation->frame() < kFrames) loaded->simulation->advance([] { return true; });
  return std::chrono::duration<Real>(std::chrono::steady_clock::now() - start).count();
}

struct FrameCosts {
  Real skin_particle, write_byte, picture_pixel;
};

/// The last frame of the flow on the slope, as a run makes it.
FrameCosts frame_costs() {
  const ThreadLimit one(1);
  const TemporaryFolder folder;
  write_file(folder.path() / "scene.toml", scene_text(12, kThin, 30));
  const std::unique_ptr<LoadedScene> loaded = load_scene(folder.path() / "scene.toml", {}, 0);
  while (loaded->simulation->frame() < kFrames) loaded->simulation->advance([] { return true; });
  FrameCosts least{1e9, 1e9, 1e9};
  for (int repeat = 0; repeat < 3; ++repeat) {
    const fs::path out = folder.path() / fmt::format("{}", repeat);
    FrameWriter writer(loaded->scene, loaded->skin, *loaded->terrain, loaded->solids, out);
    Profile profile;
    Real triangles = 1;
    const std::clock_t before = std::clock();
    {
      const ProfileScope scope(profile);
      triangles = static_cast<Real>(writer.write_frame(*loaded->simulation).triangles);
    }
    const Real seconds = static_cast<Real>(std::clock() - before) / CLOCKS_PER_SEC;
    const Real ground = zone(profile, "skin.ground") + zone(profile, "skin.keep_volume"), skin = zone(profile, "skin.") - ground, picture = zone(profile, "preview") + zone(profile, "write.png"), files = zone(profile, "write.") - zone(profile, "write.png");
    Real bytes = 0;
    for (const fs::directory_entry& file : fs::directory_iterator(out / "frames")) bytes += static_cast<Real>(file.file_size());
    const Real each = seconds / (skin + ground + picture + files);
    least.skin_particle = std::min(least.skin_particle, each * skin / (triangles / 20));
    least.write_byte = std::min(least.write_byte, each * files / bytes);
    least.picture_pixel = std::min(least.picture_pixel, each * picture / (loaded->skin.picture.width * loaded->skin.picture.height));
  }
  return least;
}

}  // namespace

Machine calibrate(const std::function<void(const std::string& what)>& progress) {
  const Machine usual = budget::usual_machine();
  Machine machine = usual;
  machine.name = budget::name_of_this_machine();
  machine.when = fmt::format("{:%Y-%m-%d %H:%M} UTC", fmt::gmtime(std::time(nullptr)));
  machine.threads = thread_count();

  // Of each part what it took here over what it takes the usual machine.
  progress("lava on a slope, in a heap");
  Real base = 0, base_usual = 0, pressure = 0, pressure_usual = 0, viscosity = 0, viscosity_usual = 0;
  for (const Parts& parts : {parts_of(scene_text(12, kThin, 30)), parts_of(scene_text(1, kThick, 20))}) {
    const Counts& c = parts.counts;
    base += parts.all - parts.pressure - parts.viscosity;
    base_usual += usual.step * c.steps + usual.particle_step * c.particle_steps + usual.pair_step * c.pair_steps;
    pressure += parts.pressure;
    pressure_usual += usual.pressure_particle * c.pressure_particles + usual.pressure_pair * c.pressure_pairs;
    viscosity += parts.viscosity;
    viscosity_usual += usual.viscosity_particle * c.viscosity_particles + usual.viscosity_pair * c.viscosity_pairs;
  }
  for (Real Machine::*figure : {&Machine::step, &Machine::particle_step, &Machine::pair_step}) machine.*figure *= base / base_usual;
  for (Real Machine::*figure : {&Machine::pressure_particle, &Machine::pressure_pair}) machine.*figure *= pressure / pressure_usual;
  for (Real Machine::*figure : {&Machine::viscosity_particle, &Machine::viscosity_pair}) machine.*figure *= viscosity / viscosity_usual;

  progress("the classic lava");
  const Parts classic = parts_of(scene_text(1, kClassic, 4));
  machine.classic_pair *= std::max(0.1, (classic.all - machine.step * classic.counts.steps) / (usual.classic_pair * classic.counts.pair_steps));

  progress("a skin, its files, a picture");
  const FrameCosts frame = frame_costs();
  machine.skin_particle = frame.skin_particle;
  machine.write_byte = frame.write_byte;
  machine.picture_pixel = frame.picture_pixel;

  if (machine.threads > 1) {
    progress(fmt::format("{} threads", machine.threads));
    Real best = 1;
    for (int repeat = 0; repeat < 3; ++repeat) best = std::max(best, wall_of(1) / wall_of(machine.threads));
    machine.speedup = std::min(best, static_cast<Real>(machine.threads));
  } else {
    machine.speedup = 1;
  }
  return machine;
}

}  // namespace effuse
