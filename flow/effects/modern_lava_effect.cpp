#include "flow/effects/modern_lava_effect.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "flow/effects/crust_blocks.h"
#include "flow/effects/lava_rheology.h"
#include "flow/effects/solid_world.h"
#include "flow/sph/lava_presets.h"
#include "flow/sph/modern_lava.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/unstable_at.h"

namespace effuse::flow {

namespace {

using sph::HeatOptions;
using sph::LavaPreset;
using sph::ModernLava;
using sph::ModernOptions;
using sph::ModernReport;
using sph::Vent;

constexpr Parameters::Range kTemperature = {0, 5000, true};
constexpr Real kRush = 100;  // [m/s] of what may come to a vent within a step
constexpr Parameters::Range kTolerance = {0, 0.1, true};

template <std::size_t N>
std::vector<std::string> names(const std::string_view (&list)[N]) {
  return {std::begin(list), std::end(list)};
}

class ModernLavaEffect final : public Effect {
 public:
  ModernLavaEffect(const ModernOptions& options, const std::vector<Vent>& vents, const geometry::Terrain& terrain, std::unique_ptr<SolidWorld> solids, const CrustBlockOptions& blocks)
      : solids_(std::move(solids)),
        lava_(options, vents,
              {[terrain](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) { terrain.contacts(x, reach, out); }},
              [terrain](const Vec3& p) { return terrain.height(p.x(), p.y()).has_value(); }, solids_->solids()),
        heat_(options.heat.on),
        origin_(terrain.georeference().origin),
        terrain_(terrain) {
    if (blocks.on) blocks_.emplace(blocks, options.spacing);
    for (const Vent& vent : vents) {
      if (vent.rate <= 0) continue;
      vents_.push_back({vent.from, vent.to, vent.width, vent.start, vent.stop});
      coldest_ = std::min(coldest_, vent.temperature);
      const Real area = static_cast<Real>(vent.lattice(options.spacing).size()) * options.spacing * options.spacing;
      openings_.push_back({vent.start, vent.stop, options.courant * options.spacing * area / vent.rate, vent.lattice(options.spacing), (vent.from + vent.to) / 2});
    }
    name_figures();
  }

  std::string_view name() const override { return "lava"; }
  Real time() const override { return lava_.time(); }

  void meet(const std::vector<Effect*>& others) override {
    for (Effect* other : others)
      if (const SoftSolid soft = other->soft(); soft.solid) {
        solids_->add_soft(std::string(other->name()), soft);
        refuse_over_vents(soft, other->name());
        other->led_by(*this);
      }
    if (solids_->softs() > 0) {
      lava_.set_solids(solids_->solids());
      name_figures();
    }
    std::vector<const Water*> waters;
    for (const Effect* other : others)
      if (const Water* water = other->water(); water && water->boiling() > 0) waters.push_back(water);
    if (waters.empty() || !heat_) return;
    quenched_ = true;
    // Where several lie over one another the first one's temperature counts for all.
    const sph::SurfaceLaw law{lava_.options().heat.air.emissivity, false, waters.front()->boiling(), waters.front()->temperature()};
    lava_.set_water({[waters](std::span<const Vec3> x, std::span<std::uint8_t> wet) {
                       for (const Water* water : waters) water->wet(x, wet);
                     },
                     law});
  }
  /// A spacing is what lava needs to come out; where solids will be when later vents open nobody knows.
  void refuse_over_vents(const SoftSolid& soft, std::string_view name) const {
    for (const Mouth& mouth : openings_)
      for (const Vec3& site : mouth.sites) {
        if (mouth.start > 0) break;
        if (const Real way = solids_->distance_to_last(site, spacing()); way < spacing())
          throw InputError(soft.place, fmt::format("'{}' is {} the vent when it opens, wanted at least a spacing, {:.3g} m, between them", name, way <= 0 ? std::string("over") : fmt::format("{:.2g} m from", way), spacing()));
      }
  }

