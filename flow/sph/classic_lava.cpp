#include "flow/sph/classic_lava.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::sph {

namespace {
constexpr int kSortInterval = 16;    // steps between two orderings of the particles in memory, and looks for what left
constexpr int kMaxRetries = 8;
constexpr Real kSmallestStep = 1e-6; // of the step at rest
constexpr Real kTorn = 0.9;          // of the rest density: no density falls below
constexpr Real kScatter = 0.15;      // of the rest density: summed over 26 disordered neighbours instead of a lattice's
constexpr Real kClearance = 0.25;    // a particle stays this many spacings off the ground
constexpr std::string_view kModel = "classic 1";  // of a checkpoint: changes with what is saved

/// Calls f with the kernel that kind names.
template <class F>
auto with_kernel(KernelKind kind, Real support, F&& f) {
  switch (kind) {
    case KernelKind::kCubicSpline: return f(CubicSpline(support));
    case KernelKind::kWendlandC2: return f(WendlandC2(support));
    default: return f(SpikyKernel(support));
  }
}

/// Thrown by a stage of a scheme that is not fit to ask for rates: the step is given up.
struct BadStage {};
}  // namespace

Real ExponentialViscosity::a() const { return std::log(cold_nu / hot_nu) / (hot_temperature - cold_temperature); }
Real ExponentialViscosity::b() const { return hot_nu * std::exp(a() * hot_temperature); }
// Written about the hot point: exp(a T) alone overflows for steep laws. Never 0: two such have no harmonic mean.
Real ExponentialViscosity::at(Real temperature) const {
  return std::max(std::numeric_limits<Real>::min(), std::min(max, hot_nu * std::exp(a() * (hot_temperature - temperature))));
}

Real ClassicOptions::heat_step() const {
  const Real m2 = with_kernel(kernel, support * spacing, [](const auto& W) { return W.second_moment(); });
  const Real loss = (air_exchange + ground_exchange) / (density * heat_capacity * spacing);  // [1/s], of a particle at rest density
  return std::min(0.35 * m2 / diffusivity, 0.5 / loss);
}

Real ClassicOptions::rest_step() const {
  const Real m2 = with_kernel(kernel, support * spacing, [](const auto& W) { return W.second_moment(); });
  return std::min({max_step, courant * support * spacing / 2 / std::sqrt(stiffness), 0.35 * m2 / viscosity.max, heat_step()});
}

void add_scaled_velocities(LavaState& y, Real a, const LavaState& k) {
  parallel_for(y.size(), [&](std::size_t i) {
    y.v[i] += a * k.v[i];
    y.T[i] += a * k.T[i];
  }, 4096);
}

void add_scaled_positions(LavaState& y, Real a, const LavaState& k) {
  parallel_for(y.size(), [&](std::size_t i) {
    y.x[i] += a * k.x[i];
    y.rho[i] += a * k.rho[i];
  }, 4096);
}

struct ClassicLava::System {
  ClassicLava& lava;
  void rates(Real, const LavaState& y, LavaState& k) { lava.compute_rates(y, k, true, true); }
  void velocity_rates(Real, const LavaState& y, LavaState& k) { lava.compute_rates(y, k, true, false); }
  void position_rates(Real, const LavaState& y, LavaState& k) { lava.compute_rates(y, k, false, true); }
};

ClassicLava::ClassicLava(const ClassicOptions& options, std::vector<Vent> vents, std::vector<ContactSource> ground, std::function<bool(const Vec3&)> inside)
    : options_(options),
      mass_(options.density * std::pow(options.spacing, 3)),
      support_(options.support * options.spacing),
      half_space_(with_kernel(options.kernel, support_, [](const auto& kernel) { return HalfSpaceTable(kernel); })),
      density_kernel_(support_),
      density_half_space_(density_kernel_),
      ground_({support_, support_, kClearance * options.spacing, 1}, std::move(ground), std::move(inside)),
      emitter_(std::move(vents), options.spacing, options.seed, ground_.sources()),
      frames_(options.rest_period) {
  CHECK_GT(options.spacing, 0.0);
  CHECK_GE(options.support, 1.5);
  CHECK_GT(options.density, 0.0);
  CHECK_GT(options.stiffness, 0.0);
  CHECK_GT(options.heat_capacity, 0.0);
  CHECK_GT(options.courant, 0.0);
  CHECK_GT(options.max_step, 0.0);
  CHECK_GE(options.surface_interval, 1);
}

