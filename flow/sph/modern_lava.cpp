#include "flow/sph/modern_lava.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "flow/sph/awake.h"
#include "flow/sph/density.h"
#include "flow/sph/emitter.h"
#include "flow/sph/even_out.h"
#include "flow/sph/material_frame.h"
#include "flow/sph/pair_kernels.h"
#include "flow/sph/particle_system.h"
#include "flow/sph/pressure.h"
#include "flow/sph/viscosity.h"
#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/unstable_at.h"
#include "geometry/base/zones.h"

namespace effuse::flow::sph {

namespace {
constexpr int kSortInterval = 16;    // steps between two orderings of the particles in memory, and looks for what left
constexpr int kMaxRetries = 8;
constexpr Real kClearance = 0.25;    // a particle stays this many spacings off the ground
constexpr Real kLook = 1.5;          // supports: ground this far off is not looked for again until a particle may be near it
constexpr Real kTakeBack = 0.2;      // share of a density that is too large that one step takes back
constexpr Real kFarthestShift = 0.1;  // spacings, a step
constexpr Real kEnough = 0.3;        // of what is to be taken back may be left
constexpr Real kFillUp = 0.2;        // share of a density that is too low that compression may make up in one step
constexpr Real kFailed = 10;          // times its tolerance: a solve that stays above has failed
constexpr Real kSteep = 0.5;          // how far the shear rate at a wall lies from the mean over the support to the wall's own; 0.35: thin films hold on too hard, 1: too little
constexpr Real kTight = 0.25;          // times dt sqrt(g / dx): share of the divergence tolerance that some iterations are spent on
constexpr Real kCrammed = 0.5;        // too much of its density
constexpr Real kSlow = 0.5;           // sqrt(g dx): slower lava all but stands
constexpr Real kWake = 2;            // times sleep_speed
constexpr int kNap = 16;             // steps of max_step that sleepers' heat takes at a time while nobody is awake
constexpr int kSettle = 3;           // rounds between ground and obstacles, at most
constexpr std::string_view kModel = "modern 5";  // of a checkpoint: changes with what is saved

BoundaryTable make_table(KernelKind kind, Real support, Real spacing) {
  switch (kind) {
    case KernelKind::kCubicSpline: return {CubicSpline(support), spacing};
    case KernelKind::kSpiky: return {SpikyKernel(support), spacing};
    default: return {WendlandC2(support), spacing};
  }
}

Real rms(std::span<const Real> values) {
  if (values.empty()) return 0;
  return std::sqrt(parallel_sum(values.size(), 0.0, [&](std::size_t i) { return values[i] * values[i]; }) / static_cast<Real>(values.size()));
}

Real largest_norm(std::span<const Vec3> a) {
  return std::sqrt(parallel_max(a.size(), 0, [&](std::size_t i) { return a[i].squaredNorm(); }));
}
}  // namespace

struct ModernLava::Impl {
  ModernOptions o;
  Real support, volume, mass, lattice;
  BoundaryTable table;
  FilmFriction film;

  // The state, all of it saved. By particle:
  std::vector<Vec3> x, v;
  std::vector<Real> q;                  // p / rho [m^2/s^2]
  std::vector<Real> mu, density;        // of the last step
  std::vector<Real> exposed, grounded;  // [m^2]
  std::vector<Real> ground_T;           // of the ground it lies on [K]
  std::vector<Real> ground_b;           // its effusivity; 0: the ground's own
  std::vector<Index> touches;           // its surface
  std::vector<Real> slow;               // [s] for how long it has been slow
  std::vector<std::uint8_t> surface, asleep;
  Census census;
  MaterialFrames frames;
  Ground ground;
  Solids solids;
  Emitter emitter;
  Heat heat;
  Real time = 0, acceleration = 0;      // largest, of the last step
  Real rested = 0;                      // [s] that heat lies behind; 0 while anybody is awake
  std::uint64_t taken = 0;              // particles
  Real left_enthalpy = 0;               // [J] of all that left
  // Not in a report yet: what add() had heat catch up on, and those that left before a step that failed.
  HeatBudget owed;
  Real reported_enthalpy = 0;
  std::uint64_t reported_left = 0;
  std::uint64_t steps = 0;
  Real solid_speed = 0;                 // of the obstacles' surfaces beside lava, in the last step [m/s]

  // Of the step: the particles it looks at, by place in `set`.
  AwakeSet set;
  ColumnGrid grid;
  Neighbors neighbors;
  Walls walls;
  FlowShape shape;
  PairKernels pairs;
  std::vector<Vec3> lx, lv, start, predicted, viscous_v;
  std::vector<Real> lq, lmu, rate, least, scratch, wall_distances;
  std::vector<std::uint8_t> fixed;
  ViscositySolver viscosity;
  PressureSolver pressure;
  std::vector<Vec3> before_x;
  WaterSource water;
  std::vector<std::uint8_t> wet;
  // What points() shows.
  mutable std::vector<Real> radius, crust, age, p;

