#include "flow/effects/smoke_effect.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "flow/effects/effect_table.h"
#include "flow/scene/placing.h"
#include "flow/smoke/smoke_grid.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"

namespace effuse::flow {

namespace {

using smoke::SmokeGrid;
using smoke::SmokeOptions;
using smoke::SmokeSource;

constexpr Real kMostCells = 2e7;
constexpr Real kAirHeat = 1.2 * 1005;  // [J/(m^3 K)]
constexpr Real kHottest = 2000;        // [K] above the air that lava heats its own cell, at most: it is not hotter itself

struct PlannedSource {
  SmokeSource source;
  bool on_ground = false, vent = false;
  Real start = 0, stop = 1e30;
};

struct SmokeSettings {
  std::string name;
  Place place;
  std::vector<Real> box;  ///< map x, y, z, x, y, z
  SmokeOptions options;
  std::vector<PlannedSource> sources;
  Real lava_smoke = 0, lava_convection = 0, lava_from = 0;
  Real step = 0, warm_up = 0;
  Vec3 color = Vec3::Ones();  ///< linear light
  std::vector<Partner> partners;
};

/// The grid's options in the world, its solid cells, and its sources; or a fault.
struct SmokeLayout {
  SmokeOptions options;
  std::vector<std::uint8_t> solid;
  std::vector<PlannedSource> sources;
};

std::optional<SmokeLayout> lay_out(const SmokeSettings& s, const World& world, std::vector<Fault>& faults) {
  SmokeLayout l;
  l.options = s.options;
  l.sources = s.sources;
  if (s.box.size() != 6) return std::nullopt;
  const geometry::Terrain& terrain = *world.terrain;
  const Vec3 origin = terrain.georeference().origin;
  l.options.corner = Vec3(s.box[0], s.box[1], s.box[2]) - origin;
  const std::size_t nx = static_cast<std::size_t>(l.options.n[0]), ny = static_cast<std::size_t>(l.options.n[1]), nz = static_cast<std::size_t>(l.options.n[2]);
  l.solid.assign(nx * ny * nz, 0);
  parallel_for(nx * ny, [&](std::size_t c) {
    const Vec2 p = l.options.corner.head<2>() + l.options.cell * Vec2(static_cast<Real>(c % nx) + 0.5, static_cast<Real>(c / nx) + 0.5);
    const std::optional<Real> z = terrain.height(p.x(), p.y());
    if (!z) return;
    for (std::size_t k = 0; k < nz && l.options.corner.z() + (static_cast<Real>(k) + 0.5) * l.options.cell < *z; ++k) l.solid[k * nx * ny + c] = 1;
  });
  bool sound = true;
  if (std::find(l.solid.begin(), l.solid.end(), 0) == l.solid.end()) {
    faults.push_back({s.place, fmt::format("smoke '{}': its box lies wholly in the ground", s.name)});
    sound = false;
  }
  for (PlannedSource& each : l.sources) {
    if (each.vent) continue;
    geometry::RigidPose pose;
    pose.position = each.source.at;
    sound &= put_on_terrain(pose, each.on_ground, terrain, fmt::format("smoke '{}'", s.name), s.place, faults);
    each.source.at = pose.position;
  }
  if (!sound) return std::nullopt;
  return l;
}

class SmokeEffect final : public Effect {
 public:
  SmokeEffect(const SmokeSettings& settings, SmokeLayout layout) : settings_(settings), sources_(std::move(layout.sources)), grid_(layout.options, std::move(layout.solid)) {
    for (std::size_t c = 0; c < grid_.size(); ++c) solid_cells_ += grid_.solid(c);
  }