  FlowView flow() const override {
    return {lava_.positions(), lava_.velocities(), heat_ ? lava_.heat().surface_temperature() : lava_.temperatures(), lava_.surface(), spacing()};
  }
  std::vector<flow::Opening> openings() const override { return vents_; }
  std::vector<std::string> remarks() const override {
    const HeatOptions& heat = lava_.options().heat;
    if (!heat.on || !heat.crust || vents_.empty() || coldest_ > heat.crust_temperature) return {};
    return {fmt::format("comes out at {:g} K, not above heat.crust_temperature, {:g} K: all of it is crust from the start", coldest_, heat.crust_temperature)};
  }

  void step(Real t_end) override {
    if (crammed_steps_ >= kMostCrammedSteps)
      throw UnstableAt(fmt::format("at t = {:.6g} s {} of {} particles have been pressed to more than 1.5 times their density for {} steps, around ({:.6g}, {:.6g}, {:.6g}): more lava is let in there than "
                                      "there is room for, as in a closed room of obstacles; a way out, or a lower rate, would do",
                                      time(), last_.crammed, lava_.size(), kMostCrammedSteps, origin_.x() + last_.crammed_at.x(), origin_.y() + last_.crammed_at.y(), origin_.z() + last_.crammed_at.z()),
                       last_.crammed_at);
    const Real wanted = longest_step(t_end - lava_.time());
    try {
      last_ = lava_.step(wanted);
    } catch (const UnstableAt& error) {
      throw UnstableAt(error.what() + blocked_vents(wanted), error.where());
    } catch (const UnstableError& error) {
      throw UnstableError(error.what() + blocked_vents(wanted));
    }
    solids_->wet(lava_.positions(), lava_.options().spacing);
    if (blocks_) blocks_->step(lava_, *solids_, terrain_);
    Totals& t = totals_;
    t.steps += 1;
    t.retries += last_.retries;
    t.pressure_iterations += last_.pressure_iterations;
    t.viscosity_iterations += last_.viscosity_iterations;
    t.density_iterations += last_.density_iterations;
    // A step that ends a frame is as short as what was left of it.
    if (last_.dt < wanted || t.smallest_step > wanted) t.smallest_step = std::min(t.smallest_step, last_.dt);
    t.unsolved += last_.solved ? 0 : 1;
    t.crushed += static_cast<Real>(last_.solids.crushed);
    t.stopped += static_cast<Real>(last_.solids.stopped);
    t.divergence_error = std::max(t.divergence_error, last_.divergence_error);
    t.viscosity_residual = std::max(t.viscosity_residual, last_.viscosity_residual);
    t.largest_density_error = std::max(t.largest_density_error, last_.density_error);
    // A few are squeezed for a moment wherever something hits.
    const bool crammed = last_.crammed >= kCrammedAtLeast && static_cast<Real>(last_.crammed) > kCrammedShare * static_cast<Real>(last_.awake);
    crammed_steps_ = crammed ? crammed_steps_ + 1 : 0;
    if (heat_) book_heat();
  }

  geometry::Points points() const override { return lava_.points(); }
  std::vector<geometry::RigidPose> body_poses() const override { return solids_->poses(); }
  std::vector<SolidPiece> pieces() const override { return solids_->pieces(); }
  bool makes_pieces() const override { return blocks_.has_value(); }
  Real volume() const override { return lava_.volume(); }
  Real spacing() const override { return lava_.options().spacing; }
  std::size_t memory() const override { return lava_.memory(); }
  void add_to(StateHash& hash) const override {
    lava_.add_to(hash);
    solids_->add_to(hash);
    if (blocks_) blocks_->add_to(hash);
  }
  void save(StateWriter& out) const override {
    lava_.save(out);
    solids_->save(out);
    if (blocks_) blocks_->save(out);
    archive(*this, out);
  }
  void load(StateReader& in) override {
    lava_.load(in);
    solids_->load(in);
    if (blocks_) blocks_->load(in);
    archive(*this, in);
  }

