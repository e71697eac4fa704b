#include "flow/effects/particles_effect.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "flow/effects/met_things.h"
#include "flow/effects/particles_table.h"
#include "flow/particles/density_grid.h"
#include "flow/scene/placing.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/collide/slide.h"
#include "geometry/mesh/measure.h"

namespace effuse::flow {

namespace {

using particles::EmitterOptions;
using particles::EmitterShape;
using particles::ParticleCloud;

constexpr std::size_t kGrain = 4096;

/// Emitters of the world's coordinates, but for vents, which nobody has seen yet; faults: what does not fit.
std::vector<PlannedEmitter> place_emitters(const ParticlesSettings& s, const World& world, std::vector<Fault>& faults) {
  std::vector<PlannedEmitter> placed = s.emitters;
  const geometry::Terrain& terrain = *world.terrain;
  for (PlannedEmitter& e : placed) {
    const auto put = [&](Vec3& p) {
      geometry::RigidPose pose;
      pose.position = p;
      put_on_terrain(pose, e.on_ground, terrain, fmt::format("particles '{}'", s.name), e.place, faults);
      p = pose.position;
    };
    if (e.from == ParticleSource::kPoint || e.from == ParticleSource::kDisk) put(e.options.at);
    for (Vec3& corner : e.options.curve) put(corner);
    if (e.from != ParticleSource::kMesh) continue;
    try {
      geometry::TriMesh mesh = e.form.file.empty() ? mesh_of(e.form) : upright(world.mesh(e.form), e.form.scale, e.form.y_up);
      put_on_terrain(e.pose, e.on_ground, terrain, fmt::format("particles '{}'", s.name), e.place, faults);
      for (Vec3& p : mesh.positions) p = e.pose.world(p);
      e.options.mesh = std::move(mesh);
      if (!(geometry::surface_area(e.options.mesh) > 0)) faults.push_back({e.place, fmt::format("particles '{}': its emitter's mesh has no area", s.name)});
    } catch (const InputError& error) {
      for (const Fault& fault : error.faults()) faults.push_back(fault.place.line > 0 ? fault : Fault{e.place, fault.message});
    }
  }
  return placed;
}

class ParticlesEffect final : public Effect {
 public:
  ParticlesEffect(const ParticlesSettings& settings, const World& world, std::vector<PlannedEmitter> emitters)
      : settings_(settings), terrain_(*world.terrain), seed_(world.seed), plans_(std::move(emitters)), things_(settings.meets ? world : World{}) {}

  void meet(const std::vector<Effect*>& others) override {
    if (settings_.meets) things_.meet(others);
    std::vector<Opening> openings;
    for (Effect* other : others) {
      if (other->flow().spacing > 0) lava_ = other;
      for (const Opening& opening : other->openings()) openings.push_back(opening);
      if (other->water()) waters_.emplace_back(std::string(other->name()), other->water());
    }
    std::vector<PlannedEmitter> all;
    for (const PlannedEmitter& plan : plans_) {
      if (plan.from != ParticleSource::kVent) {
        all.push_back(plan);
        continue;
      }
      for (const Opening& opening : openings) {
        all.push_back(plan);
        EmitterOptions& o = all.back().options;
        if ((opening.to - opening.from).norm() > opening.width) {
          o.shape = EmitterShape::kCurve;
          o.curve = {opening.from, opening.to};
        }
        o.at = (opening.from + opening.to) / 2;
        o.radius = opening.width / 2;
        o.start = std::max(o.start, opening.start);
        o.stop = std::max(o.start, std::min(o.stop, opening.stop));
      }
    }
    plans_ = std::move(all);
    make_cloud();
    warm_up();
  }

  std::string_view name() const override { return settings_.name; }
  Real time() const override { return time_; }

  void step(Real t_end) override {
    const Real left = t_end - time_, count = std::max(1.0, std::ceil(left / settings_.step * (1 - 1e-9))), dt = left / count;
    find_sources();
    things_.move(time_, dt);
    std::vector<ParticleCloud::Sources> sources;
    for (const Sources& each : sources_) sources.push_back({each.x, each.v, each.share});
    cloud_->step(dt, sources);
    if (!cloud_->finite()) throw UnstableError(fmt::format("particles '{}' at {:.6g} s: positions or velocities are no numbers any more", settings_.name, time_));
    time_ = count > 1 ? time_ + dt : t_end;
    ++steps_;
  }

  std::vector<NamedCloud> clouds() const override {
    std::vector<NamedCloud> all(1);
    fill(all.front());
    return all;
  }
  std::vector<geometry::GridVolume> volumes() const override {
    std::vector<geometry::GridVolume> all;
    if (!settings_.volume) return all;
    NamedCloud cloud;
    fill(cloud);
    particles::DensityGridOptions options;
    options.cell = settings_.voxel;
    all.push_back(particles::density_grid(cloud.x, cloud.radius, cloud.opacity, cloud.temperature, options));
    all.back().name = settings_.name;
    return all;
  }