  Impl(const ModernOptions& options, std::vector<Vent> vents, std::vector<ContactSource> sources, std::function<bool(const Vec3&)> inside, const SolidOptions& solid_options)
      : o(options),
        support(o.support * o.spacing),
        volume(std::pow(o.spacing, 3)),
        mass(volume * o.density),
        lattice(lattice_sum(o.kernel, support, o.spacing)),
        table(make_table(o.kernel, support, o.spacing)),
        film(table, o.spacing),
        frames(o.rest_period),
        ground({support, std::isfinite(o.ground_speed) ? kLook * support : support, kClearance * o.spacing, 8}, std::move(sources), std::move(inside)),
        solids(solid_options, kClearance * o.spacing, mass, film.widest()),
        emitter(std::move(vents), o.spacing, o.seed, ground.sources()),
        heat(o.heat, o.spacing, o.density) {
    CHECK_GT(o.spacing, 0.0);
    CHECK_GE(o.support, 1.5);
    CHECK_GT(o.density, 0.0);
    CHECK_GT(o.courant, 0.0);
    CHECK_GT(o.max_step, 0.0);
    CHECK_LE(o.min_step, o.max_step);
    CHECK_GE(o.ground_speed, 0.0);
    CHECK_GE(o.coupling, 1);
    CHECK(o.slip_length >= 0);
    for (const int axis : {0, 1}) CHECK(o.period[axis] == 0 || o.period[axis] >= 2 * support);
    CHECK(o.period.isZero() || o.sleep_speed == 0);
    o.rheology.check();
  }

  std::size_t size() const { return x.size(); }

  void born(const Vec3& at, const Vec3& velocity, Real temperature) {
    x.push_back(at);
    v.push_back(velocity);
    q.push_back(0);
    mu.push_back(o.rheology.viscosity(temperature, 0));
    density.push_back(1);
    exposed.push_back(0);
    grounded.push_back(0);
    ground_T.push_back(o.ground_temperature);
    ground_b.push_back(0);
    touches.push_back(0);
    slow.push_back(0);
    surface.push_back(1);
    asleep.push_back(0);
    census.born(time);
    ground.born();
    heat.born(temperature);
  }

  void keep(std::span<const Index> which) {
    gather(x, which);
    gather(v, which);
    gather(q, which);
    gather(mu, which);
    gather(density, which);
    gather(exposed, which);
    gather(grounded, which);
    gather(ground_T, which);
    gather(ground_b, which);
    gather(touches, which);
    gather(slow, which);
    gather(surface, which);
    gather(asleep, which);
    census.keep(which);
    frames.keep(which);
    ground.keep(which);
    emitter.keep(which);
    heat.keep(which);
  }

  template <class Self, class Archive>
  static void archive(Self& self, Archive& io) {
    io.array("x", self.x);
    io.array("v", self.v);
    io.array("q", self.q);
    io.array("mu", self.mu);
    io.array("density", self.density);
    io.array("exposed", self.exposed);
    io.array("grounded", self.grounded);
    io.array("ground_T", self.ground_T);
    io.array("ground_b", self.ground_b);
    io.array("touches", self.touches);
    io.array("slow", self.slow);
    io.array("surface", self.surface);
    io.array("asleep", self.asleep);
    Census::arrays(self.census, io);
    MaterialFrames::arrays(self.frames, io);
    Ground::arrays(self.ground, io);
    Emitter::arrays(self.emitter, io);
    MaterialFrames::values(self.frames, io);
    Census::values(self.census, io);
    io.value("time", self.time);
    io.value("acceleration", self.acceleration);
    io.value("rested", self.rested);
    io.value("taken", self.taken);
    io.value("left_enthalpy", self.left_enthalpy);
    io.value("owed_quenched", self.owed.quenched);
    io.value("owed_radiated", self.owed.radiated);
    io.value("owed_convected", self.owed.convected);
    io.value("owed_ground", self.owed.ground);
    io.value("owed_dissipated", self.owed.dissipated);
    io.value("reported_enthalpy", self.reported_enthalpy);
    io.value("reported_left", self.reported_left);
    io.value("steps", self.steps);
    io.value("solid_speed", self.solid_speed);
  }

  ParticleSystem system() {
    ParticleSystem s;
    s.x = lx;
    s.neighbors = &neighbors;
    s.walls = &walls;
    s.boundary = &table;
    s.kernel = o.kernel;
    s.support = support;
    s.spacing = o.spacing;
    s.period = o.period;
    s.fixed = fixed;
    s.pairs = &pairs;
    s.movable = solids.movable();
    s.pressed = solids.pressed();
    s.density = o.density;
    return s;
  }

  void drop_what_left() {
    if (!ground.has_edge()) return;
    const std::vector<Index> stay = ground.who_stays(x, surface, o.spacing);
    const std::size_t gone = size() - stay.size();
    if (gone == 0) return;
    // Their own enthalpies, not a difference of totals: it is compared with one.
    std::size_t next = 0;
    for (std::size_t i = 0; i < size(); ++i) {
      if (next < stay.size() && stay[next] == i) ++next;
      else left_enthalpy += mass * heat.enthalpy()[i];
    }
    keep(stay);
    census.count_left(gone);
  }

  void sort_particles() {
    ZONE("sph.sort");
    grid.build(x, support);
    keep(grid.order());
  }