  std::vector<std::pair<std::string, double>> figures() const override {
    const Totals& t = totals_;
    const auto n = static_cast<double>(lava_.size());
    const auto mean = [&](Real sum) { return t.steps > 0 ? sum / t.steps : 0; };
    const std::span<const Real> T = lava_.temperatures();
    std::vector<std::pair<std::string, double>> figures = {
        {"particles", n},
        {"volume_m3", lava_.volume()},
        {"mass_emitted_kg", lava_.mass_emitted()},
        {"mass_present_kg", n * lava_.particle_mass()},
        {"mass_left_kg", lava_.mass_left()},
        {"steps", t.steps},
        {"smallest_step_s", t.steps > 0 ? t.smallest_step : 0},
        {"retries", t.retries},
        {"awake", static_cast<double>(last_.awake)},
        {"pressure_iterations", mean(t.pressure_iterations)},
        {"viscosity_iterations", mean(t.viscosity_iterations)},
        {"density_iterations", mean(t.density_iterations)},
        {"largest_divergence_error", t.divergence_error},
        {"largest_viscosity_residual", t.viscosity_residual},
        {"unsolved_steps", t.unsolved},
        {"density_error", last_.density_error},
        {"largest_density_error", t.largest_density_error},
        {"max_speed_m_s", last_.max_speed},
    };
    if (n > 0) {
      figures.emplace_back("min_temperature_K", -parallel_max(T.size(), -1e300, [&](std::size_t i) { return -T[i]; }));
      figures.emplace_back("mean_temperature_K", parallel_sum(T.size(), 0.0, [&](std::size_t i) { return T[i]; }) / n);
      figures.emplace_back("max_temperature_K", parallel_max(T.size(), 0, [&](std::size_t i) { return T[i]; }));
    }
    if (heat_) {
      for (const auto& [key, value] : {std::pair("radiated_J", t.radiated),
                                       {"convected_J", t.convected},
                                       {"ground_J", t.ground},
                                       {"vent_J", t.vent},
                                       {"viscous_J", t.viscous},
                                       {"stored_J", t.stored},
                                       {"left_J", t.left}})
        figures.emplace_back(key, value);
      if (quenched_) figures.emplace_back("quenched_J", t.quenched);
      for (std::size_t k = 0; k < solids_->names().size(); ++k) {
        const SolidWorld::Warmth& warmth = solids_->warmth()[k];
        const std::string& name = figure_names_[k];
        figures.emplace_back(name + "_given_J", warmth.given);
        figures.emplace_back(name + "_hottest_K", warmth.hottest);
        if (warmth.mean > 0) figures.emplace_back(name + "_mean_K", warmth.mean);
      }
    }
    if (solids_->any()) {
      figures.emplace_back("crushed", t.crushed);
      figures.emplace_back("stopped", t.stopped);
    }
    for (auto& figure : solids_->figures()) figures.push_back(std::move(figure));
    if (blocks_)
      for (auto& figure : blocks_->figures()) figures.push_back(std::move(figure));
    return figures;
  }

  std::string status() const override {
    const std::string resting = last_.awake < lava_.size() ? fmt::format(" ({} awake)", last_.awake) : "";
    const std::string temperature = heat_ && lava_.size() > 0 ? fmt::format(", {:.0f} degC", last_.min_temperature - kZeroCelsius) : "";
    return fmt::format("{} particles{}, {:.2g} m/s{}, dt {:.3g} s", lava_.size(), resting, last_.max_speed, temperature, last_.dt);
  }

 private:
  /// Several of one name: the second is name_2.
  void name_figures() {
    figure_names_.clear();
    for (const std::string& name : solids_->names()) {
      const auto taken = std::count(solids_->names().begin(), solids_->names().begin() + static_cast<std::ptrdiff_t>(figure_names_.size()), name);
      figure_names_.push_back(taken > 0 ? fmt::format("{}_{}", name, taken + 1) : name);
    }
  }

  /// A vent's times, and the longest step while it is open [s].
  struct Mouth {
    Real start, stop, step;
    std::vector<Vec3> sites;
    Vec3 middle;
  };

  /// The solver's step follows the lava that flows. A vent that opens onto ground where none does must be met in
  /// steps of its own speed, or its first particles come out on top of one another.
  Real longest_step(Real wanted) const {
    const Real now = lava_.time();
    for (const Mouth& o : openings_)
      if (now < o.stop && now + wanted > o.start) wanted = std::min(wanted, std::max(o.step, o.start - now));
    return wanted;
  }

