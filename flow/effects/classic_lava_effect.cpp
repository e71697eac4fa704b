#include "flow/effects/classic_lava_effect.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "flow/sph/classic_lava.h"
#include "geometry/base/error.h"

namespace effuse::flow {

namespace {

using sph::ClassicLava;
using sph::ClassicOptions;
using sph::Vent;

template <std::size_t N>
std::vector<std::string> names(const std::string_view (&list)[N]) {
  return {std::begin(list), std::end(list)};
}

class ClassicLavaEffect final : public Effect {
 public:
  ClassicLavaEffect(const ClassicOptions& options, const std::vector<Vent>& vents, const geometry::Terrain& terrain)
      : lava_(options, vents,
              {[terrain](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) { terrain.contacts(x, reach, out); }},
              [terrain](const Vec3& p) { return terrain.height(p.x(), p.y()).has_value(); }) {
    for (const Vent& vent : vents)
      if (vent.rate > 0) vents_.push_back({vent.from, vent.to, vent.width, vent.start, vent.stop});
  }

  std::string_view name() const override { return "lava"; }
  Real time() const override { return lava_.time(); }
  void step(Real t_end) override {
    last_ = lava_.step(t_end - lava_.time());
    ++steps_;
    retries_ += static_cast<std::size_t>(last_.retries);
    smallest_step_ = std::min(smallest_step_, last_.dt);
  }
  geometry::Points points() const override { return lava_.points(); }
  Real volume() const override { return lava_.volume(); }
  Real spacing() const override { return lava_.options().spacing; }
  FlowView flow() const override {
    const geometry::Points p = lava_.points();
    return {p.position, p.velocity, p.temperature, p.surface, spacing()};
  }
  std::vector<Opening> openings() const override { return vents_; }
  std::size_t memory() const override { return lava_.memory(); }
  void add_to(StateHash& hash) const override { lava_.add_to(hash); }
  void save(StateWriter& out) const override {
    lava_.save(out);
    archive(*this, out);
  }
  void load(StateReader& in) override {
    lava_.load(in);
    archive(*this, in);
  }

  std::vector<std::pair<std::string, double>> figures() const override {
    return {{"particles", static_cast<double>(lava_.size())},
            {"volume_m3", lava_.volume()},
            {"mass_emitted_kg", lava_.mass_emitted()},
            {"mass_present_kg", static_cast<double>(lava_.size()) * lava_.particle_mass()},
            {"mass_left_kg", lava_.mass_left()},
            {"steps", static_cast<double>(steps_)},
            {"smallest_step_s", steps_ > 0 ? smallest_step_ : 0},
            {"retries", static_cast<double>(retries_)},
            {"max_speed_m_s", last_.max_speed},
            {"max_compression", last_.max_compression},
            {"min_temperature_K", lava_.size() > 0 ? last_.min_temperature : 0},
            {"max_temperature_K", last_.max_temperature}};
  }
  std::string status() const override {
    return fmt::format("{} particles, {:.1f} m/s, {:.0f} degC, dt {:.1f} ms", lava_.size(), last_.max_speed,
                       lava_.size() > 0 ? last_.min_temperature - kZeroCelsius : 0, 1e3 * last_.dt);
  }

 private:
  /// What the figures say of the steps so far: a run resumed reports the whole.
  template <class Self, class Archive>
  static void archive(Self& self, Archive& io) {
    io.value("steps", self.steps_);
    io.value("retries", self.retries_);
    io.value("smallest_step", self.smallest_step_);
    io.value("max_speed", self.last_.max_speed);
    io.value("max_compression", self.last_.max_compression);
    io.value("min_temperature", self.last_.min_temperature);
    io.value("max_temperature", self.last_.max_temperature);
  }