void ClassicLava::born(const Vec3& x, const Vec3& v, Real temperature) {
  y_.x.push_back(x);
  y_.v.push_back(v);
  y_.rho.push_back(options_.density);
  y_.T.push_back(temperature);
  census_.born(time_);
  surface_.push_back(1);
  outward_.push_back(Vec3::Zero());
  ground_.born();
}

void ClassicLava::add(std::span<const Vec3> x, std::span<const Vec3> v, std::span<const Real> temperature) {
  CHECK_EQ(v.size(), x.size());
  CHECK_EQ(temperature.size(), x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    CHECK(x[i].allFinite() && v[i].allFinite() && std::isfinite(temperature[i]));
    born(x[i], v[i], temperature[i]);
    emitter_.add_free();
    frames_.born(x[i], x[i]);
  }
}

std::size_t ClassicLava::emit(Real t0, Real t1) {
  const std::span<const Emitter::Newborn> newborn = emitter_.emit(t0, t1);
  for (const Emitter::Newborn& p : newborn) {
    born(p.x, p.v, p.temperature);
    // What comes out of a vent was, when the material coordinates were born, that far down the conduit.
    frames_.born(p.x - emitter_.rise(p.site, frames_.rest_born(), t1), p.x - emitter_.rise(p.site, frames_.rest2_born(), t1));
  }
  return newborn.size();
}

void ClassicLava::keep(std::span<const Index> which) {
  gather(y_.x, which);
  gather(y_.v, which);
  gather(y_.rho, which);
  gather(y_.T, which);
  census_.keep(which);
  emitter_.keep(which);
  frames_.keep(which);
  gather(surface_, which);
  gather(outward_, which);
  ground_.keep(which);
}

void ClassicLava::sort_particles() {
  ZONE("sph.sort");
  grid_.build(y_.x, support_);
  keep(grid_.order());
}

void ClassicLava::find_neighbors(std::span<const Vec3> x) {
  grid_.build(x, support_);
  neighbors_.find(grid_, support_);
  neighbors_of_ = x.data();
}

void ClassicLava::compute_rates(const LavaState& y, LavaState& k, bool velocities, bool positions) {
  if (&y != &y_ && !acceptable(y)) throw BadStage();
  if (neighbors_of_ != y.x.data()) find_neighbors(y.x);
  // A kick leaves the positions, and so the lists, as they are; anything else moves them.
  if (positions) neighbors_of_ = nullptr;
  with_kernel(options_.kernel, support_, [&](const auto& kernel) {
    if (velocities && positions) return accumulate<true, true>(kernel, y, k);
    if (velocities) return accumulate<true, false>(kernel, y, k);
    return accumulate<false, true>(kernel, y, k);
  });
  COUNT("sph.rate evaluations", velocities ? y.size() : 0);
}