  std::size_t memory() const override { return cloud_->memory(); }
  void add_to(StateHash& hash) const override {
    hash.add(time_);
    for (const PlannedEmitter& plan : plans_) hash.add(std::span<const Vec3>(plan.options.mesh.positions));  // what its file held
    cloud_->add_to(hash);
  }
  void save(StateWriter& out) const override {
    out.value("time", time_);
    out.value("steps", steps_);
    things_.save(out);
    cloud_->save(out);
  }
  void load(StateReader& in) override {
    in.value("time", time_);
    in.value("steps", steps_);
    things_.load(in);
    cloud_->load(in);
  }
  std::vector<std::pair<std::string, double>> figures() const override {
    const ParticleCloud::Counts& c = cloud_->counts();
    return {{"particles", static_cast<double>(cloud_->size())}, {"born", static_cast<double>(c.born)}, {"aged", static_cast<double>(c.aged)},
            {"left", static_cast<double>(c.left)},              {"fallen", static_cast<double>(c.fallen)}, {"steps", static_cast<double>(steps_)}};
  }
  std::string status() const override { return fmt::format("{} {}", cloud_->size(), settings_.name); }

 private:
  struct Sources {
    std::vector<Vec3> x, v;
    Real share = 1;
  };

  void make_cloud() {
    std::vector<EmitterOptions> emitters;
    for (std::size_t e = 0; e < plans_.size(); ++e) {
      EmitterOptions o = plans_[e].options;
      o.seed = seed_ + 1000 * settings_.seed + 0x9e37 * (e + 1);
      // The cloud's clock is ahead by the warm-up.
      if (o.start > 0 || plans_[e].from == ParticleSource::kVent) o.start += settings_.warm_up;
      o.stop += settings_.warm_up;
      emitters.push_back(std::move(o));
    }
    particles::CloudOptions options = settings_.cloud;
    if (!options.room) {
      const Box3 ground = terrain_.bounds();
      const Real wide = ground.sizes().maxCoeff();
      options.room = Box3(Vec3(ground.min() - Vec3::Constant(wide)), Vec3(ground.max() + Vec3::Constant(wide)));
    }
    ParticleCloud::Contacts contacts;
    ParticleCloud::Move move;
    if (settings_.meets)
      contacts = [this](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) {
        terrain_.contacts(x, reach, out);
        if (things_.empty()) return;
        near_.resize(x.size());
        things_.obstacles().contacts(x, reach, 1, near_);
        parallel_for(x.size(), [&](std::size_t i) { if (near_[i].distance < out[i].distance) out[i] = near_[i]; }, kGrain);
      };
    if (!things_.empty())
      move = [this](std::span<Vec3> x, std::span<const Vec3> dx, std::span<Vec3> v) {
        const Real radius = smallest_radius();
        geometry::slide_all(things_.obstacles(), x, dx, v, std::span(&radius, 1), {settings_.cloud.friction, settings_.cloud.on_contact == particles::OnContact::kBounce ? settings_.cloud.restitution : 0});
      };
    cloud_ = std::make_unique<ParticleCloud>(options, std::move(emitters), std::move(contacts), std::move(move));
  }

  /// What is surely no wider than any of them: the swept move is against going through; contacts keep their own distance.
  Real smallest_radius() const {
    Real least = 1e300;
    for (const PlannedEmitter& plan : plans_) least = std::min(least, 0.1 * plan.options.size);
    return least;
  }

  void warm_up() {
    if (settings_.warm_up <= 0) return;
    const Real count = std::ceil(settings_.warm_up / settings_.step), dt = settings_.warm_up / count;
    things_.move(0, 0);
    for (Real k = 0; k < count; ++k) cloud_->step(dt);
  }

  /// Lava as it is now, once for each moment it reaches.
  void find_sources() {
    sources_.resize(plans_.size());
    if (!lava_ || (found_at_ && *found_at_ == lava_->time())) return;
    found_at_ = lava_->time();
    const FlowView lava = lava_->flow();
    for (std::size_t e = 0; e < plans_.size(); ++e) {
      const PlannedEmitter& plan = plans_[e];
      Sources& found = sources_[e];
      if (plan.options.shape != EmitterShape::kPoints) continue;
      found.x.clear();
      found.v.clear();
      for (std::size_t i = 0; i < lava.x.size(); ++i) {
        if (!lava.surface.empty() && !lava.surface[i]) continue;
        if (lava.temperature[i] < plan.hotter_than) continue;
        if (plan.from == ParticleSource::kLava) {
          found.x.push_back(lava.x[i] + Vec3(0, 0, lava.spacing / 2));
          found.v.push_back(lava.v[i]);
          continue;
        }
        for (const auto& [name, water] : waters_) {
          if (!plan.water.empty() && name != plan.water) continue;
          const std::optional<Real> level = water->surface(lava.x[i].head<2>());
          if (!level || lava.x[i].z() - lava.spacing / 2 > *level || lava.x[i].z() < *level - plan.deepest) continue;
          found.x.push_back(Vec3(lava.x[i].x(), lava.x[i].y(), std::max(*level, lava.x[i].z())));
          found.v.push_back(Vec3::Zero());
          break;
        }
      }
      const Real area = static_cast<Real>(found.x.size()) * lava.spacing * lava.spacing;
      found.share = plan.full_area > 0 ? std::min(1.0, area / plan.full_area) : 1;
    }
  }