  void meet(const std::vector<Effect*>& others) override {
    std::vector<Opening> openings;
    for (const Effect* other : others) {
      if (other->flow().spacing > 0) lava_ = other;
      for (const Opening& opening : other->openings()) openings.push_back(opening);
    }
    std::vector<PlannedSource> all;
    for (const PlannedSource& each : sources_) {
      if (!each.vent) {
        all.push_back(each);
        continue;
      }
      for (const Opening& opening : openings) {
        // A fissure is a row of them.
        const Vec3 along = opening.to - opening.from;
        const int count = std::max(1, static_cast<int>(std::ceil(along.norm() / std::max(opening.width, grid_.options().cell))));
        for (int k = 0; k < count; ++k) {
          all.push_back(each);
          all.back().source.at += opening.from + (k + 0.5) / count * along;
          all.back().source.radius = std::max(each.source.radius, opening.width / 2);
          all.back().start = std::max(each.start, opening.start);
          all.back().stop = std::min(each.stop, opening.stop);
        }
      }
    }
    sources_ = std::move(all);
    const Real count = std::ceil(settings_.warm_up / settings_.step);
    for (Real k = 0; k < count; ++k) advance(settings_.warm_up / count, true);
  }

  std::string_view name() const override { return settings_.name; }
  Real time() const override { return time_; }
  void step(Real t_end) override {
    const Real left = t_end - time_, count = std::max(1.0, std::ceil(left / settings_.step * (1 - 1e-9))), dt = left / count;
    advance(dt, false);
    if (!last_.pressure.converged) ++unsolved_;
    if (!grid_.finite()) throw UnstableError(fmt::format("smoke '{}' at {:.6g} s: its numbers are none any more", settings_.name, time_));
    time_ = count > 1 ? time_ + dt : t_end;
    ++steps_;
    iterations_ += static_cast<std::uint64_t>(last_.pressure.iterations);
  }

  std::vector<geometry::GridVolume> volumes() const override {
    geometry::GridVolume v;
    const SmokeOptions& o = grid_.options();
    v.name = settings_.name;
    v.corner = o.corner;
    v.cell = o.cell;
    v.n = o.n;
    const std::size_t n = grid_.size();
    v.density.resize(n);
    v.temperature.resize(n);
    v.velocity.resize(3 * n);
    parallel_for(n, [&](std::size_t c) {
      const bool air = !grid_.solid(c);
      v.density[c] = air ? static_cast<float>(grid_.density()[c]) : 0;
      v.temperature[c] = static_cast<float>(o.air_temperature + (air ? grid_.excess()[c] : 0));
      const Vec3 u = grid_.velocity_at(c);
      for (std::size_t a = 0; a < 3; ++a) v.velocity[3 * c + a] = static_cast<float>(u[static_cast<Eigen::Index>(a)]);
    });
    std::vector<geometry::GridVolume> all;
    all.push_back(std::move(v));
    return all;
  }

  std::optional<Vec3> draws_volumes() const override { return settings_.color; }

  std::size_t memory() const override { return grid_.memory(); }
  void add_to(StateHash& hash) const override {
    hash.add(time_);
    grid_.add_to(hash);
  }
  void save(StateWriter& out) const override {
    out.value("time", time_);
    out.value("steps", steps_);
    out.value("iterations", iterations_);
    out.value("unsolved", unsolved_);
    grid_.save(out);
  }
  void load(StateReader& in) override {
    in.value("time", time_);
    in.value("steps", steps_);
    in.value("iterations", iterations_);
    in.value("unsolved", unsolved_);
    grid_.load(in);
  }
  std::vector<std::pair<std::string, double>> figures() const override {
    const Real fastest = parallel_max(grid_.size(), 0.0, [&](std::size_t c) { return grid_.velocity_at(c).norm(); });
    return {{"cells", static_cast<double>(grid_.size())},
            {"solid_cells", static_cast<double>(solid_cells_)},
            {"steps", static_cast<double>(steps_)},
            {"unsolved_steps", static_cast<double>(unsolved_)},
            {"mass", grid_.mass()},
            {"fastest_m_s", fastest},
            {"divergence_1_s", grid_.divergence()},
            {"iterations", steps_ > 0 ? static_cast<double>(iterations_) / static_cast<double>(steps_) : 0}};
  }
  std::string status() const override { return fmt::format("{}, {:.2g} m/s", settings_.name, last_.fastest); }
  std::vector<std::string> remarks() const override {
    const SmokeOptions& o = grid_.options();
    return {fmt::format("{} x {} x {} cells, {} of them in the ground, steps of {:.3g} s at most", o.n[0], o.n[1], o.n[2], solid_cells_, settings_.step)};
  }