template <bool kVelocities, bool kPositions, class Kernel>
void ClassicLava::accumulate(const Kernel& kernel, const LavaState& y, LavaState& k) {
  ZONE(kVelocities ? "sph.forces" : "sph.density");
  const std::size_t n = y.size();
  const Real m = mass_, rho0 = options_.density, stiffness = options_.stiffness;
  const Real mean_to_laplacian = 2 / kernel.second_moment();
  const Real kappa = options_.diffusivity * mean_to_laplacian;
  const Real sound = std::sqrt(stiffness);
  const Real diffuse_per_mass = options_.density_diffusion * support_ * sound;
  const Real relax = options_.density_relaxation * sound / options_.spacing;
  const Real exchange = rho0 / (m * options_.heat_capacity);
  k.x.resize(n);
  k.v.resize(n);
  k.rho.resize(n);
  k.T.resize(n);
  packed_.resize(n);

  // What neighbours ask of a particle, side by side in memory: one or two cache lines a neighbour.
  parallel_for(n, [&](std::size_t i) {
    const Real pressure = stiffness * (y.rho[i] - rho0);
    const Real felt = pressure < 0 ? options_.cohesion * pressure : pressure;
    packed_[i] = {y.x[i], felt / (y.rho[i] * y.rho[i]), y.v[i], kVelocities ? options_.viscosity.at(y.T[i]) : 0, y.T[i], y.rho[i]};
  }, 2048);

  parallel_for(n, [&](std::size_t i) {
    const Packed& a = packed_[i];
    Vec3 force = Vec3::Zero(), drag = Vec3::Zero();
    Real drho = 0, dT = 0, summed = density_kernel_.W(0);
    for (const Index j : neighbors_[i]) {
      const Packed& b = packed_[j];
      const Vec3 d = a.x - b.x;
      const Real r = d.norm();
      // Two particles at one place have no direction to push in; a vent never makes such a pair.
      const Real slope = r > 0 ? kernel.dW(r) / r : 0;  // grad W = slope d
      const Vec3 dv = b.v - a.v;
      if constexpr (kPositions) {
        summed += density_kernel_.W(r);
        drho -= slope * (dv.dot(d) + diffuse_per_mass * (b.rho - a.rho) / b.rho);
      }
      if constexpr (kVelocities) {
        force -= (a.p_over_rho2 + b.p_over_rho2) * slope * d;
        const Real w = kernel.W(r) * 2 / (a.rho + b.rho);
        drag += 2 * a.nu * b.nu / (a.nu + b.nu) * w * dv;
        dT += w * (b.T - a.T);
      }
    }
    Vec3 acceleration = m * force + (mean_to_laplacian * m) * drag + options_.gravity;
    drho *= m;
    dT *= kappa * m;
    summed *= m;

    Vec3 ground_normal = Vec3::Zero();  // of ground that it lies on
    const Real r2_over_rho = kVelocities && surface_[i] ? std::pow(m / a.rho, 2.0 / 3.0) / a.rho : 0;  // 0: exchanges nothing
    const bool held = emitter_.held(i);
    if (!held) {  // under a vent there is no floor
      ground_.for_each_contact(i, a.x, [&](const geometry::Contact& c, Real d) {
        const Vec3& normal = c.normal;
        const Real area = half_space_.slope(d);  // < 0
        const Vec3 dv = c.surface_velocity - a.v;
        acceleration -= 2 * rho0 * std::max(a.p_over_rho2, 0.0) * area * normal;
        acceleration += (mean_to_laplacian * options_.ground_friction * a.nu * half_space_.gamma(d)) * dv;
        drho -= 2 * rho0 * area * dv.dot(normal);
        summed += rho0 * density_half_space_.gamma(d);
        if (d < options_.spacing) {
          ground_normal = normal;
          const Real T_ground = c.surface_temperature > 0 ? c.surface_temperature : options_.ground_temperature;
          dT -= options_.ground_exchange * exchange * r2_over_rho * (a.T - T_ground);
        }
      });
    }
    if (surface_[i]) {
      // To the air goes what does not lie on the ground; a sheet one particle thick has both sides.
      const bool covered = outward_[i].dot(ground_normal) < -0.3;
      if (!covered) dT -= options_.air_exchange * exchange * r2_over_rho * (a.T - options_.air_temperature);
    }
    // Drift is pulled back to what the sum allows: to within the scatter that disorder gives it, and on
    // the surface, where it lacks what is not there, not above rest density, no pressure.
    const Real low = summed - kScatter * rho0, high = surface_[i] ? std::max(summed, rho0) : summed + kScatter * rho0;
    drho += relax * (std::max(low - a.rho, 0.0) - std::max(a.rho - high, 0.0));
    // Lava tears rather than thins.
    if (a.rho < kTorn * rho0) drho = std::max(drho, 0.0);

    if constexpr (kPositions) {
      k.x[i] = a.v;
      k.rho[i] = drho;
    }
    if constexpr (kVelocities) {
      k.v[i] = held ? Vec3(Vec3::Zero()) : acceleration;
      k.T[i] = held ? 0 : dT;
    }
  }, 256);
}