  /// Lists of all particles at `at`, of the nearest images where the flow is periodic.
  void find_neighbors(std::span<const Vec3> at, Neighbors& found) {
    if (o.period.isZero()) {
      grid.build(at, support);
      found.find(grid, support);
      return;
    }
    std::vector<Vec3> extended(at.begin(), at.end());
    std::vector<Index> image;
    for (const int axis : {0, 1}) {
      const Real length = o.period[axis];
      if (length <= 0) continue;
      const std::size_t now = extended.size();
      for (std::size_t i = 0; i < now; ++i) {
        for (const Real by : {length, -length}) {
          Vec3 y = extended[i];
          y[axis] += by;
          if (y[axis] <= -support || y[axis] >= length + support) continue;
          extended.push_back(y);
          image.push_back(i < at.size() ? static_cast<Index>(i) : image[i - at.size()]);
        }
      }
    }
    grid.build(extended, support);
    found.find(grid, support);
    found.fold(at.size(), image);
  }

  /// The walls of the set's particles.
  void find_walls() {
    const auto& particles = set.particles;
    if (particles.size() == size()) {
      ground.find(x, [&](std::size_t i) { return !emitter.held(i); });
    } else {
      std::vector<std::uint8_t> wanted(size());
      for (const Index i : particles) wanted[i] = !emitter.held(i);
      ground.find(x, [&](std::size_t i) { return wanted[i] != 0; });
    }
    walls.first.assign(particles.size() + 1, 0);
    walls.walls.clear();
    for (std::size_t k = 0; k < particles.size(); ++k) {
      ground.for_each_contact(particles[k], x[particles[k]], [&](const geometry::Contact& c, Real d) {
        walls.walls.push_back({.normal = c.normal, .distance = d, .reach = d, .surface = c.surface, .velocity = c.surface_velocity, .temperature = c.surface_temperature});
      });
      walls.first[k + 1] = static_cast<Index>(walls.walls.size());
    }
    solids.add_walls(lx, support, walls);
    if (o.period.isZero()) solids.part(lx, walls, neighbors);
  }

  /// Ends the step, for good: "...; particle 17 at (1, 2, 3) has a velocity that is no number": the first whose state went bad, or the
  /// fastest of the last try.
  [[noreturn]] void give_up(const std::string& message, Real dt) const {
    std::size_t worst = 0;
    Real most = -1;
    for (std::size_t k = 0; k < set.awake; ++k) {
      const Index i = set.particles[k];
      const char* bad = !x[i].allFinite() ? "position" : !start[k].allFinite() ? "velocity" : !std::isfinite(q[i]) ? "pressure" : !std::isfinite(mu[i]) ? "viscosity" : nullptr;
      if (bad) throw UnstableAt(message + fmt::format("; particle {} at ({:.6g}, {:.6g}, {:.6g}) has a {} that is no number", census.ids()[i], x[i].x(), x[i].y(), x[i].z(), bad), x[i]);
      const Real path = (dt * lv[k]).norm();
      if (path > most) most = path, worst = k;
    }
    if (most < 0) throw UnstableError(message);
    const Index i = set.particles[worst];
    throw UnstableAt(message + fmt::format("; particle {} at ({:.6g}, {:.6g}, {:.6g}) would go {:.3g} spacings", census.ids()[i], x[i].x(), x[i].y(), x[i].z(), most / o.spacing), x[i]);
  }

  /// Everything that depends on positions alone.
  void look_around() {
    if (set.particles.empty()) return;
    find_neighbors(lx, neighbors);
    find_walls();
    const ParticleSystem s = system();
    pairs.build(s);
    bend_walls(s, walls, wall_distances);
    if (solids.any()) trim_walls(table, walls);
    find_shape(s, lattice, film, walls, shape);
    pressure.prepare(s);
    const std::size_t moving = set.awake + set.drowsy;
    parallel_for(moving, [&](std::size_t k) {
      const Index i = set.particles[k];
      density[i] = shape.density[k];
      surface[i] = shape.surface[k];
      exposed[i] = emitter.held(i) ? 0 : shape.exposed[k];
      grounded[i] = shape.grounded[k];
      Real nearest = support;
      for (const Wall& wall : walls[k]) {
        if (wall.reach >= nearest) continue;
        nearest = wall.reach;
        ground_T[i] = wall.temperature > 0 ? wall.temperature : o.ground_temperature;
        ground_b[i] = wall.effusivity;
        touches[i] = wall.surface;
      }
    }, 2048);
  }

