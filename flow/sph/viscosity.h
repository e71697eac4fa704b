#pragma once

#include <limits>
#include <span>
#include <vector>

#include "flow/sph/particle_system.h"

namespace effuse::flow::sph {

/// Viscous acceleration, per unit mass [m/s^2]:
///
///   a_i = -(V/rho) sum_j mu_ij w(r_ij) (v_ij . x_ij) x_ij  -  wall terms,    mu_ij = 2 mu_i mu_j / (mu_i + mu_j)
///
/// with w of ViscousWeight: a force along the line between two particles, equal and opposite: linear and angular
/// momentum are kept to rounding, a rigid rotation feels nothing. In the continuum nu (lap v + 2 grad div v), stress
/// mu (grad v + grad v^T + I div v). The wall's half-space moves on linearly through zero at slip_length [m] behind
/// its surface, viscosity mu_i; see BoundaryTable. Error of the vector for shear in any direction, rms, on a cubic lattice
/// / with 10 % jitter: 17 % / 26 % at a support of 2 spacings, 5 % / 11 % at 2.6, 1.2 % / 6 % at 3; of the part along it alone
/// 12 % / 17 %, 3 % / 7 %, 1 % / 3 %.
/// After Weiler, Koschier, Brand & Bender 2018, Comput. Graph. Forum 37(2), whose weight 10 F / (r^2 + 0.01 h^2) leaves
/// 20 % / 48 % at 2 spacings and 3 % / 10 % at 3.
///
///   mu   [Pa s] n, each > 0;  v [m/s] n;  out [m/s^2] n
void viscous_acceleration(const ParticleSystem& system, Real density, std::span<const Real> mu, Real slip_length, std::span<const Vec3> v, std::span<Vec3> out);

/// Power that the walls' drag takes from particle i at velocity v [W/m^3].
Real wall_dissipation(const ParticleSystem& system, Real mu, Real slip_length, const Vec3& v, std::size_t i);

struct ViscosityResult {
  int iterations = 0;
  Real residual = 0;  ///< |r| / |b|, reached, the larger of both norms
  bool converged = false;
};

/// Bodies that lava moves (ParticleSystem::movable) are solved for together with it: their velocities at the step's end drag, and are
/// dragged by, the particles beside them, so that any stiffness and lightness does. So are the points of solids that deform
/// (ParticleSystem::pressed). Where no wall but theirs holds the lava, momentum of all together is then kept to rounding, whatever the
/// tolerance.
///
/// Solves  v - dt a(v) = v0  for the velocities at the step's end by conjugate gradients, matrix-free, with the
/// inverse 3x3 diagonal blocks as preconditioner. Unconditionally stable.
class ViscositySolver {
 public:
  /// v: in: first guess (velocities of fixed particles: prescribed, kept); out: solution.
  /// Stops at |r| <= tolerance |b| with b = v0 + the moving walls' drag, in the preconditioner's norm and in the plain
  /// one: what momentum goes astray is the sum of r, and stiff particles hardly count in the first. Where |b| is more than `scale`
  /// [m/s] a particle (rms), scale stands for it: fast lava in a short step must not lose what the step's forces add.
  ViscosityResult solve(const ParticleSystem& system, Real density, std::span<const Real> mu, Real slip_length, Real dt, std::span<const Vec3> v0, Real tolerance,
                        int max_iterations, std::span<Vec3> v, Real scale = std::numeric_limits<Real>::infinity());
  std::size_t memory() const;

 private:
  /// L^-1 of a block's Cholesky factor, lower triangle by rows: z = L^-T L^-1 r. Floats: as a preconditioner it stays
  /// symmetric and positive definite, however they round.
  struct Factor {
    float a, b, c, d, e, f;
    explicit Factor(const Mat3& block = Mat3::Identity());
    Vec3 solve(const Vec3& r) const;
  };
  struct Drag {
    Real along, across;  // of a wall, times dt mu / rho
  };
  /// r . M^-1 r and r . r, or the like.
  struct Sums {
    Real preconditioned = 0, plain = 0;
    Sums& operator+=(const Sums& other) {
      preconditioned += other.preconditioned;
      plain += other.plain;
      return *this;
    }
  };
  using Vec6 = Eigen::Matrix<Real, 6, 1>;
  using Mat6 = Eigen::Matrix<Real, 6, 6>;
  struct Body {
    Mat6 matrix, block, inverse;  // B; with the drag of its walls; the inverse of that
    Vec6 v, r, p, Ap;             // velocity and spin; as the particles' arrays
  };
  /// A solid that deforms: as Body, of its points; D shared out among them lumps in the preconditioner.
  struct Soft {
    BlockMatrix matrix, block;
    std::vector<Vec3> v, r, p, Ap, z;    // by point; held ones stand apart: r, p, z are 0 there
    std::vector<Vec3> vertices, pulls;   // by vertex, of a product
  };
  std::vector<Soft> soft_;
  struct Grip {
    Index particle, wall;
  };
  std::vector<Body> body_;
  std::vector<Grip> grips_, soft_grips_;  // walls of bodies, of solids that deform
  std::vector<Vec3> r_, p_, Ap_;
  std::vector<Factor> inverse_;
  std::vector<Drag> drag_;
  std::vector<Sums> partial_;
};

}  // namespace effuse::flow::sph
