#pragma once

#include <cmath>
#include <vector>

#include "flow/bodies/rigid_bodies.h"
#include "geometry/terrain/height_field.h"

/// Small worlds that tests of rigid bodies share.
namespace effuse::flow::bodies::worlds {

/// A plane that falls by `slope` [rad] towards +x, through the origin, 1 km wide.
inline geometry::Terrain plane(Real slope = 0) {
  std::vector<Real> z;
  for (int j = 0; j < 3; ++j)
    for (int i = 0; i < 3; ++i) z.push_back(-(i - 1) * 500 * std::tan(slope));
  return geometry::Terrain::from_height_field(geometry::HeightField({-500, -500}, {500, 500}, 3, 3, z));
}

/// The defaults, but for ever awake.
inline BodyOptions awake() {
  BodyOptions options;
  options.sleep_speed = 0;
  return options;
}
inline BodyOptions weightless() {
  BodyOptions options = awake();
  options.gravity.setZero();
  return options;
}

inline geometry::RigidPose at(Real x, Real y, Real z) { return {Vec3(x, y, z), Quat::Identity()}; }

inline void run(RigidBodies& world, Real seconds, Real dt = 1.0 / 120) {
  const int steps = static_cast<int>(std::lround(seconds / dt));
  for (int k = 0; k < steps; ++k) world.step(dt);
}

inline Vec3 total_momentum(const RigidBodies& world) {
  Vec3 sum = Vec3::Zero();
  for (const Vec3& p : world.momenta()) sum += p;
  return sum;
}
inline Vec3 total_angular_momentum(const RigidBodies& world) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 0; i < world.size(); ++i) sum += world.angular_momenta()[i] + world.centres()[i].cross(world.momenta()[i]);
  return sum;
}
inline Real energy(const RigidBodies& world) { return world.kinetic_energy() + world.potential_energy(); }

}  // namespace effuse::flow::bodies::worlds