  /// Apparent viscosities of the set's particles, from the velocities the step starts with.
  void find_viscosities() {
    const std::size_t m = set.particles.size();
    lmu.resize(m);
    scratch.assign(m, 0.0);
    const bool crusted = o.heat.on && o.crust_viscosity > 0;
    const ParticleSystem particles = system();
    if (o.rheology.needs_strain_rate() || crusted) shear_rate_squared(system(), o.slip_length, lv, scratch);
    const std::span<const Real> T = heat.temperature(), crust_share = heat.crust_share();
    parallel_for(m, [&](std::size_t k) {
      const Index i = set.particles[k];
      const Real shear = std::sqrt(scratch[k]);
      Real mu_k = o.rheology.viscosity(T[i], shear);
      if (crusted && crust_share[i] > 0) {
        // The crust's share of the particle: viscous up to its strength.
        const Real stiff = o.crust_strength > 0 && shear * o.crust_viscosity > o.crust_strength ? o.crust_strength / shear : o.crust_viscosity;
        mu_k += crust_share[i] * stiff;
      }
      lmu[k] = mu_k;
      mu[i] = mu_k;
      // On a wall shear is what the particle's own speed makes of its distance: a mean over the support says too little of it,
      // and lava would hold on to the ground by more than its strength.
      if (!o.rheology.needs_strain_rate()) return;
      for (Index w = walls.first[k]; w < walls.first[k + 1]; ++w) {
        Wall& wall = walls.walls[w];
        const Vec3 slip = lv[k] - particles.velocity_of(wall);
        const Real along = (slip - slip.dot(wall.normal) * wall.normal).norm();
        const Real steep = along / (std::max(wall.distance, kClearance * o.spacing) + o.slip_length);
        if (steep > shear) wall.friction *= (mu_k - o.rheology.viscosity(T[i], shear) + o.rheology.viscosity(T[i], (1 - kSteep) * shear + kSteep * steep)) / mu_k;
      }
    }, 1024);
  }

  /// The implicit step of velocities, pressures and positions of the set, from `start` and q. False: give it up.
  bool try_step(Real dt, ModernReport& report) {
    const std::size_t m = set.particles.size();
    const ParticleSystem s = system();
    rate.resize(m);
    least.assign(m, 0.0);
    predicted.resize(m);
    lv = start;
    solids.begin_try();
    parallel_for(m, [&](std::size_t k) {
      lq[k] = std::max(q[set.particles[k]], 0.0);
      rate[k] = k < set.awake ? std::max(1 - shape.density[k], 0.0) * kFillUp / dt : 0;  // a sleeper keeps its gaps
    }, 2048);
    report.pressure_iterations = report.viscosity_iterations = report.density_iterations = 0;
    const Real g = o.gravity.norm(), scale = g > 0 ? dt * g : std::numeric_limits<Real>::infinity();
    const Real tight = std::min(1.0, kTight * dt * std::sqrt(g / o.spacing)) * o.divergence_tolerance;
    for (int round = 0; round < o.coupling; ++round) {
      solids.restart(dt);
      pressure_acceleration(s, lq, predicted);
      even_pressure(s, shape.off, lq, predicted);
      push_movables(s, lq, predicted, dt);
      parallel_for(m, [&](std::size_t k) { predicted[k] = s.is_fixed(k) ? start[k] : Vec3(start[k] + dt * (predicted[k] + o.gravity)); }, 2048);
      const ViscosityResult viscous = !o.guards.implicit_viscosity ? explicit_viscosity(s, dt) : viscosity.solve(s, o.density, lmu, o.slip_length, dt, predicted, o.viscosity_tolerance, o.max_iterations, lv, scale);
      if (o.heat.on && o.heat.viscous_heating) viscous_v = lv;
      report.viscosity_iterations += viscous.iterations;
      report.viscosity_residual = viscous.residual;
      if (!(viscous.residual < kFailed * o.viscosity_tolerance) && o.guards.step_limit) return false;
      const PressureResult pressed = pressure.solve_prepared(s, rate, least, dt, o.divergence_tolerance, o.max_iterations, lv, lq, g > 0 ? tight : o.divergence_tolerance);
      // Lava pressed between what is fixed (a vent's, sleepers) cannot give way in any step: told, not tried again.
      report.solved = viscous.converged && pressed.converged;
      report.pressure_iterations += pressed.iterations;
      report.divergence_error = pressed.error;
    }
    // Where density is too large, out of it; nothing else may be compressed by that.
    std::vector<Vec3>& shift = predicted;
    shift.assign(m, Vec3::Zero());
    if (report.density_error > o.density_tolerance && o.guards.make_room) {
      parallel_for(m, [&](std::size_t k) {
        const Real excess = shape.density[k] - 1;
        rate[k] = excess > 0 ? -kTakeBack * excess : -0.5 * excess;
        // What stands still or sleeps asks for no room: a neighbour barely in reach would have to go far to give it.
        if (s.is_fixed(k) || k >= set.awake) rate[k] = std::max(rate[k], 0.0);
      }, 2048);
      // A share is taken back each step: it need not be exact.
      const Real enough = std::max(o.density_tolerance, kEnough * kTakeBack * report.density_error);
      report.density_iterations = pressure.displace(s, rate, enough, o.density_iterations, shift).iterations;
      // A particle with hardly any neighbours would have to go far to make room: it need not, it has the next steps.
      const Real farthest = kFarthestShift * o.spacing;
      parallel_for(m, [&](std::size_t k) {
        const Real far = shift[k].norm();
        if (far > farthest) shift[k] *= farthest / far;
      }, 2048);
    }
    even_out(s, shape.off, lv, dt, shift);
    const Real limit = o.spacing / 2;
    return !o.guards.step_limit || parallel_max(m, 0, [&](std::size_t k) {
             const Vec3 path = dt * lv[k] + shift[k];
             return path.squaredNorm() < limit * limit && std::isfinite(lq[k]) ? 0.0 : 1.0;  // not a number: 1
           }) == 0;
  }

