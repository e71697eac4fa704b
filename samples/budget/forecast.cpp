#include "samples/budget/forecast.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>

#include "flow/effects/registry.h"
#include "flow/scene/scene.h"
#include "geometry/base/error.h"
#include "geometry/base/units.h"

namespace effuse::budget {

namespace {

/// Two digits, downwards: 0.8537 is 0.85.
Real rounded_down(Real value) {
  const Real unit = std::pow(10.0, std::floor(std::log10(value)) - 1);
  const Real cut = std::floor(value / unit * (1 + 1e-12)) * unit;
  return std::stod(fmt::format("{:.3g}", cut));
}

/// The keys of a scene, set where they are missing, told either way.
class Chooser {
 public:
  Chooser(flow::Node& scene, std::vector<Setting>& settings) : scene_(scene), settings_(settings) {}

  /// Sets table.key to a value with its unit, or leaves what stands there; the value that holds.
  Real choose(const std::string& table, const std::string& key, Real value, const std::string& unit) {
    flow::Node& node = at(table);
    if (const flow::Node* stated = node.find(key)) {
      const Real own = stated->kind == flow::Node::Kind::kReal ? stated->real : stated->kind == flow::Node::Kind::kInteger ? static_cast<Real>(stated->integer) : parse_quantity(stated->text, unit);
      settings_.push_back({table + "." + key, format_quantity(own, unit), true});
      return own;
    }
    flow::Node chosen;
    chosen.kind = flow::Node::Kind::kText;
    chosen.text = format_quantity(value, unit);
    if (unit.empty()) {
      chosen.kind = flow::Node::Kind::kReal;
      chosen.real = value;
    }
    settings_.push_back({table + "." + key, format_quantity(value, unit), false});
    node.set(key, std::move(chosen));
    return value;
  }
  bool has(const std::string& table, const std::string& key) {
    const flow::Node* node = scene_.find(table);
    return node && node->find(key);
  }

 private:
  flow::Node& at(const std::string& table) {
    if (!scene_.find(table)) scene_.set(table, flow::Node{});
    for (auto& [name, node] : scene_.entries)
      if (name == table) return node;
    return scene_;
  }
  flow::Node& scene_;
  std::vector<Setting>& settings_;
};

/// Of its lava at a spacing: what the effect itself says it takes. Vents let the same volume out whatever the particles.
flow::Estimate estimate_of(const flow::Node& scene, Real spacing) {
  flow::Node node = scene;
  for (auto& [name, table] : node.entries)
    if (name == "lava") {
      flow::Node value;
      value.kind = flow::Node::Kind::kReal;
      value.real = spacing;
      table.set("spacing", value);
    }
  flow::Parameters root(node);
  const flow::Scene read = flow::read_scene(root, flow::effect_kinds());
  for (const flow::EffectPlan& plan : read.effects)
    if (plan.kind == "lava") return plan.estimate;
  return {};
}

Real at_time(const Rehearsal& r, Real t, const std::function<Real(const Moment&)>& value) {
  Moment before;
  for (const Moment& m : r.moments) {
    if (m.time >= t) {
      const Real w = m.time > before.time ? (t - before.time) / (m.time - before.time) : 1;
      return value(before) + w * (value(m) - value(before));
    }
    before = m;
  }
  return value(before);
}

/// What one rehearsal took at a time over what another did; 1 where either did nothing.
Real ratio_at(const Rehearsal& one, const Rehearsal& other, Real t, const std::function<Real(const Moment&)>& value) {
  const Real a = at_time(one, t, value), b = at_time(other, t, value);
  return a > 0 && b > 0 ? a / b : 1;
}

/// Rehearsals of a scene, each spacing once.
class Rehearsals {
 public:
  Rehearsals(const flow::Node& scene, const flow::World& world) : scene_(scene), world_(world) {}
  const Rehearsal& at(Real spacing) {
    const auto known = done_.find(spacing);
    return known != done_.end() ? known->second : done_.emplace(spacing, rehearse(scene_, world_, spacing, 4 * kRehearsalWork)).first->second;
  }
  const std::map<Real, Rehearsal>& done() const { return done_; }

