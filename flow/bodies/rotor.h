#pragma once

#include <string_view>

#include "geometry/base/types.h"

/// A rigid body that nothing turns: its angular momentum L stays, its orientation q goes on,
///   dq/dt = 1/2 (0, w) q,   w = R(q) I^-1 R(q)^T L,   I = diag(moments) in body axes.
namespace effuse::flow::bodies {

/// How a step of it is made. L in the world never changes, whatever the scheme: it is the state.
///   kSplitting  rotations about the three body axes in turn, half steps about the first two on either side, each exact:
///               symplectic, order 2, no iteration, so energy wavers and does not drift. The default.
///               Dullweber, Leimkuhler & McLachlan 1997, J. Chem. Phys. 107, 5840-5851
///   kMidpoint   implicit: q1 = exp(dt w_mid) q0 with w_mid from the orientation half way; order 2, time-reversible,
///               energy does not drift; for stiff tops. Fixed-point iteration to rounding, Newton's when that fails
///   kRk4        explicit, of order 4, the quaternion made unit after it; energy drifts with dt^5
///   kSymplecticEuler  w from the orientation at the beginning, q by its exact rotation: order 1. The lecture's; for
///               comparison
enum class RotorScheme { kSplitting, kMidpoint, kRk4, kSymplecticEuler };
inline constexpr std::string_view kRotorSchemeNames[] = {"splitting", "midpoint", "rk4", "symplectic_euler"};

/// Orientation after dt [s].
///   q        world_from_body, unit
///   L        angular momentum in the world [kg m^2/s]
///   moments  of inertia along the body axes [kg m^2], each > 0
/// The quaternion returned is unit to rounding.
Quat turn_freely(RotorScheme scheme, const Quat& q, const Vec3& L, const Vec3& moments, Real dt);

/// w = R I^-1 R^T L [1/s].
inline Vec3 angular_velocity(const Quat& q, const Vec3& L, const Vec3& moments) {
  return q * (q.conjugate() * L).cwiseQuotient(moments);
}

}  // namespace effuse::flow::bodies