  /// The old velocities' forces, in predicted: what viscosity is without its solve.
  ViscosityResult explicit_viscosity(const ParticleSystem& s, Real dt) {
    viscous_acceleration(s, o.density, lmu, o.slip_length, start, lv);
    parallel_for(lv.size(), [&](std::size_t k) { lv[k] = s.is_fixed(k) ? start[k] : Vec3(predicted[k] + dt * lv[k]); }, 2048);
    return {0, 0, true};
  }

  Real stable_step() const {
    Real dt = o.max_step;
    if (!o.guards.step_limit) return dt;
    const Real speed = largest_norm(v);
    if (speed > 0) dt = std::min(dt, o.courant * o.spacing / speed);
    if (solid_speed > 0) dt = std::min(dt, o.courant * o.spacing / solid_speed);
    if (acceleration > 0) dt = std::min(dt, o.courant * std::sqrt(o.spacing / acceleration));
    // Lava that all but stands has waves, too, from particle to particle, unless viscosity swallows them within such a step.
    const Real g = o.gravity.norm();
    if (g > 0 && speed < kSlow * std::sqrt(g * o.spacing) && dt > o.courant * std::sqrt(o.spacing / g)) {
      const Real falling = o.courant * std::sqrt(o.spacing / g);
      const Real thinnest = -parallel_max(size(), -std::numeric_limits<Real>::infinity(), [&](std::size_t i) { return asleep[i] ? -std::numeric_limits<Real>::infinity() : -mu[i]; });
      if (thinnest / o.density * falling < o.spacing * o.spacing) dt = falling;
    }
    return dt;
  }

  void fall_asleep(Real dt) {
    if (o.sleep_speed <= 0) return;
    for (std::size_t k = 0; k < set.awake + set.drowsy; ++k) {
      const Index i = set.particles[k];
      const Real speed = lv[k].norm();
      if (k >= set.awake) {  // a sleeper, moved along
        if (speed <= kWake * o.sleep_speed) continue;
        asleep[i] = 0;
        slow[i] = 0;
      } else if (speed > o.sleep_speed || emitter.held(i) || std::any_of(walls[k].begin(), walls[k].end(), deforms)) {
        // Nor does lava sleep on what bears it by bending: asleep it would weigh nothing there.
        slow[i] = 0;
      } else if ((slow[i] += dt) >= o.sleep_delay) {
        asleep[i] = 1;
        v[i].setZero();
      }
    }
  }

  void heat_step(Real dt, ModernReport& report) {
    if (!o.heat.on) return;
    ZONE("sph.heat");
    const bool all = set.awake == size();  // then places are the particles' own
    scratch.clear();
    std::vector<Real> power;
    if (o.heat.viscous_heating && !set.particles.empty()) {
      scratch.resize(set.particles.size());
      // Of the velocities that viscosity left: what pressure adds to these is not sheared yet, and stiff lava would boil of it.
      dissipation(system(), lmu, o.slip_length, viscous_v, scratch);
      if (!all) {
        power.assign(size(), 0.0);
        for (std::size_t k = 0; k < set.awake; ++k) power[set.particles[k]] = scratch[k];
      }
    }
    // Lists of the step's beginning are good enough for conduction; sleepers have none, and others of their own.
    Neighbors everyone;
    if (heat.conducts(dt) && !all) find_neighbors(x, everyone);
    if (water.wet) {
      wet.assign(size(), 0);
      water.wet(x, wet);
    }
    report.heat = heat.step(dt, {.x = x,
                                 .neighbors = all ? neighbors : everyone,
                                 .kernel = o.kernel,
                                 .support = support,
                                 .period = o.period,
                                 .sky_area = exposed,
                                 .ground_area = grounded,
                                 .ground_temperature = ground_T,
                                 .dissipation = all ? std::span<const Real>(scratch) : std::span<const Real>(power),
                                 .ground_effusivity = solids.any() ? std::span<const Real>(ground_b) : std::span<const Real>(),
                                 .wet = water.wet ? std::span<const std::uint8_t>(wet) : std::span<const std::uint8_t>(),
                                 .water = water.law});
    if (solids.any()) solids.warm(touches, heat.given(), heat.touched_temperature());
  }

  std::size_t emit(Real t0, Real t1) {
    const std::span<const Emitter::Newborn> newborn = emitter.emit(t0, t1);
    for (const Emitter::Newborn& b : newborn) {
      born(b.x, b.v, b.temperature);
      // What comes out of a vent was, when the material coordinates were born, that far down the conduit.
      frames.born(b.x - emitter.rise(b.site, frames.rest_born(), t1), b.x - emitter.rise(b.site, frames.rest2_born(), t1));
    }
    return newborn.size();
  }

