#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "flow/sph/ground.h"
#include "flow/sph/guards.h"
#include "flow/sph/heat.h"
#include "flow/sph/kernel.h"
#include "flow/sph/rheology.h"
#include "flow/sph/solids.h"
#include "flow/sph/vent.h"
#include "geometry/base/hash.h"
#include "geometry/base/state_io.h"
#include "geometry/mesh/points.h"

/// Lava with implicit pressure and implicit viscosity: large steps, any stiffness, physical units. Stands on its own: needs
/// points to collide with, no scene.
namespace effuse::flow::sph {

struct ModernOptions {
  Real spacing = 1;          ///< dx [m]; a particle's volume is dx^3, always
  Real support = 3;          ///< of the kernels, in spacings: viscosity is right to 1 % / 6 % (lattice / 10 % jitter) at 3, 5 % / 11 % at 2.6, 17 % / 26 % at 2
  KernelKind kernel = KernelKind::kWendlandC2;  ///< of density and pressure
  Real density = 2600;       ///< rho [kg/m^3]
  Vec3 gravity = Vec3(0, 0, -kGravity);  ///< [m/s^2]
  Rheology rheology;         ///< mu(T, shear rate) [Pa s]
  HeatOptions heat;          ///< heat.on = false: isothermal, nothing of it is computed
  Real ground_temperature = 288.15;  ///< [K] where a contact brings none
  Real crust_viscosity = 0;  ///< [Pa s] of crust; its share of a particle's thickness adds this to the viscosity
  Real crust_strength = 0;   ///< [Pa]: sheared harder, crust gives: it adds at most this over the shear rate
  Real slip_length = 0;      ///< of the ground [m]: 0 no slip, infinity free slip (Navier)
  Real ground_speed = std::numeric_limits<Real>::infinity();  ///< [m/s] no ground moves faster: what is far off need not be asked for; 0: it stands
  Real courant = 0.4;        ///< of  dx / max |v|,  of  sqrt(dx / max |a|)  and, in thin lava that all but stands, of  sqrt(dx / |g|)
  Real max_step = 1;         ///< [s]
  Real min_step = 1e-6;      ///< [s] <= max_step; a step that would have to be shorter is an UnstableError
  Real divergence_tolerance = 1e-4;  ///< of the pressure solve: rms change of density in a step it may leave
  Real density_tolerance = 2e-4;     ///< of taking density back that is too large, rms
  Real viscosity_tolerance = 1e-4;   ///< of the viscosity solve: residual over right-hand side
  int density_iterations = 4;        ///< at most, of that: it goes on in the next step
  int max_iterations = 1000;         ///< of the pressure and viscosity solves
  int coupling = 1;          ///< pressure and viscosity are solved this often a step
  Real sleep_speed = 0;      ///< [m/s]: particles that are slower for sleep_delay fall asleep; 0: never
  Real sleep_delay = 10;     ///< [s]
  Vec2 period = Vec2::Zero();  ///< of x and y [m], positions in [0, period); 0: not periodic. At least two supports.
  Real rest_period = 60;     ///< [s] between two births of one set of material coordinates; 0: never
  std::uint64_t seed = 1;
  Guards guards;             ///< all on, but for tests
};

/// Water that lava may run into: what of it is wet exchanges heat with water instead of air. Water neither carries nor moves it.
///   wet  sets 1 where a point lies under water, in parallel; the others are 0 already
///   law  of an exposed face under water; air_temperature: the water's
struct WaterSource {
  std::function<void(std::span<const Vec3> x, std::span<std::uint8_t> out)> wet;
  SurfaceLaw law;
};

/// What one step did.
struct ModernReport {
  Real dt = 0;                 ///< [s]
  int retries = 0;             ///< steps thrown away because numbers went bad
  std::size_t emitted = 0, left = 0;
  Real left_enthalpy = 0;      ///< [J] that went with those that left
  bool solved = true;          ///< both solves reached their tolerance
  std::size_t awake = 0;       ///< particles whose motion was computed
  std::size_t neighbor_pairs = 0;
  int pressure_iterations = 0, viscosity_iterations = 0, density_iterations = 0;
  Real viscosity_residual = 0; ///< relative, reached
  Real divergence_error = 0;   ///< rms of dt div v the pressure solve left
  Real density_error = 0;      ///< rms over particles of max(rho - rho0, 0) / rho0, before the step
  std::size_t crammed = 0;     ///< awake particles of more than 1.5 times the density: lava finds no room where it is let in
  Vec3 crammed_at = Vec3::Zero();  ///< their mean place
  Real max_speed = 0;          ///< [m/s]
  Real max_temperature = 0, min_temperature = 0;  ///< [K]
  geometry::SlideReport solids;  ///< particles that came near obstacles
  HeatBudget heat;             ///< [J]
};

/// One step, from positions x, velocities v, kinematic pressures q = p / rho and the thermal state:
///
///   neighbours, walls, FlowShape (density with what the free surface lacks filled in)
///   mu_i        = Rheology(T_i, shear rate of v) + crust
///   v* - dt a_visc(v*) = v + dt (g - grad q)           ViscositySolver, walls inside
///   D v' <= rate,  v' = v* - dt grad (q' - q)          PressureSolver: where density is right nothing is compressed,
///                                                      where it is low it may fill up; q' >= 0
///   x'          = x + dt v' + shift                    shift takes density back that is too large (the same solver, as a
///                                                      displacement: it gives no speed)
///   hard projection out of the ground; past obstacles by sweeping (Solids), whatever the step; heat, vents
///
/// The old pressure acts before viscosity is solved: in steady flow q' = q, and velocity and pressure fulfil the momentum
/// equation together, whatever the step (incremental pressure correction; Guermond, Minev & Shen 2006, Comput. Methods
/// Appl. Mech. Eng. 195, 6011-6045).
///
/// Sleep: a particle slower than sleep_speed for sleep_delay is left where it is: no neighbours, no pressure, no viscosity.
/// The sleepers within reach of those awake are moved along in the solves; one that would go faster than twice
/// sleep_speed wakes, and so does one that a moving surface comes, or an obstacle may come in the step, within a support of. Heat goes on (see Heat), in all; while everything sleeps and no vent is open it takes 16 max_step at
/// a time, and temperatures lie behind by up to that.
///
/// Deterministic: the same bits on any number of threads. Not thread-safe itself.
class ModernLava {
 public:
  using ContactSource = sph::ContactSource;

