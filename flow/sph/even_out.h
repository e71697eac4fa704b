#pragma once

#include <span>
#include <vector>

#include "flow/sph/particle_system.h"

namespace effuse::flow::sph {

/// Particles beside bodies that lava moves (ParticleSystem::movable) go to where they lie evenly, in pace with the shear that draws their
/// pattern out; places only, no velocity:
///
///   shift_i -= min(40 gamma_i dt, 0.3) c_i / k,   c_i = P (V sum_j grad W_ij + sum_walls slope n),   k = -V W''(0)
///
/// gamma = sqrt(2 D:D) the shear rate of v, D not renormalised; c is zero where particles are even, and 0.76 k u for one of a cubic lattice
/// that is u out of its place; P of mirrored(). Lava that rests or moves as one stays as it is; so do particles nearer to the free surface than
/// 1.3 spacings.
///
/// Why: a pattern drawn out by shear carries pressure unevenly: -V sum F d d^T is not unity. The stress that this leaves is a share of the
/// pressure itself. It resists the shear that made it, and grows with depth where viscous stress does not: without this a ball 3 spacings in
/// radius sinks 8, 29 and 48 % too slowly 3.1, 4.8 and 6.8 of its radii below the surface; with both, 7 % too fast, 7 and 27 % too slowly.
///
///   off    distance to the free surface [m], n (FlowShape)
///   v      [m/s], n
///   shift  [m], n, added to
///
/// Linear momentum is not touched. Threads: the same bits on any number. Cost: one plain sum over the neighbours of particles beside bodies.
/// Sources: Lind, Xu, Stansby & Rogers 2012, J. Comput. Phys. 231, 1499-1523 (shift down the gradient of the concentration); the share by the
/// shear rate, and walls in the sum, are ours.
void even_out(const ParticleSystem& system, std::span<const Real> off, std::span<const Vec3> v, Real dt, std::span<Vec3> shift);

/// The same against what is left of that stress: to pressure_acceleration() of q, beside the same particles, adds
///
///   a_i += -P_i V sum_j (q_i + q_j) (R_i + R_j)/2 grad W_ij,   R = (B + sum_walls moments)^-1 - 1,   B = -V sum F d d^T
///
/// R is zero on a lattice, and of all others; it fades out from 2 to 1.5 spacings below the free surface. Pairs give each other equal and
/// opposite pushes: linear momentum is kept to rounding (angular is not: they need not act along d). It is no transpose of the rate of
/// compression, so it is for pressures that act as known ones, not for the solve.
/// Source of the symmetric form: Bonet & Lok 1999, Comput. Methods Appl. Mech. Eng. 180, 97-115, whose gradient this corrects alike.
void even_pressure(const ParticleSystem& system, std::span<const Real> off, std::span<const Real> q, std::span<Vec3> a);

/// R of every particle; empty where no body is beside any.
std::vector<Mat3> even_pressure_factors(const ParticleSystem& system, std::span<const Real> off);

}  // namespace effuse::flow::sph
