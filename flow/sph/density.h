#pragma once

#include <span>
#include <vector>

#include "flow/sph/particle_system.h"

namespace effuse::flow::sph {

/// What the kernel's sum over neighbours and walls says about each particle's place in the flow.
///
///   density   rho / rho0 = (V (W(0) + sum_j W_ij) + sum_walls gamma) / L + missing, L the sum over a cubic lattice
///   off       distance to the free surface [m]: that at which a plane surface gives the sum's gradient
///             |V sum_j grad W_ij + sum_walls slope n|; the support when it is further, or has no direction
///   missing   gamma(off) / L: what the air above takes from the sum. So a lattice has density 1 up to its surface, and
///             the surface layers resist compression like all others.
///   exposed   area to the air [m^2], and along the walls grounded [m^2]:  V^(2/3) clamp(3/2 - distance / spacing, 0, 1),
///             which sums to the area of a surface wherever the particles lie below it; drops and sheets one particle
///             thick, whose sum has no gradient, by their lack of density
///   surface   1: in the outermost layer
///
/// Sources: none for `off` and `missing` known to us. Accuracy on a lattice: density 1e-3; of a plane's area 1 %.
struct FlowShape {
  std::vector<Real> density, off, missing, exposed, grounded;
  std::vector<std::uint8_t> surface;
  std::size_t memory() const {
    return (density.capacity() + off.capacity() + missing.capacity() + exposed.capacity() + grounded.capacity()) * sizeof(Real) + surface.capacity();
  }
};

/// L = V sum W over a cubic lattice.
Real lattice_sum(KernelKind kernel, Real support, Real spacing);

/// Fills shape, and multiplies the friction of walls at thin lava by `film`: at the depth of the film, where the free surface is near,
/// straight across from an obstacle's wall, or told so by neighbours; or else at the width of the channel (Wall::across).
void find_shape(const ParticleSystem& system, Real lattice, const FilmFriction& film, Walls& walls, FlowShape& shape);

/// Adds to the walls' distances what the ground's curvature does to their half-space: the sum of the principal
/// curvatures c from how the normals of neighbours' walls turn, distance += c bend / |slope|, by half a spacing
/// at most. The walls' own distances are kept in `distances` (one a wall).
void bend_walls(const ParticleSystem& system, Walls& walls, std::vector<Real>& distances);

/// Where two walls' half-spaces overlap, in a corner or where an obstacle stands in the ground, what lies behind both is counted once:
/// to the sum they give gamma_a + gamma_b - gamma_ab, and to its gradient the gradient of that,
///
///   gamma_ab = (1 - c) gamma_a gamma_b + c min(gamma_a, gamma_b)  for c = 1 - 2 angle(n_a, n_b) / pi >= 0,   (1 + c) gamma_a gamma_b  below
///
/// gammas as shares of the whole: exact on the edge itself, for walls of one plane (c = 1) or face to face (c = -1), and at right angles
/// for kernels that are products of their coordinates; within 0.04 of the whole for ours. Of three walls each shares with both
/// others. For bend_walls()'s walls; sets their part and share.
void trim_walls(const BoundaryTable& boundary, Walls& walls);

/// Shear rate squared, 2 D:D [1/s^2], D the symmetric part of the velocity's gradient
///
///   G = (V sum_j (v_j - v_i) grad W_ij^T + walls) B^-1,   B = V sum_j (x_j - x_i) grad W_ij^T + walls,
///
/// exact for linear fields at free surfaces, too; beyond a wall the velocity goes on linearly through zero at slip_length
/// behind it. Where the neighbours lie in a plane or line what they cannot tell is zero.
/// Source of the renormalisation: Randles & Libersky 1996, Comput. Methods Appl. Mech. Eng. 139, 375-408.
void shear_rate_squared(const ParticleSystem& system, Real slip_length, std::span<const Vec3> v, std::span<Real> out);

/// Power turned into heat [W/m^3]: that which the viscous pair forces and the walls' drag take from the motion, exactly.
void dissipation(const ParticleSystem& system, std::span<const Real> mu, Real slip_length, std::span<const Vec3> v, std::span<Real> out);

}  // namespace effuse::flow::sph