  /// Optical depth falls as the same stuff spreads over a wider disk; opacity fades in and out over a life.
  void fill(NamedCloud& cloud) const {
    const std::size_t n = cloud_->size();
    cloud.name = settings_.name;
    cloud.look = settings_.look;
    cloud.color = settings_.color;
    cloud.soft = settings_.soft;
    cloud.points = settings_.points;
    cloud.spheres = settings_.spheres;
    cloud.x.assign(cloud_->positions().begin(), cloud_->positions().end());
    cloud.v.assign(cloud_->velocities().begin(), cloud_->velocities().end());
    cloud.id.assign(cloud_->ids().begin(), cloud_->ids().end());
    for (std::vector<Real>* each : {&cloud.radius, &cloud.temperature, &cloud.age, &cloud.opacity}) each->resize(n);
    const Real tau = -std::log1p(-std::min(settings_.opacity, 0.999));
    const auto ramp = [](Real u) { return u <= 0 ? 0 : u >= 1 ? 1 : u * u * (3 - 2 * u); };
    parallel_for(n, [&](std::size_t i) {
      const Real age = cloud_->age(i), life = std::clamp(age / cloud_->lifetime(i), 0.0, 1.0), wide = 1 + settings_.cloud.growth * age;
      cloud.age[i] = age;
      cloud.radius[i] = cloud_->radius(i);
      cloud.temperature[i] = cloud_->temperature(i);
      Real fade = 1;
      if (settings_.fade_in > 0) fade *= ramp(life / settings_.fade_in);
      if (settings_.fade_out > 0) fade *= ramp((1 - life) / settings_.fade_out);
      cloud.opacity[i] = settings_.opacity >= 1 && wide == 1 ? fade : -std::expm1(-tau * fade / (wide * wide));
    }, kGrain);
  }

  ParticlesSettings settings_;
  geometry::Terrain terrain_;
  std::uint64_t seed_;
  std::vector<PlannedEmitter> plans_;
  MetThings things_;
  std::vector<geometry::Contact> near_;
  const Effect* lava_ = nullptr;
  std::vector<std::pair<std::string, const Water*>> waters_;
  std::optional<Real> found_at_;
  std::vector<Sources> sources_;
  std::unique_ptr<ParticleCloud> cloud_;
  Real time_ = 0;
  std::uint64_t steps_ = 0;
};

}  // namespace

EffectPlan read_particles(Parameters& parameters, Real duration) {
  const ParticlesSettings settings = read_particles_table(parameters);
  EffectPlan plan;
  plan.name = settings.name;
  plan.partners = settings.partners;
  for (const PlannedEmitter& e : settings.emitters) {
    const Real open = std::max(0.0, std::min(e.options.stop, duration) - e.options.start) + settings.warm_up;
    plan.estimate.drawn += e.options.rate * std::min(open, e.options.lifetime);
  }
  plan.estimate.bytes = 250 * plan.estimate.drawn;
  plan.estimate.steps = std::ceil(duration / settings.step);
  // Measured on one core: 60 ns a particle and step, 70 ns more in eddies, and 100 ns for the ground.
  plan.estimate.seconds = plan.estimate.steps * plan.estimate.drawn * ((settings.cloud.forces.turbulence > 0 ? 130e-9 : 60e-9) + (settings.meets ? 100e-9 : 0)) / 1.8;
  if (!(plan.estimate.drawn <= 1e8)) parameters.fault("emitter", fmt::format("{:.3g} particles at the end, at most 1e8: a smaller rate or a shorter lifetime would do", plan.estimate.drawn));
  plan.misfits = [settings](const World& world) {
    std::vector<Fault> faults;
    place_emitters(settings, world, faults);
    return faults;
  };
  plan.build = [settings](const World& world) -> std::unique_ptr<Effect> {
    std::vector<Fault> faults;
    std::vector<PlannedEmitter> emitters = place_emitters(settings, world, faults);
    if (!faults.empty()) throw InputError(faults);
    ParticlesSettings local = settings;  // from the terrain file's coordinates
    const Vec3 origin = world.terrain->georeference().origin;
    if (local.cloud.room) local.cloud.room->translate(Vec3(-origin));
    for (particles::Attractor& pull : local.cloud.forces.attractors) pull.at -= origin;
    return std::make_unique<ParticlesEffect>(local, world, std::move(emitters));
  };
  return plan;
}

}  // namespace effuse::flow
