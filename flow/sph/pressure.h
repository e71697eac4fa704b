#pragma once

#include <algorithm>
#include <limits>
#include <span>
#include <vector>

#include "flow/sph/pair_kernels_float.h"
#include "flow/sph/particle_system.h"

namespace effuse::flow::sph {

/// Rate of compression (1/rho) d rho / dt [1/s] of every particle:
///
///   (D v)_i = V sum_j (v_i - v_j) . grad W_ij  +  2 slope_i n . (v_i - v_wall)
///
/// the exact rate of the density summed over neighbours; beyond a wall the fluid moves as the mirror image.
/// Of a linear v it is -tr(grad v) on a lattice; in disorder -V sum F d d^T is not quite unity, and the shear rate adds its share: a flow
/// that is made to fulfil D v = 0 under pressure is dragged harder by that. Small bodies feel it most (even_out.h).
void compression_rate(const ParticleSystem& system, std::span<const Vec3> v, std::span<Real> out);

/// Walls that mirror (Wall::mirrors) have their mirror image counted in full: what flows along them counts for the lava's half of the
/// kernel and for the image's. Beside them v stands for v + (P - 1)(v - v_wall) above, and below the sum over j is multiplied by P,
///
///   P = (1 - sum_walls m T + sum_pairs m_ab T_a T_b)^-1,   T = 1 - n n^T,  m = moment_t of the wall alone
///
/// one over the share of the kernel that the lava has along them; m_ab is what two walls hide both, put together as in trim_walls().
/// v_wall is the mean of the walls' weighted by moment_t; what P adds pushes the wall back. All walls' own terms, too, have P n for n: in
/// a corner the floor goes on beneath the wall's mirror image. D and D^T stay transposes of each other. Without it lava at rest creeps down
/// upright walls, by 0.1 g spacing^2 / nu.
Mat3 mirrored(const ParticleSystem& system, std::size_t i);

/// Acceleration [m/s^2] by the kinematic pressures q = p / rho [m^2/s^2]:
///
///   a_i = - V sum_j (q_i + q_j) grad W_ij  -  2 q_i slope_i n   =  -(D^T q)_i
///
/// the transpose of D: pressure does the work that compression takes up, momentum is kept to rounding.
void pressure_acceleration(const ParticleSystem& system, std::span<const Real> q, std::span<Vec3> out);

/// What the pressures q push bodies and solids (ParticleSystem::movable, pressed) in a time dt: on each the opposite of what its walls push the
/// particles.
///   a  pressure_acceleration() of q
void push_movables(const ParticleSystem& system, std::span<const Real> q, std::span<const Vec3> a, Real dt);

/// A field through particles' values without their scatter: at each particle the value of the linear function that fits its
/// neighbours and itself best, weighted by the kernel (moving least squares; linear fields come out unchanged). The
/// particles' own pressures alternate by some tenths of rho g spacing: forces do not see that, a plot does.
void smooth_linear(const ParticleSystem& system, std::span<const Real> values, std::span<Real> out);

struct PressureResult {
  int iterations = 0;
  Real error = 0;  ///< rms over particles of dt (D v - rate) where that counts: change of density a step left to itself
  bool converged = false;
};

/// Projects velocities so that no particle is compressed faster than it may be:
///
///   v += dt * pressure_acceleration(q_new - q_old),   D v <= rate,   q_new >= least,   either with equality
///
/// that is A q_new = (D v - rate) / dt + A q_old with A = D M D^T (M: 0 for fixed particles, 1 otherwise), bounded
/// below: a symmetric, positive semidefinite problem, solved by modified proportioning with reduced gradient projections
/// (MPRGP: conjugate gradients on the particles off their bound). v must have been accelerated by q_old already.
/// With rate = 0 the velocities are free of divergence; a negative rate takes density back that is too large.
/// Bodies that lava moves (ParticleSystem::movable) give way to the pressures in the same solve, as their mass and inertia allow (to
/// A comes the positive part that their walls share): light ones float on it as heavy ones press on it. So do solids that deform
/// (ParticleSystem::pressed), as the matrix of their own step allows, which is solved in each iteration.
/// The same operators as DFSPH (Bender & Koschier 2015), conjugate gradients in place of Jacobi's iteration.
///
/// The iterations run in single precision, on the change of q; what they find acts on v and q in double, and where it matters
/// what is then left is measured in double and solved for again (iterative refinement). So momentum is kept to
/// rounding in double, and any tolerance can be reached.
/// Source of MPRGP: Dostal & Schoeberl 2005, Comput. Optim. Appl. 30, 23-43.
class PressureSolver {
 public:
  /// rate [1/s], least [m^2/s^2] (minus infinity: no bound), n each; v in, out; q in: old, out: new.
  PressureResult solve(const ParticleSystem& system, std::span<const Real> rate, std::span<const Real> least, Real dt, Real tolerance, int max_iterations,
                       std::span<Vec3> v, std::span<Real> q);

