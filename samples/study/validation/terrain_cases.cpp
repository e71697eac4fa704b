#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <span>
#include <vector>

#include "flow/scene/scene.h"
#include "flow/scene/simulation.h"
#include "geometry/base/units.h"
#include "samples/study/study.h"
#include "samples/study/validation/mountain.h"
#include "samples/study/validation/setups.h"

/// What a flow over a real mountain must keep: volume, heat, and to the outside of the ground.
namespace effuse::study {
namespace {


/// Where the scene's first vent lets particles go: a spacing above the ground along its line.
std::vector<Vec3> release_places(const flow::Node& root, const geometry::Terrain& terrain, Real spacing) {
  const flow::Node& vent = root.find("lava")->find("vent")->items.at(0);
  const auto end = [&](const char* key) {
    const auto coordinate = [&](const flow::Node& node) {
      return node.kind == flow::Node::Kind::kInteger ? static_cast<Real>(node.integer) : node.real;
    };
    const flow::Node& point = *vent.find(key);
    return Vec2(Vec2(coordinate(point.items.at(0)), coordinate(point.items.at(1))) - terrain.georeference().origin.head<2>());
  };
  constexpr int kSamples = 41;
  std::vector<Vec3> places;
  for (int k = 0; k < kSamples; ++k) {
    const Vec2 at = end("from") + k / (kSamples - 1.0) * (end("to") - end("from"));
    places.emplace_back(at.x(), at.y(), terrain.height(at.x(), at.y()).value() + spacing);
  }
  return places;
}

/// Mean depth of lava over these places [m]: what a vent has to lift besides its own.
Real overburden(const std::vector<Vec3>& places, std::span<const Vec3> particles, Real spacing) {
  Real sum = 0;
  for (const Vec3& place : places) {
    Real top = place.z();
    for (const Vec3& x : particles)
      if ((x - place).head<2>().norm() < spacing) top = std::max(top, x.z() + spacing / 2);
    sum += top - place.z();
  }
  return sum / static_cast<Real>(places.size());
}

/// Volume the scene's first vent has let out by t [m^3], from what the scene says.
Real let_out(const flow::Node& root, Real t) {
  const flow::Node& vent = root.find("lava")->find("vent")->items.at(0);
  const auto value = [&](const char* key, const char* unit) { return parse_quantity(vent.find(key)->text, unit); };
  flow::sph::Vent v;
  v.rate = value("rate", "m3/s");
  v.stop = value("stop", "s");
  v.ramp = value("ramp", "s");
  return v.volume(t);
}

// The sample scene on coarse particles, its vent open for two of five minutes.
CaseResult maunga_whau() {
  const auto loaded = load_scene("maunga-whau-modern.toml",
                           {"lava.spacing=1.5 m", "lava.vent[0].rate=140 m3/s", "lava.vent[0].width=3 m", "lava.vent[0].stop=120 s",
                            "lava.vent[0].ramp=10 s", "film.fps=1", "film.time_scale=5", "film.frames=60"});
  flow::Simulation& simulation = *loaded->simulation;
  const flow::Effect& lava = *simulation.effects().front();

  Curve released{"let out by the vent", {}, {}, false, true}, present{"in particles, and over the edge", {}, {}, true, false};
  Curve missing{"brought, and gained by friction, less what is stored", {}, {}, false, true},
      lost{"lost to sky, air and ground", {}, {}, true, false};
  Curve sky{"radiated", {}, {}, false, false}, air{"convected", {}, {}, false, false}, ground{"into the ground", {}, {}, false, false};
  std::map<std::string, double> f;
  const std::vector<Vec3> places = release_places(loaded->root, *loaded->terrain, lava.spacing());
  double lifted = 0, let_out_before = 0;  // the vent's work [J]
  double worst_volume = 0, worst_energy = 0, deepest = 0;
  std::size_t under_ground = 0, beside = 0, most = 0;
  while (simulation.frame() < loaded->scene.frames) {
    simulation.advance([] { return true; });
    for (const auto& [name, value] : lava.figures()) f[name] = value;
    const Real t = simulation.time();

    const double volume = (f["mass_present_kg"] + f["mass_left_kg"]) / f["mass_present_kg"] * f["volume_m3"],
                 wanted = let_out(loaded->root, t);
    released.x.push_back(t), present.x.push_back(t);
    released.y.push_back(wanted), present.y.push_back(volume);
    // Before, a vent's staggered particles are a coarse measure.
    if (t >= 120) worst_volume = std::max(worst_volume, std::abs(volume / wanted - 1));

    const double gone = f["vent_J"] + f["viscous_J"] - f["stored_J"] - f["left_J"],
                 losses = f["radiated_J"] + f["convected_J"] + f["ground_J"];
    if (losses > 0) worst_energy = std::max(worst_energy, std::abs(gone / losses - 1));
    for (Curve* c : {&missing, &lost, &sky, &air, &ground}) c->x.push_back(t);
    missing.y.push_back(gone), lost.y.push_back(losses), sky.y.push_back(f["radiated_J"]), air.y.push_back(f["convected_J"]),
        ground.y.push_back(f["ground_J"]);

    const geometry::Points points = lava.points();
    const double density = f["mass_present_kg"] / f["volume_m3"];
    lifted += density * kGravity * overburden(places, points.position, lava.spacing()) * (wanted - let_out_before);
    let_out_before = wanted;
    most = std::max(most, points.size());
    for (const Vec3& x : points.position) {
      const auto height = loaded->terrain->height(x.x(), x.y());
      beside += !height;
      if (!height || x.z() >= *height) continue;
      ++under_ground;
      deepest = std::max(deepest, *height - x.z());
    }
  }

  // Lava this stiff gives what it falls to friction, nearly all; and what the vent does to press it out under what lies there.
  Real top = 0;
  for (const Vec3& place : places) top += place.z() / static_cast<Real>(places.size());
  const geometry::Points points = lava.points();
  double fallen = lifted, moving = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double mass = f["mass_present_kg"] / static_cast<double>(points.size());
    fallen += mass * kGravity * (top - points.position[i].z());
    moving += mass / 2 * points.velocity[i].squaredNorm();
  }

