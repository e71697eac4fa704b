#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "flow/integrate/integrate.h"
#include "flow/sph/column_grid.h"
#include "flow/sph/emitter.h"
#include "flow/sph/ground.h"
#include "flow/sph/kernel.h"
#include "flow/sph/material_frame.h"
#include "flow/sph/surface_particles.h"
#include "flow/sph/vent.h"
#include "geometry/base/hash.h"
#include "geometry/base/state_io.h"
#include "geometry/mesh/points.h"

/// The lava of Stora, Agliati, Cani, Neyret & Gascuel 1999, "Animating Lava Flows", on the smoothed
/// particles of Desbrun & Gascuel 1996. Stands on its own: needs points to collide with, no scene.
namespace effuse::flow::sph {

/// nu(T) = b exp(-a T), from two measured points; never above max (explicit steps pay for it:
/// dt <= 0.35 m2 / nu).
struct ExponentialViscosity {
  Real hot_nu = 0.5, hot_temperature = 1473.15;    ///< [m^2/s], [K]
  Real cold_nu = 10, cold_temperature = 1173.15;   ///< [m^2/s], [K]
  Real max = 15;                                   ///< [m^2/s]

  Real a() const;  ///< [1/K] = ln(cold_nu / hot_nu) / (hot_temperature - cold_temperature)
  Real b() const;  ///< [m^2/s] = hot_nu exp(a hot_temperature)
  Real at(Real temperature) const;
};

struct ClassicOptions {
  Real spacing = 1;           ///< dx [m]; a particle's volume at rest is dx^3
  Real support = 2;           ///< of the kernel, in spacings
  KernelKind kernel = KernelKind::kSpiky;
  Real density = 2600;        ///< rho0 [kg/m^3]
  Real stiffness = 900;       ///< k in P = k (rho - rho0) [m^2/s^2]; sqrt(k) is the speed of sound
  Real cohesion = 0.3;        ///< of negative pressure, 1: as the state equation says; less clumps less
  Real density_diffusion = 0.1;  ///< delta of Molteni & Colagrossi 2009; 0: the paper's continuity equation alone
  Real density_relaxation = 0.02;  ///< share of sqrt(k) / dx at which the density goes to the summed one; 0: the paper's
  ExponentialViscosity viscosity;
  Real ground_friction = 1;   ///< of the viscous drag of the ground: 1 no slip, 0 free slip
  Real diffusivity = 1e-6;    ///< heat inside [m^2/s]
  Real heat_capacity = 1150;  ///< [J/kg/K]
  Real air_exchange = 60, air_temperature = 288.15;     ///< [W/m^2/K], [K]
  Real ground_exchange = 60, ground_temperature = 288.15;  ///< [W/m^2/K], [K] where a contact brings none
  Vec3 gravity = Vec3(0, 0, -kGravity);  ///< [m/s^2]
  Scheme scheme = Scheme::kSymplecticEuler;
  Real courant = 0.4;         ///< of  (support / 2) / (sqrt(k) + max |v|)
  Real max_step = 0.1;        ///< [s]
  SurfaceCriteria surface;
  int surface_interval = 4;   ///< steps between two looks at who is on the surface
  Real rest_period = 60;      ///< [s] between two births of one set of material coordinates; 0: never
  std::uint64_t seed = 1;