  ModernReport step(Real dt_max) {
    ZONE("sph.step");
    CHECK_GT(dt_max, 0.0);
    ModernReport report;
    Real dt = std::min(dt_max, stable_step());
    if (dt_max - dt < 1e-6 * dt) dt = dt_max;  // no crumb of a step is left over
    if (dt < dt_max && dt < o.min_step)
      throw UnstableError(fmt::format("at t = {:.6g} s speed or acceleration leave a step of {:.3g} s, less than min_step {:.3g} s ({} particles)", time, dt, o.min_step, size()));
    if (solids.any()) solids.stand(time, dt);
    wake_by_walls(dt);
    const bool all_asleep = std::find(asleep.begin(), asleep.end(), 0) == asleep.end();
    if (!all_asleep) catch_up_unreported();
    if (steps % kSortInterval == 0 && !all_asleep) {
      drop_what_left();
      sort_particles();
    }

    emitter.carry(time, dt, v);
    set.find(x, asleep, support);
    if (set.awake == 0) {  // those awake may just have left
      rest(dt, report);
      return report;
    }
    const std::size_t m = set.particles.size();
    lx.resize(m);
    start.resize(m);
    lv.resize(m);
    lq.resize(m);
    fixed.resize(m);
    parallel_for(m, [&](std::size_t k) {
      const Index i = set.particles[k];
      lx[k] = x[i];
      lv[k] = start[k] = v[i];
      fixed[k] = k >= set.awake + set.drowsy || emitter.held(i);
    }, 2048);
    look_around();
    find_viscosities();
    std::vector<Real> excess(set.awake);
    parallel_for(set.awake, [&](std::size_t k) { excess[k] = std::max(shape.density[k] - 1, 0.0); }, 4096);
    report.density_error = rms(excess);
    for (std::size_t k = 0; k < set.awake; ++k)
      if (excess[k] > kCrammed && !fixed[k]) ++report.crammed, report.crammed_at += lx[k];
    if (report.crammed > 0) report.crammed_at /= static_cast<Real>(report.crammed);

    for (;; ++report.retries, dt /= 2) {
      if (try_step(dt, report)) break;
      if (report.retries == kMaxRetries || dt / 2 < o.min_step)
        give_up(fmt::format("the step at t = {:.6g} s stayed unstable down to dt = {:.3g} s ({} particles)", time, dt, size()), dt);
      emitter.carry(time, dt / 2, v);
      parallel_for(m, [&](std::size_t k) { start[k] = v[set.particles[k]]; }, 2048);
    }
    // Where all are looked at, lx holds the places of the step's beginning.
    const bool all = set.awake == size();
    if (!all) before_x = x;
    parallel_for(set.awake, [&](std::size_t k) {
      const Index i = set.particles[k];
      v[i] = lv[k];
      q[i] = lq[k];
      x[i] += dt * lv[k] + predicted[k];  // its shift by now
    }, 2048);
    // Sleepers take up the load, or they would have to yield to it anew each step.
    for (std::size_t k = set.awake; k < set.awake + set.drowsy; ++k) q[set.particles[k]] = lq[k];
    acceleration = std::sqrt(parallel_max(set.awake, 0, [&](std::size_t k) { return ((lv[k] - start[k]) / dt).squaredNorm(); }));
    ground.moved(all ? lx : before_x, x, dt * o.ground_speed);
    if (o.guards.projection) ground.project(x, v, [&](std::size_t i) { return !emitter.held(i) && !asleep[i]; });
    if (solids.any()) pass_solids(all ? lx : before_x, dt, report);
    fall_asleep(dt);
    wrap();
    heat_step(dt, report);
    report.neighbor_pairs = neighbors.pairs();
    finish(dt, report);
    return report;
  }

  /// From `from` to x among the obstacles; and out of the ground where those have led them in.
  void pass_solids(std::span<const Vec3> from, Real dt, ModernReport& report) {
    solid_speed = solids.speed();
    solids.go(time, dt);
    if (!o.guards.projection) return;
    std::vector<Index> which;
    which.reserve(set.awake);
    for (std::size_t k = 0; k < set.awake; ++k)
      if (!emitter.held(set.particles[k])) which.push_back(set.particles[k]);
    std::vector<Vec3> wanted;
    report.solids = solids.slide(which, from, x, v, &wanted);
    if (report.solids.near == 0) return;
    ground.moved(wanted, x);
    // Obstacles have the last word: what they keep in the ground waits for the next step.
    for (int round = 0; round < kSettle; ++round) {
      wanted = x;
      if (ground.project(x, v, [&](std::size_t i) { return !emitter.held(i) && !asleep[i]; }).pushed == 0) return;
      const std::vector<Vec3> projected = x;
      solids.rest();
      if (solids.slide(which, wanted, x, v).near == 0) return;
      ground.moved(projected, x);
    }
  }

  /// A step in which nobody moves: heat, by many at a time, and vents.
  void rest(Real dt, ModernReport& report) {
    acceleration = 0;
    if (o.ground_speed > 0) ground.moved(x, x, dt * o.ground_speed);
    if (solids.any()) solids.go(time, dt);
    rested += dt;
    if (rested >= kNap * o.max_step || emitter.emits(time, time + dt)) catch_up(report);
    finish(dt, report);
  }