  CaseResult result;
  result.measures = {
      compared("present and left against rate and time, worst from 120 s on", "m3", present.y.back(), released.y.back(), 1e-3),
      bounded("particles under the ground, all frames", static_cast<Real>(under_ground), 0, "particles"),
      compared("heat lost against heat missing, worst of all frames", "J", lost.y.back(), missing.y.back(), 0.01),
      compared("friction and motion against the fall and the vent's work", "J", f["viscous_J"] + moving, fallen, 0.01)};
  result.measures[0].error = worst_volume;
  result.measures[2].error = worst_energy;
  result.plots = {{"maunga_whau_volume", "Maunga Whau: volume", "time [s]", "volume [m3]", false, false, {released, present}},
                  {"maunga_whau_heat", "Maunga Whau: heat lost", "time [s]", "heat [J]", false, false, {missing, lost, sky, air, ground}}};
  result.note = fmt::format(
      "{} particles of 1.5 m on the mountain's 10 m cells, {:.0f} steps, {:.0f} tried again; {:.0f} pressure and {:.0f} viscosity "
      "iterations a step; of the fall {:.2g} % is in motion, {:.2g} % the vent's work; "
      "compression {:.2g} rms at the end, {:.2g} at worst; {:.3g} kg left over the edge{}{}.",
      most, f["steps"], f["retries"], f["pressure_iterations"], f["viscosity_iterations"], 100 * moving / fallen, 100 * lifted / fallen, f["density_error"],
      f["largest_density_error"], f["mass_left_kg"],
      beside > 0 ? fmt::format(", {} times a particle was seen beside the terrain on its way out", beside) : "",
      under_ground > 0 ? fmt::format(", deepest {:.3g} m under the ground", deepest) : "");
  return result;
}

// The sample scene, whole: a flow that comes to rest and sleeps, cools for eleven hours, and is woken by a second vent.
CaseResult cold_night() {
  const auto loaded = load_scene("maunga-whau-night.toml", {});
  flow::Simulation& simulation = *loaded->simulation;
  const flow::Effect& lava = *simulation.effects().front();
  constexpr double kSecondVent = 41000;
  constexpr int kLastFrames = 10;  // before the second vent: the night's end
  constexpr std::size_t kAtPeak = 10;  // steps
  using Clock = std::chrono::steady_clock;

  Curve awake{"awake", {}, {}, false, false}, all{"all", {}, {}, false, true};
  Curve cost{"a step", {}, {}, false, false};
  std::map<std::string, double> f;
  double peak = 0, old = 0, asleep_from = -1, woken = 0;
  std::vector<double> costs;  // of a step, by frame, until the second vent
  double awake_before = 0;
  while (simulation.frame() < loaded->scene.frames) {
    std::vector<Clock::time_point> ticks;  // begins of steps, and the last one's end
    const auto tick = [&] { ticks.push_back(Clock::now()); };
    simulation.advance([&] {
      tick();
      return true;
    });
    tick();
    const auto mean_step = [&](std::size_t from, std::size_t to) {
      return std::chrono::duration<double>(ticks[to] - ticks[from]).count() / static_cast<double>(to - from);
    };
    for (const auto& [name, value] : lava.figures()) f[name] = value;
    const double a_step = mean_step(0, ticks.size() - 1), t = simulation.time();
    for (Curve* c : {&awake, &all, &cost}) c->x.push_back(t / 3600);
    awake.y.push_back(f["awake"]), all.y.push_back(f["particles"]), cost.y.push_back(1e3 * a_step);
    if (t < kSecondVent) {
      costs.push_back(a_step);
      for (std::size_t k = kAtPeak; k < ticks.size(); ++k) peak = std::max(peak, mean_step(k - kAtPeak, k));
      old = f["particles"];
      awake_before = f["awake"];
      if (f["awake"] > 0) asleep_from = -1;
      else if (asleep_from < 0) asleep_from = t;
    } else {
      woken = std::max(woken, f["awake"] - (f["particles"] - old));
    }
  }
  double end = 0;
  for (int k = 0; k < kLastFrames; ++k) end += costs[costs.size() - 1 - static_cast<std::size_t>(k)] / kLastFrames;

  CaseResult result;
  result.measures = {compared("a step at the night's end, peak for reference", "ms", 1e3 * end, 1e3 * peak, 0.02),
                     bounded("particles awake when the second vent opens", awake_before, 0, "particles"),
                     bounded("particles awake at the end", f["awake"], 0, "particles"),
                     compared("sleepers awake at once by the second vent, all there are for reference", "particles", woken, old, 1)};
  result.measures[0].error = end / peak;
  result.measures[3].error = woken > 0 ? 0 : 1;
  result.measures[3].hold = 0;
  result.plots = {{"cold_night_awake", "A night on Maunga Whau: particles", "time [h]", "particles", false, false, {all, awake}},
                  {"cold_night_cost", "A night on Maunga Whau: cost", "time [h]", "a step [ms]", false, true, {cost}}};
  result.note = fmt::format("{:.0f} particles, {:.0f} of them before the second vent; all asleep from {:.2g} h on; {:.0f} steps, {:.0f} tried again.",
                            f["particles"], old, asleep_from / 3600, f["steps"], f["retries"]);
  return result;
}

}  // namespace

void add_terrain_cases(std::vector<Case>& cases) {
  cases.push_back({"maunga_whau", "Volume and heat on Maunga Whau",
                   "conservation; heights of R's volcano data set, samples/scenes/maunga-whau.asc", false, maunga_whau});
  cases.push_back({"cold-night", "A night on Maunga Whau: sleep and waking", "what sleeping lava may cost; samples/scenes/maunga-whau-night.toml", false, cold_night});
}

}  // namespace effuse::study