  /// The largest step for lava at rest [s]: the conditions of ClassicLava::stable_step() without speed and
  /// acceleration, at the viscosity's maximum.
  Real rest_step() const;
  /// The largest step for the explicit exchange of heat [s]: 0.35 m2 / kappa inside, and half the time in which
  /// a particle with one face to the air and one to the ground would lose its heat.
  Real heat_step() const;
};

/// What the integrator moves; the rates have the same layout.
struct LavaState {
  std::vector<Vec3> x, v;      ///< [m], [m/s]
  std::vector<Real> rho, T;    ///< [kg/m^3], [K]
  std::size_t size() const { return x.size(); }
};
void add_scaled_velocities(LavaState& y, Real a, const LavaState& k);  ///< v, T
void add_scaled_positions(LavaState& y, Real a, const LavaState& k);   ///< x, rho

/// What one step did.
struct StepReport {
  Real dt = 0;                  ///< [s]
  int retries = 0;              ///< steps thrown away because numbers went bad
  std::size_t emitted = 0, left = 0;
  std::size_t neighbor_pairs = 0;
  Real max_speed = 0;           ///< [m/s]
  Real max_compression = 0;     ///< max rho / rho0 - 1
  Real max_temperature = 0, min_temperature = 0;  ///< [K]
};

/// Equations, for particle i, kernel W with second moment m2, pair means rho_ij = (rho_i + rho_j)/2
/// and nu_ij = 2 nu_i nu_j / (nu_i + nu_j):
///
///   P_i       = k (rho_i - rho0), times cohesion where negative
///   drho_i/dt = sum_j m (v_i - v_j) . grad W_ij                                (continuity)
///   dv_i/dt   = - sum_j m (P_i/rho_i^2 + P_j/rho_j^2) grad W_ij
///               + (2/m2) sum_j nu_ij (m/rho_ij) (v_j - v_i) W_ij + g           (mean velocity)
///   dT_i/dt   = (2/m2) kappa sum_j (m/rho_ij) (T_j - T_i) W_ij                 (mean difference)
///               - (h rho0 / (m c)) (r_i^2 / rho_i) (T_i - T_ext) on the surface, r_i = (m/rho_i)^(1/3)
///
/// The factor 2/m2 makes nu and kappa physical (m^2/s) at any spacing; the paper's sums go without it
/// and change with the smoothing length (Taylor: sum V (f_j - f_i) W -> (m2/2) lap f). Pair terms are
/// antisymmetric: momentum and heat inside are conserved to rounding. The surface term falls to
/// h dx^2 (T - T_ext) / (m c) at rest density: h is a heat transfer coefficient.
///
/// Ground: surface particles get contacts, and the inner ones that the ground's half-space reaches (the
/// paper has the surface ones only; a force that comes and goes with the flag pumps energy into the flow).
/// The half-space beyond the contact's plane joins the sums like a mirror image: the particle's own
/// pressure (ground does not pull) and density, twice its approach speed (so that the work of the pressure is what the density
/// takes up: with the speed alone the ground pumps energy into the flow). Drag of the ground as of a
/// neighbour at rest. A hard projection at the end of the step keeps every particle at least
/// spacing / 4 outside; it asks only about those that may have come near since the step began (see Ground).
///
/// Density by continuity grows noise over thousands of steps: a diffusion of density
///   2 delta (support/2) sqrt(k) sum_j (m/rho_j) (rho_j - rho_i) (x_j - x_i) . grad W_ij / r^2
/// smooths it (Molteni & Colagrossi 2009, Comput. Phys. Commun. 180, 861-872). And it drifts: slowly it is
/// pulled back to what the density summed over neighbours and ground allows, +- 0.15 rho0 for the disorder of
/// the neighbours; on the surface, where the sum lacks what is not there, to no more than rest density.
/// Below 0.9 rho0 lava tears: the density falls no further.
///
/// Symplectic Euler kicks velocities with the old density, then moves positions and density with the
/// new velocities: two passes over the neighbours, stable for sound as Euler is not.
///
/// Deterministic: the same bits on any number of threads. Not thread-safe itself.
class ClassicLava {
 public:
  /// Checks the options (spacing, support, density, stiffness, capacities > 0).
  /// inside: whether a point has ground above or below it; surface particles that come off the ground where
  /// there is none are taken out and counted, a few steps later. Empty: none leave.
  ClassicLava(const ClassicOptions& options, std::vector<Vent> vents, std::vector<ContactSource> ground, std::function<bool(const Vec3&)> inside = {});

  /// Adds particles at rest density; ids follow on. All finite (checked).
  void add(std::span<const Vec3> x, std::span<const Vec3> v, std::span<const Real> temperature);