  /// For a step that failed: what is in or near a vent that is open, or will be within the step.
  std::string blocked_vents(Real dt) const {
    std::string text;
    const Real now = lava_.time();
    for (const Mouth& o : openings_) {
      if (now + dt < o.start || now >= o.stop) continue;
      std::optional<SolidWorld::Near> worst;
      for (const Vec3& site : o.sites) {
        const auto near = solids_->nearest(site, 4 * spacing() + kRush * dt);
        if (near && near->distance < 4 * spacing() + near->speed * dt && (!worst || near->distance < worst->distance)) worst = near;
      }
      if (!worst) continue;
      const std::string where = worst->distance <= 0 ? "over" : fmt::format("{:.2g} m from", worst->distance);
      text += fmt::format("; {}{} is {} the open vent at {:.10g}, {:.10g}: where lava comes out nothing may stand or pass, or be slower than the lava", worst->name,
                          worst->speed > 0 ? fmt::format(", {:.3g} m/s fast,", worst->speed) : "", where, o.middle.x() + origin_.x(), o.middle.y() + origin_.y());
    }
    return text;
  }

  /// Of all steps so far; numbers as the figures show them. Heat in J.
  struct Totals {
    Real steps = 0, retries = 0;
    Real pressure_iterations = 0, viscosity_iterations = 0, density_iterations = 0;
    Real smallest_step = 1e9, largest_density_error = 0;
    Real unsolved = 0, divergence_error = 0, viscosity_residual = 0;  // steps; worst of all
    Real crushed = 0, stopped = 0;  // particles among obstacles, once a step each (geometry::Slid)
    Real quenched = 0;  // of radiated and convected: into water
    Real radiated = 0, convected = 0, ground = 0, viscous = 0, vent = 0, left = 0;
    Real stored = 0;  // now
  };

  void book_heat() {
    Totals& t = totals_;
    const sph::HeatBudget& booked = last_.heat;
    t.radiated += booked.radiated;
    t.convected += booked.convected;
    t.quenched += booked.quenched;
    t.ground += booked.ground;
    t.viscous += booked.dissipated;
    // The newest particles stand at the end, and nothing has touched their heat.
    Real born = 0;
    for (const Real enthalpy : lava_.heat().enthalpy().last(last_.emitted)) born += lava_.heat().particle_mass() * enthalpy;
    t.vent += born;
    t.left += last_.left_enthalpy;
    t.stored = lava_.heat().total_enthalpy();
  }

  /// A run resumed reports the whole.
  template <class Self, class Archive>
  static void archive(Self& self, Archive& io) {
    auto& t = self.totals_;
    io.value("steps", t.steps);
    io.value("retries", t.retries);
    io.value("pressure_iterations", t.pressure_iterations);
    io.value("viscosity_iterations", t.viscosity_iterations);
    io.value("density_iterations", t.density_iterations);
    io.value("smallest_step", t.smallest_step);
    io.value("largest_density_error", t.largest_density_error);
    io.value("unsolved", t.unsolved);
    io.value("crushed", t.crushed);
    io.value("stopped", t.stopped);
    io.value("divergence_error", t.divergence_error);
    io.value("viscosity_residual", t.viscosity_residual);
    io.value("radiated", t.radiated);
    io.value("convected", t.convected);
    io.value("quenched", t.quenched);
    io.value("ground", t.ground);
    io.value("viscous", t.viscous);
    io.value("vent", t.vent);
    io.value("left", t.left);
    io.value("stored", t.stored);
    io.value("awake", self.last_.awake);
    io.value("density_error", self.last_.density_error);
    io.value("max_speed", self.last_.max_speed);
    io.value("crammed_steps", self.crammed_steps_);
    io.value("crammed", self.last_.crammed);
  }

  static constexpr std::size_t kCrammedAtLeast = 20;
  static constexpr Real kCrammedShare = 0.05;
  static constexpr std::uint64_t kMostCrammedSteps = 50;

