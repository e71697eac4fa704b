#include "samples/effuse/cost.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <ctime>

#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/tessellate/make_skin.h"

namespace effuse {

namespace {

constexpr double kStart = 0.1;  // [s] that the program takes to start, to read a scene and its terrain, and to write what stands beside the frames

constexpr double kLeastOwn = 0.5, kMostOwn = 20;  // times a machine's figures, of a scene's own rehearsals: beyond is a disturbance

/// Triangles of a skin: of the level set's mesh twenty a particle at voxels of half a spacing, as Maunga Whau's thin flow has them
/// (thicker ones have fewer), and refined to edges. By pixels: no finer.
///   share  of them as those of its own particles that a rehearsal's have (sample_skin)
double triangles(double particles, const skin::SkinSettings& s, double share) {
  particles *= share;
  const double meshed = std::pow(0.5 / s.voxel, 2), edge = s.detail.edge;
  if (s.detail.kind != skin::SkinKind::kNoise) return 20 * particles * std::max(meshed, 0.19 / (edge * edge));
  // All in fours until they are fine enough, three times at most (refine_for).
  double fours = 1;
  for (double mean = 1.15 * s.voxel; mean > 1.7 * edge && fours < 64; mean /= 2) fours *= 4;
  return 20 * particles * meshed * fours;
}

/// Bytes a frame's files take, as Maunga Whau's do: a vertex for two triangles.
double disk_per_frame(double particles, const skin::SkinSettings& s, double share) {
  return triangles(particles, s, share) * (57 * s.ply + 82 * s.obj + 57 * s.glb + 38 * s.vtp + 167 * s.usda + 57 * s.flipbook) + share * particles * 84 * s.bgeo + share * particles * 400 * std::pow(0.5 / s.voxel, 2) * s.vdb + (s.preview ? 1.2 * s.picture.width * s.picture.height : 0);
}

/// Bytes of the program with its libraries, and of the terrain. Measured on Maunga Whau.
double memory_at_start(std::size_t posts, const skin::SkinSettings& s) { return 52e6 + static_cast<double>(posts) * (s.preview ? 460 : 225); }

/// Bytes of the skin of the last frame as it is made, written and drawn. Measured on Maunga Whau at edges of 0.5, 0.25 and 0.15 with one
/// format, all, and pictures: within a quarter, voronoi too.
double memory_of_skin(double particles, const skin::SkinSettings& s, double share) {
  if (!s.ply && !s.obj && !s.glb && !s.vdb && !s.vtp && !s.usda && !s.preview) return 0;
  double bytes = share * particles * (3500 * std::pow(0.5 / s.voxel, 2) + (s.detail.kind == skin::SkinKind::kNoise ? 0 : 5000));
  bytes += triangles(particles, s, share) * (155 + 40 * s.obj + 60 * s.glb + 90 * s.vtp + 350 * s.usda + 40 * s.preview);
  return bytes + (s.preview ? 25.0 * s.picture.width * s.picture.height : 0);
}

/// The most that this process has held so far: after rehearsals all that a scene's ground and solids take is there.
double memory_so_far() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

/// A skin of the rehearsal's last particles, beside what a machine's figures count on.
struct SampleSkin {
  double share = 1;   ///< triangles over those that triangles() counts on: particles that lie alone have a surface all round
  double ground = 0;  ///< processor seconds a particle that asking the terrain takes: a mesh, many times what a plane or a grid takes
};

SampleSkin sample_skin(const LoadedScene& loaded) {
  const budget::Forecast& f = *loaded.forecast;
  const skin::SkinSettings& s = loaded.skin;
  if (f.sample.empty() || (!s.ply && !s.obj && !s.glb && !s.vdb && !s.preview)) return {};
  const double spacing = f.sample_spacing, count = static_cast<double>(f.sample.size());
  const std::vector<double> radius(f.sample.size(), spacing / 2);
  geometry::Points points;
  points.position = f.sample;
  points.radius = radius;
  skin::SkinOptions options = skin::skin_at(s, *loaded.terrain, 0, spacing);
  options.detail.reset();
  options.coarsen = 0;
  const ThreadLimit one(1);
  Profile profile;
  try {
    const ProfileScope scope(profile);
    const std::clock_t before = std::clock();
    const skin::Skin skin = skin::make_skin(points, std::pow(spacing, 3) * count, &*loaded.terrain, options);
    const double seconds = static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC;
    // Zones are of the clock: of the processor's time, their share.
    double all = 0, ground = 0;
    for (const ZoneRow& zone : profile.zones()) {
      all += zone.self_s;
      if (zone.name == "skin.ground" || zone.name == "skin.keep_volume") ground += zone.self_s;
    }
    return {static_cast<double>(skin.mesh.triangles.size()) / (20 * count * std::pow(0.5 / s.voxel, 2)), all > 0 ? seconds * ground / all / count : 0};
  } catch (const InputError&) {
    return {};  // particles that no skin can be made of: the run will say so
  }
}

/// How wrong the front is, in words: "3.4 %".
std::string share(double error) { return error < 0.1 ? fmt::format("{:.2g} %", 100 * error) : fmt::format("{:.0f} %", 100 * error); }

}  // namespace

std::string bytes_text(double b) {
  if (b < 1e6) return fmt::format("{:.0f} kB", b / 1e3);
  return b < 1e9 ? fmt::format("{:.0f} MB", b / 1e6) : fmt::format("{:.1f} GB", b / 1e9);
}


std::string time_text(double s) {
  if (s < 10) return fmt::format("{:.1f} s", s);
  if (s < 120) return fmt::format("{:.0f} s", s);
  if (s < 7200) return fmt::format("{:.0f} min", s / 60);
  if (s < 2 * 86400) return fmt::format("{:.0f} h {:.0f} min", std::floor(s / 3600), (s - 3600 * std::floor(s / 3600)) / 60);
  return fmt::format("{:.0f} days", s / 86400);
}

Cost cost_of(const LoadedScene& loaded, const budget::Machine& machine) {
  const flow::Scene& scene = loaded.scene;
  const skin::SkinSettings& skin = loaded.skin;
  const SolidThings& solids = loaded.solids;
  Cost cost;
  cost.rehearsed = loaded.forecast.has_value();
  double others = 0;
  for (const flow::EffectPlan& plan : scene.effects) {
    flow::Estimate e = plan.estimate;
    if (cost.rehearsed && plan.kind == "lava") {
      const budget::Forecast& f = *loaded.forecast;
      // The rehearsals were timed: a mesh for ground, obstacles and crusts cost what no machine's figures know.
      const double told = machine.seconds(f.rehearsed_counts, f.classic), own = told > 0 ? f.rehearsed_seconds / told : 1;
      cost.processor_seconds = machine.seconds(f.counts, f.classic) * std::clamp(own, kLeastOwn, kMostOwn);
      cost.lava_seconds = machine.on_threads(cost.processor_seconds, thread_count());
      e.steps = f.counts.steps;
      e.particles = f.particles;
      e.mean_particles = f.mean_particles;
      e.bytes = f.solver_bytes;
      e.seconds = cost.lava_seconds;
    } else {
      others += e.seconds;
    }
    cost.sum.particles += e.particles;
    cost.sum.mean_particles += e.mean_particles;
    cost.sum.bytes += e.bytes;
    cost.sum.steps += e.steps;
    cost.sum.seconds += e.seconds;
    cost.sum.drawn += e.drawn;
    cost.sum.cells += e.cells;
  }
  const flow::Estimate& sum = cost.sum;
  const bool drawn = skin.preview || (skin.ply && solids.any_moves());
  const bool any = skin.ply || skin.obj || skin.glb || skin.vdb || skin.vtp || skin.usda || skin.preview;
  const double start_bytes = std::max(memory_at_start(loaded.terrain->mesh().positions.size(), skin), cost.rehearsed ? memory_so_far() : 0);
  const SampleSkin sample = cost.rehearsed ? sample_skin(loaded) : SampleSkin{};
  const double share = sample.share;
  const double own_bytes = disk_per_frame(sum.mean_particles, skin, share);
  const double pixels = skin.preview ? 1.0 * skin.picture.width * skin.picture.height : 0;
  double frame_s = 5e-6 * sum.drawn + (skin.preview ? 4e-8 : 2e-8) * sum.cells;
  if (cost.rehearsed) {
    // A skin goes by its voxels, files by their bytes, a picture by its pixels.
    const double own = any ? (machine.skin_particle * share * std::pow(0.5 / skin.voxel, 2) + sample.ground) * sum.mean_particles + machine.write_byte * own_bytes + machine.picture_pixel * pixels : 0;
    frame_s += machine.on_threads(own, thread_count());
    cost.processor_seconds += scene.frames * own;
  } else {
    // As Maunga Whau takes them: 80 us a particle, and 0.7 us a pixel for the picture.
    frame_s += 80e-6 * sum.mean_particles + 7e-7 * pixels;
  }
  if (cost.rehearsed) {
    cost.processor_seconds += kStart;
    frame_s += kStart / scene.frames;
  }
  cost.seconds = cost.lava_seconds + others + solids.start_seconds() + scene.frames * (frame_s + (drawn ? solids.frame_seconds() : 0));
  cost.disk = scene.frames * (own_bytes + (skin.ply && solids.any_moves() ? 94.0 * static_cast<double>(solids.triangles()) : 0) + 40 * sum.drawn + 2 * sum.cells);
  // A film in one file lies in memory as a whole, twice while it is written.
  const double book = skin.flipbook ? 2 * 57 * scene.frames * triangles(sum.mean_particles, skin, share) : 0;
  cost.memory = book + sum.bytes + solids.memory() + start_bytes + memory_of_skin(sum.particles, skin, share);
  return cost;
}

std::vector<std::pair<std::string, std::string>> told(const budget::Forecast& f) {
  std::vector<std::pair<std::string, std::string>> lines;
  std::string rehearsed;
  for (const double spacing : f.rehearsed) rehearsed += fmt::format("{}{:.3g}", rehearsed.empty() ? "" : ", ", spacing);
  lines.emplace_back("accuracy", fmt::format("front within {} wanted; about {} with these settings ({}), at {:.3g} m in the end; the flow is about {:.2g} m deep (rehearsed with particles of {} m{})", share(f.wanted), share(f.error),
                                             f.told_by == budget::ErrorBy::kRehearsals ? "as finer particles move it: to a factor of two" : "by the flow's depth alone: to a factor of four", f.front, f.law.depth, rehearsed,
                                             f.whole ? "" : ", which took too long: cut off, the rest is a guess"));
  std::string chosen, stated;
  for (const budget::Setting& s : f.settings) {
    std::string& text = s.of_the_scene ? stated : chosen;
    text += fmt::format("{}{} = {}", text.empty() ? "" : ", ", s.key, s.value);
  }
  if (!chosen.empty()) lines.emplace_back("chosen", chosen);
  if (!stated.empty()) lines.emplace_back("kept", stated + ": the scene says so");
  if (f.error > 1.05 * f.wanted)
    for (const budget::Setting& s : f.settings)
      if (s.key == "lava.spacing") lines.emplace_back("short of it", s.of_the_scene ? fmt::format("the scene's spacing leaves about {}: without lava.spacing it would be chosen", share(f.error)) : fmt::format("{} m was chosen by the flow's depth, finer particles tell of {}: ask for less, or state lava.spacing", fmt::format("{:.3g}", f.spacing), share(f.error)));
  return lines;
}

}  // namespace effuse