 private:
  void advance(Real dt, bool before_the_film) {
    for (const PlannedSource& each : sources_)
      if ((before_the_film && each.start <= 0 && !each.vent) || (!before_the_film && time_ + dt > each.start && time_ < each.stop)) grid_.add(each.source, dt);
    if (lava_ && !before_the_film) take_from_lava(dt);
    last_ = grid_.step(dt);
  }

  /// Each hot particle of the surface gives the air above it heat and smoke; serial, in the particles' order.
  void take_from_lava(Real dt) {
    if (settings_.lava_smoke <= 0 && settings_.lava_convection <= 0) return;
    const FlowView lava = lava_->flow();
    const SmokeOptions& o = grid_.options();
    const Real area = lava.spacing * lava.spacing, per_cell = dt * area / std::pow(o.cell, 3);
    for (std::size_t i = 0; i < lava.x.size(); ++i) {
      if (!lava.surface.empty() && !lava.surface[i]) continue;
      if (lava.temperature[i] < settings_.lava_from) continue;
      const Real excess = lava.temperature[i] - o.air_temperature;
      const Real heated = std::min(settings_.lava_convection * excess * per_cell / kAirHeat, std::min(excess, kHottest));
      grid_.add_at(lava.x[i] + Vec3(0, 0, std::max(lava.spacing, o.cell) / 2), settings_.lava_smoke * per_cell, heated);
    }
  }