  void catch_up(ModernReport& report) {
    if (rested > 0) heat_step(rested, report);
    rested = 0;
  }

  void catch_up_unreported() {
    if (rested <= 0) return;
    ModernReport report;
    catch_up(report);
    owed = report.heat;
  }

  /// Sleepers that a moving surface has come near to.
  void wake_by_walls(Real dt) {
    const bool moving = solids.any() && solids.fastest() > o.sleep_speed;
    if ((o.ground_speed <= 0 && !moving) || std::find(asleep.begin(), asleep.end(), 1) == asleep.end()) return;
    if (moving) {
      const Real reach = support + dt * solids.fastest();
      parallel_for(size(), [&](std::size_t i) {
        if (!asleep[i] || !solids.disturbs(x[i], reach, o.sleep_speed)) return;
        asleep[i] = 0;
        slow[i] = 0;
      });
    }
    if (o.ground_speed <= 0) return;
    ground.find(x, [&](std::size_t i) { return asleep[i] != 0; });
    for (std::size_t i = 0; i < size(); ++i) {
      if (!asleep[i]) continue;
      ground.for_each_contact(i, x[i], [&](const geometry::Contact& c, Real) {
        if (c.surface_velocity.isZero()) return;
        asleep[i] = 0;
        slow[i] = 0;
      });
    }
  }

  /// Into the report: what no report has had.
  void settle(ModernReport& report) {
    report.heat.radiated += owed.radiated;
    report.heat.convected += owed.convected;
    report.heat.quenched += owed.quenched;
    report.heat.ground += owed.ground;
    report.heat.dissipated += owed.dissipated;
    owed = {};
    report.left = census.left() - reported_left;
    report.left_enthalpy = left_enthalpy - reported_enthalpy;
    reported_left = census.left();
    reported_enthalpy = left_enthalpy;
  }

  void finish(Real dt, ModernReport& report) {
    const Real from = time;
    time += dt;
    ++steps;
    report.emitted = emit(from, time);
    frames.renew(time, x);
    settle(report);

    report.dt = dt;
    report.awake = set.awake;
    report.max_speed = largest_norm(v);
    const std::span<const Real> T = heat.temperature();
    report.max_temperature = parallel_max(size(), 0, [&](std::size_t i) { return T[i]; });
    report.min_temperature = -parallel_max(size(), -1e6, [&](std::size_t i) { return -T[i]; });
    COUNT("sph.steps", 1);
    COUNT("sph.awake particles", set.awake);
  }

  void load(StateReader& in) {
    std::string model;
    in.text("model", model);
    if (model != kModel) throw InputError(Place{}, fmt::format("the checkpoint holds a '{:.40}' lava, wanted '{}'", model, kModel));
    archive(*this, in);
    heat.load(in);
    const std::size_t n = size();
    check_loaded_sizes(n, {v.size(), q.size(), mu.size(), density.size(), exposed.size(), grounded.size(), ground_T.size(), ground_b.size(), touches.size(), slow.size(), surface.size(), asleep.size(),
                           heat.size()});
    census.check_loaded(n);
    frames.check_loaded(n);
    ground.check_loaded(n);
    emitter.check_loaded(n);
    set = {};
  }