  /// One step of at most dt_max [s] > 0. A step whose result (or a stage of it) is not finite, or moves a
  /// particle by more than half a spacing, is undone and tried with half the size, eight times at most; then
  /// UnstableError, the particles where they were before the step. UnstableError, too, when speed or
  /// acceleration leave less than a millionth of rest_step(): time would stand still.
  StepReport step(Real dt_max);

  /// The largest step the conditions below allow now [s]:
  ///   courant (support/2) / (sqrt(k) + max|v|),   0.35 m2 / max nu,   0.4 sqrt(dx / max|a|),
  ///   heat_step(),   max_step
  Real stable_step() const;

  Real time() const { return time_; }
  std::size_t size() const { return y_.size(); }
  Real particle_mass() const { return mass_; }
  Real volume() const { return static_cast<Real>(size()) * mass_ / options_.density; }  ///< at rest density [m^3]
  Real mass_emitted() const { return static_cast<Real>(census_.emitted()) * mass_; }     ///< by vents and add() [kg]
  Real mass_left() const { return static_cast<Real>(census_.left()) * mass_; }           ///< over the ground's edge [kg]
  const LavaState& state() const { return y_; }
  const ClassicOptions& options() const { return options_; }
  /// Views, valid until the next step. crust: 0 at the hot end of the viscosity law, 1 at the cold.
  geometry::Points points() const;
  /// dv/dt and the rest at the current state, for tests and studies.
  const LavaState& rates();
  std::span<const std::uint8_t> surface() const { return surface_; }
  /// Bytes held by particles, grid and lists.
  std::size_t memory() const;

  void add_to(StateHash& hash) const;
  void save(StateWriter& out) const;
  /// Throws InputError when the bytes are of another version or cut short, and leaves everything as it was.
  void load(StateReader& in);

 private:
  void load_unsafely(StateReader& in);
  std::size_t emit(Real t0, Real t1);
  void born(const Vec3& x, const Vec3& v, Real temperature);  // without its part in emitter_ and frames_
  void keep(std::span<const Index> which);  // drops all other particles, in this order
  void sort_particles();
  void find_neighbors(std::span<const Vec3> x);
  /// The solver as the integrator sees it.
  struct System;
  void compute_rates(const LavaState& y, LavaState& k, bool velocities, bool positions);
  template <bool kVelocities, bool kPositions, class Kernel>
  void accumulate(const Kernel& kernel, const LavaState& y, LavaState& k);
  std::size_t drop_what_left();     // returns how many
  bool try_step(Real dt);           // false: the state is not fit to go on from
  bool acceptable(const LavaState& y) const;
  template <class Self, class Archive>
  static void archive(Self& self, Archive& io);  // save, load and hash: one list, one order

  ClassicOptions options_;
  Real mass_, support_;
  HalfSpaceTable half_space_;        // of the kernel
  CubicSpline density_kernel_;       // of the summed density: exact to 0.03 % on a lattice at support 2
  HalfSpaceTable density_half_space_;

  // The state, all of it saved.
  LavaState y_;
  Census census_;
  Ground ground_;
  Emitter emitter_;
  MaterialFrames frames_;
  std::vector<std::uint8_t> surface_;
  std::vector<Vec3> outward_;
  Real time_ = 0;
  std::uint64_t steps_ = 0;
  Real max_acceleration_ = 0;  // of the last step: the next one's size depends on it

  // Derived at each evaluation; kept for their memory.
  struct Packed {
    Vec3 x;
    Real p_over_rho2;
    Vec3 v;
    Real nu, T, rho;
  };
  ColumnGrid grid_;
  Neighbors neighbors_;
  const Vec3* neighbors_of_ = nullptr;  // positions they were found for; null: none that still stand
  std::vector<Packed> packed_;
  LavaState before_;
  StepStorage<LavaState> storage_;
  mutable std::vector<Real> radius_, crust_, age_;  // what points() shows
};

}  // namespace effuse::flow::sph