 private:
  const flow::Node& scene_;
  const flow::World& world_;
  std::map<Real, Rehearsal> done_;
};

constexpr Real kOpeningTells = 0.08;  // of the film: of a shorter one powers of the spacing tell more

/// The finer rehearsal's counts to the film's end, as they will be at another spacing.
Counts scaled(const Rehearsal& coarse, const Rehearsal& fine, const Rehearsal& opening, Real spacing, Real end) {
  if (opening.whole && opening.spacing == spacing) return opening.moments.back().counts;
  const Real covered = fine.moments.back().time, seen = std::min(opening.moments.back().time, covered), finer = fine.spacing / spacing;
  // A rehearsal that was cut off goes on at its last pace.
  const Counts whole = Counts::each(fine.moments.back().counts, {}, [&](Real a, Real) { return a * end / covered; });
  const auto power_of = [&](const std::function<Real(const Moment&)>& value, Real low, Real high) {
    return std::clamp(2 * std::log2(ratio_at(fine, coarse, covered, value)), low, high);
  };
  const auto factor = [&](const std::function<Real(const Moment&)>& value, Real low, Real high) {
    if (seen >= kOpeningTells * end) return ratio_at(opening, fine, seen, value);
    return std::pow(finer, power_of(value, low, high));
  };
  const auto per = [](Real a, Real b) { return b > 0 ? a / b : 0; };
  const auto steps = [](const Moment& m) { return m.counts.steps; };
  const auto neighbors = [&](const Moment& m) { return per(m.counts.pair_steps, m.counts.particle_steps); };
  const auto pressure = [&](const Moment& m) { return per(m.counts.pressure_particles, m.counts.particle_steps); };
  const auto viscosity = [&](const Moment& m) { return per(m.counts.viscosity_particles, m.counts.particle_steps); };
  const Real more_steps = factor(steps, 0.3, 1.2), more_particles = std::pow(finer, 3), more_neighbors = factor(neighbors, 0, 1);
  const Real more_pressure = factor(pressure, 0, 2), more_viscosity = factor(viscosity, 0, 1.5);
  Counts counts;
  counts.steps = whole.steps * more_steps;
  counts.particle_steps = whole.particle_steps * more_steps * more_particles;
  counts.pair_steps = whole.pair_steps * more_steps * more_particles * more_neighbors;
  counts.pressure_particles = whole.pressure_particles * more_steps * more_particles * more_pressure;
  counts.pressure_pairs = whole.pressure_pairs * more_steps * more_particles * more_pressure * more_neighbors;
  counts.viscosity_particles = whole.viscosity_particles * more_steps * more_particles * more_viscosity;
  counts.viscosity_pairs = whole.viscosity_pairs * more_steps * more_particles * more_viscosity * more_neighbors;
  return counts;
}

}  // namespace

Forecast forecast(flow::Node& scene, const flow::AccuracyWish& wish, const flow::World& world) {
  Forecast f;
  f.wanted = wish.front;
  Chooser chooser(scene, f.settings);
  const flow::Node* lava = scene.find("lava");
  const flow::Node* model = lava ? lava->find("model") : nullptr;
  f.classic = model && model->text == "classic";
  Real courant = kUsualCourant;
  if (!f.classic) {
    courant = chooser.choose("lava", "courant", std::stod(fmt::format("{:.2g}", courant_for(wish.front))), "");
    const Real tolerance = std::stod(fmt::format("{:.2g}", tolerance_for(wish.front)));
    chooser.choose("lava", "divergence_tolerance", tolerance, "");
    chooser.choose("lava", "density_tolerance", 2 * tolerance, "");
    chooser.choose("lava", "viscosity_tolerance", tolerance, "");
  }
  if (wish.front >= flow::quality_fronts().front()) chooser.choose("skin", "voxel", 0.7, "");

  // Any spacing tells the volume; another tells how steps go with it.
  constexpr Real kAny = 5;
  const flow::Estimate any = estimate_of(scene, kAny);
  const Real volume = any.particles * std::pow(kAny, 3);
  if (!(volume > 0)) throw InputError(wish.place, "nothing can be said of the front's error: not one particle will come out within the film");
  const Real root2 = std::sqrt(2.0);
  const auto work = [](const flow::Estimate& e) { return e.steps * e.mean_particles; };
  const auto can_be_told = [&](Real own) {
    const flow::Estimate finer = estimate_of(scene, own / root2);
    return finer.particles <= kMostRehearsed && work(finer) <= kRehearsalWork;
  };
  Real spacing = std::cbrt(volume / kRehearsed);
  std::optional<Real> stated;
  if (chooser.has("lava", "spacing")) {
    std::vector<Setting> told;
    stated = Chooser(scene, told).choose("lava", "spacing", 1, "m");
    // A little finer than what it is to tell of: particles that lie alone say little about the flow's depth.
    spacing = std::max(spacing, *stated / root2);
  }
  for (int k = 0; k < 8; ++k) {
    const Real much = work(estimate_of(scene, spacing));
    if (much <= kRehearsalWork) break;
    spacing *= std::pow(much / kRehearsalWork, 0.25);
  }
  const Real end = [&] {
    flow::Parameters root(scene);
    const flow::Scene read = flow::read_scene(root, flow::effect_kinds());
    return read.frame_time(read.frames);
  }();

  Rehearsals rehearsals(scene, world);
  const auto told_by_finer = [&](Real own) -> std::optional<Real> {
    if (!can_be_told(own)) return std::nullopt;
    try {
      for (const Real each : {root2 * own, own, own / root2})
        if (const Rehearsal& r = rehearsals.at(each); !r.whole || !(r.moments.back().front > 0)) return std::nullopt;
    } catch (const UnstableError&) {
      return std::nullopt;
    } catch (const InputError&) {
      return std::nullopt;  // what the scene's own particles are not too large or too small for
    }
    return refined_error(front_differences(rehearsals.at(root2 * own), rehearsals.at(own), rehearsals.at(own / root2)), courant);
  };
  std::optional<Real> told;
  Real coarser = root2 * spacing;
  if (stated) {
    told = told_by_finer(*stated);
    if (told) coarser = *stated, spacing = *stated / root2;
  }
  const auto [coarse, fine] = [&] {
    try {
      return std::pair(rehearsals.at(coarser), rehearsals.at(spacing));
    } catch (const UnstableError& error) {
      throw InputError(wish.place, fmt::format("nothing can be said of the front's error: a rehearsal with particles of {:.3g} m could not be kept stable: {}; without it, lava.spacing says how large particles are", spacing, error.what()));
    }
  }();
  f.whole = coarse.whole && fine.whole;
  const Real difference = difference_of_fronts(coarse, fine);
  if (!std::isfinite(difference)) throw InputError(wish.place, "nothing can be said of the front's error: not one particle came out in the rehearsals");
  f.law.depth = flow_depth(fine.spacing, middle_layers(fine), difference);

  const Real widest = std::cbrt(volume / kLeastParticles), finest = std::cbrt(volume / kMostParticles);
  f.spacing = stated ? *stated : rounded_down(std::clamp(f.law.spacing_for(wish.front, std::min(courant, courant_for(wish.front))), finest, widest));
  if (!stated) told = told_by_finer(f.spacing);
  f.error = told.value_or(f.law.error(f.spacing, courant));
  f.told_by = told ? ErrorBy::kRehearsals : ErrorBy::kDepth;
  f.spacing = chooser.choose("lava", "spacing", f.spacing, "m");

  const auto known = rehearsals.done().find(f.spacing);
  const Rehearsal opening = [&] {
    try {
      return known != rehearsals.done().end() ? known->second : rehearse(scene, world, f.spacing, kOpeningWork);
    } catch (const UnstableError&) {
      return fine;  // the run will say so itself
    }
  }();
  const auto add = [&](const Rehearsal& each) {
    f.rehearsed_counts = Counts::each(f.rehearsed_counts, each.moments.back().counts, std::plus<>());
    f.rehearsed_seconds += each.moments.back().seconds;
  };
  for (const auto& [h, each] : rehearsals.done()) add(each);
  if (known == rehearsals.done().end()) add(opening);
  // One that came to the film's end is the film, to its last particle.
  const bool is_the_film = opening.whole && opening.spacing == f.spacing;
  const Rehearsal& sample = is_the_film ? opening : fine;
  f.sample = sample.at_the_end;
  f.sample_spacing = sample.spacing;
  for (const auto& [h, each] : rehearsals.done()) f.rehearsed.push_back(h);
  if (is_the_film && known == rehearsals.done().end()) f.rehearsed.push_back(f.spacing);
  std::sort(f.rehearsed.begin(), f.rehearsed.end(), std::greater<>());
  const Moment& last = fine.moments.back();
  const flow::Estimate mine = estimate_of(scene, f.spacing);
  f.counts = scaled(coarse, fine, opening, f.spacing, end);
  // What lies on the ground, of what was let out: some may have left over the edge.
  const Real stays = last.particles > 0 && f.whole ? last.particles / std::max(last.particles, estimate_of(scene, fine.spacing).particles) : 1;
  f.particles = is_the_film ? opening.moments.back().particles : mine.particles * stays;
  f.mean_particles = mine.mean_particles;
  f.solver_bytes = std::max(last.bytes / std::max(last.particles, 1.0), opening.moments.back().bytes / std::max(opening.moments.back().particles, 1.0)) * f.particles;
  // The front goes on towards the converged one as it went from the coarser rehearsal to the finer.
  constexpr Real kPower = 2.5;
  const auto to_the = [&](Real spacing_of) { return std::pow(spacing_of, kPower); };
  const Real further = (to_the(fine.spacing) - to_the(f.spacing)) / (to_the(coarse.spacing) - to_the(fine.spacing));
  if (is_the_film) f.front = opening.moments.back().front;
  else f.front = std::max(0.0, last.front - further * (at_time(coarse, last.time, [](const Moment& m) { return m.front; }) - last.front));
  return f;
}

}  // namespace effuse::budget