  std::uint64_t crammed_steps_ = 0;     // in a row
  std::unique_ptr<SolidWorld> solids_;  // lava_ refers to it
  ModernLava lava_;
  bool heat_;
  Vec3 origin_;  // of the map
  geometry::Terrain terrain_;
  std::optional<CrustBlocks> blocks_;
  std::vector<Mouth> openings_;
  std::vector<flow::Opening> vents_;
  Real coldest_ = std::numeric_limits<Real>::infinity();  // of what comes out of them [K]
  bool quenched_ = false;  // by water
  std::vector<std::string> figure_names_;  // of obstacles and bodies
  ModernReport last_;
  Totals totals_;
};

void read_heat(Parameters p, const LavaPreset* preset, bool on, HeatOptions& h) {
  const auto not_negative = Parameters::not_negative();
  if (preset) {
    h.curve = {preset->heat_capacity, preset->latent_heat_released(), preset->solidus, preset->eruption_temperature};
    h.conductivity = preset->conductivity;
    h.air.emissivity = preset->emissivity;
    h.air.convection = preset->convection;
  }
  h.air.air_temperature = 288.15;
  h.on = p.flag("on", on,
                "false: every particle keeps its temperature, nothing is computed; true when there is a preset or a table [lava.heat]");
  h.curve.heat_capacity = p.number("heat_capacity", "J/(kg K)", h.curve.heat_capacity, {1, 1e6}, "");
  h.curve.latent_heat =
      p.number("latent_heat", "J/kg", h.curve.latent_heat, {0, 1e8}, "set free from liquidus to solidus, a kilogram of lava");
  h.curve.solidus = p.number("solidus", "K", h.curve.solidus, kTemperature, "all of the latent heat is out below");
  h.curve.liquidus = p.number("liquidus", "K", h.curve.liquidus, kTemperature, "none of it is out above");
  if (h.curve.liquidus < h.curve.solidus)
    p.fault(p.has("liquidus") ? "liquidus" : "solidus",
            fmt::format("the liquidus, {:g} K, is below the solidus, {:g} K", h.curve.liquidus, h.curve.solidus));
  h.conductivity = p.number("conductivity", "W/(m K)", h.conductivity, {0, 1e4, true}, "of the melt, its bubbles included");
  h.solid_conductivity = p.number("solid_conductivity", "W/(m K)", h.solid_conductivity, {0, 1e4}, "of the solid; 0: as the melt");
  h.air.thompson_ramsey = p.choice("emissivity_law", {"constant", "thompson_ramsey"}, 0,
                                   "of temperature: thompson_ramsey is 1.0463 - 1.48144e-4 T (2021)") == 1;
  h.air.emissivity = p.number("emissivity", "", h.air.emissivity, {0, 1}, "of law constant");
  h.air.convection =
      p.number("convection", "W/(m2 K)", h.air.convection, {0, 1e6}, "heat transfer to the air; figures in use range from 9 to 75");
  h.air.air_temperature = p.number("air_temperature", "K", h.air.air_temperature, kTemperature, "of air and sky");
  // Effusivity's own unit has a root in it, which units here have not. Soil: 2 W/(m K) and 2.2 MJ/(m3 K).
  const Real k = p.number("ground_conductivity", "W/(m K)", 2, {0, 1e4},
                          "of the ground, which warms up under the lava; its temperature is terrain.temperature; 0: insulates");
  const Real rho_c = p.number("ground_heat_capacity", "J/(m3 K)", 2.2e6, {1, 1e9}, "of a cubic metre of ground");
  h.ground_effusivity = std::sqrt(k * rho_c);
  h.ground_conductance = p.number("ground_conductance", "W/(m2 K)", h.ground_conductance, {0, 1e6},
                                  "of a plate in the ground's place, its far side at the ground's temperature; 0: none");
  h.viscous_heating = p.flag("viscous_heating", h.viscous_heating, "friction inside the lava warms it");
  h.crust =
      p.flag("crust", h.crust,
             "a conductive column on each exposed particle: what glows is its thin skin; false: each particle cools and glows as a whole");
  h.crust_temperature = p.number("crust_temperature", "K", h.crust_temperature, kTemperature, "what is colder is crust");
  h.longest_interval = p.number("longest_interval", "s", h.longest_interval, not_negative, "between two exchanges among particles");
}

// Conduction over a particle this many times faster than the step would take thousands of passes over the pairs.
constexpr Real kMostDiffusion = 1e4;

/// Speed and viscosity of lava as it leaves the vents, guessed: a film fed along their length, on a slope of 0.3, no thinner
/// than a spacing, and never faster than what falls freely through 10 m.
struct Guess {
  Real speed = 0;  ///< the fastest vent's [m/s]
  Real nu = 0;     ///< the stiffest lava's, kinematic [m^2/s]
};
Guess guess_flow(const ModernOptions& o, const std::vector<PlannedVent>& vents) {
  constexpr Real kSlope = 0.3, kFall = 10;
  Guess guess;
  for (const PlannedVent& v : vents) {
    const Real q = v.vent.rate / std::max((v.to - v.from).norm(), v.vent.width);
    Real shear = 1, speed = 0, nu = 0;
    for (int k = 0; k < 20; ++k) {  // shear thins it
      nu = o.rheology.viscosity(v.vent.temperature, shear) / o.density;
      const Real depth = std::max(std::cbrt(3 * nu * q / (kGravity * kSlope)), o.spacing);
      speed = 1.5 * q / depth;
      shear = 2 * speed / depth;
    }
    guess.speed = std::max(guess.speed, speed);
    guess.nu = std::max(guess.nu, nu);
  }
  guess.speed = std::min(guess.speed, std::sqrt(2 * kGravity * kFall));
  return guess;
}

Estimate estimate(const ModernOptions& o, const std::vector<PlannedVent>& vents, Real duration) {
  Estimate e;
  const Real volume = std::pow(o.spacing, 3);
  const Guess guess = guess_flow(o, vents);
  e.particles = let_out(vents, duration) / volume;
  e.mean_particles = mean_let_out(vents, duration) / volume;
  // The fastest particle is faster than the film, and now and then one falls.
  Real dt = std::min(o.courant * std::sqrt(o.spacing / kGravity), o.max_step);
  if (guess.speed > 0) dt = std::min(dt, o.courant * o.spacing / guess.speed);
  e.steps = 1.3 * duration / dt;
  e.bytes = 2300 * e.particles;
  // Measured on Maunga Whau, 4,600 particles, one thread, 2000 to 240,000 Pa s: 1.5 us a particle and step and 0.2 us an
  // iteration of the solves, of which there are 5 to 80 in all, as far as viscosity reaches in a step. A second thread
  // makes that 1.8 times as fast. Kernels of other support have more or fewer neighbours.
  const Real iterations = 5 + 75 * std::min(1.0, guess.nu * dt / (o.spacing * o.spacing)), neighbors = std::pow(o.support / 3, 3);
  e.seconds = e.steps * e.mean_particles * neighbors * (1.5e-6 + 0.2e-6 * iterations) / 1.8;
  return e;
}

}  // namespace

LavaModel read_modern_lava(Parameters& p) {
  ModernOptions o;
  std::vector<std::string> presets = {"none"};
  for (const std::string& name : sph::lava_preset_names()) presets.push_back(name);
  const std::size_t chosen =
      p.choice("preset", presets, 0, "a real lava: the defaults of rheology, density, heat and the vents' temperature");
  const LavaPreset* preset = chosen > 0 ? sph::find_lava_preset(presets[chosen]) : nullptr;

  const auto positive = Parameters::positive(), not_negative = Parameters::not_negative();
  o.spacing = p.number("spacing", "m", std::nullopt, positive, "between particles at rest: the resolution");
  o.support = p.number("support", "", o.support, {1.5, 4},
                       "radius of the kernel, in spacings: 3 is right to some per cent, 2 three times as fast and 20 % off");
  o.kernel = static_cast<sph::KernelKind>(
      p.choice("kernel", names(sph::kKernelNames), static_cast<std::size_t>(o.kernel), "smoothing kernel of density and pressure"));
  o.density = p.number("density", "kg/m3", preset ? preset->density : o.density, {1, 1e5}, "bubbles included");
  o.rheology = read_rheology(p, preset);
  read_heat(p.table("heat", "what the lava loses, and to what"), preset, preset || p.has("heat"), o.heat);
  o.crust_viscosity = p.number("crust_viscosity", "Pa s", o.crust_viscosity, {0, 1e15},
                               "of crust; its share of a particle's thickness adds this to the viscosity; 0: crust does not stiffen");
  o.crust_strength = p.number("crust_strength", "Pa", o.crust_strength, {0, 1e9}, "stress at which crust gives; 0: it never does");
  o.slip_length =
      p.number("slip_length", "m", o.slip_length, not_negative, "on the ground: 0 is no slip, far more than the lava's depth free slip");
  o.courant =
      p.number("courant", "", o.courant, {0, 2, true}, "of the step: share of the time in which the fastest particle moves one spacing");
  o.max_step = p.number("max_step", "s", o.max_step, positive, "no step is longer");
  o.min_step = p.number("min_step", "s", o.min_step, positive, "a run that would need a shorter one ends");
  if (o.min_step > o.max_step) p.fault("min_step", fmt::format("min_step, {:g} s, is above max_step, {:g} s", o.min_step, o.max_step));
  o.ground_speed = 0;  // terrain stands
  o.divergence_tolerance = p.number("divergence_tolerance", "", o.divergence_tolerance, kTolerance,
                                    "of the pressure solve: change of density a step may leave, rms");
  o.density_tolerance = p.number("density_tolerance", "", o.density_tolerance, kTolerance, "of taking compression back, rms");
  o.density_iterations =
      static_cast<int>(p.integer("density_iterations", o.density_iterations, 1, 1000000, "of that, at most: it goes on in the next step"));
  o.viscosity_tolerance =
      p.number("viscosity_tolerance", "", o.viscosity_tolerance, {0, 1e-2, true}, "of the viscosity solve: residual over right-hand side");
  o.max_iterations = static_cast<int>(p.integer("max_iterations", o.max_iterations, 1, 1000000, "of either solve"));
  o.coupling = static_cast<int>(p.integer("coupling", o.coupling, 1, 20, "pressure and viscosity are solved this often a step"));
  const Real pace =
      p.number("sleep_pace", "s", 3600, not_negative, "lava that would take longer than this to move one spacing falls asleep; 0: never");
  o.sleep_speed = pace > 0 ? o.spacing / pace : 0;
  o.sleep_delay = p.number("sleep_delay", "s", o.sleep_delay, not_negative, "once it has been that slow for so long");
  o.rest_period = p.number("rest_period", "s", o.rest_period, not_negative, "material coordinates are renewed this often; 0: never");
  if (o.rest_period > 0 && o.rest_period < 1e-3) p.fault("rest_period", "must be 0 s, or at least 0.001 s");

  const Real diffusion = std::max(o.heat.conductivity, o.heat.solid_conductivity) / (o.density * o.heat.curve.heat_capacity) * o.max_step /
                         (o.spacing * o.spacing);
  if (o.spacing > 0 && o.heat.on && !(diffusion <= kMostDiffusion))
    p.fault("spacing", fmt::format("heat would cross {:.3g} particles of this size in a step, at most {:.0f}: a larger spacing, a smaller "
                                   "max_step or heat.conductivity would do",
                                   std::sqrt(diffusion), std::sqrt(kMostDiffusion)));

  const CrustBlockOptions blocks = read_crust_blocks(p, o.spacing, o.density);
  if (blocks.on && !(o.heat.on && o.heat.crust)) p.fault("crust_blocks", "need a crust: [lava.heat] with crust = true, or a preset");

  LavaModel model;
  model.spacing = o.spacing;
  if (preset) model.vent_temperature = preset->eruption_temperature;
  model.sets_the_step = "max_step, courant, spacing and the vents' rates";
  model.estimate = [o](const std::vector<PlannedVent>& vents, Real duration) { return estimate(o, vents, duration); };
  model.make = [o, blocks](const std::vector<Vent>& vents, const World& world) -> std::unique_ptr<Effect> {
    ModernOptions options = o;
    options.seed = world.seed;
    CrustBlockOptions own = blocks;
    own.seed = world.seed;
    return std::make_unique<ModernLavaEffect>(options, vents, *world.terrain, make_solid_world(world, blocks.on), own);
  };
  return model;
}

}  // namespace effuse::flow