  std::vector<Opening> vents_;
  ClassicLava lava_;
  sph::StepReport last_;
  std::size_t steps_ = 0, retries_ = 0;
  Real smallest_step_ = 1e9;
};

Estimate estimate(const ClassicOptions& o, const std::vector<PlannedVent>& vents, Real duration) {
  Estimate e;
  e.particles = let_out(vents, duration) / std::pow(o.spacing, 3);
  e.mean_particles = mean_let_out(vents, duration) / std::pow(o.spacing, 3);
  e.steps = 1.15 * duration / o.rest_step();  // lava that moves takes shorter ones
  e.bytes = 720 * e.particles;
  // 0.5 us a particle, step and evaluation on two cores (the benchmark's figure).
  e.seconds = e.steps * e.mean_particles * 0.5e-6 * evaluations(o.scheme) + e.steps * 5e-5;
  return e;
}

}  // namespace

LavaModel read_classic_lava(Parameters& p) {
  ClassicOptions o;
  const auto positive = Parameters::positive(), not_negative = Parameters::not_negative();
  const Parameters::Range temperature = {0, 5000, true};
  o.spacing = p.number("spacing", "m", std::nullopt, positive, "between particles at rest: the resolution");
  o.support = p.number("support", "", o.support, {1.5, 4}, "radius of the kernel, in spacings");
  o.kernel = static_cast<sph::KernelKind>(p.choice("kernel", names(sph::kKernelNames), 0, "smoothing kernel"));
  o.density = p.number("density", "kg/m3", o.density, positive, "at rest");
  o.stiffness = p.number("stiffness", "m2/s2", o.stiffness, positive,
                         "k in P = k (rho - rho0): speed of sound squared; stiffer is less compressible and slower");
  o.cohesion = p.number("cohesion", "", o.cohesion, {0, 1}, "of negative pressure: 1 as the state equation says");
  o.density_diffusion =
      p.number("density_diffusion", "", o.density_diffusion, {0, 0.5}, "smooths the noise of the continuity equation; 0 is the paper's");
  o.density_relaxation = p.number("density_relaxation", "", o.density_relaxation, {0, 1},
                                  "pull of the density to the one summed over neighbours; 0 is the paper's");
  Parameters viscosity = p.table("viscosity", "kinematic, nu(T) = b exp(-a T) through two points");
  auto& law = o.viscosity;
  law.hot_nu = viscosity.number("hot", "m2/s", law.hot_nu, positive, "at hot_temperature");
  law.hot_temperature = viscosity.number("hot_temperature", "K", law.hot_temperature, temperature, "");
  law.cold_nu = viscosity.number("cold", "m2/s", law.cold_nu, positive, "at cold_temperature");
  law.cold_temperature = viscosity.number("cold_temperature", "K", law.cold_temperature, temperature, "");
  law.max = viscosity.number("max", "m2/s", law.max, positive, "never above: the explicit step pays for it");
  if (law.cold_temperature >= law.hot_temperature) viscosity.fault("cold_temperature", "is not below hot_temperature");
  if (law.cold_nu < law.hot_nu) viscosity.fault("cold", "is below hot: lava thickens as it cools");
  o.ground_friction = p.number("ground_friction", "", o.ground_friction, {0, 1}, "1 no slip, 0 free slip");
  o.diffusivity = p.number("diffusivity", "m2/s", o.diffusivity, not_negative, "of heat inside");
  o.heat_capacity = p.number("heat_capacity", "J/(kg K)", o.heat_capacity, positive, "");
  o.air_exchange = p.number("air_exchange", "W/(m2 K)", o.air_exchange, not_negative, "heat transfer to the air");
  o.air_temperature = p.number("air_temperature", "K", o.air_temperature, temperature, "");
  o.ground_exchange = p.number("ground_exchange", "W/(m2 K)", o.ground_exchange, not_negative, "heat transfer to the ground");
  const std::vector<std::string> explicit_schemes(kSchemeNames, kSchemeNames + kExplicitSchemes);
  o.scheme = static_cast<Scheme>(p.choice("scheme", explicit_schemes, 1, "time integration"));
  o.courant = p.number("courant", "", o.courant, {0, 2, true}, "of the step: share of the time sound takes over half the support");
  o.max_step = p.number("max_step", "s", o.max_step, positive, "no step is longer");
  o.surface.mass_quotient = p.number("surface_mass_quotient", "", o.surface.mass_quotient, {0, 1},
                                     "on the surface below this share of mass in the outer half-space");
  o.surface.coplanarity =
      p.number("surface_coplanarity", "", o.surface.coplanarity, {0, 1}, "on the surface when the neighbours are this flat");
  o.rest_period = p.number("rest_period", "s", o.rest_period, not_negative, "material coordinates are renewed this often; 0: never");
  if (o.rest_period > 0 && o.rest_period < 1e-3) p.fault("rest_period", "must be 0 s, or at least 0.001 s");

  LavaModel model;
  model.spacing = o.spacing;
  model.sets_the_step = "max_step, courant, stiffness, viscosity and heat exchange";
  model.estimate = [o](const std::vector<PlannedVent>& vents, Real duration) { return estimate(o, vents, duration); };
  model.obstacles = false;
  model.make = [o](const std::vector<Vent>& vents, const World& world) -> std::unique_ptr<Effect> {
    ClassicOptions options = o;
    options.seed = world.seed;
    return std::make_unique<ClassicLavaEffect>(options, vents, *world.terrain);
  };
  return model;
}

}  // namespace effuse::flow