  SmokeSettings settings_;
  std::vector<PlannedSource> sources_;
  SmokeGrid grid_;
  const Effect* lava_ = nullptr;
  SmokeGrid::Report last_;
  std::size_t solid_cells_ = 0;
  Real time_ = 0;
  std::uint64_t steps_ = 0, iterations_ = 0, unsolved_ = 0;
};

SmokeSettings read(Parameters& p) {
  SmokeSettings s;
  SmokeOptions& o = s.options;
  s.place = p.place("");
  s.name = read_effect_name(p, "smoke");
  s.box = p.numbers("box", "m", 6, true, "[x, y, z, x, y, z]: low and high corner, map coordinates");
  o.cell = p.number("cell", "m", std::nullopt, Parameters::positive(), "side of its cells");
  if (s.box.size() == 6 && o.cell > 0) {
    Real cells = 1;
    for (std::size_t a = 0; a < 3; ++a) {
      const Real n = std::ceil((s.box[a + 3] - s.box[a]) / o.cell - 1e-9);
      if (!(n >= 1)) {
        p.fault("box", "must have its high corner above the low one along x, y and z");
        s.box.clear();
        break;
      }
      o.n[a] = static_cast<int>(std::min(n, 1e8));
      cells *= n;
    }
    if (!s.box.empty() && !(cells <= kMostCells)) {
      p.fault("cell", fmt::format("{:.3g} cells of {:g} m, at most {:.0g}: wider cells or a smaller box would do", cells, o.cell, kMostCells));
      s.box.clear();
    }
  }
  std::vector<std::string> sides = {"west", "east", "south", "north", "bottom", "top"};
  o.open.fill(false);
  for (const std::size_t side : p.choices("open", sides, {0, 1, 2, 3, 5}, "sides of the box that air passes; others are walls")) o.open[side] = true;
  o.air_temperature = p.number("air_temperature", "K", o.air_temperature, {0, 1e4, true}, "");
  o.weight = p.number("weight", "m/s2", o.weight, Parameters::not_negative(), "that smoke of density 1 pulls down");
  o.wind = read_vector(p, "wind", "m/s", o.wind, "along x and y; it comes in through the open sides it blows from");
  o.swirl = p.number("swirl", "", 0.2, {0, 2}, "vorticity confinement: gives back the whirls that cells swallow");
  o.cooling = p.number("cooling", "s", 10, Parameters::not_negative(), "in which its excess of temperature falls to 1/e; 0: never");
  o.thinning = p.number("thinning", "s", 30, Parameters::not_negative(), "in which its density falls to 1/e; 0: never");
  o.sharp = p.flag("sharp", o.sharp, "MacCormack's correction: less blur, twice the time");
  o.tolerance = p.number("tolerance", "", o.tolerance, {0, 0.1, true}, "of the projection: share of the divergence that it leaves");
  s.step = p.number("step", "s", 1. / 24, Parameters::positive(), "at most");
  s.warm_up = p.number("warm_up", "s", 0, {0, 1e4}, "its own sources have been open for so long as the film begins");
  s.color = read_color(p, Vec3(0.45, 0.43, 0.42));
  s.lava_smoke = p.number("lava_smoke", "1/s", 0, Parameters::not_negative(), "that hot lava gives off: metres of density 1 a second");
  s.lava_convection = p.number("lava_convection", "W/(m2 K)", 0, Parameters::not_negative(), "from lava's surface into the air of its cell");
  s.lava_from = p.number("lava_from", "K", 900, {0, 5000}, "colder lava gives neither");
  if (s.lava_smoke > 0 || s.lava_convection > 0) {
    const std::string key = s.lava_smoke > 0 ? "lava_smoke" : "lava_convection";
    s.partners.push_back({p.place(key), p.path() + "." + key, "", {"lava"}, "smoke comes off lava"});
  }
  for (Parameters& t : p.tables("source", "lets smoke in")) {
    PlannedSource each;
    each.vent = t.choice("from", {"point", "vent"}, 0, "a ball about a point, or about each of lava's vents") == 1;
    const std::vector<Real> at = t.numbers("at", "m", 3, !each.vent, "x, y in the terrain's map coordinates, and z; from a vent: from its middle");
    if (at.size() == 3) each.source.at = Vec3(at[0], at[1], at[2]);
    if (!each.vent) each.on_ground = t.flag("on_ground", false, "its height counts from the terrain");
    each.source.radius = t.number("radius", "m", each.vent ? 0.0 : std::optional<Real>(), each.vent ? Parameters::not_negative() : Parameters::positive(), "of the ball; of a vent's: its own half width if that is more");
    each.source.density = t.number("density", "1/s", 2, Parameters::not_negative(), "that comes in its middle");
    each.source.temperature = t.number("temperature", "K", 500, {0, 5000}, "of what comes; 0: as it is there");
    each.source.velocity = read_vector(t, "velocity", "m/s", each.source.velocity, "of what comes; 0: as it is there");
    each.start = t.number("start", "s", 0, Parameters::not_negative(), "");
    each.stop = t.number("stop", "s", each.stop, Parameters::not_negative(), "");
    if (each.vent) s.partners.push_back({t.place("from"), t.path() + ".from", "", {"lava"}, "it comes out of lava's vents"});
    s.sources.push_back(each);
  }
  if (s.sources.empty() && s.lava_smoke <= 0) p.fault("source", "is missing: [[smoke.source]] or lava_smoke says where smoke comes from");
  return s;
}

}  // namespace

EffectPlan read_smoke(Parameters& parameters, Real duration) {
  const SmokeSettings settings = read(parameters);
  EffectPlan plan;
  plan.name = settings.name;
  plan.partners = settings.partners;
  if (settings.box.size() == 6) plan.estimate.cells = static_cast<double>(settings.options.n[0]) * settings.options.n[1] * settings.options.n[2];
  plan.estimate.bytes = 330 * plan.estimate.cells;
  plan.estimate.steps = std::ceil((duration + settings.warm_up) / settings.step);
  plan.estimate.seconds = plan.estimate.steps * plan.estimate.cells * (settings.options.sharp ? 2.5e-6 : 1.5e-6) / 1.8;
  plan.misfits = [settings](const World& world) {
    std::vector<Fault> faults;
    lay_out(settings, world, faults);
    return faults;
  };
  plan.build = [settings](const World& world) -> std::unique_ptr<Effect> {
    std::vector<Fault> faults;
    std::optional<SmokeLayout> layout = lay_out(settings, world, faults);
    if (!layout) throw InputError(faults);
    return std::make_unique<SmokeEffect>(settings, std::move(*layout));
  };
  return plan;
}

}  // namespace effuse::flow