  /// What depends on positions, walls and fixed particles only. solve() does it itself; solve_prepared() and displace() may
  /// follow as often as wanted, on the same system.
  void prepare(const ParticleSystem& system);
  /// tight: where the error is within the tolerance from the start, but above tight, up to four iterations are done all the same:
  /// in short steps, each of which may leave as much, a flow at rest comes to rest.
  PressureResult solve_prepared(const ParticleSystem& system, std::span<const Real> rate, std::span<const Real> least, Real dt, Real tolerance, int max_iterations,
                                std::span<Vec3> v, std::span<Real> q, Real tight = std::numeric_limits<Real>::infinity());
  /// The same for a displacement from where particles are, in no time: D shift <= rate [1], by pressures >= 0, walls at
  /// rest. shift [m] n, out; single precision. error: rms of what is left of D shift - rate where that counts.
  PressureResult displace(const ParticleSystem& system, std::span<const Real> rate, Real tolerance, int max_iterations, std::span<Vec3> shift);
  std::size_t memory() const;

 private:
  struct Sums {
    Real first = 0, second = 0, third = 0, fourth = 0, least = std::numeric_limits<Real>::infinity();
    Sums& operator+=(const Sums& other) {
      first += other.first;
      second += other.second;
      third += other.third;
      fourth += other.fourth;
      least = std::min(least, other.least);
      return *this;
    }
  };
  struct Grip {  // a wall of a body
    Index particle, wall;
    Index mirrored;  // place in mirrored_, or kNotMovable
    Real weight;     // of this wall among those that mirror
  };
  struct Answer {  // of a body: accelerations
    Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
  };
  /// A particle beside a wall that mirrors.
  struct Mirrored {
    Index particle;
    Mat3 P;
    Vec3 wall = Vec3::Zero();   // weighted velocity of walls that are no body's
    Vec3 body = Vec3::Zero();   // the same of bodies, or of their accelerations
    Vec3 extra = Vec3::Zero();  // acceleration that P adds
    Eigen::Vector3f kept = Eigen::Vector3f::Zero();  // its acceleration, while a_ holds what flows
  };
  template <class F>
  Sums sum_of(F&& f);
  void accelerate(const ParticleSystem& s);
  template <class F>
  void answer(F&& of, const ParticleSystem& s);
  Vec3 answer_at(const Wall& wall, const ParticleSystem& s) const;
  Sums multiply(const ParticleSystem& s);
  Sums iterate(const ParticleSystem& s, Real dt, Real goal, int max_iterations, int& iterations);

  // Unknowns y = (q - old q) / scale, bounded by low; gradient g, direction p, A p.
  FloatPairs pairs_;
  std::vector<float> y_, low_, scale_, g_, p_, Ap_;
  std::vector<FloatPairs::Vector> a_;
  std::vector<Vec3> push_;  // of each wall
  std::vector<Mirrored> mirrored_;  // rising
  std::vector<Grip> grips_;
  std::vector<Answer> answer_;      // of bodies to a_
  struct Bend {  // of a solid that deforms: forces, and accelerations of its points and vertices
    std::vector<Vec3> force, points, vertices;
  };
  std::vector<Bend> bends_;
  std::vector<Vec3> flow_;          // P v, where some are
  std::vector<Real> change_;
  std::vector<Sums> partial_;
};

}  // namespace effuse::flow::sph