  void wrap() {
    for (const int axis : {0, 1}) {
      const Real length = o.period[axis];
      if (length > 0) parallel_for(size(), [&](std::size_t i) { x[i][axis] -= length * std::floor(x[i][axis] / length); }, 4096);
    }
  }
};

ModernLava::ModernLava(const ModernOptions& options, std::vector<Vent> vents, std::vector<ContactSource> ground, std::function<bool(const Vec3&)> inside,
                       const SolidOptions& solids)
    : impl_(std::make_unique<Impl>(options, std::move(vents), std::move(ground), std::move(inside), solids)) {}
ModernLava::~ModernLava() = default;
ModernLava::ModernLava(ModernLava&&) noexcept = default;
ModernLava& ModernLava::operator=(ModernLava&&) noexcept = default;

void ModernLava::add(std::span<const Vec3> x, std::span<const Vec3> v, std::span<const Real> temperature) {
  CHECK_EQ(v.size(), x.size());
  CHECK_EQ(temperature.size(), x.size());
  Impl& m = *impl_;
  m.catch_up_unreported();
  for (std::size_t i = 0; i < x.size(); ++i) {
    CHECK(x[i].allFinite() && v[i].allFinite() && std::isfinite(temperature[i]));
    m.born(x[i], v[i], temperature[i]);
    m.emitter.add_free();
    m.frames.born(x[i], x[i]);
  }
}

void ModernLava::set_water(WaterSource water) { impl_->water = std::move(water); }
void ModernLava::set_solids(const SolidOptions& solids) { impl_->solids = Solids(solids, kClearance * impl_->o.spacing, impl_->mass, impl_->film.widest()); }

Real ModernLava::take(std::span<const Index> which) {
  Impl& m = *impl_;
  std::vector<Index> stay;
  std::size_t next = 0;
  Real enthalpy = 0;
  for (Index i = 0; i < m.size(); ++i) {
    if (next == which.size() || which[next] != i) {
      stay.push_back(i);
      continue;
    }
    enthalpy += m.mass * m.heat.enthalpy()[i];
    ++next;
  }
  CHECK_EQ(next, which.size());
  m.keep(stay);
  m.taken += which.size();
  m.set = {};  // of the last step, by numbers that have moved
  return enthalpy;
}

ModernReport ModernLava::step(Real dt_max) { return impl_->step(dt_max); }
Real ModernLava::time() const { return impl_->time; }
std::size_t ModernLava::size() const { return impl_->size(); }
const ModernOptions& ModernLava::options() const { return impl_->o; }
Real ModernLava::particle_mass() const { return impl_->mass; }
Real ModernLava::volume() const { return impl_->volume * static_cast<Real>(size()); }
Real ModernLava::mass_emitted() const { return impl_->mass * static_cast<Real>(impl_->census.emitted()); }
Real ModernLava::mass_taken() const { return impl_->mass * static_cast<Real>(impl_->taken); }
Real ModernLava::mass_left() const { return impl_->mass * static_cast<Real>(impl_->census.left()); }
std::span<const Vec3> ModernLava::positions() const { return impl_->x; }
std::span<const Vec3> ModernLava::velocities() const { return impl_->v; }
std::span<const Real> ModernLava::temperatures() const { return impl_->heat.temperature(); }
std::span<const Real> ModernLava::viscosities() const { return impl_->mu; }
std::span<const Real> ModernLava::densities() const { return impl_->density; }
std::span<const std::uint8_t> ModernLava::surface() const { return impl_->surface; }
std::span<const std::uint8_t> ModernLava::asleep() const { return impl_->asleep; }
std::span<const std::uint64_t> ModernLava::ids() const { return impl_->census.ids(); }
const Heat& ModernLava::heat() const { return impl_->heat; }

std::span<const Real> ModernLava::pressures() const {
  Impl& m = *impl_;
  m.p.resize(m.size());
  for (std::size_t i = 0; i < m.size(); ++i) m.p[i] = m.q[i] * m.o.density;
  // The neighbours are those of the step's beginning, and so are the places they belong to.
  const std::size_t n = m.set.particles.size();
  if (n == 0) return m.p;
  std::vector<Real> raw(n), smooth(n);
  for (std::size_t k = 0; k < n; ++k) raw[k] = m.p[m.set.particles[k]];
  smooth_linear(m.system(), raw, smooth);
  for (std::size_t k = 0; k < m.set.awake; ++k) m.p[m.set.particles[k]] = std::max(smooth[k], 0.0);
  return m.p;
}

geometry::Points ModernLava::points() const {
  const Impl& m = *impl_;
  const std::size_t n = m.size();
  m.radius.assign(n, m.o.spacing / 2);
  m.crust.resize(n);
  m.age.resize(n);
  const bool hot = m.o.heat.on;
  for (std::size_t i = 0; i < n; ++i) {
    m.crust[i] = hot ? std::clamp(std::max(m.heat.crust_share()[i], m.heat.solid_fraction()[i]), 0.0, 1.0) : 0;
    m.age[i] = m.time - m.census.births()[i];
  }
  geometry::Points points;
  points.position = m.x;
  points.radius = m.radius;
  points.velocity = m.v;
  points.temperature = m.heat.surface_temperature();
  points.crust = m.crust;
  points.age = m.age;
  points.id = m.census.ids();
  points.surface = m.surface;
  points.rest = m.frames.rest();
  points.rest2 = m.frames.rest2();
  points.rest_ratio = m.frames.ratio(m.time);
  return points;
}

std::size_t ModernLava::memory() const {
  const Impl& m = *impl_;
  const auto bytes = [](const auto&... vectors) { return ((vectors.capacity() * sizeof(vectors[0])) + ...); };
  return bytes(m.x, m.v, m.q, m.mu, m.density, m.exposed, m.grounded, m.ground_T, m.ground_b, m.touches, m.slow, m.surface, m.asleep) + m.census.memory() + m.frames.memory() +
         m.ground.memory() + m.solids.memory() + m.emitter.memory() + m.heat.memory() + m.grid.memory() + m.neighbors.memory() + m.pairs.memory() + m.shape.memory() + m.viscosity.memory() +
         m.pressure.memory() + bytes(m.set.particles, m.walls.first, m.walls.walls, m.lx, m.lv, m.start, m.predicted, m.viscous_v, m.lq, m.lmu, m.rate, m.least,
                                     m.scratch, m.wall_distances, m.fixed, m.before_x, m.radius, m.crust, m.age, m.p);
}

void ModernLava::add_to(StateHash& hash) const {
  HashArchive io{hash};
  Impl::archive(*impl_, io);
  impl_->heat.add_to(hash);
}

void ModernLava::save(StateWriter& out) const {
  out.text("model", kModel);
  Impl::archive(*impl_, out);
  impl_->heat.save(out);
}

void ModernLava::load(StateReader& in) {
  StateWriter before;
  save(before);
  try {
    impl_->load(in);
  } catch (...) {
    StateReader back(before.bytes(), "");
    impl_->load(back);
    throw;
  }
}

}  // namespace effuse::flow::sph
