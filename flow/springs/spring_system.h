#pragma once

#include <memory>
#include <span>
#include <vector>

#include "flow/integrate/block_newton.h"
#include "flow/integrate/integrate.h"
#include "flow/integrate/plane_contacts.h"
#include "flow/springs/spring_network.h"
#include "geometry/motion/force_grid.h"

namespace effuse::flow::springs {

/// A flat wall that pushes back by a spring and a damper along its normal: with s = normal . x + offset < 0 a point feels
///   F = (-stiffness s - damping normal . v) normal
/// (the damper pulls, too, while a point leaves: as in the lecture).
struct PenaltyWall {
  Vec3 normal = Vec3::UnitZ();  ///< unit, into the room
  Real offset = 0;              ///< [m]
};

/// What acts on the points besides springs. Gravity and drag act on every one.
struct Surroundings {
  Vec3 gravity = Vec3::Zero();  ///< [m/s^2]
  Real drag = 0;                ///< [1/s]: F = -m drag (v - wind)
  Vec3 wind = Vec3::Zero();     ///< [m/s]
  const geometry::ForceGrid* field = nullptr;  ///< force on each point [N]; null: none
  std::vector<PenaltyWall> walls;
  std::vector<PlaneContact> contacts;
  PenaltyResponse response;  ///< of walls and contacts; walls have no friction
  std::vector<Vec3> load;    ///< force on each point [N]; empty: none
};

/// How the implicit step is solved.
struct ImplicitOptions {
  int max_iterations = 50;  ///< of Newton's method
  Real tolerance = 1e-8;    ///< of the last move over the mean rest length
};

/// The rates of a network's state, for every scheme of flow/integrate. Keeps to the network it was made of until torn.
/// The same bits on any number of threads.
///
/// Implicit Euler minimises the step's own energy
///   |M^(1/2) (x - x_n - h v_n - h^2 M^-1 F_ext)|^2 / (2 h^2) + springs(x) + walls(x) + h dissipation((x - x_n) / h)
/// by Newton's method with a line search, the Hessians of single springs made positive (a compressed spring's sideways
/// part is left out): each step lowers it, so no step is too long. Damping acts along the springs' directions at x_n; wall
/// dampers and friction act where a point was in touch at x_n. First order.
/// Sources: Baraff & Witkin 1998; Martin et al. 2011 (variational form).
class SpringSystem {
 public:
  /// network: kept, must outlive this. Throws InputError where sizes disagree, a mass is not > 0, a spring names no point
  /// or joins a point to itself.
  explicit SpringSystem(const SpringNetwork& network);
  ~SpringSystem();
  SpringSystem(SpringSystem&&) noexcept;

  Surroundings surroundings;
  ImplicitOptions implicit;

  void velocity_rates(Real t, const SpringState& y, SpringState& k) const;
  void position_rates(Real t, const SpringState& y, SpringState& k) const;
  void rates(Real t, const SpringState& y, SpringState& k) const;
  void implicit_euler(Real t, Real dt, SpringState& y);
  /// The implicit step of dt [s] as Newton's method begins it: linearised about y. Of any scheme it says what many small steps come to.
  ///   velocity  out: what each point goes over dt [m/s]; of held ones their own
  ///   answer    out: A = M + dt^2 K + dt C [kg]; impulses J [N s] through the step, on top of load, change those by A^-1 J. Held points stand
  ///             alone in it
  void predict(Real dt, const SpringState& y, std::vector<Vec3>& velocity, BlockMatrix& answer);
  BlockNewton::Report implicit_report() const;  ///< of the last implicit step

  /// Fastest oscillation omega and fastest decay gamma [1/s] about the state, of springs, walls, contacts and drag: largest
  /// eigenvalues of M^-1 K = omega^2 and M^-1 D = gamma by Lanczos' method (from below; 1 % on networks of some thousand points),
  /// the single-point terms added.
  struct Spectrum {
    Real omega = 0, gamma = 0;
  };
  Spectrum spectrum(const SpringState& y) const;

  std::size_t memory() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The longest stable step [s] of x'' + gamma x' + omega^2 x = 0, both at the fastest:
///   symplectic Euler  (sqrt(gamma^2 + 4 omega^2) - gamma) / omega^2, that is 2 / omega without damping
///   Euler             min(gamma / omega^2, 2 / gamma): none without damping
///   RK4               2.78 / max(omega, gamma)
///   midpoint          the step at which an undamped oscillation grows by 1e-3 a period, (8e-3 / 2 pi)^(1/3) / omega = 0.108 / omega
///                     (it grows at any step), or 2 / gamma if that is less
///   implicit Euler    infinite
Real longest_stable_step(Scheme scheme, const SpringSystem::Spectrum& spectrum);

/// Removes the springs whose strain at x is beyond their material's tear_strain; how many. Systems made of the network must be
/// made anew.
std::size_t tear(SpringNetwork& network, const std::vector<Vec3>& x);

}  // namespace effuse::flow::springs
