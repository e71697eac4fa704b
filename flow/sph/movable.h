#pragma once

#include "geometry/base/types.h"

namespace effuse::flow::sph {

/// A rigid body that lava moves as it is moved by it: how it answers to impulses. Its walls name it (Wall::movable).
///
///   surface          number of its contacts
///   centre           of mass [m]
///   inverse_mass     [1/kg]; inverse_inertia about the centre, in the world [1/(kg m^2)]
///   velocity, spin   of the centre [m/s], angular [rad/s]: changed by the solves
///   acceleration     what else moves the centre in the step, gravity and what it rests on [m/s^2]
struct Movable {
  Index surface = 0;
  Vec3 centre = Vec3::Zero();
  Real inverse_mass = 0;
  Mat3 inverse_inertia = Mat3::Zero();
  Vec3 velocity = Vec3::Zero(), spin = Vec3::Zero();
  Vec3 acceleration = Vec3::Zero();

  /// Of its point `arm` [m] from the centre.
  Vec3 velocity_at(const Vec3& arm) const { return velocity + spin.cross(arm); }
  void push(const Vec3& impulse, const Vec3& arm) {
    velocity += inverse_mass * impulse;
    spin += inverse_inertia * arm.cross(impulse);
  }
};

inline constexpr Index kNotMovable = ~Index{0};

}  // namespace effuse::flow::sph