const LavaState& ClassicLava::rates() {
  find_neighbors(y_.x);
  find_surface(y_.x, neighbors_, support_, options_.surface, surface_, outward_);
  ground_.find(y_.x);
  compute_rates(y_, storage_.k1, true, true);
  return storage_.k1;
}

Real ClassicLava::stable_step() const {
  const Real speed = std::sqrt(parallel_max(size(), 0, [&](std::size_t i) { return y_.v[i].squaredNorm(); }));
  const Real coldest = -parallel_max(size(), -1e6, [&](std::size_t i) { return -y_.T[i]; });
  const Real m2 = with_kernel(options_.kernel, support_, [](const auto& kernel) { return kernel.second_moment(); });
  Real dt = std::min({options_.max_step, options_.heat_step(), options_.courant * support_ / 2 / (std::sqrt(options_.stiffness) + speed)});
  if (size() > 0) dt = std::min(dt, 0.35 * m2 / options_.viscosity.at(coldest));
  if (max_acceleration_ > 0) dt = std::min(dt, 0.4 * std::sqrt(options_.spacing / max_acceleration_));
  return dt;
}

bool ClassicLava::try_step(Real dt) {
  try {
    integrate_step(options_.scheme, System{*this}, time_, dt, y_, storage_);
  } catch (const BadStage&) {
    return false;
  }
  return acceptable(y_);
}

bool ClassicLava::acceptable(const LavaState& y) const {
  const Real limit = options_.spacing / 2;
  const Real worst = parallel_max(size(), 0, [&](std::size_t i) {
    const bool good = y.v[i].allFinite() && std::isfinite(y.T[i]) && y.rho[i] > 0.1 * options_.density && y.rho[i] < 10 * options_.density &&
                      (y.x[i] - before_.x[i]).squaredNorm() < limit * limit;
    return good ? 0.0 : 1.0;
  });
  return worst == 0;
}

std::size_t ClassicLava::drop_what_left() {
  if (!ground_.has_edge()) return 0;
  const std::vector<Index> stay = ground_.who_stays(y_.x, surface_, options_.spacing);
  const std::size_t gone = size() - stay.size();
  if (gone > 0) keep(stay);
  census_.count_left(gone);
  return gone;
}

StepReport ClassicLava::step(Real dt_max) {
  ZONE("sph.step");
  CHECK_GT(dt_max, 0.0);
  StepReport report;
  neighbors_of_ = nullptr;
  if (steps_ % kSortInterval == 0) {
    report.left = drop_what_left();
    sort_particles();
  }
  Real dt = std::min(dt_max, stable_step());
  if (dt_max - dt < 1e-6 * dt) dt = dt_max;  // no crumb of a step is left over
  if (dt < dt_max && dt < kSmallestStep * options_.rest_step())
    throw UnstableError(fmt::format("at t = {:.6g} s speed or acceleration leave a step of {:.3g} s only ({} particles)", time_, dt, size()));

  if (steps_ % static_cast<std::uint64_t>(options_.surface_interval) == 0 && size() > 0) {
    find_neighbors(y_.x);
    find_surface(y_.x, neighbors_, support_, options_.surface, surface_, outward_);
  }
  ground_.find(y_.x);
  emitter_.carry(time_, dt, y_.v);
  before_ = y_;
  for (;; ++report.retries, dt /= 2) {
    if (try_step(dt)) break;
    y_ = before_;
    neighbors_of_ = nullptr;
    if (report.retries == kMaxRetries)
      throw UnstableError(fmt::format("the step at t = {:.6g} s stayed unstable down to dt = {:.3g} s ({} particles, stiffness {} m2/s2)", time_, dt, size(),
                                      options_.stiffness));
  }
  max_acceleration_ = std::sqrt(parallel_max(size(), 0, [&](std::size_t i) { return ((y_.v[i] - before_.v[i]) / dt).squaredNorm(); }));
  const Real from = time_;
  time_ += dt;
  ++steps_;
  ground_.moved(before_.x, y_.x);
  ground_.project(y_.x, y_.v, [&](std::size_t i) { return !emitter_.held(i); });
  report.emitted = emit(from, time_);
  frames_.renew(time_, y_.x);

  report.dt = dt;
  report.neighbor_pairs = neighbors_.pairs();
  report.max_speed = std::sqrt(parallel_max(size(), 0, [&](std::size_t i) { return y_.v[i].squaredNorm(); }));
  report.max_compression = parallel_max(size(), 0, [&](std::size_t i) { return y_.rho[i] / options_.density - 1; });
  report.max_temperature = parallel_max(size(), 0, [&](std::size_t i) { return y_.T[i]; });
  report.min_temperature = -parallel_max(size(), -1e6, [&](std::size_t i) { return -y_.T[i]; });
  COUNT("sph.steps", 1);
  return report;
}