  /// Checks the options. inside: whether a point has ground above or below it; surface particles that come off the ground
  /// where there is none are taken out and counted, a few steps later. Empty: none leave.
  /// solids: obstacles beside the ground.
  ModernLava(const ModernOptions& options, std::vector<Vent> vents, std::vector<ContactSource> ground, std::function<bool(const Vec3&)> inside = {},
             const SolidOptions& solids = {});
  ~ModernLava();
  ModernLava(ModernLava&&) noexcept;
  ModernLava& operator=(ModernLava&&) noexcept;

  /// Adds particles, pressure 0; ids follow on. All finite (checked).
  void add(std::span<const Vec3> x, std::span<const Vec3> v, std::span<const Real> temperature);

  /// Takes particles out, rising numbers (checked), for what becomes of them elsewhere. The heat [J] that went with them; they count
  /// neither as present nor as left (mass_taken). Numbers of those behind move up.
  Real take(std::span<const Index> which);

  /// From the next step on; no part of what is saved.
  void set_water(WaterSource water);
  /// Other solids in place of those it was made with, likewise.
  void set_solids(const SolidOptions& solids);

  /// One step of at most dt_max [s] > 0. A step whose viscosity solve fails (stays above ten times the tolerance), whose result is not finite,
  /// or which moves a particle by more than half a spacing is undone and tried with half the size, eight times and down to min_step; then
  /// UnstableError, the particles where they were. UnstableError, too, when speed or acceleration leave less than min_step.
  ModernReport step(Real dt_max);

  Real time() const;
  std::size_t size() const;
  const ModernOptions& options() const;
  Real particle_mass() const;
  Real volume() const;         ///< [m^3]
  Real mass_emitted() const;   ///< by vents and add() [kg]
  Real mass_left() const;      ///< over the ground's edge [kg]
  Real mass_taken() const;     ///< by take() [kg]

  /// Views, valid until the next step.
  std::span<const Vec3> positions() const;
  std::span<const Vec3> velocities() const;     ///< [m/s]
  std::span<const Real> pressures() const;      ///< [Pa], as a field (smooth_linear) at the last step's beginning
  std::span<const Real> temperatures() const;   ///< of a particle as a whole [K]
  std::span<const Real> viscosities() const;    ///< apparent, of the last step [Pa s]
  std::span<const std::uint8_t> surface() const;
  std::span<const std::uint8_t> asleep() const;
  std::span<const Real> densities() const;      ///< rho / rho0, of the last step's beginning; 1 for sleepers
  std::span<const std::uint64_t> ids() const;
  const Heat& heat() const;
  geometry::Points points() const;
  std::size_t memory() const;

  void add_to(StateHash& hash) const;
  void save(StateWriter& out) const;
  /// Throws InputError where what was saved does not fit; this is then unchanged.
  void load(StateReader& in);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace effuse::flow::sph