geometry::Points ClassicLava::points() const {
  const std::size_t n = size();
  radius_.assign(n, options_.spacing / 2);
  crust_.resize(n);
  age_.resize(n);
  const ExponentialViscosity& law = options_.viscosity;
  for (std::size_t i = 0; i < n; ++i) {
    crust_[i] = std::clamp((law.hot_temperature - y_.T[i]) / (law.hot_temperature - law.cold_temperature), 0.0, 1.0);
    age_[i] = time_ - census_.births()[i];
  }
  geometry::Points points;
  points.position = y_.x;
  points.radius = radius_;
  points.velocity = y_.v;
  points.temperature = y_.T;
  points.crust = crust_;
  points.age = age_;
  points.id = census_.ids();
  points.surface = surface_;
  points.rest = frames_.rest();
  points.rest2 = frames_.rest2();
  points.rest_ratio = frames_.ratio(time_);
  return points;
}

std::size_t ClassicLava::memory() const {
  const auto bytes = [](const auto&... vectors) { return ((vectors.capacity() * sizeof(vectors[0])) + ...); };
  const auto of_state = [&](const LavaState& y) { return bytes(y.x, y.v, y.rho, y.T); };
  return of_state(y_) + of_state(before_) + of_state(storage_.stage) + of_state(storage_.k1) + of_state(storage_.k2) + of_state(storage_.k3) + of_state(storage_.k4) +
         bytes(surface_, outward_, packed_, radius_, crust_, age_) + census_.memory() + emitter_.memory() + frames_.memory() + ground_.memory() + grid_.memory() +
         neighbors_.memory();
}

template <class Self, class Archive>
void ClassicLava::archive(Self& self, Archive& io) {
  io.array("x", self.y_.x);
  io.array("v", self.y_.v);
  io.array("rho", self.y_.rho);
  io.array("T", self.y_.T);
  Census::arrays(self.census_, io);
  Emitter::arrays(self.emitter_, io);
  MaterialFrames::arrays(self.frames_, io);
  io.array("surface", self.surface_);
  io.array("outward", self.outward_);
  Ground::arrays(self.ground_, io);
  io.value("time", self.time_);
  MaterialFrames::values(self.frames_, io);
  Census::values(self.census_, io);
  io.value("steps", self.steps_);
  io.value("max_acceleration", self.max_acceleration_);
}

void ClassicLava::add_to(StateHash& hash) const {
  HashArchive io{hash};
  archive(*this, io);
}

void ClassicLava::save(StateWriter& out) const {
  out.text("model", kModel);
  archive(*this, out);
}

void ClassicLava::load(StateReader& in) {
  StateWriter before;
  save(before);
  try {
    load_unsafely(in);
  } catch (...) {
    StateReader back(before.bytes(), "");
    load_unsafely(back);
    throw;
  }
}

void ClassicLava::load_unsafely(StateReader& in) {
  std::string model;
  in.text("model", model);
  if (model != kModel) throw InputError(Place{}, fmt::format("the checkpoint holds a '{:.40}' lava, wanted '{}'", model, kModel));
  archive(*this, in);
  const std::size_t n = y_.size();
  check_loaded_sizes(n, {y_.v.size(), y_.rho.size(), y_.T.size(), surface_.size(), outward_.size()});
  census_.check_loaded(n);
  emitter_.check_loaded(n);
  frames_.check_loaded(n);
  ground_.check_loaded(n);
}

}  // namespace effuse::flow::sph
